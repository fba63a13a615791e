"""Cameras stored as L and D maps: half a code of error, exact ends, hand-made maps, rendered pictures."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ii_core import Camera, IICamera, camera_names, five_viewpoints, preset, preset_cameras, read_maps, write_maps
from ii_core.base.files import read_image, write_image
from ii_core.camera.maps import FORMATS, decode, encode, widened
from ii_core.design import design
from ii_core.design import properties as ii
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


@pytest.mark.parametrize("name", first_fast(CAMERAS, 2))
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


# -- properties and design of cameras, against the equations of the dissertation


ROUNDING = 1e-12  # relative: a few operations in double precision
LENGTH = st.floats(1e-4, 1e4)


def lens_camera(**more):
    lens = {"kind": "lenslet", "focal_mm": 1.8, "aperture_mm": 0.5}
    return IICamera(
        **{"pixels": (60, 40), "lenses": (6, 4), "pixel_pitch_mm": 0.1, "gap_mm": 2.0, "optics": (lens,)} | more
    )


def test_setup_3_by_hand():
    # 0.39 / (2·0.73) = 0.26712; arctan of it is 14.956°
    assert ii.view_angle_deg(lens_pitch_mm=0.39, gap_mm=0.73) == pytest.approx(29.9, abs=0.05)  # as the text rounds
    p = ii.properties(preset("setup3"))
    assert p["view_angle_deg"][0] == pytest.approx(29.9, abs=0.05)
    assert p["views"] == [64, 64] and p["pixels_per_mm"] == pytest.approx(163.934, abs=1e-3)
    (plane,) = p["image_planes"]
    assert plane["z_mm"] == math.inf and plane["image_pixel_mm"] == pytest.approx(0.3904)
    assert plane["depth_range_mm"] == pytest.approx(2 * 0.730748718 * 64)  # (2.5), δL/δP = 64
    assert p["map_bytes"]["exr"] == 4096 * 4096 * 24 and p["map_bytes"]["hdr"] == 4096 * 4096 * 8
    assert p["map_bytes"]["png16"] == 2 * p["map_bytes"]["png8"] == 4096 * 4096 * 12


def test_image_plane_by_hand_and_its_limits():
    assert ii.image_plane_mm(focal_mm=1.0, gap_mm=1.25) == pytest.approx(5.0, rel=ROUNDING)  # 1·1.25/0.25
    assert ii.image_plane_mm(focal_mm=1.0, gap_mm=0.75) == pytest.approx(-3.0, rel=ROUNDING)
    assert ii.image_plane_mm(focal_mm=0.73, gap_mm=0.73) == math.inf
    assert ii.image_plane_mm(focal_mm=math.inf, gap_mm=2.0) == -2.0
    for sign in (1, -1):
        near = [ii.image_plane_mm(focal_mm=1.0, gap_mm=1 + sign * 10.0**-i) * sign for i in (3, 6, 9)]
        # f·Λ/(Λ − f) ≈ 10^i; of 10⁻⁹ a double next to 1 keeps seven digits
        np.testing.assert_allclose(near, [1e3, 1e6, 1e9], rtol=2e-3)


@given(LENGTH, st.floats(0.1, 10))
def test_image_plane_obeys_the_lens_law(focal, ratio):
    assume(abs(ratio - 1) > 1e-6)
    gap = focal * ratio
    z = ii.image_plane_mm(focal_mm=focal, gap_mm=gap)
    # Λ/f − 1 keeps 10 digits of 16 next to 1; then 1/z is a small part of the sum, so that more are left.
    assert 1 / gap + 1 / z == pytest.approx(1 / focal, rel=1e-9)


def test_image_pixel_and_resolution():
    at = dict(gap_mm=1.0, pixel_pitch_mm=0.01, lens_pitch_mm=0.5)
    assert ii.image_pixel_mm(z_mm=20.0, **at) == pytest.approx(0.2, rel=ROUNDING)
    assert ii.image_pixel_mm(z_mm=-20.0, **at) == pytest.approx(0.2, rel=ROUNDING)
    assert ii.image_pixel_mm(z_mm=50.0, **at) == pytest.approx(0.5, rel=ROUNDING)  # U·Λ
    for z in (1e9, math.inf, -math.inf):
        assert ii.image_pixel_mm(z_mm=z, **at) == 0.5
    assert ii.resolution_per_mm(image_pixel_mm=0.2) == 5.0


def test_depth_range():
    at = dict(gap_mm=1.0, pixel_pitch_mm=0.01, lens_pitch_mm=0.5)
    assert ii.depth_range_mm(z_mm=20.0, **at) == pytest.approx(2 * 20 * 0.2 / 0.5, rel=ROUNDING)  # (2.4)
    assert ii.depth_range_mm(z_mm=math.inf, **at) == pytest.approx(100.0, rel=ROUNDING)  # (2.5)
    # They meet at U·Λ = 50, and Λ → f has a limit from both sides.
    assert ii.depth_range_mm(z_mm=50.0, **at) == pytest.approx(100.0, rel=ROUNDING)
    for gap in (1 - 1e-9, 1 + 1e-9):
        z = ii.image_plane_mm(focal_mm=1.0, gap_mm=gap)
        near = ii.depth_range_mm(z_mm=z, **at | {"gap_mm": gap})
        assert near == pytest.approx(100.0, rel=1e-8)


def test_depth_range_is_where_the_blur_is_an_image_pixel():
    # A lens as wide as its pitch sends a cone from δL at z = 0 to a point at z; δPI wide at z ± Δz/2.
    z, at = 20.0, dict(gap_mm=1.0, pixel_pitch_mm=0.01, lens_pitch_mm=0.5)
    half = ii.depth_range_mm(z_mm=z, **at) / 2
    assert at["lens_pitch_mm"] * half / z == pytest.approx(ii.image_pixel_mm(z_mm=z, **at), rel=ROUNDING)


@given(LENGTH, LENGTH, LENGTH, LENGTH | st.just(math.inf))
def test_characteristic_equation(lens_pitch, gap, pixel_pitch, z):
    at = dict(gap_mm=gap, pixel_pitch_mm=pixel_pitch, lens_pitch_mm=lens_pitch)
    left = ii.characteristic_per_mm(
        resolution_per_mm=ii.resolution_per_mm(image_pixel_mm=ii.image_pixel_mm(z_mm=z, **at)),
        depth_range_mm=ii.depth_range_mm(z_mm=z, **at),
        view_angle_deg=ii.view_angle_deg(lens_pitch_mm=lens_pitch, gap_mm=gap),
    )
    # tan amplifies the rounding of angles near 180°: by δL/2Λ, 5e7 at most here.
    assert left == pytest.approx(1 / pixel_pitch, rel=1e-7)


def test_products_with_diffraction():
    assert ii.diffraction_limited_per_mm(wavelength_mm=5e-4) == pytest.approx(2000.0)
    assert ii.pixel_limited_per_mm(pixel_pitch_mm=0.01, wavelength_mm=5e-4) == pytest.approx(5.0)
    # (2.8) from its parts: Δz = λ(z/δL)², R_I = Λ/(z·δP), α = δL/Λ
    z, gap, pitch, pixel, wave = 30.0, 1.5, 0.2, 0.004, 6e-4
    product = wave * (z / pitch) ** 2 * (gap / (z * pixel)) ** 2 * (pitch / gap) ** 2
    assert ii.pixel_limited_per_mm(pixel_pitch_mm=pixel, wavelength_mm=wave) == pytest.approx(product, rel=ROUNDING)
    # (2.7) likewise, where R_I = δL/(λz)
    product = wave * (z / pitch) ** 2 * (pitch / (wave * z)) ** 2
    assert ii.diffraction_limited_per_mm(wavelength_mm=wave) == pytest.approx(product, rel=ROUNDING)
    assert ii.diffraction_spot_mm(lens_pitch_mm=0.1, gap_mm=0.2, wavelength_mm=5e-4) == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ii.view_angle_deg(lens_pitch_mm=0.0, gap_mm=1.0), "lens_pitch_mm is 0"),
        (lambda: ii.view_angle_deg(lens_pitch_mm=1.0, gap_mm=math.nan), "gap_mm is nan"),
        (lambda: ii.image_plane_mm(focal_mm=-1.0, gap_mm=1.0), "focal_mm is -1"),
        (lambda: ii.image_plane_mm(focal_mm=1.0, gap_mm=math.inf), "gap_mm is inf"),
        (lambda: ii.image_pixel_mm(z_mm=0.0, gap_mm=1.0, pixel_pitch_mm=1.0, lens_pitch_mm=1.0), "z_mm is 0"),
        (lambda: ii.depth_range_mm(z_mm=math.nan, gap_mm=1.0, pixel_pitch_mm=1.0, lens_pitch_mm=1.0), "z_mm is nan"),
        (lambda: ii.resolution_per_mm(image_pixel_mm=-1.0), "image_pixel_mm is -1"),
        (
            lambda: ii.characteristic_per_mm(resolution_per_mm=1.0, depth_range_mm=1.0, view_angle_deg=180.0),
            "view_angle_deg is 180",
        ),
        (lambda: ii.diffraction_limited_per_mm(wavelength_mm=0.0), "wavelength_mm is 0"),
    ],
)
def test_values_out_of_range_are_named(call, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        call()


FIVE = ("lens_pitch_mm", "gap_mm", "pixel_pitch_mm", "ei_pixels", "view_angle_deg")
SOLVABLE = [
    tuple(n for n in FIVE if n not in (a, b))
    for i, a in enumerate(FIVE)
    for b in FIVE[i + 1 :]
    if {a, b} not in ({"gap_mm", "view_angle_deg"}, {"pixel_pitch_mm", "ei_pixels"})
]


@given(LENGTH, st.floats(1e-4, 10.0), st.floats(1, 1e4), st.sampled_from(SOLVABLE))
def test_solve_round_trip(pixel_pitch, gap_to_pitch, count, names):
    pitch = count * pixel_pitch
    gap = gap_to_pitch * pitch
    truth = dict(
        lens_pitch_mm=pitch, gap_mm=gap, pixel_pitch_mm=pixel_pitch, ei_pixels=count,
        view_angle_deg=math.degrees(2 * math.atan(pitch / (2 * gap))),
    )  # fmt: skip
    found = design.solve(**{name: truth[name] for name in names})
    # The angle near 180° of a short gap holds the gap to 1e-16·δL/Λ·π/2 only.
    assert found == pytest.approx(truth, rel=1e-10)
    assert list(found) == list(FIVE)


def test_solve_setup_3():
    found = design.solve(pixel_pitch_mm=0.0061, ei_pixels=64, gap_mm=0.730748718)
    assert found["lens_pitch_mm"] == pytest.approx(0.3904) and found["view_angle_deg"] == pytest.approx(
        29.9117, abs=1e-4
    )
    assert found["view_angle_deg"] == pytest.approx(preset("setup3").view_angle_deg, rel=ROUNDING)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "under-determined: nothing given, three are needed"),
        ({"gap_mm": 1.0}, "under-determined: gap_mm given"),
        ({"lens_pitch_mm": 1.0, "gap_mm": 1.0}, "under-determined: lens_pitch_mm, gap_mm given"),
        (
            {"lens_pitch_mm": 0.39, "pixel_pitch_mm": 0.0061, "ei_pixels": 64},
            "contradictory: ei_pixels is 64, the others make it 63.9344. δL = U·δP binds lens_pitch_mm, "
            "pixel_pitch_mm, ei_pixels: leave one out and give gap_mm or view_angle_deg",
        ),
        (
            {"lens_pitch_mm": 2.0, "gap_mm": 1.0, "view_angle_deg": 90.0, "ei_pixels": 4},
            "over-determined: the others make view_angle_deg 90 already. tan(α/2) = δL / 2Λ binds lens_pitch_mm, "
            "gap_mm, view_angle_deg: leave one out",
        ),
        ({"lens_pitch_mm": 2.0, "gap_mm": 1.0, "view_angle_deg": 80.0}, "contradictory: view_angle_deg is 80"),
        (
            {"gap_mm": 1.0, "view_angle_deg": 90.0, "pixel_pitch_mm": 0.1, "ei_pixels": 20},
            "over-determined: the others make lens_pitch_mm 2 already. pixels give it",
        ),
        (
            {"gap_mm": 1.0, "view_angle_deg": 90.0, "pixel_pitch_mm": 0.1, "ei_pixels": 10},
            "contradictory: lens_pitch_mm is 1, the others make it 2",
        ),
        (dict.fromkeys(FIVE, 1.0), "contradictory: view_angle_deg is 1"),
        ({"lens_pitch_mm": -1.0, "gap_mm": 1.0, "ei_pixels": 4}, "lens_pitch_mm is -1"),
        ({"lens_pitch_mm": 1.0, "gap_mm": math.nan, "ei_pixels": 4}, "gap_mm is nan"),
        ({"lens_pitch_mm": 1.0, "view_angle_deg": 180.0, "ei_pixels": 4}, "view_angle_deg is 180"),
        ({"lens_pitch_mm": 1e9, "view_angle_deg": 1e-300, "ei_pixels": 4}, "a length from 1e-09 to 1e+09 mm"),
    ],
)  # fmt: skip
def test_solve_refuses_in_one_error(given, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        design.solve(**given)


def crossing(camera, m, n, places=((0.25, 0.5), (0.75, 0.5))):
    """z at which rays of a pixel through two places of the aperture have the same x; inf if they are parallel."""
    (la, da), (lb, db) = (camera.rays_at(m, n, place=place) for place in places)
    slope = da[0] / da[2] - db[0] / db[2]
    if abs(slope) < 1e-12:  # rounding of slopes near 1
        return math.inf
    a, b = la[0] - la[2] * da[0] / da[2], lb[0] - lb[2] * db[0] / db[2]
    return (b - a) / slope


@pytest.mark.parametrize("focal", [1.8, 1.5, 2.5, 2.0])
@pytest.mark.parametrize("front", [None, 30.0, -25.0])
def test_image_planes_are_where_rays_meet(focal, front):
    lens = {"kind": "lenslet", "focal_mm": focal, "aperture_mm": 0.5}
    ahead = () if front is None else ({"kind": "lens", "z_mm": 8.0, "focal_mm": front},)
    camera = lens_camera(optics=(lens, *ahead))
    (plane,) = ii.image_planes(camera)
    # Thin lenses are exact: what is left is rounding, magnified by slopes a hundredth apart.
    assert crossing(camera, 33, 22) == pytest.approx(plane["scene_z_mm"], rel=1e-9)
    if front is None:
        assert plane["scene_z_mm"] == camera.gap_mm + plane["z_mm"]


def test_spherical_lenslets_focus_paraxially():
    errors = []
    for aperture in (0.02, 0.01):
        glass = {"kind": "spherical-lenslet", "radius_mm": 1.2, "ior": 1.5, "aperture_mm": aperture}
        camera = lens_camera(optics=(glass,), pixels=(66, 44), gap_mm=4.0)  # 11 px: one on the axis
        (plane,) = ii.image_planes(camera)
        errors.append(abs(crossing(camera, 33 + 5, 22 + 5) / plane["scene_z_mm"] - 1))
    # Spherical aberration goes with the aperture's square.
    assert errors[0] < 1e-3 and errors[1] == pytest.approx(errors[0] / 4, rel=0.05)


def test_several_focal_lengths_and_none():
    lens = {"kind": "lenslet", "focal_mm": [[1.8, 1.9], [1.8, 2.0]], "aperture_mm": 0.5}
    planes = ii.image_planes(lens_camera(optics=(lens,)))
    assert [plane["focal_mm"] for plane in planes] == [1.8, 1.9, 2.0]
    assert planes[0]["z_mm"] == pytest.approx(18.0) and planes[2]["z_mm"] == math.inf
    flat = {"kind": "spherical-lenslet", "radius_mm": 5.0, "ior": 1.0}
    (plane,) = ii.image_planes(lens_camera(optics=(flat,)))
    assert plane["focal_mm"] == math.inf and plane["z_mm"] < 0
    assert ii.image_planes(preset("pinhole2d")) == []


@pytest.mark.parametrize("name", ["setup1", "setup3", "setup2-128", "grin"])
def test_viewing_zone(name):
    camera = preset(name, scale=4)
    zone = ii.viewing_zone(camera)
    usual = camera.gap_mm - five_viewpoints(camera)["front"][2]
    assert 3 * zone["nearest_mm"] == pytest.approx(usual, rel=ROUNDING)
    # At its edge the outermost lens shows the outermost place of its own image: Λ·(E − L)/r = δL/2.
    for axis in range(2):
        outermost = (camera.lenses[axis] - 1) / 2 * camera.lens_pitch_mm[axis]
        for distance, width in ((zone["nearest_mm"], zone["width_mm"]), (usual, zone["usual_width_mm"])):
            offset = camera.gap_mm * (width[axis] / 2 + outermost) / distance
            assert offset == pytest.approx(camera.lens_pitch_mm[axis] / 2, rel=1e-9)
    assert zone["width_mm"][0] == pytest.approx(camera.lens_pitch_mm[0], rel=1e-6)


def test_viewing_zone_of_a_hexagonal_array_reaches_over_half_a_lens_more():
    camera = lens_camera(lattice="hexagonal")  # 6 lenses of 1 mm across, 6.5 with the odd rows', gap 2 mm
    zone = ii.viewing_zone(camera)
    assert zone["nearest_mm"] == pytest.approx(6.5 * 2)
    assert zone["width_mm"] == pytest.approx([1.0, 6.5 - 3])


def test_viewing_zone_without_parallax_down():
    zone = ii.viewing_zone(preset("hpo"))
    assert zone["width_mm"][1] == math.inf and zone["nearest_mm"] == pytest.approx(512 * 0.182687179)


def test_cells():
    regular = ii.cells(preset("setup1", scale=8))
    assert regular["unowned"] == regular["shared"] == 0 and regular["pixels_per_lens"] == [256, 256]
    # 2.5 px cells: every fifth column and row lies across a border.
    half = ii.cells(IICamera(pixels=(50, 50), lenses=(20, 20), pixel_pitch_mm=1.0, gap_mm=1.0))
    assert half["shared"] == pytest.approx(1 - 0.8**2) and half["unowned"] == 0
    assert half["pixels_per_lens"] == [4, 9]
    # An array of 4×4 lenses of 5 px in the middle of 40×40 px
    small = IICamera(pixels=(40, 40), lenses=(4, 4), pixel_pitch_mm=1.0, gap_mm=1.0, lens_pitch_mm=(5.0, 5.0))
    assert ii.cells(small)["unowned"] == pytest.approx(0.75) and ii.cells(small)["shared"] == 0
    # The f-number of a main lens that fits: its rim's image fills the cell.
    assert ii.cells(preset("plenoptic1"))["rim_image_mm"] == pytest.approx(0.0976, rel=2e-3)
    clear = ii.cells(lens_camera())["aperture_share"]
    assert clear == pytest.approx(math.pi * 0.25**2)


def test_diffraction_against_pixels():
    camera = preset("setup1")
    spot = ii.properties(camera, wavelength_mm=5e-4)["diffraction"]
    assert spot["spot_mm"] == pytest.approx(5e-4 * 0.182687179 / 0.0976) and not spot["limits"]
    fine = replace(camera, pixel_pitch_mm=0.0005, lens_pitch_mm=None)
    assert ii.properties(fine)["diffraction"]["limits"] and "diffraction limits" in design.report(fine)
    assert ii.properties(preset("pinhole2d"))["diffraction"] is None


LARGE = {"hdtv": 5, "hexagonal": 8, "grin-hexagonal-depth-control": 8, "moving-lenslets": 8}  # their quick scales


@pytest.mark.parametrize(
    ("name", "scale"),
    [(name, LARGE.get(name, 1)) for name in sorted(camera_names())]
    + [pytest.param(name, 1, marks=pytest.mark.slow) for name in LARGE],
)
def test_every_camera_has_a_report(name, scale):
    camera = preset_cameras(name, scale=scale)[0]
    text = design.report(camera)
    assert camera.name in text and max(map(len, text.splitlines())) <= 118
    p = ii.properties(camera)
    assert f"{p['view_angle_deg'][0]:.4g}°" in text and f"{p['map_bytes']['exr'] / 1e6:.4g} MB" in text
    assert "nan" not in text
    if p["image_planes"] and p["optics"][0] != "spherical-lenslet":
        assert p["characteristic_per_mm"] == pytest.approx(p["pixels_per_mm"], rel=1e-9)


def test_reports_mention_special_elements():
    assert "No parallax down" in design.report(preset("hpo"))
    assert "Not regular" in design.report(preset("hdtv")) and "under no lens" in design.report(preset("hdtv"))
    assert "40 mm from the lenses" in design.report(preset("resolution-priority"))
    assert "imaged by what stands in front" in design.report(preset("depth-control"))
    assert "just touch" in design.report(preset("plenoptic1"))
    assert "a lone pinhole" in design.report(preset("pinhole2d")) and "One view" in design.report(preset("pinhole2d"))
    single = lens_camera(lenses=(1, 1))
    assert "18 mm from the lenses" in design.report(single) and "One view" in design.report(single)
