"""Cameras on the command line: stored maps, rendering from maps, camera arrays, irregular structures."""

import json

import numpy as np
import pytest

from benchmarks.accuracy.calibration import exposed, random_camera, white_image
from ii_core import IICamera, IIPicture, camera_names, preset
from ii_core.base.files import read_image, write_image
from ii_core.camera.maps import FORMATS
from tests.support.processes import full_disk
from tests.support.slow import first_fast


def test_every_camera_is_listed(run):
    code, out, _ = run("cameras")
    assert code == 0
    assert {line.split()[0] for line in out.splitlines()} == set(camera_names())


@pytest.mark.parametrize("format", first_fast(FORMATS, 2))
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
    assert code == 0 and float(out.split()[1].replace("inf", "99")) > 20


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


@pytest.mark.parametrize("name", ["setup2-16", "setup2"])
def test_a_folder_of_pictures_may_have_the_name_of_a_camera(run, tmp_path, monkeypatch, name):
    """`--camera setup1 -o setup1/a.png` took the folder for maps of rays once it was there."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir()
    assert run("render", "apples", "--camera", name, "--scale", 128, "-o", f"{name}/a.png")[0] == 0


def test_invalid_cameras_are_refused(run, refused, tmp_path):
    refused(run("camera", "nope", "-o", tmp_path / "c"), "unknown camera 'nope'")
    refused(run("camera"), "a camera is needed")
    refused(run("render", "apples", "--camera", "", "-o", tmp_path / "a.png"), "is '': a path is needed")
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


@pytest.mark.slow
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


# -- raytrace-ii calibrate


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """A raw picture of an even scene, a white image and a dark frame, on disk, and their camera."""
    folder = tmp_path_factory.mktemp("raw")
    rng = np.random.default_rng(2)
    camera = random_camera(rng, (320, 300), 14.3, True)
    share = white_image(camera, 2)
    for name, picture in (
        ("white", exposed(share, camera, rng)),
        ("raw", exposed(share * 0.5, camera, rng)),
        ("dark", rng.normal(30, 5, share.shape).clip(0).astype(np.uint16)),
    ):
        write_image(folder / f"{name}.png", picture)
    return folder, camera


@pytest.mark.slow
def test_a_raw_picture_becomes_an_ordinary_ii_picture(run, frames, tmp_path):
    """Calibrated, regular with odd rows under even ones, coded and decoded."""
    folder, camera = frames
    arguments = ("--white", folder / "white.png", "--dark", folder / "dark.png", "--pixel-pitch-mm", 0.005)
    code, out, _ = run("calibrate", folder / "raw.png", *arguments, "--gap-mm", 0.3, "-o", tmp_path / "camera")
    assert code == 0 and "hexagonal" in out and "from the white image" in out and "assumed" not in out
    report = json.loads((tmp_path / "camera/report.json").read_text())
    assert report["turn_deg"] == pytest.approx(camera.lens_turn_deg, abs=0.005)
    assert report["residual_rms_px"] < 0.2 and report["not_told"]
    found = IICamera.from_json(json.loads((tmp_path / "camera/camera.json").read_text()))
    picture = IIPicture.load(tmp_path / "camera/picture.png")
    assert picture.camera == found and found.gap_mm == 0.3
    assert read_image(tmp_path / "camera/centres.png").shape == (600, 640, 3)
    code, out, _ = run("regular", tmp_path / "camera/picture.png", "--deshift", "-o", tmp_path / "r.png")
    assert code == 0 and f"{found.lenses[0]}×{found.lenses[1]} lenses of 14×" in out
    assert run("encode", tmp_path / "r.png", "--scheme", "jpeg2000", "--bpp", 0.5, "-o", tmp_path / "r.ii")[0] == 0
    assert run("decode", tmp_path / "r.ii", "-o", tmp_path / "d.png")[0] == 0
    assert IIPicture.load(tmp_path / "d.png").camera == IIPicture.load(tmp_path / "r.png").camera


def test_a_picture_without_lenses_ends_in_one_line(run, refused, tmp_path):
    write_image(tmp_path / "n.png", np.random.default_rng(0).integers(0, 255, (200, 200, 3)).astype(np.uint8))
    refused(run("calibrate", tmp_path / "n.png", "-o", tmp_path / "c"), "no lenses are found")
    refused(run("calibrate", tmp_path / "n.png", "--mosaic", "rgbb", "-o", tmp_path / "c"), "mosaic")
    refused(run("calibrate", tmp_path / "n.png", "--white", tmp_path / "w.png", "-o", tmp_path / "c"), "w.png")


@pytest.mark.slow
@pytest.mark.parametrize("limit", [1_000, 140_000])
def test_a_full_disk_ends_in_one_line(run, frames, tmp_path, limit):
    """No file fits, or all but the picture of centres."""
    with full_disk(limit):
        code, _, err = run("calibrate", frames[0] / "raw.png", "-o", tmp_path / "c")
    assert code == 2 and "error: cannot write " in err and "Traceback" not in err
    left = sorted(path.name for path in tmp_path.rglob("*"))
    whole = ["c", "camera.json", "picture.png", "picture.png.json", "report.json"]
    assert left == ([] if limit == 1_000 else whole)
    if limit > 1_000:
        assert IIPicture.load(tmp_path / "c/picture.png").camera is not None


def test_existing_files_are_not_replaced(run, refused, frames, tmp_path):
    (tmp_path / "c").mkdir()
    (tmp_path / "c/camera.json").write_text("mine")
    refused(run("calibrate", frames[0] / "raw.png", "-o", tmp_path / "c"), "camera.json is there already")
    assert (tmp_path / "c/camera.json").read_text() == "mine"
