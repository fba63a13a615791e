"""II-video: frames read when used, access by time and view, round trips through folders and quilt videos."""

import json

import numpy as np
import pytest

from ii_core import IIVideo, open_video, preset, sub_images, video_of, view_image, write_view_folders
from ii_core.display.look import viewpoints_across
from ii_core.display.quilt import quilt
from ii_core.display.video import open_quilt_video, write_path_film, write_quilt_video, write_view_films
from ii_core.picture.picture import IIPicture
from ii_core.video.video import KEPT, blank

CAMERA = preset("setup1", scale=32)  # 16×8 lenses of 16×16 pixels


def pictures(count, seed=0):
    rng = np.random.default_rng(seed)
    (k, l), (u, v) = CAMERA.lenses, CAMERA.ei_pixels
    return [
        IIPicture(rng.integers(0, 256, (l * v, k * u, 3), np.uint8), CAMERA.lenses, CAMERA.ei_pixels, CAMERA)
        for _ in range(count)
    ]


class Counted:
    """A source that records the requested frames."""

    def __init__(self, pictures):
        self.pictures, self.asked = pictures, []

    def picture(self, frame):
        self.asked.append(frame)
        return self.pictures[frame]


def test_frames_are_read_when_used_and_few_are_kept():
    source = Counted(pictures(6))
    video = IIVideo(6, 24, source, blank(source.pictures[0]))
    assert source.asked == []
    for frame in (0, 1, 0, 2, 0, 3, 4, 5, 0):
        assert video[frame] is source.pictures[frame]
        assert len(video._kept) <= KEPT
    assert source.asked == [0, 1, 2, 3, 4, 5, 0]


def test_access_by_time_and_view():
    shown = pictures(3)
    video = video_of(shown, fps=30)
    assert (len(video), video.fps, video.seconds, video.camera, video.size) == (3, 30, 0.1, CAMERA, shown[0].size)
    np.testing.assert_array_equal(video.component(2, "si", (3, 5)), sub_images(shown[2])[5, 3])
    np.testing.assert_array_equal(video.component(1, "ei", (2, 7)), shown[1].pixels[7 * 16 : 8 * 16, 2 * 16 : 3 * 16])
    np.testing.assert_array_equal(
        video.component(1, "ri", (4, 6)).reshape(-1, 3), shown[1].pixels[6 * 16 + 4].reshape(-1, 3)
    )
    for a, b in zip(video.view(1, (3, 0, -400)), view_image(shown[1], (3, 0, -400)), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("call", "error"), [
    (lambda v: v[3], IndexError), (lambda v: v[-1], IndexError), (lambda v: v[True], TypeError),
    (lambda v: v.component(0, "xi", (0, 0)), ValueError), (lambda v: v.component(0, "si", (16, 0)), ValueError),
    (lambda v: video_of([]), ValueError), (lambda v: video_of([v[0]], fps=0), ValueError),
])  # fmt: skip
def test_missing_frames_and_views_are_refused(call, error):
    with pytest.raises(error):
        call(video_of(pictures(3)))


def test_frames_of_another_structure_are_refused():
    first = pictures(1)[0]
    other = IIPicture(first.pixels, (CAMERA.lenses[0] * 2, CAMERA.lenses[1]), (8, 16))
    with pytest.raises(ValueError, match="frame 1: pictures of different structure: lenses"):
        video_of([first, other])
    video = IIVideo(2, 24, Counted([first, other]), blank(first))
    with pytest.raises(ValueError, match="frame 1: pictures of different structure"):
        video[1]


@pytest.mark.parametrize("write", [lambda v, f: v.save(f), write_view_folders], ids=["frames", "views"])
def test_folders_give_back_every_bit(write, tmp_path):
    shown = [IIPicture(p.pixels[:32, :64], (16, 8), (4, 4)) for p in pictures(4)]
    video = video_of(shown, fps=12.5)
    video.poses = np.tile(np.eye(4), (4, 1, 1)) + np.arange(4)[:, None, None]
    write(video, tmp_path / "v")
    back = open_video(tmp_path / "v")
    assert (back.frames, back.fps, back.structure.lenses) == (4, 12.5, (16, 8))
    np.testing.assert_array_equal(back.poses, video.poses)
    for a, b in zip(back, shown, strict=True):
        np.testing.assert_array_equal(a.pixels, b.pixels)
    assert open_video(tmp_path / "v", fps=50).fps == 50


def test_folders_without_a_take_are_refused(tmp_path):
    with pytest.raises(ValueError, match="holds no frames"):
        open_video(tmp_path)
    with pytest.raises(ValueError, match="is no folder of frames"):
        open_video(tmp_path / "none")
    with pytest.raises(ValueError, match="source is ''"):  # not the working folder
        open_video("")
    video_of(pictures(3)).save(tmp_path)
    far = tmp_path / f"frame_{10**20}.png"
    far.write_bytes((tmp_path / "frame_0001.png").read_bytes())
    with pytest.raises(ValueError, match=rf"lacks frame 3 \({10**20 - 3} missing"):  # not by counting
        open_video(tmp_path)
    far.unlink()
    (tmp_path / "frame_0001.png").unlink()
    with pytest.raises(ValueError, match=r"lacks frame 1 \(1 missing of 0\.\.2\)"):
        open_video(tmp_path)
    video_of(pictures(3)).save(tmp_path)
    index = json.loads((tmp_path / "video.json").read_text())
    (tmp_path / "video.json").write_text(json.dumps(index | {"poses": [[1]]}))
    with pytest.raises(ValueError, match=r"video\.json is damaged"):
        open_video(tmp_path)


def smooth(count):
    """Return frames that video coding changes little."""
    (k, l), (u, v) = CAMERA.lenses, CAMERA.ei_pixels
    y, x = np.mgrid[: l * v, : k * u]
    base = np.repeat((x * 100 // (k * u) + y * 100 // (l * v))[..., None], 3, axis=2)
    return [IIPicture((base + 20 * t).astype(np.uint8), (k, l), (u, v), CAMERA) for t in range(count)]


def test_a_quilt_video_has_its_name_its_rate_and_its_views(tmp_path):
    shown = smooth(3)
    options = {"size": (32, 16), "depth_mm": 60.0, "cone": 0.5}
    path = write_quilt_video(video_of(shown, fps=12), tmp_path / "take.mp4", (4, 2), **options)
    assert path.name == "take_qs4x2a2.mp4"
    back = open_quilt_video(path)
    assert (back.frames, back.fps, back.structure.lenses, back.structure.ei_pixels) == (3, 12, (32, 16), (8, 1))
    for frame in (2, 0):  # backwards, too
        views = quilt(shown[frame], (8, 1), **options).reshape(16, 8, 32, 3)
        for u in (0, 3, 7):
            view = back.component(frame, "si", (u, 0)).astype(int)
            assert np.abs(view - views[:, u]).mean() < 4, (frame, u)  # a frame is 20 from the next
    path = path.rename(tmp_path / "take_qs4x2a1.6.mp4")
    across, down = open_quilt_video(path)[1].camera.lens_pitch_mm
    assert (32 * across) / (16 * down) == pytest.approx(1.6)
    with pytest.raises(ValueError, match="grid of tiles"):
        open_quilt_video(path.rename(tmp_path / "plain.mp4"))
    (tmp_path / "no_qs2x2a1.mp4").write_bytes(b"no video")
    with pytest.raises(ValueError, match="cannot be read as a video"):
        open_quilt_video(tmp_path / "no_qs2x2a1.mp4")


@pytest.mark.slow
def test_films_of_views_and_along_a_path(tmp_path):
    import av

    video = video_of(smooth(3), fps=12)
    made = write_view_films(video, tmp_path / "films")
    assert len(made) == 256 and made[17].name == "view_01_01.mp4"
    write_path_film(video, tmp_path / "path.mp4", viewpoints_across(video[0], 2), size=(64, 32))
    for path, size in ((made[17], (16, 8)), (tmp_path / "path.mp4", (64, 32))):
        with av.open(str(path)) as film:
            frames = [f.to_ndarray(format="rgb24") for f in film.decode(video=0)]
        assert len(frames) == 3 and frames[0].shape[1::-1] == size
    with pytest.raises(ValueError, match="no viewpoints"):
        write_path_film(video, tmp_path / "path.mp4", [])
