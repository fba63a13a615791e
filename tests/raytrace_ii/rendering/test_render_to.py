"""Pictures written band by band: equal to `render`, bounded memory, whole files or none; support images."""

import json
import subprocess
import sys

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, orthoscopic, preset, stand_back
from ii_core.base.files import read_about, read_channels, read_depth, read_image
from raytrace_ii import Scene, render, render_to
from raytrace_ii.rendering import job
from raytrace_ii.tracing.support_images import SUPPORT_IMAGES
from tests.support.slow import first_fast
from tests.support.trace_scenes import body, hall, sphere, wall

SMALL = preset("setup1", scale=64)  # 128×64 px, 8×4 lenses
TALL = IICamera(pixels=(40, 150), lenses=(4, 15), pixel_pitch_mm=0.4, gap_mm=6.0)  # two bands of noise and a piece
HEXAGONAL = IICamera(pixels=(100, 131), lenses=(8, 10), pixel_pitch_mm=0.4, gap_mm=11.7, lattice="hexagonal")
FLAT = IICamera(pixels=(90, 150), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=15.0)
ALL = ("depth", "normal", "object_id", "ray_length", "shading_normal", "disparity", "samples")


@pytest.fixture(scope="module")
def scene():
    return hall()


@pytest.mark.parametrize(
    ("camera", "end", "options"),
    first_fast(
        [
            (TALL, ".tif", {"noise": 3.0, "dtype": "uint16", "samples": 3}),
            (SMALL, ".png", {}),
            (TALL, ".png", {"noise": 3.0, "seed": 4}),
            (HEXAGONAL, ".exr", {"noise": 1.0, "dtype": "float32", "samples": (4, 8), "error": 9.0}),
            (TALL, ".tif", {"dtype": "float32", "samples": (4, 8)}),
        ]
    ),
)
def test_a_file_holds_what_render_gives(camera, end, options, scene, tmp_path, monkeypatch):
    shot = render(scene, camera, support=ALL, **options)
    for tile in (50, 700, 10**6):
        monkeypatch.setattr(job, "TILE_RAYS", tile)
        support = {name: tmp_path / f"{name}.exr" for name in ALL}
        stats = render_to(tmp_path / f"p{end}", scene, camera, support=support, **options)
        stored = IIPicture.load(tmp_path / f"p{end}")
        np.testing.assert_array_equal(stored.pixels, shot.picture.pixels)
        stored.check_same_structure(shot.picture)
        assert stored.camera == shot.picture.camera
        for name, path in support.items():
            np.testing.assert_array_equal(read_image(path).squeeze(), getattr(shot, name))
        assert stats.samples == shot.stats.samples
    assert stats.rays["shadow"] > 0


def test_one_lens_upright(scene, tmp_path, monkeypatch):
    pose = stand_back(FLAT)
    shot = render(scene, FLAT, pose=pose, noise=2.0)
    turned = orthoscopic(shot.picture)
    for tile in (50, 4000, 10**6):
        monkeypatch.setattr(job, "TILE_RAYS", tile)
        render_to(
            tmp_path / "p.png", scene, FLAT, pose=pose, noise=2.0, upright=True, support={"depth": tmp_path / "d.exr"}
        )
        stored = IIPicture.load(tmp_path / "p.png")
        np.testing.assert_array_equal(stored.pixels, turned.pixels)
        assert stored.erect and turned.erect
        np.testing.assert_array_equal(read_image(tmp_path / "d.exr")[..., 0], shot.depth[::-1, ::-1])
    with pytest.raises(ValueError, match="only the picture of one lens is turned"):
        render_to(tmp_path / "q.png", scene, SMALL, upright=True)


def test_one_file_for_all_support_images(scene, tmp_path):
    path = tmp_path / "all.exr"
    render_to(None, scene, SMALL, support=dict.fromkeys(ALL, path))
    assert [p.name for p in tmp_path.iterdir()] == ["all.exr"], "no picture was asked for"
    shot, stored = render(scene, SMALL, support=ALL), read_channels(path)
    assert set(stored) == {channel for name in ALL for channel in SUPPORT_IMAGES[name].channels}
    for name in ALL:
        for i, channel in enumerate(SUPPORT_IMAGES[name].channels):
            expected = np.atleast_3d(getattr(shot, name))[..., i]
            np.testing.assert_array_equal(stored[channel], expected.astype(np.float32))
    np.testing.assert_array_equal(read_depth(path), shot.depth)
    assert json.loads(read_about(path, "objectNames")) == shot.object_names
    assert "mm in the camera's frame" in read_about(path, "units")
    assert read_about(path, "nothing") is None


@pytest.mark.parametrize("kind", ["pinhole", "grin"])
def test_disparity_leads_to_the_pixel_of_the_next_lens(kind):
    """The ray of that pixel under the next lens, right or below, meets the same point."""
    camera = IICamera(
        pixels=(128, 64), lenses=(8, 4), pixel_pitch_mm=0.4, gap_mm=9.0, optics=({"kind": kind},),
        origin_mm=(0.5, 0.25, -2.0),
    )  # fmt: skip
    shot = render(Scene(bodies=[body(wall(60, 300), turn=(0, 20, 0))]), camera, support=("depth", "disparity"))
    assert (shot.disparity < 0).all() == (kind == "grin")
    # a pixel is nearest to its own lens: a disparity beyond the elementary image has no pixel to look at
    n, m = np.mgrid[:48, :112]
    z, moved = shot.depth[n, m].astype(float), shot.disparity[n, m].astype(float)
    u, v = m % 16 + 0.5 + moved, n % 16 + 0.5 + moved
    inside = (u > 0) & (u < 16) & (v > 0) & (v < 16)
    assert inside.mean() > 0.3
    m, n, u, v, z = m[inside], n[inside], u[inside], v[inside], z[inside]

    def point(column, row, u, v):
        L, D = camera.rays_at(
            column // 16 * 16 + u.astype(int), row // 16 * 16 + v.astype(int), np.stack([u % 1, v % 1], axis=-1)
        )
        return L + D * ((z - L[:, 2]) / D[:, 2])[:, None]

    here = point(m, n, m % 16 + 0.5, n % 16 + 0.5)
    right, below = point(m + 16, n, u, n % 16 + 0.5), point(m, n + 16, m % 16 + 0.5, v)
    # float32 disparity of a few pixels over 60 mm: a ray turns by 1e-6 of a pixel, far less than 1e-3 mm out there
    np.testing.assert_allclose(right, here, atol=1e-3)
    np.testing.assert_allclose(below, here, atol=1e-3)


def test_ray_length_is_the_distance_from_the_camera_to_the_point():
    shot = render(Scene(bodies=[body(wall(60, 300))]), SMALL, support=("depth", "ray_length"))
    L, D = SMALL.rays()
    way = (60 - L[..., 2]) / D[..., 2] * np.linalg.norm(D, axis=-1)
    np.testing.assert_allclose(shot.ray_length, way, rtol=2e-6)  # float32 rays
    np.testing.assert_allclose(shot.depth, 60, rtol=1e-6)


def test_depth_starts_at_the_pixel_plane_and_ray_length_at_the_pinhole():
    """On a lens's axis they differ by the gap, which is 16 mm here."""
    camera = IICamera(pixels=(15, 15), lenses=(3, 3), pixel_pitch_mm=0.1, gap_mm=16.0)
    shot = render(Scene(bodies=[body(wall(60))]), camera, support=("depth", "ray_length"))
    assert shot.depth[7, 7] == 60 and shot.ray_length[7, 7] == 44


def test_one_image_in_several_files(scene, tmp_path):
    alone, together = tmp_path / "z.exr", tmp_path / "all.exr"
    render_to(None, scene, SMALL, support={"depth": (alone, together), "normal": together})
    np.testing.assert_array_equal(read_image(alone)[..., 0], read_channels(together)["depth.Z"])
    assert len(read_channels(together)) == 4


def test_shading_normals_are_the_balls_own():
    """A ball of 24 segments: the faces' normals are up to 7° off the radius, the interpolated ones hardly.

    On the rim the face's normal replaces an interpolated one that faces away: the innermost 60° are tested.
    """
    ball = Scene(bodies=[body(sphere(8, 24), at=(0, 0, 30))])
    shot = render(ball, SMALL, support=("normal", "shading_normal", "ray_length"))
    hit = np.isfinite(shot.ray_length)
    L, D = (rays[hit] for rays in SMALL.rays())
    radius = L + D / np.linalg.norm(D, axis=1)[:, None] * shot.ray_length[hit][:, None] - [0, 0, 30]
    radius /= np.linalg.norm(radius, axis=1)[:, None]
    inner = (radius * D).sum(axis=1) < -0.5 * np.linalg.norm(D, axis=1)
    smooth, flat = ((n[hit] * radius).sum(axis=1)[inner].min() for n in (shot.shading_normal, shot.normal))
    assert smooth > np.cos(np.radians(0.5)) > np.cos(np.radians(5)) > flat
    assert (shot.shading_normal[~hit] == 0).all()
    faceted = Scene(bodies=[body(sphere(8, 24), at=(0, 0, 30), flat=True)])
    shot = render(faceted, SMALL, support=("normal", "shading_normal"))
    np.testing.assert_array_equal(shot.shading_normal, shot.normal)


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        (FLAT, "has no neighbouring lenses"),
        (preset("depth-control", scale=64), "has a lens before its array"),
    ],
)
def test_no_disparity_where_it_does_not_follow_from_depth(camera, says):
    with pytest.raises(ValueError, match=f"disparity: .*{says}"):
        render(Scene(bodies=[body(wall(60))]), camera, support=("disparity",))


def test_an_interrupted_render_leaves_nothing(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(job, "TILE_RAYS", 500)

    def stop(done, total):
        if done == total - 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_to(
            tmp_path / "p.exr", scene, TALL, dtype="float32", support={"depth": tmp_path / "d.exr"}, progress=stop
        )
    assert list(tmp_path.iterdir()) == []
    render_to(tmp_path / "p.png", scene, TALL)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(KeyboardInterrupt):
        render_to(tmp_path / "p.png", scene, TALL, noise=5.0, progress=stop)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("path", "options", "error", "says"),
    [
        ("p.bmp", {}, ValueError, "no known picture type"),
        ("p.png", {"dtype": "float32"}, ValueError, "cannot hold float32"),
        ("gone/p.png", {}, OSError, "cannot write"),
        ("p.png", {"support": {"depth": "d.png"}}, ValueError, "cannot hold float32"),
        ("p.png", {"support": {"dept": "d.exr"}}, ValueError, "unknown support image dept"),
    ],
)
def test_unwritable_outputs_are_refused_at_once(path, options, error, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=says):
        render_to(path, Scene(bodies=[body(wall(5))]), SMALL, **options)
    assert list(tmp_path.iterdir()) == []


LIMITED = """
import resource, sys
import numpy as np
from ii_core import IICamera
from raytrace_ii import Body, Material, Scene, render, render_to
from raytrace_ii.tracing.support_images import SUPPORT

corners = np.array([[-9e3, -9e3, 50], [9e3, -9e3, 50], [0, 9e3, 50]])
scene = Scene(bodies=[Body(name="wall", vertices=corners, faces=np.array([[0, 2, 1]]), material=Material())])
def camera(rows):
    return IICamera(pixels=(1024, rows), lenses=(64, rows // 16), pixel_pitch_mm=0.1, gap_mm=4.0)
def banded(rows):
    support = dict.fromkeys(SUPPORT, "s.exr")
    return render_to("p.exr", scene, camera(rows), dtype="float32", support=support, workers=2)
def whole(rows):
    return render(scene, camera(rows), dtype="float32", workers=2)
banded(256), whole(256)  # compile, and start every pool of threads there is
used = int(next(l for l in open("/proc/self/status") if l.startswith("VmData")).split()[1]) * 1024
resource.setrlimit(resource.RLIMIT_DATA, (used + 96 * 2**20,) * 2)
{"banded": banded, "whole": whole}[sys.argv[1]](5120)
print("done")
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_DATA holds for all memory on Linux only")
def test_a_picture_larger_than_memory(tmp_path):
    """5.2 million pixels of 32 bytes, 168 MB, written with 96 MB to spare; in memory they do not fit.

    A smaller limit is not reliable: a thread that starts late takes 8 MB for its stack and its own heap.
    """
    runs = {
        how: subprocess.run([sys.executable, "-c", LIMITED, how], capture_output=True, text=True, cwd=tmp_path)
        for how in ("whole", "banded")
    }
    assert runs["banded"].stdout == "done\n", runs["banded"].stderr
    assert runs["whole"].returncode and "MemoryError" in runs["whole"].stderr
    assert read_image(tmp_path / "p.exr").shape == (5120, 1024, 3)
