"""Takes in the viewer's page: time slider, playing, comparison, requests for parts of a file."""

import contextlib
import functools
import http.server
import json
import re
import threading
import urllib.error
import urllib.request

import numpy as np
import pytest

from codec import Plan, encode_take
from ii_core import video_of, view_image
from ii_core.display.viewer import page, write_viewer, write_viewer_folder
from ii_core.video.video import IIVideo
from tests.ii_core.test_viewer import snapshot
from tests.support.browser import served

pytestmark = pytest.mark.slow  # the page itself is in `test_viewer.py`

FRAMES = 6


@pytest.fixture(scope="module")
def take(shot):
    """Return a take whose frames are shifted by whole lenses, each with its own brightness."""
    step = shot.picture.ei_pixels[0]
    frames = [
        shot.picture.with_pixels(np.roll(shot.picture.pixels // 2 + np.uint8(15 * t), 3 * t * step, axis=1))
        for t in range(FRAMES)
    ]
    return video_of(frames, fps=10)


@pytest.fixture(scope="module")
def other(take):
    """Another take, 9 steps brighter."""
    return video_of([picture.with_pixels(picture.pixels + np.uint8(9)) for picture in take], fps=10)


@pytest.fixture(scope="module")
def compared_takes(take, other, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "v.html"
    write_viewer(path, take, other, quality=None, labels=("original", "brighter"))
    return path


@pytest.fixture
def tab(opened, compared_takes):
    """The page as it opened."""
    tab = opened(compared_takes)
    tab.evaluate("ii.viewer.play(false); ii.viewer.set({ ...ii.viewer.opening, mode: 'original', f: 0, a: 1 })")
    on_screen(tab, 0)
    return tab


def on_screen(tab, frame):
    tab.wait_for_function(f"ii.viewer.take.shown === {frame}")


def shows(tab, video, frame, **state):
    """Return whether the view is `view_image` of a frame, up to the rounding of the graphics card."""
    shown, viewpoint = snapshot(tab, **state)
    wanted, valid = view_image(video[frame], viewpoint)
    return np.abs(shown - wanted)[valid].max() <= 1


PLACES = [(0, 0, 0), (3, 0.7, -0.3), (5, -1, 1), (1, 0.4, 0.9)]


@pytest.mark.slow
def test_every_instant_and_place_shows_its_view_image(tab, take, other):
    slider = tab.locator("[data-state=t]")
    for frame, x, y in PLACES:
        slider.fill(str(frame))
        on_screen(tab, frame)
        assert shows(tab, take, frame, x=x, y=y, mode="original")
        assert shows(tab, other, frame, mode="decoded")
        assert not shows(tab, take, (frame + 1) % FRAMES, mode="original")
        tab.get_by_text(f"{frame / 10:.2f} s", exact=True).wait_for()


PLAYING = """state => { ii.viewer.set(state); const s = ii.viewer.snapshot();
    return [ii.viewer.take.shown, s.width, s.height, Array.from(s.data), ii.viewer.viewpoint()] }"""


@pytest.mark.slow
def test_the_space_bar_plays_with_parallax_and_comparison(tab, take, other):
    tab.locator("#main").focus()
    tab.keyboard.press(" ")
    assert tab.evaluate("ii.viewer.take.playing")
    seen = [set(), set()]
    for number in range(60):  # from another place each time
        which = number % 2
        state = {"x": 0.1 * (number % 7) - 0.3, "mode": ("original", "decoded")[which]}
        frame, width, height, data, viewpoint = tab.evaluate(PLAYING, state)
        shown = np.array(data, np.uint8).reshape(height, width, 4)[..., :3].astype(float)
        wanted, valid = view_image((take, other)[which][frame], viewpoint)
        assert np.abs(shown - wanted)[valid].max() <= 1
        seen[which].add(frame)
        if min(map(len, seen)) >= 3:
            break
    assert min(map(len, seen)) >= 3
    tab.wait_for_function("document.getElementById('play').innerText === 'Pause'")
    tab.keyboard.press(" ")
    assert not tab.evaluate("ii.viewer.take.playing")
    frame = tab.evaluate("ii.viewer.take.shown")
    tab.evaluate("() => new Promise(done => setTimeout(done, 300))")
    assert tab.evaluate("ii.viewer.take.shown") == frame == tab.evaluate("ii.viewer.state.t")


# Play by a clock of the test's own, without drawing; what is due and shown at every change.
PLAYED = """([times, step]) => {
    const viewer = ii.viewer, asked = [], real = window.requestAnimationFrame, due = [];
    viewer.redraw = () => {};
    window.requestAnimationFrame = (f) => asked.push(f);
    viewer.take.play((frame) => due.push([frame, viewer.take.shown]));
    for (let i = 0; i < times; i++) for (const f of asked.splice(0)) f(1000 + step * i);
    viewer.take.pause();
    window.requestAnimationFrame = real;
    delete viewer.redraw;
    return due; }"""


@pytest.mark.slow
@pytest.mark.parametrize(("step", "by"), [(50, 1), (100, 1), (300, 3)])
def test_frames_come_in_order_and_at_their_rate(tab, step, by):
    """At 10 frames a second; where the screen is slower, frames are left out."""
    tab.wait_for_function(f"ii.viewer.take.slotOf.size === {FRAMES}")
    due = tab.evaluate(PLAYED, [24, step])
    count = 23 * step // (100 * by)
    assert due == [[by * (1 + i) % FRAMES] * 2 for i in range(count)]


def test_difference_is_that_of_the_frame(tab):
    for frame in (2, 4):
        tab.evaluate("t => ii.viewer.set({ t })", frame)
        on_screen(tab, frame)
        shown, _ = snapshot(tab, mode="difference", gain=4)
        assert np.abs(shown - (127.5 + 4 * 9)).max() <= 5  # 4 × rounding, and it


def test_keys_step_and_the_address_keeps_the_instant(tab):
    tab.locator("#main").focus()
    for key in "lllj":
        tab.keyboard.press(key)
    on_screen(tab, 2)
    tab.wait_for_function("location.hash.includes('t=2')")
    tab.evaluate("location.hash = '#t=4'")
    on_screen(tab, 4)
    tab.evaluate("ii.viewer.set({ t: 0 })")
    tab.keyboard.press("j")  # before the first is the last
    on_screen(tab, FRAMES - 1)


@contextlib.contextmanager
def simply_served(folder):
    """A server without range requests, like many simple ones."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()


@pytest.mark.slow
def test_a_card_without_room_for_all_frames(opened, take, tmp_path, monkeypatch):
    """Frames leave the card and come again; here from a server that always sends the whole file."""
    monkeypatch.setattr(page, "CARD_BYTES", 0)
    write_viewer_folder(tmp_path, take, quality=None)
    with simply_served(tmp_path) as url:
        tab = opened(f"{url}index.html", "#f=0&a=1")
        assert tab.evaluate("ii.viewer.take.slots") == 2
        for frame in (4, 1, 5, 0, 0, 1):
            tab.evaluate("t => ii.viewer.set({ t })", frame)
            on_screen(tab, frame)
            assert shows(tab, take, frame, x=0.3)
            assert tab.evaluate("ii.viewer.take.slotOf.size") <= 2
        tab.evaluate("ii.viewer.play(true)")  # not all come in time: some are left out, none is wrong
        seen = {tab.evaluate("ii.viewer.take.shown")}
        while len(seen) < 3:
            frame, width, height, data, viewpoint = tab.evaluate(PLAYING, {})
            shown = np.array(data, np.uint8).reshape(height, width, 4)[..., :3].astype(float)
            wanted, valid = view_image(take[frame], viewpoint)
            assert np.abs(shown - wanted)[valid].max() <= 1
            seen.add(frame)
        tab.goto("about:blank")  # before the server ends


@pytest.mark.slow
def test_the_command_serves_a_take_in_parts(run, monkeypatch, opened, take, tmp_path):
    take.save(tmp_path / "frames")
    encode_take(take, "si-h264", qp=30, plan=Plan(walk="time-first"), path=tmp_path / "take.ii")
    words = ["view", tmp_path / "frames", "--serve", "--lossless", "--compare", tmp_path / "take.ii"]

    def visit(url):
        with urllib.request.urlopen(url) as answer:
            order = json.loads(re.search(r"ii\.fetch\((\[.*\])\)", answer.read().decode())[1])
        _, name, *_, first, end = order[-1]
        part = urllib.request.Request(url + name, headers={"Range": f"bytes={first}-{end - 1}"})
        with urllib.request.urlopen(part) as answer:
            size = int(answer.headers["Content-Range"].rpartition("/")[2])
            assert answer.status == 206 and len(answer.read()) == end - first and size == end
        beyond = urllib.request.Request(url + name, headers={"Range": f"bytes={size}-"})
        with pytest.raises(urllib.error.HTTPError, match="416") as refusal:
            urllib.request.urlopen(beyond)
        refusal.value.close()
        tab = opened(url, "#f=0&a=1&t=4")
        on_screen(tab, 4)
        assert shows(tab, take, 4, x=-0.6, mode="original")
        assert re.fullmatch(r"si-h264, [\d.]+ bpp, [\d.]+ dB", tab.evaluate("ii.viewer.meta.labels[1]"))
        tab.goto("about:blank")  # before the server ends

    code, _, err = served(monkeypatch, run, words, visit)
    assert code == 0, err


def test_a_take_too_large_is_refused_by_its_first_frame(take, tmp_path, monkeypatch):
    whole = write_viewer(tmp_path / "v.html", take)
    (tmp_path / "v.html").unlink()
    read = []

    class Counted:
        def picture(self, frame):
            read.append(frame)
            return take[frame]

    monkeypatch.setattr(page, "MAX_EMBEDDED", whole // 2)
    counted = IIVideo(FRAMES, 10.0, Counted(), take.structure)
    with pytest.raises(ValueError, match=r"--serve shows the take of 6 frames of 512×256 px"):
        write_viewer(tmp_path / "v.html", counted)
    assert set(read) == {0} and not list(tmp_path.iterdir())


def test_invalid_takes_are_refused(run, refused, take, shot, tmp_path):
    take.save(tmp_path / "frames")
    video_of([take[0], take[1]]).save(tmp_path / "short")
    shot.picture.save(tmp_path / "a.png")
    out = ["-o", tmp_path / "v.html"]
    refused(run("view", tmp_path / "frames", "--depth", tmp_path / "d.exr", *out), "--depth is the map of one")
    refused(run("view", tmp_path / "frames", "--compare", tmp_path / "short", *out), "has 2 frames")
    refused(run("view", tmp_path / "frames", "--compare", tmp_path / "a.png", *out), "is no take, but")
    refused(run("display", tmp_path / "frames", "-o", tmp_path / "f.mp4"), "is a take: raytrace-ii video")
    with pytest.raises(ValueError, match="2 frames, the take of 6 frames: the same number is needed"):
        write_viewer(tmp_path / "v.html", take, video_of([take[0], take[1]]))
    with pytest.raises(ValueError, match="depth is the map of one picture"):
        write_viewer(tmp_path / "v.html", take, depth=shot.depth)
    assert not list(tmp_path.glob("*.html"))
