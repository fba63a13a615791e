"""One browser tab for all tests of a page: a third of the CPU time of new ones. Pages of commands with --serve."""

import threading
from functools import partial
from pathlib import Path

from raytrace_ii.cli.server import PageServer
from tests.support.browser import READY, true_of

SMALL = {"width": 480, "height": 240}  # drawn by the processor: few pixels


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
