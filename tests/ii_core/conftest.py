"""A picture for tests of the viewer's page."""

import pytest

from ii_core import preset
from raytrace_ii import load_scene, render


@pytest.fixture(scope="session")
def shot():
    return render(load_scene("apples"), preset("setup1", scale=16), support=("depth",))
