"""A browser for tests of pages; without one the tests are skipped with a message.

One tab for all tests of a page takes a third of the CPU time of new ones.
"""

import shutil
import threading
import time
from functools import partial
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Its usual shared memory, /dev/shm, is 64 MB in many a container: too little for a large picture.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]
FLAGS += [f"--disable-{what}" for what in ("background-networking", "component-update", "sync", "quic")]
# A served page sets its promise after all its files are loaded.
READY = """() => Promise.race([
    (async () => { while (!ii.ready) await new Promise((later) => setTimeout(later, 20)); await ii.ready; })(),
    new Promise((_, reject) => setTimeout(() => reject(new Error("the page does not get ready")), 60000))])"""
SMALL = {"width": 480, "height": 240}  # drawn by the processor: few pixels


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


class Tab:
    """A tab without idle motion; keeps the errors of the pages that it has shown."""

    def __init__(self, browser, **viewport):
        self.browser, self.viewport = browser, viewport or SMALL
        self.page, self.shown, self.complaints = None, None, []

    def open(self, path, fragment=None, *, wait=True, motion="reduce", viewport=None, again=False):
        """Show a page, and return the tab: as it stands if it is shown already, without a fragment, unless again."""
        if self.page is None:
            self._start()
        address = str(path) if "://" in str(path) else f"file://{path}"
        viewport = viewport or self.viewport
        if self.page.viewport_size != viewport:
            self.page.set_viewport_size(viewport)
        self.page.emulate_media(reduced_motion=motion)
        if fragment is not None or again or self.shown != address:
            if self.shown == address:
                self.page.goto("about:blank")  # else only the fragment would change
            self.shown = None
            self.page.goto(address + (fragment or ""))
            if wait:
                self.page.evaluate(READY)
            self.shown = address if wait and motion == "reduce" else None
        return self.page

    def check(self):
        """Fail with what the pages complained about; after a crash the next page gets a new tab."""
        found, self.complaints = self.complaints, []
        if found:
            self.close()
        assert found == []

    def close(self):
        """Close the tab."""
        if self.page is not None:
            self.page.context.close()
        self.page = self.shown = None

    def _start(self):
        self.page = self.browser.new_page(viewport=self.viewport, reduced_motion="reduce")
        self.page.wait_for_function = partial(true_of, self.page)
        self.page.on("console", lambda message: self._add(message.text) if message.type == "error" else None)
        self.page.on("pageerror", lambda error: self._add(str(error)))
        self.page.on("crash", lambda _: self._add("the page crashed"))

    def _add(self, text):
        self.complaints.append(text)


def one_tab(browser, **viewport):
    """Yield a `Tab` for a fixture of the whole run."""
    tab = Tab(browser, **viewport)
    yield tab
    tab.close()


def with_script(page, script, copy):
    """Write a copy of a page that runs a script before its own; return its path."""
    text = Path(page).read_text(encoding="utf-8")
    assert text.count("<head>") == 1
    copy.write_text(text.replace("<head>", f"<head><script>{script}</script>"), encoding="utf-8")
    return copy


def served(monkeypatch, run, words, visit):
    """Run a command that serves a page, call ``visit`` with its address, end the server; return what `run` does."""
    from raytrace_ii.cli.server import PageServer  # this file is imported before all tests

    real = PageServer.serve_forever

    def serve(server):
        thread = threading.Thread(target=real, args=(server, 0.01))  # looks for its end every 10 ms
        thread.start()
        try:
            visit(f"http://127.0.0.1:{server.server_port}/")
        finally:
            server.shutdown()
            thread.join()

    monkeypatch.setattr(PageServer, "serve_forever", serve)
    return run(*words)
