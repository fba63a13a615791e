"""Commands look and eye."""

from dataclasses import replace

import numpy as np
import pytest

from ii_core import IIPicture, five_viewpoints, preset, view_image, with_assumed_camera
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
    faults = ["--layout", "rgb-stripe", "--fill", "0.6", "--turn", "0.5", "--shift", "0.01,0", "--gap-mm", "6"]
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
        (["--lens-pitch-mm", "0"], "lens_pitch_mm"),
        (["--gap-mm", "nan"], "gap_mm"),
        (["--apart", "0", "--both"], "apart_mm"),
        (["--size", "big"], "two whole numbers"),
    ],
)
def test_invalid_options_are_refused(run, refused, path, tmp_path, options, said):
    refused(run("eye", path, *options, "-o", tmp_path / "e.png"), said)
    assert not list(tmp_path.glob("e*.png"))


def test_look_writes_view_images(run, path, tmp_path):
    picture = IIPicture.load(path)
    code, out, err = run("look", path, "--at", "left", "--at", "1,2,-90", "-o", tmp_path / "v.png")
    assert code == 0 and not err and out.count("the viewing zone of") == 2
    for name, place in (("v_1", five_viewpoints(picture.camera)["left"]), ("v_2", (1, 2, -90))):
        np.testing.assert_array_equal(read_image(tmp_path / f"{name}.png"), view_image(picture, place)[0])


@pytest.mark.parametrize("command", ["look", "eye", "view", "display"])
def test_all_commands_assume_the_same_camera(run, refused, path, tmp_path, command):
    picture, bare = IIPicture.load(path), tmp_path / "bare.png"
    replace(picture, camera=None).save(bare)
    kind = {"view": ".html", "display": ".gif"}.get(command, ".png")
    more = {"eye": ["--pupil", "0"], "display": ["--frames", "2", "--size", "64x32"]}.get(command, [])
    code, _, err = run(command, bare, *more, "-o", tmp_path / f"20{kind}")
    assert code == 0 and err == f"note: {bare} has no camera: a viewing angle of 20° is assumed\n"
    code, _, err = run(command, bare, *more, "--angle", "35", "-o", tmp_path / f"35{kind}")
    assert code == 0 and not err
    same = (tmp_path / f"20{kind}").read_bytes() == (tmp_path / f"35{kind}").read_bytes()
    assert same == (command in ("look", "eye"))  # from the front, every angle shows the middle pixels
    refused(run(command, path, *more, "--angle", "35", "-o", tmp_path / f"no{kind}"), "has a camera")
    refused(run(command, bare, *more, "--angle", "180", "-o", tmp_path / f"no{kind}"), "angle is 180°")


def test_an_assumed_angle_is_that_of_the_border():
    # by hand: from the place "left" a lens shows the pixel next to its border, (U - 1)/2 pixels from the middle
    picture = with_assumed_camera(IIPicture(np.zeros((8, 8, 3), np.uint8), (2, 2), (4, 4)), 40)
    camera = picture.camera
    assert camera.view_angle_deg == pytest.approx(40)
    assert 2 / camera.gap_mm == pytest.approx(np.tan(np.radians(20)))
