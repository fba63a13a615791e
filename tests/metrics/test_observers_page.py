"""The page of a test with observers in a real browser. On b1dc540 there is none."""

import json
import re
import threading
from functools import partial

import numpy as np
import pytest

from ii_core import IIPicture, preset, view_image
from ii_core.picture.view import five_viewpoints
from metrics.observers import Options, Stimulus, read_results, write_test
from metrics.observers.store import ResultFolder
from raytrace_ii.cli.server import Answers, PageServer
from tests.support.browser import one_tab, true_of

pytestmark = pytest.mark.slow

CAMERA = preset("setup1", scale=32)
QUICK = {"seconds": 0.05, "grey_seconds": 0.0, "training": 1, "block": 2, "frames": 3, "observers": 2}


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


def noise(seed):
    pixels = np.random.default_rng(seed).integers(0, 256, (*CAMERA.pixels[::-1], 3), np.uint8)
    return IIPicture(pixels, CAMERA.lenses, CAMERA.ei_pixels, CAMERA)


def written(path, served=False, **options):
    """A test of one scene: the reference and two pictures, shown for a twentieth of a second."""
    stimuli = [Stimulus(scene="s", name=f"n{i}", picture=noise(i), reference=i == 0) for i in range(3)]
    return write_test(path, stimuli, Options(**{**QUICK, **options}), served=served)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "t.html"
    written(path)
    return path


def begun(tab, wrong_plates=0):
    """Go through the pages before the first presentation."""
    tab.click("#begin")
    tab.click("#sized")
    for number in range(5):
        digit = tab.evaluate(f"ii.plan.plates[{number}]") if number >= wrong_plates else "–"
        tab.wait_for_function("src => byId('plate').src === src", arg=tab.evaluate(f"ii.plates[{number}]"))
        tab.click(f"#digits button:text-is('{digit}')")
        if number == 4:
            tab.wait_for_selector("#message:not([hidden])")
        else:
            tab.wait_for_function("n => byId('plate').src === ii.plates[n]", arg=number + 1)


def vote(tab):
    """Go on through messages until the page waits for an answer."""
    while tab.wait_for_selector("#vote:not([hidden]), #message:not([hidden]) #next").get_attribute("id") == "next":
        tab.click("#next")
        tab.wait_for_selector("#message", state="hidden")


def answer(tab, key):
    """Give one answer and wait until it is kept."""
    before = tab.evaluate("ii.answers?.given ?? 0")
    vote(tab)
    tab.keyboard.press(key)
    tab.wait_for_function(
        "n => ii.answers.given > n && ii.answers.lines.length === ii.answers.records.length", arg=before
    )


def downloaded(tab, path):
    with tab.expect_download() as download:
        tab.click("section:not([hidden]) button:has-text('Download')")
    download.value.save_as(path)
    return download.value.suggested_filename


@pytest.mark.slow
def test_a_whole_test_gives_results_that_are_read(opened, page, tmp_path):
    tab = opened(page, "#observer=2")
    begun(tab)
    for key in "1425":  # one of training, then the hidden reference and two pictures, with a break after two
        answer(tab, key)
    tab.wait_for_selector("#end:not([hidden])")
    assert downloaded(tab, tmp_path / "r.jsonl") == "observer-002.jsonl"
    results = read_results([tmp_path / "r.jsonl"])
    (one,) = results.observers
    order = results.plan["orders"][1]
    assert one.answers == [(tuple(pair), grade) for pair, grade in zip(order, (4, 2, 5), strict=True)]
    assert one.complete and one.colours and results.notes == []
    records = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    assert [r["kind"] for r in records] == ["begin", "answer", "answer", "answer", "break", "answer", "end"]
    assert all(len(r["shown_ms"]) == 2 and min(r["shown_ms"]) >= 50 for r in records if r["kind"] == "answer")
    assert records[0]["px_per_mm"] == pytest.approx(324 / 85.6) and records[0]["screen"] == [1000, 700]
    assert set(records[0]) == {
        "kind", "at", "format", "version", "plan", "observer", "colour_vision",
        "px_per_mm", "device_pixel_ratio", "screen", "window", "check",
    }  # fmt: skip # nothing about the person or the machine beyond these


def test_the_pixels_shown_are_those_of_the_views(opened, tmp_path):
    """Either picture as it stands on the canvas before it goes grey; on the screen each pixel is a square."""
    written(tmp_path / "t.html", show="front", training=0)
    tab = opened(tmp_path / "t.html")
    begun(tab)
    tab.evaluate(
        """() => { const grey = blank; ii.shown = [];
             blank = (seconds) => {
               const c = byId("left"), d = c.getContext("2d").getImageData(0, 0, c.width, c.height);
               ii.shown.push([c.width, c.height, Array.from(d.data), c.getBoundingClientRect().width]);
               return grey(seconds); } }"""
    )
    vote(tab)
    front = five_viewpoints(CAMERA)["front"]
    for number, shown in zip(tab.evaluate("ii.plan.orders[0][0]"), tab.evaluate("ii.shown"), strict=True):
        wanted, _ = view_image(noise(number), front)
        got = np.array(shown[2]).reshape(shown[1], shown[0], 4)[..., :3]
        assert np.abs(got - wanted).max() <= 1  # halves are rounded either way
        assert shown[3] == 56 * CAMERA.lenses[0]


@pytest.mark.slow
def test_pairs_are_answered_by_arrows_and_buttons(opened, tmp_path):
    written(tmp_path / "t.html", method="pairs", training=0)
    tab = opened(tmp_path / "t.html", viewport={"width": 1400, "height": 800})
    begun(tab)
    answer(tab, "ArrowLeft")
    answer(tab, " ")
    vote(tab)
    tab.click("#answers button:has-text('right')")
    tab.wait_for_selector("#end:not([hidden])")
    downloaded(tab, tmp_path / "r.jsonl")
    (one,) = read_results([tmp_path / "r.jsonl"]).observers
    assert [given for _, given in one.answers] == ["left", "same", "right"]


@pytest.mark.slow
def test_a_closed_tab_loses_nothing(browser, page, tmp_path):
    context = browser.new_context(viewport={"width": 1000, "height": 700})
    tab = context.new_page()
    tab.goto(f"file://{page}")
    begun(tab, wrong_plates=2)
    answer(tab, "3")
    answer(tab, "4")
    again = context.new_page()
    tab.close()
    again.goto(f"file://{page}")
    again.wait_for_selector("text=Observer 1: 2 of 4 answers.")
    assert again.input_value("#observer") == "2"  # the next observer gets another number
    downloaded(again, tmp_path / "half.jsonl")
    half = read_results([tmp_path / "half.jsonl"])
    assert half.notes == [f"{tmp_path / 'half.jsonl'}: stopped after 1 of 3 answers, which count"]
    assert not half.observers[0].colours  # two plates were not read
    again.click("#earlier button:text-is('Continue')")
    again.click("#sized")
    answer(again, "5")
    answer(again, "1")
    again.wait_for_selector("#end:not([hidden])")
    downloaded(again, tmp_path / "whole.jsonl")
    (one,) = read_results([tmp_path / "whole.jsonl"]).observers
    assert [grade for _, grade in one.answers] == [4, 5, 1] and one.complete
    context.close()


@pytest.mark.slow
def test_a_presentation_begins_again_when_the_tab_was_out_of_sight(opened, tmp_path):
    written(tmp_path / "t.html", training=0)
    tab = opened(tmp_path / "t.html")
    begun(tab)
    tab.evaluate(
        """() => { const shown = play;
             const sight = (value) => { Object.defineProperty(document, "hidden", { value, configurable: true });
                                        document.dispatchEvent(new Event("visibilitychange")); };
             play = (...what) => {
               const playing = shown(...what);
               sight(true); sight(false); play = shown;
               return playing; } }"""
    )
    answer(tab, "4")
    record = tab.evaluate("ii.answers.records.at(-1)")
    assert record["repeated"] == 1 and min(record["shown_ms"]) >= 50


def test_a_window_that_is_too_small_is_refused(opened, page):
    tab = opened(page, viewport={"width": 700, "height": 500})
    tab.click("#begin")
    assert tab.is_disabled("#sized") and "are needed" in tab.inner_text("#small")
    tab.set_viewport_size({"width": 1000, "height": 700})
    tab.wait_for_selector("#sized:enabled")


def test_every_control_has_a_name_and_the_text_contrast(opened, page):
    tab = opened(page)
    nameless = tab.evaluate(
        """[...document.querySelectorAll("input, button, img")]
             .filter(e => !(e.labels?.[0]?.innerText || e.textContent || e.alt)).length"""
    )
    assert nameless == 0
    # black on mid grey: 5.3 to 1 by WCAG's formula, where 4.5 is asked for
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(128, 128, 128)"


class Server:
    """The server of a test, which can be stopped and started again at its port."""

    def __init__(self, folder, plan):
        self.folder, self.plan, self.port = folder, plan, 0

    def __enter__(self):
        kept = ResultFolder(self.folder / "results", json.dumps(self.plan, ensure_ascii=False))
        handler = partial(Answers.into(kept), directory=str(self.folder / "page"))
        self.server = PageServer(("127.0.0.1", self.port), handler)
        self.port = self.server.server_port
        self.thread = threading.Thread(target=self.server.serve_forever, args=(0.01,))
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()


@pytest.fixture
def server(tmp_path):
    (tmp_path / "page").mkdir()
    return Server(tmp_path, written(tmp_path / "page" / "index.html", served=True))


@pytest.mark.slow
def test_the_server_has_every_answer_at_once(show, server, tmp_path):
    with server:
        tab = show(f"http://127.0.0.1:{server.port}/")
        begun(tab)
        file = tmp_path / "results" / "observer-001.jsonl"
        for given, key in enumerate("342", 1):
            answer(tab, key)
            tab.wait_for_function("ii.answers.sent === ii.answers.lines.length")
            assert file.read_text().count('"answer"') == 2 * given  # the kind and the key
        other = show(f"http://127.0.0.1:{server.port}/")
        begun(other)
        assert (tmp_path / "results" / "observer-002.jsonl").exists()
        answer(tab, "1")
        tab.wait_for_selector("text=All answers are saved.")
    results = read_results([file])
    assert [grade for _, grade in results.observers[0].answers] == [4, 2, 1] and results.notes == []


@pytest.mark.slow
def test_answers_given_while_the_server_is_away_arrive_later(browser, server, tmp_path):
    """Without `show`, which fails on the browser's error about the stopped server."""
    tab = browser.new_page(viewport={"width": 1000, "height": 700})
    tab.wait_for_function = partial(true_of, tab)
    with server:
        tab.goto(f"http://127.0.0.1:{server.port}/")
        tab.evaluate("ii.ready")
        begun(tab)
        answer(tab, "3")
        tab.wait_for_function("ii.answers.sent === ii.answers.lines.length")
    for key in "421":
        answer(tab, key)
    tab.wait_for_selector("#status:has-text('The server has not accepted the last answers')")
    with server:
        tab.wait_for_selector("text=All answers are saved.")
    tab.close()
    results = read_results([tmp_path / "results" / "observer-001.jsonl"])
    assert [grade for _, grade in results.observers[0].answers] == [4, 2, 1] and results.observers[0].complete


@pytest.mark.parametrize(("served", "connect"), [(False, "'none'"), (True, "'self'")])
def test_the_page_may_run_its_own_scripts_alone(tmp_path, served, connect):
    """The tests above run under this policy: a breach is an error on the console, which fails them."""
    written(tmp_path / "t.html", served)
    text = (tmp_path / "t.html").read_text(encoding="utf-8")
    (nonce,) = set(re.findall(r"<(?:script|style) nonce=\"(\w{32})\">", text))
    assert f"default-src 'none'; script-src 'nonce-{nonce}'" in text and f"connect-src {connect};" in text
    assert not re.search(r"<(?:script|style)>|unsafe-|<[^>]+\s(?:style|on\w+)=", text.split("<script nonce")[0])
