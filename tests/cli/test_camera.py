"""Cameras on the command line: stored maps, rendering from maps, camera arrays, irregular structures."""

import json

import numpy as np
import pytest

from ii_core import IIPicture, camera_names, preset
from ii_core.base.files import read_image
from ii_core.camera.maps import FORMATS


def test_every_camera_is_listed(run):
    code, out, _ = run("cameras")
    assert code == 0
    assert {line.split()[0] for line in out.splitlines()} == set(camera_names())


@pytest.mark.parametrize("format", FORMATS)
def test_maps_are_written_and_rendered(run, tmp_path, format):
    folder, suffix = tmp_path / "cam", FORMATS[format][0]
    assert run("camera", "grin", "--scale", 64, "--format", format, "-o", folder)[0] == 0
    assert sorted(p.name for p in folder.iterdir()) == [f"D{suffix}", f"L{suffix}", "camera.json"]
    assert json.loads((folder / "camera.json").read_text())["kind"] == "grin"
    assert run("render", "apples", "--camera", folder, "-o", tmp_path / "a.png")[0] == 0
    assert run("render", "apples", "--camera", "grin", "--scale", 64, "-o", tmp_path / "b.png")[0] == 0
    mapped, direct = (IIPicture.load(tmp_path / name) for name in ("a.png", "b.png"))
    assert mapped.camera == direct.camera and mapped.erect
    code, out, _ = run("measure", tmp_path / "b.png", tmp_path / "a.png")
    assert code == 0 and float(out.split()[1].replace("inf", "99")) > 20  # as `map_precision` charts


def test_a_set_of_arrays_gives_numbered_pictures(run, tmp_path):
    arguments = ("render", "apples", "--camera", "stacked-sensors", "--scale", 64, "--depth", tmp_path / "d.exr")
    assert run(*arguments, "-o", tmp_path / "a.png")[0] == 0
    assert sorted(p.name for p in tmp_path.glob("*.png")) == ["a_0.png", "a_1.png", "a_2.png"]
    assert len(list(tmp_path.glob("d_*.exr"))) == 3
    assert IIPicture.load(tmp_path / "a_2.png").camera.origin_mm[2] == pytest.approx(0.00195583 * 64)


def test_a_camera_file_of_the_users_own(run, refused, tmp_path):
    file = tmp_path / "mine.json"
    file.write_text(
        json.dumps(
            {
                "pixels": [64, 32], "lenses": [8, 5], "pixel_pitch_mm": 0.4, "gap_mm": 6, "lattice": "hexagonal",
                "optics": ["grin", {"kind": "lens", "z_mm": 30, "focal_mm": 25}],
            }
        )
    )  # fmt: skip
    assert run("render", "apples", "--camera", file, "--at", "0,0,-60", "-o", tmp_path / "a.png")[0] == 0
    picture = IIPicture.load(tmp_path / "a.png")
    assert not picture.regular and picture.ei_pixels == (8.0, 6.4) and picture.erect
    # PSNR needs no structure, coding by component images does
    code, out, _ = run("measure", tmp_path / "a.png", tmp_path / "a.png")
    assert code == 0 and "Q_global" in out and "the structure is not regular" in out
    refused(run("encode", tmp_path / "a.png", "--qp", 30, "-o", tmp_path / "a.ii"), "the structure is not regular")
    file.write_text('{"pixels": [64, 32], "lenses": [8, 5], "pixel_pitch_mm": 0.4, "gap_mm": 6, "optics": ["prism"]}')
    refused(run("render", "apples", "--camera", file, "-o", tmp_path / "b.png"), "unknown optical element 'prism'")
    refused(run("camera", tmp_path / "gone.json", "-o", tmp_path / "c"), "gone.json does not exist")


def test_position_of_the_camera(run, refused, tmp_path):
    depths = []
    for at in ("0,0,0", "0,0,-10"):
        name = tmp_path / f"{at}.exr"
        arguments = ("render", "apples", "--scale", 64, "--at", at, "--depth", name)
        assert run(*arguments, "-o", tmp_path / f"{at}.png")[0] == 0
        depths.append(np.nanmin(read_image(name)))
    assert depths[1] > depths[0] + 5
    refused(run("render", "apples", "--at", "1,2", "-o", tmp_path / "x.png"), "three numbers x,y,z are needed")


def test_invalid_cameras_are_refused(run, refused, tmp_path):
    refused(run("camera", "nope", "-o", tmp_path / "c"), "unknown camera 'nope'")
    refused(run("camera"), "a camera is needed")
    refused(run("camera", "setup1", "--scale", 64, "--format", "bmp", "-o", tmp_path / "c"), "unknown format 'bmp'")
    assert not list(tmp_path.iterdir())
    folder = tmp_path / "cam"
    assert run("camera", "setup1", "--scale", 64, "-o", folder)[0] == 0
    refused(run("camera", "setup1", "--scale", 64, "-o", folder), "--force replaces it")
    refused(
        run("render", "apples", "--camera", folder, "--scale", 2, "-o", tmp_path / "a.png"),
        "stored maps have a fixed size",
    )
    (folder / "L.png").unlink()
    refused(run("render", "apples", "--camera", folder, "-o", tmp_path / "a.png"), "L.png does not exist")
    assert not (tmp_path / "a.png").exists()


def test_values_of_presets():
    assert preset("hdtv").pixels == (3840, 2160) and preset("hdtv").lenses == (160, 125)
    assert preset("hdtv").ei_pixels == pytest.approx((24, 17.28))
    assert preset("plenoptic").ei_pixels == pytest.approx((13.84, 13.84), abs=0.005)


def test_a_hexagonal_picture_is_made_regular_and_coded(run, refused, tmp_path):
    assert run("render", "apples", "--camera", "hexagonal", "--scale", 8, "-o", tmp_path / "h.png")[0] == 0
    for method, ei in (("resample", (16, 14)), ("rectangle", (16, 18))):
        out = tmp_path / f"{method}.png"
        arguments = ("regular", tmp_path / "h.png", "--method", method, "--mask", tmp_path / f"{method}_mask.png")
        code, said, _ = run(*arguments, "-o", out)
        assert code == 0 and "owned by their lens" in said
        made = IIPicture.load(out)
        assert made.regular and made.lenses == (64, 37) and made.ei_pixels == ei
        owned = read_image(tmp_path / f"{method}_mask.png")[..., 0]
        assert owned.shape == made.pixels.shape[:2] and 0.6 < (owned == 255).mean() < 1
        assert run("encode", out, "--scheme", "si-h264", "--qp", 30, "-o", tmp_path / f"{method}.ii")[0] == 0
    refused(run("regular", tmp_path / "h.png", "--method", "x", "-o", tmp_path / "x.png"), "unknown method 'x'")


@pytest.mark.parametrize(("name", "scale"), [("setup3", 1), ("plenoptic2", 1), ("hdtv", 5), ("moving-lenslets", 32)])
def test_reports(run, name, scale):
    code, out, _ = run("camera", name, "--scale", scale, "--report")
    assert code == 0
    for what in (
        "viewing angle",
        "image plane",
        "depth range",
        "viewing zone",
        "elementary image",
        "L and D maps",
        "limit",
    ):
        assert what in out


def test_solving_for_missing_lengths(run, refused):
    code, out, _ = run("camera", "--solve", "pitch=0.39,gap=0.73,pixel=0.0061")
    found = {line.split()[0]: float(line.split()[1]) for line in out.splitlines()}
    assert code == 0 and found["view_angle_deg"] == pytest.approx(29.91, abs=0.005)  # to the digits of 0.39 and 0.73
    refused(run("camera", "--solve", "pitch=0.39"), "under-determined")
    refused(run("camera", "--solve", "pitch=0.39,gap=0.73,pixel=0.0061,angle=31"), "contradictory")
    refused(run("camera", "--solve", "width=3"), "'width=3' is no length: NAME=NUMBER is needed")
