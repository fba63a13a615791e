"""A browser for tests of pages; without one the tests are skipped with a message."""

import shutil
import time
from functools import partial

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Its usual shared memory, /dev/shm, is 64 MB in many a container: too little for a large picture.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]
FLAGS += [f"--disable-{what}" for what in ("background-networking", "component-update", "sync", "quic")]
# A served page sets its promise after all its files are loaded.
READY = """() => Promise.race([
    (async () => { while (!ii.ready) await new Promise((later) => setTimeout(later, 20)); await ii.ready; })(),
    new Promise((_, reject) => setTimeout(() => reject(new Error("the page does not get ready")), 60000))])"""


def mark(items):
    """Mark every test that drives a browser. Together they take a tenth of the time of the others: all are slow."""
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.browser)
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip(f"no browser is installed: one of {', '.join(BROWSERS)} is needed")
    with playwright.sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=path, args=FLAGS)
        yield running
        running.close()


def pages(browser):
    """Yield a function that opens a page file without idle motion; errors of the page fail the test."""
    opened, complaints = [], []

    def call(path, fragment="", wait=True, script=None, **options):
        options = {"viewport": {"width": 1000, "height": 700}, "reduced_motion": "reduce", **options}
        tab = browser.new_page(**options)
        opened.append(tab)
        tab.wait_for_function = partial(true_of, tab)
        if script:
            tab.add_init_script(script)
        tab.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("crash", lambda _: complaints.append("the page crashed"))
        tab.goto(path if "://" in str(path) else f"file://{path}{fragment}")
        if wait:
            tab.evaluate(READY)
        return tab

    yield call
    for tab in opened:
        tab.close()
    assert complaints == [], "\n".join(complaints)


def true_of(tab, expression, *, arg=None, timeout=30000):
    """Wait until an expression is true: Playwright's own function needs eval, which the pages' policy forbids."""
    until = time.monotonic() + timeout / 1000
    while not (found := tab.evaluate(expression, arg)):
        assert time.monotonic() < until, f"never true: {expression}"
        tab.wait_for_timeout(20)
    return found


@pytest.fixture
def show(browser):
    yield from pages(browser)


@pytest.fixture(scope="module")
def show_once(browser):
    """As `show`, for a page that several tests share."""
    yield from pages(browser)
