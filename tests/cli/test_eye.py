"""Command eye."""

import numpy as np
import pytest

from ii_core import IIPicture, five_viewpoints, preset, view_image
from ii_core.base.files import read_image


@pytest.fixture
def path(tmp_path):
    camera = preset("setup1", scale=32)
    pixels = np.random.default_rng(0).integers(0, 256, (*camera.pixels[::-1], 3), np.uint8)
    IIPicture(pixels, camera.lenses, camera.ei_pixels, camera).save(tmp_path / "p.png")
    return tmp_path / "p.png"


def test_a_point_pupil_shows_the_view_image(run, path, tmp_path):
    code, out, err = run("eye", path, "--pupil", "0", "-o", tmp_path / "e.png")
    assert code == 0, err
    picture = IIPicture.load(path)
    front = five_viewpoints(picture.camera)["front"]
    wanted, _ = view_image(picture, front, interpolation="nearest")
    np.testing.assert_array_equal(read_image(tmp_path / "e.png"), wanted)
    assert "100.0% of the rays meet the panel; inside the viewing zone of" in out


def test_two_eyes_of_a_faulty_display(run, path, tmp_path):
    faults = ["--layout", "rgb-stripe", "--fill", "0.6", "--turn", "0.5", "--shift", "0.01,0", "--gap", "6"]
    options = [*faults, "--at", "0,0,-200", "--size", "64x32"]
    code, out, err = run("eye", path, "--both", *options, "-o", tmp_path / "e.png")
    assert code == 0, err
    left, right = (read_image(tmp_path / f"e_{side}.png") for side in ("left", "right"))
    assert left.shape == right.shape == (32, 64, 3) and (left != right).any()
    assert out.count("the viewing zone of") == 2 and not (tmp_path / "e.png").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--at", "0,0"], "at is '0,0'"),
        (["--at", "0,0,900"], "before the lens plane"),
        (["--shift", "a"], "shift is 'a'"),
        (["--pupil", "-1"], "pupil_mm is -1"),
        (["--focus", "0"], "focus_mm"),
        (["--rays", "0"], "rays is 0"),
        (["--layout", "hex"], "rgb-stripe"),
        (["--fill", "0"], "fill is 0"),
        (["--lens-pitch", "0"], "lens_pitch_mm"),
        (["--gap", "nan"], "gap_mm"),
        (["--apart", "0", "--both"], "apart_mm"),
        (["--size", "big"], "two whole numbers"),
    ],
)
def test_invalid_options_are_refused(run, refused, path, tmp_path, options, said):
    refused(run("eye", path, *options, "-o", tmp_path / "e.png"), said)
    assert not list(tmp_path.glob("e*.png"))
