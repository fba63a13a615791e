"""Viewer page in an installed browser; refusals of its commands."""

import io
import json
import re
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from ii_core import IICamera, IIPicture, Rig, disparity_of_depth, preset, view_image
from ii_core.base.files import write_image
from ii_core.display.viewer import page, write_viewer, write_viewer_folder
from ii_core.display.viewer.page import depth_view
from metrics import quality_rows
from tests.support import pictures
from tests.support.browser import served, with_script


def snapshot(tab, **state):
    """Return the view of the page with one pixel per lens, and its viewpoint."""
    got = tab.evaluate(
        """state => { ii.viewer.set(state); const s = ii.viewer.snapshot();
                      return [s.width, s.height, Array.from(s.data), ii.viewer.viewpoint()] }""",
        state,
    )
    return np.array(got[2], np.uint8).reshape(got[1], got[0], 4)[..., :3].astype(float), got[3]


def slow(*values):
    """Values of a test for `make test-all`: a page takes half a second of CPU time to open."""
    return pytest.param(*values, marks=pytest.mark.slow)


def psnr(a, b):
    return 10 * np.log10(255**2 / max(np.mean((a - b) ** 2), 1e-9))


PLACES = [(0, 0, 1), (0.7, -0.3, 1), (-1, 1, 1), (1.8, 0, 1), (0.2, 0.1, 0.5)]


def test_every_viewpoint_shows_its_view_image(opened, still, shot):
    tab = opened(still)
    for x, y, r in PLACES:
        shown, viewpoint = snapshot(tab, x=x, y=y, r=r, f=0, a=1)
        wanted, valid = view_image(shot.picture, viewpoint)
        assert np.abs(shown - wanted)[valid].max() <= 1  # the card rounds a half its own way


def test_upright_elementary_images_look_the_other_way(opened, shot, tmp_path):
    picture = replace(shot.picture, erect=True)
    write_viewer(tmp_path / "v.html", picture, quality=None)
    shown, viewpoint = snapshot(opened(tmp_path / "v.html"), x=0.6, y=-0.4, f=0, a=1)
    assert np.abs(shown - view_image(picture, viewpoint)[0]).max() <= 1


@pytest.mark.parametrize("optics", [slow("pinhole"), "grin"])
def test_viewing_zones_that_meet(opened, shot, tmp_path, optics):
    old = shot.picture.camera
    camera = replace(old, viewer_mm=150 * old.gap_mm, optics=(optics,), lens_pitch_mm=None)
    picture = replace(shot.picture, camera=camera, erect=camera.erect)
    write_viewer(tmp_path / "v.html", picture, quality=None)
    tab = opened(tmp_path / "v.html")
    for x, y, r in PLACES[:3]:
        shown, viewpoint = snapshot(tab, x=x, y=y, r=r, f=0, a=1)
        wanted, valid = view_image(picture, viewpoint)
        assert np.abs(shown - wanted)[valid].max() <= 1


@pytest.mark.parametrize(
    ("lenses", "ei_pixels"),
    [((1, 1), (1, 1)), slow((7, 5), (1, 1)), slow((1, 1), (9, 4)), ((3, 2), (1, 6))],
)
@pytest.mark.parametrize("with_camera", [True, slow(False)])
def test_any_structure(opened, tmp_path, lenses, ei_pixels, with_camera):
    size = lenses[0] * ei_pixels[0], lenses[1] * ei_pixels[1]
    pixels = np.random.default_rng(1).integers(0, 256, (size[1], size[0], 3), np.uint8)
    camera = IICamera(pixels=size, lenses=lenses, pixel_pitch_mm=0.01, gap_mm=0.3) if with_camera else None
    picture = IIPicture(pixels, lenses, ei_pixels, camera)
    write_viewer(tmp_path / "v.html", picture, quality=None)
    shown, viewpoint = snapshot(opened(tmp_path / "v.html"), f=0, a=1)
    if with_camera:
        wanted, valid = view_image(picture, viewpoint)
        assert np.abs(shown - wanted)[valid].max() <= 1
    else:
        assert shown.shape == (lenses[1], lenses[0], 3)


def test_a_mosaic_of_several_pages(opened, shot, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "PAGE_SIDE", 100)  # cuts through sub-images of 32×16 px
    write_viewer(tmp_path / "v.html", shot.picture, quality=None)
    shown, viewpoint = snapshot(opened(tmp_path / "v.html"), x=-0.4, y=0.9, f=0, a=1)
    assert np.abs(shown - view_image(shot.picture, viewpoint)[0]).max() <= 1


def focused(picture, viewpoint, shift, radius):
    """Compute the shader's result in numpy: pixels within the aperture, each from the lens of the same point."""
    from ii_core.picture.view import view_positions

    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    field = picture.pixels.reshape(l, v, k, u, 3).astype(float)
    x, y = view_positions(picture.camera, viewpoint)
    x, y = x - np.arange(k) * u, y - np.arange(l) * v
    total, weights = np.zeros((l, k, 3)), np.zeros((l, k, 1))
    for row in range(l):
        for col in range(k):
            room = np.minimum([col, row], [k - 1 - col, l - 1 - row]) + 0.5  # to the border of the array
            held = np.clip(shift, -room, room)
            for j in range(v):
                for i in range(u):
                    off = np.array([i - x[col], j - y[row]])
                    weight = np.prod(np.maximum(0, 1 - np.abs(off) / radius))
                    at = np.array([col, row]) + held * off
                    if weight <= 0 or (at < -0.5).any() or (at > [k - 0.5, l - 0.5]).any():
                        continue
                    low = np.floor(at).astype(int)
                    (tx, ty), (x0, x1), (y0, y1) = (
                        at - low,
                        np.clip([low[0], low[0] + 1], 0, k - 1),
                        np.clip([low[1], low[1] + 1], 0, l - 1),
                    )
                    p = field[:, j, :, i]
                    value = (1 - ty) * ((1 - tx) * p[y0, x0] + tx * p[y0, x1]) + ty * (
                        (1 - tx) * p[y1, x0] + tx * p[y1, x1]
                    )
                    total[row, col] += weight * value
                    weights[row, col] += weight
    return total / weights


@pytest.mark.parametrize("erect", [slow(False), True])
def test_focus_and_aperture(opened, tmp_path, erect):
    rng = np.random.default_rng(2)
    camera = IICamera(pixels=(40, 24), lenses=(10, 6), pixel_pitch_mm=0.01, gap_mm=0.1)
    picture = IIPicture(rng.integers(0, 256, (24, 40, 3), np.uint8), (10, 6), (4, 4), camera, erect)
    write_viewer(tmp_path / "v.html", picture, quality=None)
    tab = opened(tmp_path / "v.html")
    shown, viewpoint = snapshot(tab, x=0.3, y=0.2, f=0.7, a=1.8)
    if erect:  # the same formulas with the other sign, which `view_positions` takes
        from functools import partial

        import ii_core.picture.view

        original = ii_core.picture.view.view_positions
        ii_core.picture.view.view_positions = partial(original, erect=True)
        try:
            wanted = focused(picture, viewpoint, -0.7, 1.8)
        finally:
            ii_core.picture.view.view_positions = original
    else:
        wanted = focused(picture, viewpoint, 0.7, 1.8)
    assert np.abs(shown - wanted).max() <= 2  # 8-bit rounding of sums in single precision


def test_dragging_turns_the_scene(opened, still, shot):
    tab = opened(still, "#f=0&a=1")
    box = tab.locator("#main").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + box["width"] / 4, y - box["height"] / 8, steps=5)
    tab.mouse.up()
    tab.wait_for_function("/x=-0\\.5/.test(location.hash)")
    state = tab.evaluate("ii.viewer.state")
    assert state["x"] == pytest.approx(-0.5, abs=0.01) and state["y"] == pytest.approx(-0.25, abs=0.01)
    shown, viewpoint = snapshot(tab)
    assert viewpoint[0] < 0 and viewpoint[1] < 0
    assert psnr(shown, view_image(shot.picture, viewpoint)[0]) >= 35
    assert state["f"] == 0  # a drag is no click: the focus stayed


def lens_at(tab, k, l):
    """Where a lens lies on the page."""
    return tab.evaluate(
        """([k, l]) => {
             const v = ii.viewer, m = v.map(v.pane("main"));
             const box = document.getElementById("main").getBoundingClientRect();
             const at = (n, axis) => (n - m.origin[axis]) / m.pace[axis] / v.density;
             return [box.left + at(k, 0), box.top + at(l, 1)]; }""",
        [k, l],
    )


def test_a_page_as_jpeg_shows_the_picture_nearly_and_clicks_focus_by_its_depth_map(opened, mapped, shot):
    tab = opened(mapped, "#f=0")
    # on the red apple in front, the green one and the large one behind, away from their edges
    for k, l in ((5, 11), (16, 13), (10, 8)):
        tab.evaluate("ii.viewer.set({ f: 0 })")
        tab.mouse.click(*lens_at(tab, k, l))
        tab.wait_for_function("ii.viewer.state.f !== 0")
        depth = tab.evaluate("ii.viewer.depthOf(ii.viewer.state.f)")
        around = depth_view(shot.picture, shot.depth)[l - 1 : l + 2, k - 1 : k + 2]
        # the line of sight meets the map between its pixels: one of the nine around is what it finds
        assert np.abs(around - depth).min() < 0.02 * depth
    shown, viewpoint = snapshot(tab, x=0.5, y=0.2, f=0, a=1)
    assert psnr(shown, view_image(shot.picture, viewpoint)[0]) >= 35


@pytest.mark.parametrize("focus_mm", [None, 500.0])
def test_focus_of_an_array_of_cameras_reaches_near_things(opened, tmp_path, focus_mm):
    """Of cameras that agree at infinity, the slider reached 0.006 px of disparity, and z was wrong."""
    camera = Rig(baseline_mm=10, focal_mm=30, sensor_mm=36, focus_mm=focus_mm).camera((3, 3), (48, 32))
    write_viewer(tmp_path / "v.html", IIPicture(np.zeros((96, 144, 3), np.uint8), (48, 32), (3, 3), camera))
    tab = opened(tmp_path / "v.html")
    for z in (60.0, 200.0, 450.0, 2000.0):
        f = tab.evaluate("z => ii.viewer.focusOf(z)", z)
        assert f == pytest.approx(-float(disparity_of_depth(camera, z)), rel=1e-6)
        assert tab.evaluate("f => ii.viewer.depthOf(f)", f) == pytest.approx(z, rel=1e-4)
        near, far = tab.evaluate("ii.viewer.meta.focus")
        assert near <= f <= far
    told = tab.evaluate("(ii.viewer.set({ f: 0 }), [ii.viewer.shown().f, ii.viewer.shown().r])")
    assert told == (["z 500.0 mm", "500 mm"] if focus_mm else ["z 4.000 km", "4.000 km"])


def test_a_click_before_the_first_painting_finds_its_lens(opened, mapped, tmp_path):
    tab = opened(with_script(mapped, "window.requestAnimationFrame = () => 1", tmp_path / "v.html"), "#f=0")
    tab.mouse.click(*lens_at(tab, 5, 11))
    assert tab.evaluate("ii.viewer.state.f") != 0 and tab.evaluate("Number.isFinite(ii.viewer.state.f)")


def test_a_click_without_a_map_finds_where_views_agree(opened, tmp_path):
    """A textured plane: seven places all lie on it."""
    rng = np.random.default_rng(4)
    k, l, u, shift = 48, 24, 7, 1.5
    wall = np.kron(rng.integers(40, 216, (40, 80, 3)), np.ones((2, 2, 1)))
    camera = IICamera(pixels=(k * u, l * u), lenses=(k, l), pixel_pitch_mm=0.01, gap_mm=0.2)
    field = np.empty((l, u, k, u, 3), np.uint8)
    for v in range(u):
        for h in range(u):  # a point at lens n in view 0 is at n + 1.5·h in view h
            rows, cols = (np.arange(n) + 20 - shift * (h if n == k else v) for n in (l, k))
            top = (
                wall[np.floor(rows).astype(int)] * (1 - rows % 1)[:, None, None]
                + wall[np.floor(rows).astype(int) + 1] * (rows % 1)[:, None, None]
            )
            c0, t = np.floor(cols).astype(int), (cols % 1)[None, :, None]
            field[:, v, :, h] = top[:, c0] * (1 - t) + top[:, c0 + 1] * t
    picture = IIPicture(field.reshape(l * u, k * u, 3), (k, l), (u, u), camera)
    write_viewer(tmp_path / "v.html", picture, quality=None)
    tab = opened(tmp_path / "v.html", "#f=0")
    found = [tab.evaluate("p => ii.viewer.pick(p)", [col, row]) for col in (14, 20, 30, 36) for row in (10, 14)]
    span = tab.evaluate("ii.viewer.meta.focus")
    assert found == pytest.approx([shift] * len(found), abs=(span[1] - span[0]) / 500)


PANES = """([k, l]) => {
  const { field, meta } = ii.viewer, [u, v] = meta.ei, [across, down] = meta.lenses.map((n, i) => n * meta.ei[i]);
  const optics = { ...ii.viewer.optics(), second: 0 };
  const raw = field.offscreen(across, down, (pane) => field.draw("raw", pane,
    { ...optics, middle: [across / 2, down / 2], extent: [across, down], magnify: 1 }));
  const epi = field.offscreen(meta.lenses[0], u, (pane) => field.draw("epi", pane,
    { ...optics, origin: [-0.5, 0], pace: [1, 0], cursor: [k, l], rows: u }));
  return [Array.from(raw), Array.from(epi), optics.base, optics.slope];
}"""


def test_lenslets_and_the_epipolar_image_are_the_pictures_pixels(opened, still, shot):
    (k, l), (u, v) = shot.picture.lenses, shot.picture.ei_pixels
    raw, epi, base, slope = opened(still, "#x=0.3&y=-0.2&f=0").evaluate(PANES, [5, 7])
    pixels = shot.picture.pixels.astype(int)
    shown = np.reshape(raw, (l * v, k * u, 4))[..., :3]
    marked = (shown != pixels).any(axis=-1)
    lens = np.stack(np.meshgrid(np.arange(k), np.arange(l)), axis=-1)
    seen = np.floor(np.array(base) + np.array(slope) * lens + 0.5).astype(int) % (u, v) + lens * (u, v)
    expected = np.zeros_like(marked)
    expected[seen[..., 1], seen[..., 0]] = True
    np.testing.assert_array_equal(marked, expected)
    np.testing.assert_allclose(shown[marked], np.full((k * l, 3), (255, 204, 51)), atol=1)
    row = pixels.reshape(l, v, k, u, 3)[7, int(np.floor(base[1] + slope[1] * 7 + 0.5))].transpose(1, 0, 2)
    place, beside = np.arange(u)[:, None], np.arange(k) - 5
    view = base[0] + slope[0] * np.arange(k)
    bare = (abs(place - view) >= abs(slope[0]) + 1) & (abs(beside) >= 1)  # of the view's line, and that of the focus
    assert bare.mean() > 0.4
    np.testing.assert_array_equal(np.reshape(epi, (u, k, 4))[..., :3][bare], row[bare])


def test_comparison_shows_the_difference(opened, compared, shot, brighter):
    tab = opened(compared)
    assert tab.evaluate("ii.viewer.state.mode") == "split"
    first, _ = snapshot(tab, mode="original", f=0)
    second, _ = snapshot(tab, mode="decoded")
    shown, _ = snapshot(tab, mode="difference", gain=4)
    np.testing.assert_allclose(shown, np.clip(127.5 + 4 * (second - first), 0, 255), atol=6)  # 4 × rounding, and it
    split, _ = snapshot(tab, mode="split", split=0.5)
    np.testing.assert_array_equal(split[:, :14], first[:, :14])
    np.testing.assert_array_equal(split[:, 18:], second[:, 18:])
    names, values = (tab.locator(f"table {kind}").all_inner_texts() for kind in ("th", "td"))
    assert names[:3] == ["Qglobal", "Qangle", "Qview front"]
    assert values[0] == quality_rows(shot.picture, brighter)[0][1]
    assert tab.locator("table sub").count() == len(names)


@pytest.mark.slow
def test_stereo_pairs_and_keys(opened, still):
    tab = opened(still, "#stereo=cross-eyed&eyes=1&f=0")
    tab.locator("#main").focus()
    assert tab.evaluate("ii.viewer.state.stereo") == "cross-eyed"
    for key in ("ArrowRight", "ArrowUp", "+", "]", ".", "s"):
        tab.keyboard.press(key)
    tab.wait_for_function("/anaglyph/.test(location.hash)")
    state = tab.evaluate("ii.viewer.state")
    assert state["stereo"] == "anaglyph" and state["x"] == 0.05 and state["y"] == 0.05
    assert state["zoom"] == 1.2 and state["a"] == 2 and state["f"] > 0
    again = opened(still, tab.evaluate("location.hash"))
    for key, value in again.evaluate("ii.viewer.state").items():
        assert value == (state[key] if isinstance(value, str) else pytest.approx(state[key], rel=1e-4, abs=1e-5))


BACKGROUND = (13, 13, 15)  # of the shader, in steps of 8 bits


def screen(tab):
    """Return the pane's pixels, and masks of those on the array and beside it, by a margin of one pixel."""
    box = tab.locator("#main").bounding_box()
    tab.evaluate("() => new Promise(done => { ii.viewer.redraw(); setTimeout(done, 200); })")
    pixels = np.asarray(Image.open(io.BytesIO(tab.screenshot(clip=box))).convert("RGB")).astype(int)
    origin, pace, lenses = tab.evaluate(
        "() => { const v = ii.viewer, m = v.map(v.pane('main')); return [m.origin, m.pace, v.meta.lenses] }"
    )
    on, off = np.ones(pixels.shape[:2], bool), np.zeros(pixels.shape[:2], bool)
    for axis, n in enumerate(pixels.shape[1::-1]):
        at = origin[axis] + pace[axis] * (np.arange(n) + 0.5)
        edge = np.minimum(at + 0.5, lenses[axis] - 0.5 - at) / pace[axis]  # pixels to the border
        side = (None, slice(None)) if axis == 0 else (slice(None), None)
        on &= (edge > 2)[side]
        off |= (edge < -2)[side]
    return pixels, on, off


@pytest.fixture(scope="module", params=["twins", "mountains"])
def far(request):
    return pictures.shot(request.param)


@pytest.mark.slow
@pytest.mark.parametrize("with_map", [True, False])
def test_far_scenes_open_without_bands(opened, far, tmp_path, with_map):
    write_viewer(tmp_path / "v.html", far.picture, depth=far.depth if with_map else None)
    tab = opened(tmp_path / "v.html", viewport={"width": 800, "height": 420})  # wide: a border beside the array
    for focused in (False, True):  # as it opens, and focused as far as the slider goes
        if focused:
            tab.evaluate("ii.viewer.set({ f: ii.viewer.meta.focus[1] })")
        pixels, on, off = screen(tab)
        background = (abs(pixels - BACKGROUND) <= 1).all(axis=2)
        assert background[off].all() and off.any()  # nothing is drawn beside the array
        assert not background[on].any()  # no black on it
    # The lens of a neighbouring pixel is at most a sixteenth of 16 rows away.
    assert abs(tab.evaluate("ii.viewer.opening.f")) <= 1


def test_focus_breaks_nowhere_in_the_picture(opened, tmp_path):
    """A smooth far scene, focused near: earlier, a step appeared where a neighbour's lens left the array."""
    camera = IICamera(pixels=(256, 128), lenses=(32, 16), pixel_pitch_mm=0.0244, gap_mm=0.73)
    ramp = np.tile(np.linspace(40, 215, 8)[:, None], (16, 256))  # what every lens sees of infinity
    picture = IIPicture(np.repeat(ramp[..., None], 3, axis=2).astype(np.uint8), (32, 16), (8, 8), camera)
    near = picture.pixels.reshape(16, 8, 32, 8, 3) + np.arange(16, dtype=np.uint8)[:, None, None, None, None]
    write_viewer(tmp_path / "v.html", picture.with_pixels(near.reshape(128, 256, 3)), quality=None)
    shown, _ = snapshot(opened(tmp_path / "v.html"), f=6, a=1)
    step = np.diff(shown[..., 0].mean(axis=1))
    # From row to row: a pixel of the ramp over 16 lenses and its brightening; a pixel of the ramp alone is 25.
    assert abs(step).max() < 14, step


def test_a_damaged_link_is_ignored(opened, still):
    tab = opened(still, "#x=nonsense&r=-5&stereo=smell&mode=difference&f=1&__proto__=2")
    state = tab.evaluate("ii.viewer.state")
    assert (state["x"], state["r"], state["stereo"], state["mode"]) == (0, 0.35, "off", "original")


@pytest.mark.slow
def test_a_lost_graphics_card_is_reported(opened, still):
    tab = opened(still, again=True)
    assert not tab.locator("#failure").is_visible()
    tab.evaluate("ii.viewer.field.gl.getExtension('WEBGL_lose_context').loseContext()")
    tab.locator("#failure").wait_for(state="visible")
    assert "graphics card" in tab.locator("#failure").inner_text()


def test_the_centre_view_comes_first(opened, shot, tmp_path):
    """Served with every page held back: the preview stands for them."""
    write_viewer_folder(tmp_path, shot.picture, quality=None)
    text = (tmp_path / "index.html").read_text()
    (tmp_path / "early.html").write_text(re.sub(r"<script[^>]*>ii\.fetch.*</script>", "", text))
    tab = opened(tmp_path / "early.html", wait=False)
    order = json.loads(re.search(r"ii\.fetch\((\[.*\])\)", text)[1])
    assert order[0][0] == "preview"
    data = list((tmp_path / order[0][1]).read_bytes())
    tab.evaluate("async data => { ii.viewer.preview(new Uint8Array(data)); await ii.viewer.finished() }", data)
    shown, viewpoint = snapshot(tab, f=0)
    assert psnr(shown, view_image(shot.picture, viewpoint)[0]) > 30  # JPEG of quality 90


@pytest.mark.slow  # the mosaic of several pages above, by 8 pages of 2048² px
def test_the_largest_picture(opened, tmp_path):
    camera = preset("setup1")
    row = np.arange(8192)[:, None] % 251
    pixels = np.broadcast_to(row.astype(np.uint8), (4096, 8192, 3)).copy()
    pixels[::7] //= 2
    write_viewer(tmp_path / "v.html", IIPicture(pixels, camera.lenses, camera.ei_pixels, camera))
    shown, viewpoint = snapshot(opened(tmp_path / "v.html"), x=0.8, y=-0.6, f=0, a=1)
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    assert psnr(shown, view_image(picture, viewpoint)[0]) >= 35


def test_the_command_refuses_invalid_pictures(run, refused, shot, tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    shot.picture.save(path)
    refused(run("view", path), "one of --output and --serve is needed")
    refused(run("view", path, "-o", tmp_path / "a.png"), "is no page: .html is needed")
    write_image(tmp_path / "bare.png", shot.picture.pixels)
    refused(run("view", tmp_path / "bare.png", "-o", tmp_path / "b.html"), "bare.png")
    monkeypatch.setattr(page, "MAX_EMBEDDED", 1000)
    refused(run("view", path, "-o", tmp_path / "v.html"), "--serve")
    assert not list(tmp_path.glob("*.html")) and not list(tmp_path.glob(".*"))


def test_served(run, monkeypatch, shot, tmp_path):
    path = tmp_path / "a.png"
    shot.picture.save(path)

    def visit(url):
        with urllib.request.urlopen(url) as page:
            order = json.loads(re.search(r"ii\.fetch\((\[.*\])\)", page.read().decode())[1])
        assert len(order) > 1
        for _, name, *_ in order:
            with urllib.request.urlopen(url + name) as data:
                assert len(data.read()) > 100

    code, out, _ = served(monkeypatch, run, ["view", path, "--serve"], visit)
    assert code == 0 and "shows the page" in out


@pytest.mark.slow
def test_the_page_may_run_its_own_scripts_alone(opened, shot, tmp_path):
    """A content security policy: other scripts, and requests to other hosts, are refused."""
    write_viewer(tmp_path / "v.html", shot.picture, title="<script>alert(1)</script>")
    text = (tmp_path / "v.html").read_text(encoding="utf-8")
    (nonce,) = set(re.findall(r"<(?:script|style) nonce=\"(\w{32})\">", text))
    assert f"script-src 'nonce-{nonce}'" in text and "connect-src 'none'" in text
    assert not re.search(r"<(?:script|style)>|unsafe-|<[^>]+\s(?:style|on\w+)=", text.split("<script nonce")[0])
    (tmp_path / "x.html").write_text(text.replace("</body>", "<script>window.run = 1</script></body>"), "utf-8")
    page = opened(tmp_path / "v.html").context.browser.new_page()  # its complaints are expected
    page.goto(f"file://{tmp_path / 'x.html'}")
    assert page.evaluate("() => ii.ready.then(() => window.run === undefined)")
    assert page.evaluate("() => fetch('http://127.0.0.1:9/').then(() => false, (error) => true)")
    page.close()
