"""raytrace-ii calibrate."""

import json

import numpy as np
import pytest

from benchmarks.accuracy.calibration import exposed, random_camera, white_image
from ii_core import IICamera, IIPicture
from ii_core.base.files import read_image, write_image
from tests.support.full_disk import full_disk


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
