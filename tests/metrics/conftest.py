"""One tab for all tests of the page of a test with observers."""

import pytest

from tests.support.browser import one_tab


@pytest.fixture(scope="session")
def tab_of_all(browser):
    yield from one_tab(browser, width=1000, height=700)


@pytest.fixture
def opened(tab_of_all):
    """Open a page in the tab of all tests, without answers of earlier ones; errors of the page fail the test."""
    yield tab_of_all.open
    if tab_of_all.shown:
        tab_of_all.page.evaluate("localStorage.clear()")
        tab_of_all.page.goto("about:blank")
        tab_of_all.shown = None
    tab_of_all.check()
