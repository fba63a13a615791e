"""Controls of the viewer's page in a real browser."""

import numpy as np
import pytest

from codec import encode
from ii_core import IICamera, IIPicture
from ii_core.display.viewer import write_viewer
from tests.ii_core.conftest import LABELS
from tests.support.browser import with_script

pytestmark = pytest.mark.slow  # the page itself is in `test_viewer.py`

PHONE = {"width": 390, "height": 844}
WIDE = {"width": 780, "height": 260}  # controls stand beside the picture


@pytest.fixture
def tab(opened, compared):
    """The page as it opened."""
    tab = opened(compared, viewport=WIDE)
    tab.evaluate("ii.viewer.set({ ...ii.viewer.opening })")
    frame(tab)
    return tab


def state(tab):
    return tab.evaluate("ii.viewer.state")


def frame(tab):
    """Wait until what has changed is on the screen."""
    tab.evaluate(
        """() => new Promise(done => {
             ii.viewer.redraw(); requestAnimationFrame(() => requestAnimationFrame(done)); })"""
    )


def drag(tab, x, y, dx, dy):
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + dx, y + dy, steps=2)
    tab.mouse.up()


@pytest.mark.slow
def test_reset_returns_to_what_the_page_opened_with(tab):
    opened = tab.evaluate("ii.viewer.state")
    assert opened["f"] != 0 and opened["mode"] == "split" and opened["a"] == 1.5
    tab.evaluate("ii.viewer.set({ f: 0, x: 1, zoom: 3, mode: 'decoded', a: 2 })")
    assert "f=0" in tab.url
    tab.locator("#reset").click()
    assert tab.evaluate("ii.viewer.state") == opened and tab.evaluate("location.hash") == ""


def test_every_control_has_a_name(tab):
    nameless = tab.evaluate(
        """[...document.querySelectorAll("input, select, button, [tabindex], [role=img]")]
             .filter(e => !(e.labels?.[0]?.innerText || e.innerText || e.getAttribute("aria-label"))).length"""
    )
    assert nameless == 0
    assert tab.evaluate("document.querySelectorAll('input, select').length") == 11


def test_a_still_has_no_clock(tab):
    assert tab.locator("#play, [data-state=t]").count() == 0
    tab.locator("#main").focus()
    tab.keyboard.press(" ")
    assert not tab.evaluate("ii.viewer.take.playing")


def test_a_drag_on_the_split_line_turns_the_view(tab):
    """The line opens in the middle of the page, and earlier took the first drag, which begins there."""
    box = tab.locator("#main").bounding_box()
    drag(tab, box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, box["width"] / 8, 0)
    assert state(tab)["x"] == pytest.approx(-0.25, abs=0.01) and state(tab)["split"] == 0.5


def test_the_split_line_has_a_handle_and_labels(tab):
    box, grip = tab.locator("#main").bounding_box(), tab.locator("#grip").bounding_box()
    drag(tab, grip["x"] + grip["width"] / 2, grip["y"] + grip["height"] / 2, -box["width"] / 4, 0)
    assert state(tab)["split"] == pytest.approx(0.25, abs=0.01) and state(tab)["x"] == 0
    tab.keyboard.press("ArrowRight")  # the handle has the focus
    assert state(tab)["split"] == pytest.approx(0.27, abs=0.01) and state(tab)["x"] == 0
    frame(tab)
    line = box["x"] + state(tab)["split"] * box["width"]
    left, right = (tab.locator("#split .half").nth(i) for i in (0, 1))
    assert (left.inner_text(), right.inner_text()) == LABELS
    assert left.bounding_box()["x"] + left.bounding_box()["width"] <= line <= right.bounding_box()["x"]
    tab.evaluate("ii.viewer.set({ mode: 'decoded' })")
    frame(tab)
    assert not tab.locator("#grip").is_visible()


def test_the_command_names_scheme_rate_and_quality(run, opened, shot, tmp_path):
    shot.picture.save(tmp_path / "a.png")
    encode(shot.picture, "si-h264", qp=30).save(tmp_path / "a.ii")
    code, _, err = run("view", tmp_path / "a.png", "--compare", tmp_path / "a.ii", "-o", tmp_path / "v.html")
    assert code == 0, err
    text = opened(tmp_path / "v.html").locator("#split .half").nth(1).inner_text()
    scheme, rate, quality = text.split(", ")
    assert scheme == "si-h264" and float(rate.removesuffix(" bpp")) > 0
    assert 20 < float(quality.removesuffix(" dB")) < 60


def test_every_slider_shows_its_value(tab):
    tab.evaluate("ii.viewer.set({ x: 0.5, r: 2, a: 3, zoom: 2, split: 0.3, gain: 8, eyes: 0.5 })")
    frame(tab)
    values = tab.evaluate(
        """Object.fromEntries([...document.querySelectorAll("input[type=range]")]
             .map(i => [i.dataset.state, i.parentElement.querySelector("output").textContent]))"""
    )
    degrees = np.degrees(tab.evaluate("ii.viewer.meta.camera.phi"))
    assert values["x"] == f"{0.5 * degrees:.1f}°" and values["eyes"] == f"{degrees:.1f}°"
    assert values["a"] == "5.0 px" and values["zoom"] == "2.00 ×" and values["split"] == "30 %"
    assert values["gain"] == "8.0 ×" and values["r"].endswith(" mm") and values["f"].startswith("z ")
    assert len(values) == 9 and all(values.values())


def disabled(tab):
    frame(tab)
    return set(tab.evaluate("[...document.querySelectorAll('[data-state]:disabled')].map(i => i.dataset.state)"))


@pytest.mark.slow
def test_sliders_without_effect_are_disabled(tab, opened, tmp_path):
    assert disabled(tab) == {"eyes", "gain"}
    tab.evaluate("ii.viewer.set({ mode: 'difference', stereo: 'anaglyph' })")
    assert disabled(tab) == {"split"}
    pixels = np.full((4, 6, 3), 128, np.uint8)  # one pixel a lens: there is nothing to focus
    camera = IICamera(pixels=(6, 4), lenses=(6, 4), pixel_pitch_mm=0.01, gap_mm=0.3)
    write_viewer(tmp_path / "v.html", IIPicture(pixels, (6, 4), (1, 1), camera))
    assert disabled(opened(tmp_path / "v.html")) == {"eyes", "f", "a"}


@pytest.mark.slow
def test_nothing_is_cut_on_a_small_screen(tab):
    """Earlier, the help stood at the end of a column of 880 px."""
    tab.set_viewport_size({"width": 1280, "height": 800})
    box = tab.locator(".help").bounding_box()
    assert box["y"] + box["height"] <= 800
    assert tab.evaluate("(a => a.scrollHeight - a.clientHeight)(document.querySelector('aside'))") == 0
    cut = "[...document.querySelectorAll('label, td, output')].filter(e => e.scrollWidth > e.clientWidth + 1).length"
    assert tab.evaluate(cut) == 0


@pytest.mark.slow
def test_full_screen_shows_the_picture_alone(tab):
    for leave in ("narrow", "Escape"):
        tab.locator("#wide").click()
        filled = "(box => box.width === innerWidth && box.height === innerHeight)"
        tab.wait_for_function(f"{filled}(document.getElementById('main').getBoundingClientRect())")
        assert not tab.locator("aside").is_visible()
        if leave == "narrow":
            tab.locator("#narrow").click()
        else:
            tab.keyboard.press(leave)
        tab.locator("aside").wait_for(state="visible")
    assert state(tab)["x"] == 0


# Animation frames at the rate of the test, independent of drawing time.
PACE = "let now = 0; window.requestAnimationFrame = (f) => setTimeout(() => f((now += %d)), 30);"


def places(tab, count=4):
    got = []
    for _ in range(count):
        got.append(tuple(tab.evaluate("ii.viewer.viewpoint()")))
        tab.wait_for_timeout(150)
    return got


@pytest.mark.slow
def test_the_view_sways_until_the_first_touch(opened, still, tmp_path):
    tab = opened(with_script(still, PACE % 30, tmp_path / "v.html"), motion="no-preference")
    assert len(set(places(tab))) > 2
    assert tab.evaluate("location.hash") == ""  # the sway is no state to keep
    box = tab.locator("#main").bounding_box()
    drag(tab, box["x"] + 100, box["y"] + 100, 3, 0)
    tab.wait_for_timeout(300)
    assert len(set(places(tab))) == 1


@pytest.mark.slow
def test_the_view_rests_where_motion_is_slow_or_not_wanted(tab, opened, still, tmp_path):
    assert len(set(places(tab))) == 1
    slow = opened(with_script(still, PACE % 300, tmp_path / "v.html"), motion="no-preference")
    slow.wait_for_function("ii.viewer.swaying === false")
    assert len(set(places(slow))) == 1


@pytest.fixture(scope="module")
def phone(show_once, compared):
    return show_once(compared, viewport=PHONE, has_touch=True)


@pytest.mark.slow
def test_on_a_phone_the_picture_comes_first(phone):
    tab = phone
    box = tab.locator("#main").bounding_box()
    assert box["y"] <= 8 and box["height"] >= PHONE["height"] / 2
    pace, rows = tab.evaluate("[ii.viewer.map(ii.viewer.pane('main')).pace[1], ii.viewer.meta.lenses[1]]")
    rows /= pace * tab.evaluate("ii.viewer.density")
    assert rows >= PHONE["height"] / 2  # the picture itself, not the pane around it
    opened = state(tab)
    tab.evaluate("ii.viewer.set({ zoom: 1 })")
    tab.locator("#reset").click()
    assert state(tab) == opened
    assert tab.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]


@pytest.mark.slow
def test_on_a_phone_controls_are_as_large_as_fingers_and_nothing_is_cut(phone):
    """44 px is the usual size of a touch target; buttons had 25 and sliders 16."""
    small = """[...document.querySelectorAll("aside button, aside input, aside select, #grip")].filter(e => {
        const box = e.getBoundingClientRect(); return box.width > 0 && Math.min(box.width, box.height) < 44; })"""
    cut = """[...document.querySelectorAll("aside *, .half")].filter(
        e => e.clientWidth && e.scrollWidth > e.clientWidth)"""
    assert phone.evaluate(f"{small}.map(e => e.outerHTML)") == []
    assert phone.evaluate(f"{cut}.map(e => e.outerHTML)") == []
    assert phone.locator("#canvas").get_attribute("aria-label")


@pytest.mark.slow
def test_tilting_turns_by_the_same_angle(phone):
    """Right edge and top edge away: the viewer then stands to the left of the display's axis, and below it."""
    tab = phone
    tilt = """([beta, gamma]) =>
        dispatchEvent(new DeviceOrientationEvent("deviceorientation", { alpha: 0, beta, gamma }))"""
    tab.evaluate(tilt, [40, 0])
    assert state(tab)["x"] == 0  # until it is switched on
    tab.locator("#tilt").click()
    tab.wait_for_selector("#tilt[aria-pressed=true]")  # a browser may ask for permission first, and answers later
    tab.evaluate(tilt, [40, 0])
    tab.evaluate(tilt, [37, 2])
    phi, theta = tab.evaluate("[ii.viewer.meta.camera.phi, ii.viewer.meta.camera.theta]")
    assert state(tab)["x"] == pytest.approx(-np.radians(2) / phi, abs=1e-6)
    assert state(tab)["y"] == pytest.approx(-np.radians(3) / theta, abs=1e-6)
    tab.evaluate(tilt, [40, -80])
    assert state(tab)["x"] == 1  # never out of the viewing zone
    tab.locator("#tilt").click()
    tab.evaluate(tilt, [40, 0])
    assert state(tab)["x"] == 1


@pytest.mark.slow
def test_without_webgl2_a_still_picture_stands_under_the_message(compared, opened, tmp_path):
    page = with_script(compared, "HTMLCanvasElement.prototype.getContext = () => null", tmp_path / "v.html")
    tab = opened(page, wait=False, viewport={"width": 1280, "height": 720})
    assert "WebGL2" in tab.locator("#failure").inner_text()
    still, text = tab.locator("#still").bounding_box(), tab.locator("#failure p").bounding_box()
    assert tab.evaluate("document.getElementById('still').naturalWidth") == 32 and still["width"] > 300
    assert still["y"] >= text["y"] + text["height"]
