"""Which tests share a worker of pytest-xdist: files as a whole, and all tests of `si-lf`.

Fixtures of a module are made once then, and the kernels of `si-lf`, a minute of compilation, by one worker alone.
"""

import pytest

LIGHT_FIELD = "si-lf"


def group(items):
    """Mark every test with its group."""
    for item in items:
        light_field = "test_lf" in item.path.name or LIGHT_FIELD in item.name
        item.add_marker(pytest.mark.xdist_group(LIGHT_FIELD if light_field else item.path.name))
