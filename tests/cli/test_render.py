"""Command render: samples, support images, pictures of every type."""

import numpy as np
import pytest

from ii_core import IIPicture, preset
from ii_core.base.files import read_channels, read_image
from raytrace_ii import load_scene, render

CAMERA = preset("setup1", scale=128)  # 64×32 px, 4×2 lenses
OBJECTS = ("render", "objects", "--scale", 128)


def test_support_images_in_one_file_and_alone(run, tmp_path):
    extra = {"depth": "depth", "ray_length": "ray-length", "disparity": "disparity", "normal": "normal"}
    extra |= {"object_id": "object-id", "shading_normal": "shading-normal"}
    options = [x for name, option in extra.items() for x in (f"--{option}", tmp_path / f"{name}.exr")]
    code, out, _ = run(*OBJECTS, "-o", tmp_path / "p.png", *options)
    assert code == 0 and " rays" in out and "s of CPU time" in out  # the closing line names times at its end
    assert run(*OBJECTS, "-o", tmp_path / "q.png", "--support", tmp_path / "all.exr")[0] == 0
    shot = render(load_scene("objects"), CAMERA, support=tuple(extra))
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "p.png").pixels, shot.picture.pixels)
    for name in extra:
        np.testing.assert_array_equal(read_image(tmp_path / f"{name}.exr").squeeze(), getattr(shot, name))
    stored = read_channels(tmp_path / "all.exr")
    np.testing.assert_array_equal(stored["depth.Z"], shot.depth)
    np.testing.assert_array_equal(stored["disparity"], shot.disparity)
    assert len(stored) == 10
    both = ("--support", tmp_path / "both.exr", "--depth", tmp_path / "z.exr")
    assert run(*OBJECTS, "-o", tmp_path / "r.png", *both)[0] == 0
    stored = read_channels(tmp_path / "both.exr")
    np.testing.assert_array_equal(stored["depth.Z"], shot.depth, "a file of its own does not take it from the other")
    assert len(stored) == 10
    flat = ("render", "objects", "--camera", "pinhole2d", "--scale", 128)
    assert run(*flat, "-o", tmp_path / "f.png", "--support", tmp_path / "f.exr")[0] == 0
    assert "disparity" not in read_channels(tmp_path / "f.exr"), "one lens has no neighbour"


def test_adaptive_samples(run, tmp_path):
    code, out, _ = run(*OBJECTS, "-o", tmp_path / "p.png", "--samples", "4..16", "--error", 2, "--seed", 3)
    shot = render(load_scene("objects"), CAMERA, samples=(4, 16), error=2.0, seed=3)
    assert code == 0 and f"({shot.stats.mean_samples:.1f} per pixel)" in out
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "p.png").pixels, shot.picture.pixels)


def test_audit(run, refused, tmp_path):
    code, out, _ = run(*OBJECTS, "-o", tmp_path / "p.png", "--audit", 0.1)
    shot = render(load_scene("objects"), CAMERA, audit=0.1)
    assert code == 0 and f"; measured at {shot.stats.audit.pixels} pixels: {shot.stats.audit.wrong} wrong by" in out
    moving = ("render", "objects", "--frames", "0", "-o", tmp_path / "frames", "--audit", 0.1)
    refused(run(*moving), "--audit is of one picture: without --frames and --set")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--samples", "many"), "samples is 'many': a whole number, or two like 4..64, is needed"),
        (("--samples", "4.."), "samples is '4..'"),
        (("--samples", "4..48"), "two powers of 2 are needed"),
        (("--samples", "64..4"), "two powers of 2 are needed, at least 4 and the second not less"),
        (("--samples", "4", "--error", "1"), "error is 1, but the number of samples is fixed"),
        (("--samples", "4..8", "--error", "0"), "error is 0.0: a positive number"),
        (("--audit", "2"), "audit is 2.0: a share of the pixels, from 0 to 1, is needed"),
        (("--support", "all.tif"), "only .exr has named channels"),
        (("--support", "gone/all.exr"), "is no folder"),
        (("--camera", "pinhole2d", "--disparity", "d.exr"), "has no neighbouring lenses"),
    ],
)
def test_invalid_values_are_one_line(run, refused, tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    refused(run(*OBJECTS, "-o", "p.png", *options), said)
    assert list(tmp_path.iterdir()) == []
