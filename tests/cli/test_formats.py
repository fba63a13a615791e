"""Commands import, export and components."""

import numpy as np
import pytest

from ii_core import IIPicture, Rig, preset, sub_images, with_assumed_camera
from ii_core.base.files import read_depth, read_image, write_image
from ii_core.formats.pfm import read_pfm
from tests.support.slow import first_fast


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A rendered picture with depth, on disk."""
    from ii_core.base.files import write_image
    from raytrace_ii import load_scene, render

    folder = tmp_path_factory.mktemp("shot")
    made = render(load_scene("apples"), preset("setup1", scale=16), support=("depth",))
    made.picture.save(folder / "a.png")
    write_image(folder / "z.exr", made.depth.astype(np.float32))
    return folder / "a.png"


@pytest.mark.parametrize("to", ["views", "hci"])
def test_export_and_import(run, shot, tmp_path, to):
    code, out, _ = run("export", shot, "--to", to, "-o", tmp_path / "lf")
    assert code == 0 and "256 views of 32×16 px" in out
    code, out, _ = run("import", tmp_path / "lf", "-o", tmp_path / "back.png")
    assert code == 0 and "32×16 lenses of 16×16 px" in out and "(given); disparity -" in out
    a, b = IIPicture.load(shot), IIPicture.load(tmp_path / "back.png")
    np.testing.assert_array_equal(a.pixels, b.pixels)
    assert (a.camera == b.camera) == (to == "views")


def test_hci_with_depth(run, shot, tmp_path):
    assert run("export", shot, "--to", "hci", "--depth", shot.parent / "z.exr", "-o", tmp_path / "lf")[0] == 0
    assert np.nanmax(read_pfm(tmp_path / "lf" / "gt_disp_lowres.pfm")) < 0


def test_quilt_and_mosaic(run, shot, tmp_path):
    code, out, _ = run("export", shot, "--to", "quilt", "-o", tmp_path / "q.png")
    assert code == 0 and "_qs" in out
    assert run("import", out.strip(), "-o", tmp_path / "back.png")[0] == 0
    back, original = IIPicture.load(tmp_path / "back.png"), IIPicture.load(shot)
    np.testing.assert_array_equal(sub_images(back)[0], sub_images(original)[8])
    assert run("export", shot, "--to", "mosaic", "-o", tmp_path / "m.png")[0] == 0
    assert run("import", tmp_path / "m.png", "--ei-pixels", "16x16", "-o", tmp_path / "mm.png")[0] == 0
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "mm.png").pixels, original.pixels)


def test_a_quilt_keeps_the_aspect_of_its_display(run, tmp_path):
    """Tiles of 24×20 px fill a display of 1.6:1, as those of 819×455 px do on a Looking Glass of 15.6 inches."""
    tiles = np.random.default_rng(2).integers(0, 256, (40, 72, 3), np.uint8)
    write_image(tmp_path / "q_qs3x2a1.6.png", tiles)
    assert run("import", tmp_path / "q_qs3x2a1.6.png", "-o", tmp_path / "p.png")[0] == 0
    picture = IIPicture.load(tmp_path / "p.png")
    across, down = picture.camera.lens_pitch_mm
    assert (24 * across) / (20 * down) == pytest.approx(1.6) and picture.camera.packed
    out = run("export", tmp_path / "p.png", "--to", "quilt", "-o", tmp_path / "back.png")[1]
    assert "a1.6.png" in out
    assert (
        run("display", tmp_path / "p.png", "--as", "simulation", "--size", "160x100", "-o", tmp_path / "s.png")[0]
        == 0
    )
    assert read_image(tmp_path / "s.png").any(axis=2).mean() > 0.97  # the whole of a window of its aspect
    with pytest.raises(ValueError, match="aspect is -1"):
        with_assumed_camera(IIPicture(tiles, (24, 20), (3, 2)), aspect=-1)


def test_flips_are_overridden(run, shot, tmp_path):
    run("export", shot, "--to", "hci", "-o", tmp_path / "lf")
    assert run("import", tmp_path / "lf", "--flip-down", "--flip-across", "-o", tmp_path / "b.png")[0] == 0
    a, b = (sub_images(IIPicture.load(path)) for path in (shot, tmp_path / "b.png"))
    np.testing.assert_array_equal(a[::-1, ::-1], b)


@pytest.mark.parametrize(
    ("kind", "count", "size"), first_fast([("si", 256, (16, 32)), ("ri", 256, (32, 16)), ("ei", 512, (16, 16))])
)
def test_components(run, shot, tmp_path, kind, count, size):
    sheet = tmp_path / "sheet.png"
    assert run("components", shot, "--type", kind, "-o", tmp_path / "views", "--sheet", sheet)[0] == 0
    files = sorted((tmp_path / "views").iterdir())
    assert len(files) == count and read_image(files[0]).shape[:2] == size
    rows = 16
    assert read_image(sheet).shape[:2] == (rows * (size[0] + 1) - 1, count // rows * (size[1] + 1) - 1)
    if kind == "si":
        np.testing.assert_array_equal(read_image(files[35]), sub_images(IIPicture.load(shot))[2, 3])


def test_refused(run, refused, shot, tmp_path):
    out = tmp_path / "o.png"
    refused(run("export", shot, "--to", "cube", "-o", out), "unknown layout 'cube': known are views, hci")
    refused(run("export", shot, "--depth", shot, "-o", out), "depth is no option of layout views")
    refused(run("export", shot, "--to", "quilt", "--row", 16, "-o", out), "row is 16: the picture has 16 rows")
    refused(run("components", shot, "--type", "vi", "-o", out), "unknown component image 'vi'")
    refused(run("import", shot, "-o", out), "is no folder and its name says no _qsCxRaA")
    refused(run("import", shot, "--grid", "9by9", "-o", out), "grid is '9by9'")
    refused(run("import", shot, "--ei-pixels", "0x3", "-o", out), "ei-pixels is '0x3'")
    refused(run("import", tmp_path / "none", "-o", out), "none does not exist")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").touch()
    refused(run("components", shot, "-o", tmp_path / "full"), "is not empty: --force")
    assert not out.exists()


def test_a_row_of_cameras_has_depth_and_its_camera_is_taken_from_the_picture(run, refused, tmp_path):
    """A wall 700 mm before five cameras: columns move by 20 · 50 / (36/64) · (1/700 − 1/900) px a view."""
    step = 20 * 50 / (36 / 64) * (1 / 700 - 1 / 900)
    waves = np.random.default_rng(1).uniform(-1, 1, (6, 3))
    rows, columns = np.mgrid[:48, :64].astype(float)
    for u in range(5):
        x = columns + step * (u - 2)
        light = sum(np.sin(a * x + b * rows + 9 * c) for a, b, c in waves)
        (tmp_path / "v").mkdir(exist_ok=True)
        write_image(
            tmp_path / "v" / f"im{u}.png", np.repeat((127 + 20 * light).astype(np.uint8)[..., None], 3, axis=2)
        )
    row, depth = tmp_path / "row.png", tmp_path / "d.exr"
    rig = ("--baseline-mm", 20, "--focal-mm", 50, "--sensor-mm", 36, "--focus-mm", 900)
    refused(run("import", tmp_path / "v", "-o", row), "give the grid, as in 9x1")
    said = run("import", tmp_path / "v", "--grid", "5x1", "-o", row, *rig)[1]
    assert "numbers run left to right (" in said and "then" not in said
    assert run("depth", row, "-o", depth)[0] == 0
    assert np.median(read_depth(depth)) == pytest.approx(700, rel=0.005)
    assert run("export", row, "--to", "hci", "-o", tmp_path / "hci")[0] == 0
    assert run("import", tmp_path / "hci", "-o", tmp_path / "again.png")[0] == 0
    camera, again = IIPicture.load(row).camera, IIPicture.load(tmp_path / "again.png").camera
    for name in ("lens_pitch_mm", "viewer_mm", "gap_mm", "pixel_pitch_mm", "origin_mm", "start_mm", "packed"):
        assert getattr(again, name) == pytest.approx(getattr(camera, name), rel=1e-9), name
    assert "5×1 px, lens pitch 10.12" in run("camera", row)[1] and preset(row) == camera
    assert run("render", "apples", "--camera", row, "-o", tmp_path / "a.png")[0] == 0
    assert IIPicture.load(tmp_path / "a.png").camera == camera
    assert run("camera", row, "--set", "pixel=0.1,gap=2")[0] == 0
    square = IIPicture.load(row).camera
    assert square.packed and square.lens_pitch_mm == pytest.approx((0.5, 0.5))
    bare = tmp_path / "bare.png"
    camera_of_none = IIPicture(IIPicture.load(row).pixels, (64, 48), (5, 1))
    camera_of_none.save(bare)
    refused(run("camera", bare), "the picture has no camera")
    refused(run("camera", tmp_path / "v" / "im0.png"), "im0.png.json does not exist")


def test_imported_views_get_a_camera(run, refused, shot, tmp_path):
    """From the parameters of an array of cameras, or from a file; incomplete ones are refused before any work."""
    views, out = tmp_path / "v", tmp_path / "p.png"
    assert run("export", shot, "--to", "views", "-o", views)[0] == 0
    (views / "structure.json").unlink()
    rig = ("--baseline-mm", 5, "--focal-mm", 50)
    refused(run("import", views, "-o", out, *rig), "sensor-mm is missing")
    refused(run("import", views, "-o", out, *rig, "--sensor-mm", 35, "--camera", "setup1"), "camera is given, too")
    assert "a nominal one of 20°" in run("import", views, "-o", out)[1]
    code, said, _ = run("import", views, "-o", out, *rig, "--sensor-mm", 35, "--focus-mm", 800, "--force")
    assert code == 0 and "no camera" not in said
    camera = IIPicture.load(out).camera
    assert camera.viewer_mm == 800 and camera.start_mm == 800
    for path in sorted(views.glob("*.png")):  # the camera places of the Stanford archive, 5 mm apart
        row, col = map(int, path.stem.split("_")[1:])
        path.rename(views / f"out_{row:02}_{col:02}_{5 * (7.5 - row):.6f}_{5 * (col - 7.5):.6f}.png")
    code, said, _ = run("import", views, "-o", out, *rig[2:], "--sensor-mm", 35, "--focus-mm", 800, "--force")
    assert code == 0 and "by camera places in names, 5×5 mm apart" in said and IIPicture.load(out).camera == camera
    import json

    (tmp_path / "c.json").write_text(json.dumps(preset("setup1", scale=16).to_json()))
    assert run("import", views, "-o", out, "--camera", tmp_path / "c.json", "--force")[0] == 0
    assert IIPicture.load(out).camera.lens_pitch_mm == preset("setup1", scale=16).lens_pitch_mm
    refused(run("import", views, "-o", out, "--camera", "setup3", "--force"), "64×64 lenses of 64×64 px need")


def test_a_field_without_camera_gets_a_nominal_one_that_set_replaces(run, tmp_path):
    """Views, measures and displays work, and say that lengths are nominal, until lengths are given."""
    (tmp_path / "v").mkdir()
    rng = np.random.default_rng(0)
    for row, col in np.ndindex(3, 3):
        write_image(tmp_path / f"v/view_{row}_{col}.png", rng.integers(0, 256, (12, 14, 3), np.uint8))
    field, note = tmp_path / "p.png", "has a nominal camera: lengths in mm are nominal"
    assert run("import", tmp_path / "v", "-o", field)[0] == 0
    assert IIPicture.load(field).camera.name == "nominal"
    measured = run("measure", field, field)
    assert measured[0] == 0 and note in measured[2] and "Q_view" in measured[1]
    quilt = ("display", field, "--as", "quilt", "--size", "16x16", "-o", tmp_path / "q.png", "--force")
    assert note in run(*quilt)[2]
    assert run(*quilt, "--angle", 40)[0] == 0
    for text, angle in (("angle=30", 30.0), ("pixel=0.01,gap=0.06", 28.07), ("baseline=2,focal=5,sensor=3", None)):
        assert run("camera", field, "--set", text)[0] == 0
        camera = IIPicture.load(field).camera
        assert angle is None or camera.view_angle_deg == pytest.approx(angle, abs=0.01)
    assert camera == Rig(baseline_mm=2, focal_mm=5, sensor_mm=3).camera((3, 3), (14, 12))
    assert note not in run(*quilt)[2]
    for text, said in (
        ("angle", "a name and a number"),
        ("gap=1", "known are angle"),
        ("angle=999", "between 0 and 180"),
    ):
        code, _, error = run("camera", field, "--set", text)
        assert code == 2 and said in error
