"""Commands depth and focus."""

import json

import numpy as np
import pytest

from ii_core import IIPicture, Rig, depth_of_disparity, disparity_of_depth, preset
from ii_core.base.colour import linear
from ii_core.base.files import read_depth, read_image
from ii_core.depth.preview import four_digits, preview
from ii_core.formats.pfm import read_pfm, write_pfm
from ii_core.picture.component import sub_images
from tests.ii_core.test_depth import slanted


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    picture, truth = slanted()
    path = tmp_path_factory.mktemp("field") / "f.png"
    picture.save(path)
    return path, truth


def test_maps_points_and_preview(run, field, tmp_path):
    path, truth = field
    files = ["--points", tmp_path / "p.ply", "--confidence", tmp_path / "c.exr", "--preview", tmp_path / "v.png"]
    code, out, err = run("depth", path, "-o", tmp_path / "d.exr", *files, "--range", "-2,2")
    assert code == 0, err
    assert "a viewing angle of 20° is assumed" in err and "% sure" in out
    depth = read_depth(tmp_path / "d.exr", size=(48, 40))
    assert read_image(tmp_path / "c.exr").max() <= 1
    head, _, body = (tmp_path / "p.ply").read_bytes().partition(b"end_header\n")
    assert b"element vertex 1920\n" in head and len(body) == 1920 * 15
    points = np.frombuffer(body, [("place", "<f4", 3), ("colour", "u1", 3)])
    np.testing.assert_allclose(np.sort(points["place"][:, 2]), np.sort(depth.ravel()), rtol=1e-5)
    assert read_image(tmp_path / "v.png").shape == (320, 384 + 96, 3)

    code, _, err = run("depth", path, "-o", tmp_path / "d.pfm", "--disparity", "--range", "-2,2")
    assert code == 0, err
    assert np.median(np.abs(read_pfm(tmp_path / "d.pfm") - truth)) < 0.02


def test_millimetres_and_all_views(run, field, tmp_path):
    path, truth = field
    code, _, err = run("depth", path, "-o", tmp_path / "d.png", "--angle", "30", "--range", "-2,2")
    assert code == 0, err
    assert read_image(tmp_path / "d.png").dtype == np.uint16
    code, _, err = run("depth", path, "-o", tmp_path / "a.tif", "--disparity", "--view", "all", "--range", "-2,2")
    assert code == 0, err
    moved = read_image(tmp_path / "a.tif")[..., 0]
    assert moved.shape == (200, 240)
    np.testing.assert_allclose(moved[2::5, 2::5], truth, atol=0.2)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--disparity", "-o", "d.png"], "--disparity needs .exr, .tif or .pfm"),
        (["-o", "d.jpg"], "no known picture type"),
        (["-o", "d.exr", "--points", "p.obj"], ".ply is needed"),
        (["-o", "d.exr", "--view", "a"], "view is 'a'"),
        (["-o", "d.exr", "--range", "5"], "two numbers as in -4,2.5 are needed"),
        (["-o", "d.exr", "--range", "2,1"], "low < high"),
    ],
)
def test_depth_refuses(run, field, tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    code, _, err = run("depth", field[0], *options)
    assert code == 2 and said in err and not list(tmp_path.iterdir())


def test_focus_at_whole_disparities_is_the_mean_of_shifted_views(run, field, tmp_path):
    """Direct integration: the mean in linear light of the views' pixels at x − p·D."""
    path, _ = field
    code, out, err = run("focus", path, "--at", "1px", "-o", tmp_path / "f.tif")
    assert code == 0, err
    assert "of the pupil sees a pixel, at least" in out
    light = linear(sub_images(IIPicture.load(path)) / 255)
    inner = np.mean([light[v, u, 8 - (v - 2) : 32 - (v - 2), 8 - (u - 2) : 40 - (u - 2)]
                     for v in range(5) for u in range(5)], axis=0)  # fmt: skip
    np.testing.assert_allclose(read_image(tmp_path / "f.tif")[8:32, 8:40], inner, atol=1e-6)


@pytest.mark.slow
def test_focus_everywhere_a_stack_and_a_tilted_plane(run, field, tmp_path):
    path, _ = field
    code, _, err = run("focus", path, "--all-in-focus", "-o", tmp_path / "all.png")
    assert code == 0, err
    own = sub_images(IIPicture.load(path))[2, 2].astype(float)
    assert np.abs(read_image(tmp_path / "all.png") - own)[4:-4, 4:-4].mean() < 1.0
    code, out, err = run(
        "focus", path, "--stack", "3", "--over", "0.7,1.2", "--aperture", "circle", "-o", tmp_path / "s.gif"
    )
    assert code == 0 and "planes at 0.7, 0.95, 1.2 px" in out, err
    code, _, err = run("focus", path, "--stack", "2", "-o", tmp_path / "s.png", "--aperture", "hexagon:0.6")
    assert code == 0 and (tmp_path / "s_2.png").exists(), err
    code, _, err = run("focus", path, "--at", "9mm", "--tilt", "20,-5", "--bokeh", "4", "-o", tmp_path / "t.png")
    assert code == 0, err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--at", "3"], "at is '3'"),
        (["--at", "1px", "--tilt", "1,1"], "a tilted plane needs its z"),
        (["--stack", "0"], "stack is 0"),
        (["--stack", "2", "--at", "1px"], "--stack does not use --at"),
        (["--aperture", "star"], "known are square, circle"),
        (["--bokeh", "0"], "bokeh is 0"),
        (["--fps", "3"], "does not use --fps"),
    ],
)
def test_focus_refuses(run, field, tmp_path, options, said):
    code, _, err = run("focus", field[0], "-o", tmp_path / "f.png", *options)
    assert code == 2 and said in err and not list(tmp_path.iterdir())


@pytest.mark.parametrize(("camera", "said"), [("hexagonal", "not regular"), ("plenoptic1", "ends at 75 mm")])
def test_focus_refuses_cameras(run, tmp_path, camera, said):
    made = preset(camera, scale=8)
    pixels = np.zeros((made.pixels[1], made.pixels[0], 3), np.uint8)
    path = IIPicture(pixels, made.lenses, made.ei_pixels, made).save(tmp_path / "p.png")
    code, _, err = run("focus", path, "--at", "40mm", "-o", tmp_path / "f.png")
    assert code == 2 and said in err and not (tmp_path / "f.png").exists()


@pytest.mark.parametrize(
    ("made", "z"),
    [
        (Rig(baseline_mm=4, focal_mm=50, sensor_mm=36).camera((5, 5), (4, 4)), [20, 25, 50, 1e9]),
        (preset("setup1", scale=64), [47, 80, 120, 160]),
    ],
    ids=["cameras", "lenses"],
)
def test_preview_of_depths_beside_infinity_and_at_the_lenses(made, z):
    """Steps of z went to one point near infinity, and 20 to 50 mm looked alike; steps of 1/z to one at the lenses."""
    disparity = np.array([disparity_of_depth(made, z)] * 4)
    colours = preview(disparity, "mm", told=lambda d: depth_of_disparity(made, d))[0, ::75][:4].astype(int)
    assert (np.abs(np.diff(colours, axis=0)).sum(axis=1) > 40).all()  # a pixel is shown 75 px wide
    bright = colours.sum(axis=1)
    assert (np.diff(bright) < 0).all()


def test_preview_has_the_shape_of_the_lens_array():
    assert preview(np.eye(40), "px", pixel=(8.0, 1.0))[:, :-96].shape == (320, 2560, 3)


def test_errors_of_a_map(run, field, tmp_path):
    path, truth = field
    write_pfm(tmp_path / "t.pfm", truth.astype(np.float32))
    write_pfm(tmp_path / "d.pfm", (truth + 0.05).astype(np.float32))
    options = ["--border", "2", "--field", path, "--json", tmp_path / "e.json"]
    code, out, err = run("measure-depth", tmp_path / "d.pfm", tmp_path / "t.pfm", *options)
    assert code == 0, err
    errors = json.loads((tmp_path / "e.json").read_text())
    assert errors["badpix_003"] == 100 and errors["badpix_007"] == 0 and "badpix_007_outlines" in out
    code, _, err = run("measure-depth", tmp_path / "d.pfm", tmp_path / "t.pfm", "--mm")
    assert code == 2 and "--mm needs the camera of --field" in err
    code, _, err = run("measure-depth", tmp_path / "d.pfm", tmp_path / "t.pfm", "--field", path, "--view", "7,1")
    assert code == 2 and "view is '7,1': columns 0–4" in err


def test_numbers_of_scales_have_no_exponent():
    """The scale of a field that reaches far said 2.728e+04 mm."""
    assert [four_digits(v) for v in (27284.3, 1.5e-4, -3.14159, np.inf)] == ["27280", "0.00015", "-3.142", "inf"]
