"""A picture for tests of the viewer's page, pages of it, and one tab for them all."""

import numpy as np
import pytest

from ii_core.display.viewer import write_viewer
from metrics import quality_rows
from tests.support import pictures
from tests.support.browser import one_tab

LABELS = ("original", "si-h264, 0.100 bpp, 30.32 dB")


@pytest.fixture(scope="session")
def shot():
    return pictures.shot()


@pytest.fixture(scope="session")
def still(shot, tmp_path_factory):
    """Page of a picture, lossless, without a depth map."""
    path = tmp_path_factory.mktemp("still") / "v.html"
    write_viewer(path, shot.picture, quality=None)
    return path


@pytest.fixture(scope="session")
def mapped(shot, tmp_path_factory):
    """Page of a picture as JPEG, with its depth map."""
    path = tmp_path_factory.mktemp("mapped") / "v.html"
    write_viewer(path, shot.picture, depth=shot.depth)
    return path


@pytest.fixture(scope="session")
def brighter(shot):
    """The picture ten codes brighter."""
    return shot.picture.with_pixels(np.minimum(shot.picture.pixels, 245) + np.uint8(10))


@pytest.fixture(scope="session")
def compared(shot, brighter, tmp_path_factory):
    """Page of a picture beside another, lossless, with a depth map and a table of qualities."""
    path = tmp_path_factory.mktemp("compared") / "v.html"
    rows = quality_rows(shot.picture, brighter)
    options = {"depth": shot.depth, "quality_rows": rows, "labels": LABELS}
    write_viewer(path, shot.picture, brighter, quality=None, **options)
    return path


@pytest.fixture(scope="session")
def tab_of_all(browser):
    yield from one_tab(browser)


@pytest.fixture
def opened(tab_of_all):
    """Open a page in the tab of all tests; errors of the page fail the test."""
    yield tab_of_all.open
    tab_of_all.check()
