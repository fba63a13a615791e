"""Cameras stored as L and D maps: half a code of error, exact ends, hand-made maps, rendered pictures."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ii_core import Camera, IICamera, preset, preset_cameras, read_maps, write_maps
from ii_core.base.files import read_image, write_image
from ii_core.camera.maps import FORMATS, decode, encode, widened
from raytrace_ii import render
from tests.support.slow import first_fast
from tests.support.trace_scenes import hall

SMALL = preset("setup1", scale=32)
FINE = {"png16": 2**16, "png8": 2**8}


@settings(max_examples=300, deadline=None)
@given(
    low=st.floats(-1e6, 1e6),
    extent=st.one_of(st.just(0.0), st.floats(1e-9, 1e9)),
    share=st.floats(0, 1),
    format=st.sampled_from(["png8", "png16"]),
)
def test_codes_are_right_to_half_a_step_and_exact_at_both_ends(low, extent, share, format):
    steps, high = FINE[format], low + extent
    box = [widened([low, high], steps)] * 3
    values = np.array([[low, high, low + share * (high - low)]])
    stored = encode(values, box, steps, FORMATS[format][1])
    assert stored[0, 0] == 0
    back = decode(stored, box, steps)
    # the arithmetic itself is good to a few units in the last place of the box's ends
    rounding = 8 * np.spacing(max(abs(low), abs(high)))
    assert back[0, 0] == low and abs(back[0, 1] - high) <= rounding
    assert abs(back[0, 2] - values[0, 2]) <= (high - low) / (steps - 1) / 2 + rounding


def test_maps_have_rays_as_any_camera_does(tmp_path):
    """Equal within half a float32 step of 25 mm, which EXR holds, by the same protocol as other cameras."""
    write_maps([SMALL], tmp_path, format="exr")
    block = slice(3, 9), slice(5, 20)
    cameras: list[Camera] = [SMALL, *read_maps(tmp_path)]
    (L, D), (l, d) = (camera.rays(*block) for camera in cameras)
    assert L.shape == l.shape == (6, 15, 3)
    np.testing.assert_allclose(l, L, atol=1e-6)
    np.testing.assert_allclose(d / np.linalg.norm(d, axis=2, keepdims=True), D / np.linalg.norm(
        D, axis=2, keepdims=True), atol=1e-6)  # fmt: skip


CAMERAS = ["setup1", "grin", "hexagonal", "hpo", "depth-control", "plenoptic1", "spherical"]


@pytest.mark.parametrize("name", first_fast(CAMERAS, 3))
@pytest.mark.parametrize("format", FORMATS)
def test_a_camera_comes_back_within_half_a_code(tmp_path, name, format):
    camera = preset(name, scale=8 if name == "hexagonal" else 32)  # 8 is the largest that divides its 296 rows
    write_maps([camera], tmp_path, format=format)
    (stored,) = read_maps(tmp_path)
    assert (stored.pixels, stored.lenses, stored.ei_pixels) == (camera.pixels, camera.lenses, camera.ei_pixels)
    assert stored.model == camera and stored.erect == camera.erect
    L, D, weight = camera.weighted_rays()
    l, d, share = stored.stored_rays(0)
    D = D / np.linalg.norm(D, axis=-1, keepdims=True)
    on = np.ones(L.shape[:2], bool) if weight is None else weight > 0
    if weight is not None and (weight != 1).any():
        np.testing.assert_array_equal(share, weight)
    for there, back in ((L, l), (D, d)):
        extent = np.ptp(there[on], axis=0)
        # integers: half a step; floats: half of 24 bits; RGBE shares one exponent and leaves 8 bits of the largest
        allowed = {
            "png16": extent / 65535 / 2,
            "png8": extent / 255 / 2,
            "exr": 2.0**-24 * abs(there).max(axis=(0, 1)),
            "hdr": extent / 128,
        }[format]
        assert (abs(there - back)[on] <= allowed * 1.0001 + 1e-12).all()


@pytest.mark.parametrize("name", ["setup1", "plenoptic1"])
def test_pictures_from_maps_need_no_camera(tmp_path, name):
    """Metric floats place a ray to 1e-7: a picture differs in pixels on an edge only."""
    camera, scene = preset(name, scale=32), hall()
    pose = np.eye(4)
    pose[2, 3] = 0.0 if name == "setup1" else -70.0
    write_maps([camera], tmp_path, format="exr")
    sheet = json.loads((tmp_path / "camera.json").read_text())
    for key in (
        "kind",
        "pixel_pitch_mm",
        "lens_pitch_mm",
        "gap_mm",
        "focal_mm",
        "lattice",
        "name",
        "version",
        "format",
    ):
        del sheet[key]
    del sheet["arrays"][0]["camera"]
    (tmp_path / "camera.json").write_text(json.dumps(sheet))
    (stored,) = read_maps(tmp_path)
    assert stored.model is None
    direct, mapped = (render(scene, c, pose=pose) for c in (camera, stored))
    assert mapped.stats.rays["primary"] == direct.stats.rays["primary"]
    differs = (direct.picture.pixels != mapped.picture.pixels).any(axis=-1)
    assert differs.mean() < 0.005
    np.testing.assert_array_equal(np.isnan(direct.depth), np.isnan(mapped.depth))


def test_maps_made_by_hand(tmp_path):
    """Two images and a minimal sheet: one pixel looks ahead, one right, one up, and one has no ray."""
    L = np.zeros((2, 2, 3), np.float32)
    L[..., 2] = 5
    D = np.array([[[0, 0, 1], [1, 0, 1]], [[0, 1, 1], [0, 0, 0]]], np.float32)
    write_image(tmp_path / "where.exr", L)
    write_image(tmp_path / "whither.exr", D)
    sheet = {"arrays": [{"samples": [{"L": {"file": "where.exr"}, "D": {"file": "whither.exr"}}]}]}
    (tmp_path / "camera.json").write_text(json.dumps(sheet))
    (camera,) = read_maps(tmp_path)
    assert (camera.pixels, camera.lenses, camera.ei_pixels, camera.model) == ((2, 2), (1, 1), (2, 2), None)
    L2, D2, share = camera.stored_rays(0)
    np.testing.assert_array_equal(L2, L)
    np.testing.assert_array_equal(D2, D)
    assert share.tolist() == [[1, 1], [1, 0]]
    shot = render(hall(), camera)
    assert shot.stats.rays["primary"] == 3 and shot.object_id[1, 1] == -1


def test_several_arrays_and_samples(tmp_path):
    cameras = preset_cameras("stacked-sensors", scale=64)
    samples = [((0.25, 0.5), (0.1, 0.5)), ((0.75, 0.5), (0.9, 0.5))]
    write_maps(cameras, tmp_path, format="exr", samples=samples)
    stored = read_maps(tmp_path)
    assert len(stored) == 3 and stored[0].stored_samples == 2
    for camera, maps in zip(cameras, stored, strict=True):
        for i, where in enumerate(samples):
            L, _, _ = camera.weighted_rays(slice(None), slice(None), *where)
            np.testing.assert_allclose(maps.stored_rays(i)[0], L, atol=1e-5)  # float32 of 25 mm
    shot = render(hall(), stored[0])
    assert shot.stats.rays["primary"] == 2 * stored[0].pixels[0] * stored[0].pixels[1]
    with pytest.raises(ValueError, match="samples is 5: the maps hold 2"):
        render(hall(), stored[0], samples=5)


def test_extents_of_zero_and_huge_ones(tmp_path):
    point = IICamera(pixels=(1, 1), lenses=(1, 1), pixel_pitch_mm=1.0, gap_mm=3.0)
    far = IICamera(pixels=(4, 4), lenses=(2, 2), pixel_pitch_mm=1e5, gap_mm=1e5, origin_mm=(1e6, -1e6, 0))
    for camera in (point, far):
        for format in ("png16", "png8"):
            write_maps([camera], tmp_path, format=format)
            (stored,) = read_maps(tmp_path)
            L, _ = camera.rays()
            np.testing.assert_allclose(stored.stored_rays(0)[0], L, rtol=1e-12)  # every value is an end of its box


def test_integer_maps_are_scaled_by_the_sheet(tmp_path):
    write_maps([SMALL], tmp_path, format="png16")
    sheet = json.loads((tmp_path / "camera.json").read_text())
    entry = sheet["arrays"][0]["samples"][0]["D"]
    stored = read_image(tmp_path / entry["file"])
    assert entry["C"] == 65536 and stored.dtype == np.uint16
    x_min, x_max = entry["box"][0]
    _, D = SMALL.rays()
    unit = D[3, 5] / np.linalg.norm(D[3, 5])
    assert stored[3, 5, 0] / 65536 * (x_max - x_min) + x_min == pytest.approx(unit[0], abs=(x_max - x_min) / 131072)


BROKEN = {
    "no camera maps": lambda s: s.pop("arrays"),
    '"samples"': lambda s: s["arrays"][0].pop("samples"),
    "needs the images L and D": lambda s: s["arrays"][0]["samples"][0].pop("D"),
    "its box is needed": lambda s: s["arrays"][0]["samples"][0]["L"].pop("box"),
    "a positive C and three pairs": lambda s: s["arrays"][0]["samples"][0]["L"].update(C=0),
    "three pairs of numbers": lambda s: s["arrays"][0]["samples"][0]["L"].update(box=[[0, 1]]),
    "lenses is": lambda s: s.update(lenses=[0, 1]),
    "no camera": lambda s: s["arrays"][0].update(camera=[1]),
}


@pytest.mark.parametrize("says", BROKEN)
def test_broken_sheets_are_one_clear_error(tmp_path, says):
    write_maps([SMALL], tmp_path)
    sheet = json.loads((tmp_path / "camera.json").read_text())
    BROKEN[says](sheet)
    (tmp_path / "camera.json").write_text(json.dumps(sheet))
    with pytest.raises(ValueError, match=says) as error:
        read_maps(tmp_path)
    assert str(error.value).startswith(str(tmp_path)) and "\n" not in str(error.value)


def test_missing_and_mismatched_images(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"camera\.json does not exist"):
        read_maps(tmp_path)
    write_maps([SMALL], tmp_path)
    write_image(tmp_path / "D.png", np.zeros((3, 3, 3), np.uint16))
    with pytest.raises(ValueError, match=r"D\.png has 3×3 pixels: 256×128 are needed"):
        read_maps(tmp_path)
    (tmp_path / "D.png").unlink()
    with pytest.raises(FileNotFoundError):
        read_maps(tmp_path)


def test_unstorable_cameras_are_refused(tmp_path):
    with pytest.raises(ValueError, match="unknown format 'bmp': known are png16"):
        write_maps([SMALL], tmp_path, format="bmp")
    with pytest.raises(ValueError, match="differ in pixels or lenses"):
        write_maps([SMALL, preset("setup1", scale=64)], tmp_path)
    blind = IICamera(
        pixels=(4, 4), lenses=(2, 2), pixel_pitch_mm=1, gap_mm=1, name="blind",
        optics=["pinhole", {"kind": "lens", "z_mm": 2, "focal_mm": 9, "diameter_mm": 0.5}],
    )  # fmt: skip
    with pytest.raises(ValueError, match="camera 'blind' blocks every ray"):
        write_maps([blind], tmp_path)
