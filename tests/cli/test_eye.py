"""Commands look and eye."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from codec import encode
from ii_core import IIPicture, five_viewpoints, preset, view_image, with_assumed_camera
from ii_core.base.files import read_image
from ii_core.camera.maps import FORMATS
from ii_core.waves.spread import spread_maps, spread_picture
from ii_core.waves.spread_files import read_spread
from raytrace_ii import load_scene, render


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


@pytest.mark.parametrize("command", ["look", "eye", "view", "display"])
def test_a_coded_file_is_shown_as_its_picture(run, path, tmp_path, command):
    encode(IIPicture.load(path), "ei-ffv1").save(tmp_path / "c.ii")
    kind = {"view": ".html", "display": ".gif"}.get(command, ".png")
    more = {"eye": ["--pupil", "0"], "display": ["--frames", "2", "--size", "64x32"]}.get(command, [])
    for name, source in ("coded", tmp_path / "c.ii"), ("plain", path):
        code, _, err = run(command, source, *more, "-o", tmp_path / f"{name}{kind}")
        assert code == 0 and not err
    if command != "view":  # its page has the name of the picture
        assert (tmp_path / f"coded{kind}").read_bytes() == (tmp_path / f"plain{kind}").read_bytes()


def test_an_assumed_angle_is_that_of_the_border():
    # by hand: from the place "left" a lens shows the pixel next to its border, (U - 1)/2 pixels from the middle
    picture = with_assumed_camera(IIPicture(np.zeros((8, 8, 3), np.uint8), (2, 2), (4, 4)), 40)
    camera = picture.camera
    assert camera.view_angle_deg == pytest.approx(40)
    assert 2 / camera.gap_mm == pytest.approx(np.tan(np.radians(20)))


# -- point-spread functions on the command line: stored beside L and D, applied by render and eye


def stored(run, folder, *options, name="setup1", scale=64):
    assert run("camera", name, "--scale", scale, "-o", folder, *options)[0] == 0
    return folder


@pytest.mark.parametrize("format", FORMATS)
def test_what_is_written_is_read_to_half_a_code(run, tmp_path, format):
    """A camera of glass, for all five widths; on b1dc540 there was neither command nor file for them."""
    sheet = preset("setup1", scale=64).to_json()
    sheet["optics"] = [{"kind": "spherical-lenslet", "radius_mm": 6.6, "ior": 1.52}]
    (tmp_path / "glass.json").write_text(json.dumps(sheet))
    camera = preset(str(tmp_path / "glass.json"))
    folder = stored(
        run, tmp_path / "cam", "--spread", "80", "--format", format, name=tmp_path / "glass.json", scale=1
    )
    suffix = FORMATS[format][0]
    assert sorted(p.name for p in folder.iterdir()) == [*(f"{n}{suffix}" for n in "ADLS"), "camera.json"]
    (got,), wanted = read_spread(folder), spread_maps(camera, 80.0)
    assert got.pixel_pitch_mm == wanted.pixel_pitch_mm
    for a, b in zip((got.defocus_mm, got.airy_mm, got.aberration_mm), (wanted[0], wanted[1], wanted[3]), strict=True):
        codes = {"png16": 2**16, "png8": 2**8, "hdr": 2**7}.get(format, 1e6)  # hdr cuts after 8 bits
        np.testing.assert_allclose(a, b, atol=0.51 * float(np.ptp(b)) / codes + 1e-6 * float(abs(b).max()))


@pytest.mark.slow
def test_pictures_are_spread_by_a_folder_and_by_the_depth_met(run, tmp_path):
    camera = preset("setup1", scale=64)
    folder = stored(run, tmp_path / "cam", "--spread", "60", "--format", "exr")
    shot = render(load_scene("apples"), camera, support=("depth",), dtype="float32")
    for option, depth in ((folder, 60.0), ("auto", shot.depth)):
        path = tmp_path / "soft.exr"
        assert run("render", "apples", "--scale", 64, "--spread", option, "-o", path, "--force")[0] == 0
        wanted = spread_picture(shot.picture, spread_maps(camera, depth)).pixels
        np.testing.assert_allclose(IIPicture.load(path).pixels, wanted, atol=1e-5)
        assert abs(wanted - shot.picture.pixels).max() > 0.05
    assert not list(tmp_path.glob(".soft.*"))
    # the camera of maps, 8 bit, with its noise after the spread
    command = ("render", "apples", "--camera", folder, "--spread", folder, "--noise", "1", "--seed", "3")
    assert run(*command, "-o", tmp_path / "a.png", "--depth", tmp_path / "d.exr")[0] == 0
    picture = IIPicture.load(tmp_path / "a.png")
    assert picture.camera == camera and read_image(tmp_path / "d.exr").shape[:2] == shot.depth.shape
    grey = (picture.pixels.astype(int) - np.rint(255 * _srgb(wanted_of(folder, shot)))).reshape(-1, 3)
    free = ((picture.pixels > 8) & (picture.pixels < 247)).all(axis=2).reshape(-1)
    assert 0.8 < grey[free].std() < 1.3 and np.ptp(grey[free], axis=1).max() <= 3


def wanted_of(folder, shot):
    return spread_picture(shot.picture, read_spread(folder)[0]).pixels.clip(0, 1).astype(np.float64)


def _srgb(light):
    from ii_core.base.colour import srgb

    return srgb(light)


@pytest.mark.slow
def test_an_eye_sees_the_light_spread_towards_it(run, tmp_path):
    assert run("render", "apples", "--scale", 64, "-o", tmp_path / "a.png")[0] == 0
    folder = stored(run, tmp_path / "cam", "--spread", "-200", "--format", "exr")
    seen = []
    for i, option in enumerate(((), ("--spread", "auto"), ("--spread", folder))):
        view = tmp_path / f"{i}.png"
        assert run("eye", tmp_path / "a.png", "--at", "0,0,-200", "--pupil", 0, "-o", view, *option)[0] == 0
        seen.append(read_image(view).astype(int))
    assert abs(seen[0] - seen[1]).max() > 5
    np.testing.assert_array_equal(seen[1], seen[2])


@pytest.mark.slow
def test_arrays_of_a_set_have_their_own_and_bad_input_is_one_line(run, refused, tmp_path):
    stacked = stored(run, tmp_path / "set", "--spread", "inf", name="stacked-sensors")
    assert len(read_spread(stacked)) == 3 and (stacked / "S_2.png").exists()
    bare = stored(run, tmp_path / "bare")
    out = ("-o", tmp_path / "x.png")
    for command, said in (
        (("camera", "setup1", "--scale", 64, "-o", tmp_path / "n", "--spread", "near"), "spread is 'near': a depth"),
        (("camera", "setup1", "--scale", 64, "-o", tmp_path / "n", "--spread", tmp_path / "gone.exr"), "gone.exr"),
        (("camera", "setup1", "--scale", 64, "-o", tmp_path / "n", "--spread", "nan"), "spread is 'nan': a depth"),
        (("camera", "setup1", "--scale", 64, "--spread", "inf"), "-o is needed"),
        (("camera", "hexagonal", "--scale", 8, "-o", tmp_path / "n", "--spread", "inf"), "not regular"),
        (("render", "apples", "--scale", 64, "--spread", "all", *out), "spread is 'all': auto, or a folder"),
        (("render", "apples", "--scale", 64, "--spread", bare, *out), "no point-spread functions"),
        (("render", "apples", "--scale", 32, "--spread", stacked, *out), "the camera of (256, 128)"),
        (("render", "apples", "--camera", "pinhole2d", "--spread", "auto", *out), "this camera has one lens"),
        (("render", "apples", "--camera", "hexagonal", "--scale", 8, "--spread", "auto", *out), "not regular"),
        (("render", "apples", "--scale", 64, "--frames", "0..1", "--spread", "auto", *out), "--frames"),
        (
            ("render", "--set", "reference", "--scale", 64, "--spread", "auto", "-o", tmp_path / "n"),
            "without --frames",
        ),
        (("render", "--set", "benchmark:small", "--spread", "auto", "-o", tmp_path / "n"), "leave out --spread"),
    ):
        refused(run(*command), said)
    assert not (tmp_path / "n").exists() and not (tmp_path / "x.png").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda e: e.pop("A"), "spread has no A"),
        (lambda e: e["S"].update(file="../S.png"), "a name inside"),
        (lambda e: e["A"].update(box=[[0, 0], [0, 0], [0, 0]]), "rings above 0"),
        (lambda e: e["S"].update(C=0), "a positive C"),
        (lambda e: e.update(pixel_pitch_mm=-1), "pixel_pitch_mm"),
        (lambda e: e.update(S=3), "spread is damaged"),
        (lambda e: e["A"].update(file="small.png"), "small.png"),
    ],
)
def test_a_damaged_folder_is_one_line(run, refused, tmp_path, change, said):
    folder = stored(run, tmp_path / "cam", "--spread", "inf")
    shutil.copy(stored(run, tmp_path / "small", "--spread", "inf", scale=128) / "A.png", folder / "small.png")
    sheet = json.loads((folder / "camera.json").read_text())
    change(sheet["arrays"][0]["spread"])
    (folder / "camera.json").write_text(json.dumps(sheet))
    refused(run("render", "apples", "--scale", 64, "--spread", folder, "-o", tmp_path / "x.png"), said)
