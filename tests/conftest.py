"""Fixtures that several test files share; markers of tests."""

import gc
import os
import sys

import pytest
from hypothesis import settings

from raytrace_ii import cli
from tests.support import browser as browsers
from tests.support.browser import browser, show, show_once  # noqa: F401

# The first call of a kernel compiles it, which would exceed any deadline. CI uses the same examples every time. Half
# of the usual number of examples saves 5 s of `make test`.
settings.register_profile("here", max_examples=50, deadline=None, derandomize="CI" in os.environ)
settings.load_profile("here")

gc.set_threshold(20_000, 10, 10)  # Python's 700 takes 6 % of the time of all tests


def pytest_addoption(parser):
    """Flags of this suite."""
    parser.addoption("--make-golden", action="store_true", help="code what tests/golden lacks")


def pytest_collection_modifyitems(items):
    """Mark tests by what they need."""
    browsers.mark(items)


@pytest.fixture
def run(monkeypatch, capsys):
    """Return a function that runs the command in this process, and returns exit code, output and error output."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["raytrace-ii", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        captured = capsys.readouterr()
        return stop.value.code, captured.out, captured.err

    return call


@pytest.fixture
def refused():
    """Check a result of `run`: exit code 2, no output, one line on the error stream with the reason."""

    def check(result, said):
        code, out, err = result
        assert code == 2, (code, out, err)
        assert out == ""
        assert err.startswith("error: ") and err.count("\n") == 1 and said in err, err

    return check
