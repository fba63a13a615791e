"""II-cameras: rays, validation, JSON, presets."""

import itertools
import json
import math
import re

import numpy as np
import pytest

from ii_core import IICamera, five_viewpoints, preset, projection_camera
from ii_core.camera.presets import scaled
from ii_core.design.design import report
from ii_core.design.properties import properties

CASES = [("setup1", 8), ("setup1", 64), ("setup2-32", 8), ("setup2-128", 4), ("setup3", 8)]


def pixel_seeing(camera, point, k, l):
    """Fractional column and row, inside the elementary image of lens (k, l), whose ray meets a point.

    Rays of two pixels of that image give the line of all: L + t·D with D affine in the column and row.
    """
    u, v = camera.ei_pixels
    L, D = camera.rays(rows=slice(l * v, l * v + v), cols=slice(k * u, k * u + u))
    per_z = D[..., :2] / D[..., 2:]  # slope of every ray
    wanted = (np.asarray(point[:2]) - L[0, 0, :2]) / (point[2] - L[0, 0, 2])
    column = (wanted[0] - per_z[0, 0, 0]) / (per_z[0, -1, 0] - per_z[0, 0, 0]) * (u - 1)
    row = (wanted[1] - per_z[0, 0, 1]) / (per_z[-1, 0, 1] - per_z[0, 0, 1]) * (v - 1)
    return column, row


@pytest.mark.parametrize(("name", "scale"), CASES)
@pytest.mark.parametrize("z", [15.0, 45.0, 180.0])
def test_disparity_between_neighbouring_lenses(name, scale, z):
    camera = preset(name, scale=scale)
    k, l = camera.lenses[0] // 2, camera.lenses[1] // 2
    point = (0.3, -0.2, z)
    here, right, below = (pixel_seeing(camera, point, *lens) for lens in ((k, l), (k + 1, l), (k, l + 1)))
    expected = camera.gap_mm * camera.lens_pitch_mm[0] / ((z - camera.gap_mm) * camera.pixel_pitch_mm)
    # Through the lens to the right, the point is seen further left of the lens, so by a pixel further right; the
    # lens below sees it higher up, by a pixel further down. A thousandth of a pixel is what coding could ever notice.
    assert right[0] - here[0] == pytest.approx(expected, abs=1e-3)
    assert below[1] - here[1] == pytest.approx(expected, abs=1e-3)
    assert right[1] == pytest.approx(here[1], abs=1e-3)
    assert below[0] == pytest.approx(here[0], abs=1e-3)


def test_hand_made_camera():
    camera = IICamera(pixels=(4, 4), lenses=(2, 2), pixel_pitch_mm=1, gap_mm=3)
    L, D = camera.rays()
    # Lens centres at ±1, y up; pixel centres half a millimetre around them.
    np.testing.assert_array_equal(L[0, 0], [-1, 1, 3])
    np.testing.assert_array_equal(L[0, 3], [1, 1, 3])
    np.testing.assert_array_equal(L[3, 0], [-1, -1, 3])
    np.testing.assert_array_equal(D[0, 0], [0.5, -0.5, 3])  # top left pixel (-1.5, 1.5): looks right and down
    np.testing.assert_array_equal(D[0, 1], [-0.5, -0.5, 3])
    np.testing.assert_array_equal(D[1, 0], [0.5, 0.5, 3])
    np.testing.assert_array_equal(D[3, 3], [-0.5, 0.5, 3])


def test_every_pixel_is_under_its_own_lens():
    camera = preset("setup2-32", scale=32)
    L, D = camera.rays()
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    lenses = L.reshape(l, v, k, u, 3)
    assert (lenses == lenses[:, :1, :, :1]).all()
    half = camera.lens_pitch_mm[0] / 2
    assert (abs(D[..., :2]) < half).all() and (D[..., 2] == camera.gap_mm).all()
    assert (np.diff(L[:, 0, 1]) <= 0).all() and (np.diff(L[0, :, 0]) >= 0).all()  # rows go down, columns right


def test_blocks_are_slices_of_the_whole():
    camera = preset("setup3", scale=16)
    whole = camera.rays()
    for rows, cols in [
        (slice(0, 16), slice(0, 64)),
        (slice(5, 6), slice(250, 256)),
        (slice(None, None, 7), slice(3, 200, 50)),
        (slice(-3, None), slice(None, None, -1)),
        (slice(4, 4), slice(None)),
    ]:
        for block, full in zip(camera.rays(rows, cols), whole, strict=True):
            np.testing.assert_array_equal(block, full[rows, cols])
    for block, full in zip(camera.rays_at([3, 100], [200, 7]), whole, strict=True):
        np.testing.assert_array_equal(block, full[[200, 7], [3, 100]])


def test_samples_on_the_corner_stay_under_their_own_lens():
    camera = preset("setup1", scale=64)
    L, centre = camera.rays()
    half = camera.pixel_pitch_mm / 2
    for sample, step in [((0, 0), (half, -half)), ((1, 1), (-half, half)), ((0.5, 0), (0, -half))]:
        corner, D = camera.rays(sample=sample)
        np.testing.assert_array_equal(corner, L)
        # Coordinates of tens of mm in float64: 1e-12 mm is a few hundred roundings.
        np.testing.assert_allclose(D[..., 0] - centre[..., 0], step[0], atol=1e-12)
        np.testing.assert_allclose(D[..., 1] - centre[..., 1], step[1], atol=1e-12)


def test_a_sample_for_every_pixel():
    camera = preset("setup3", scale=64)
    sample = np.random.default_rng(0).random((*camera.pixels[::-1], 2))
    _, D = camera.rays(sample=sample)
    for m, n in [(0, 0), (17, 3), (63, 63)]:
        _, one = camera.rays(slice(n, n + 1), slice(m, m + 1), sample[n, m])
        np.testing.assert_array_equal(D[n, m], one[0, 0])


@pytest.mark.parametrize("sample", [(-0.1, 0), (0, 1.01), (math.nan, 0), (0.5,), 0.5])
def test_samples_outside_the_pixel_are_refused(sample):
    with pytest.raises(ValueError, match="must hold positions"):
        preset("setup3", scale=64).rays(sample=sample)


@pytest.mark.parametrize(
    ("name", "pixels", "lenses", "ei"),
    [
        ("setup1", (8192, 4096), (512, 256), (16, 16)),
        ("setup2", (8192, 4096), (512, 256), (16, 16)),
        ("setup2-16", (8192, 4096), (512, 256), (16, 16)),
        ("setup2-32", (8192, 4096), (256, 128), (32, 32)),
        ("setup2-64", (8192, 4096), (128, 64), (64, 64)),
        ("setup2-128", (8192, 4096), (64, 32), (128, 128)),
        ("setup2-256", (8192, 4096), (32, 16), (256, 256)),
        ("setup3", (4096, 4096), (64, 64), (64, 64)),
        ("pinhole2d", (8192, 4608), (1, 1), (8192, 4608)),
    ],
)
def test_presets_are_those_of_the_dissertation(name, pixels, lenses, ei):
    camera = preset(name)
    assert (camera.pixels, camera.lenses, camera.ei_pixels) == (pixels, lenses, ei)
    assert camera.pixel_pitch_mm == 0.0061
    assert camera.view_angle_deg == pytest.approx(29.9, abs=0.05)  # given to a tenth of a degree


def test_setup3_lenslet():
    camera = preset("setup3")
    assert camera.gap_mm == pytest.approx(0.73, abs=0.005)  # f and pitch are given to 10 µm
    assert camera.lens_pitch_mm == pytest.approx((0.39, 0.39), abs=0.005)


@pytest.mark.parametrize(
    "name", ("setup1", "setup2-16", "setup2-32", "setup2-64", "setup2-128", "setup2-256", "setup3", "pinhole2d")
)
@pytest.mark.parametrize("scale", [2, 4, 16])
def test_scale_keeps_what_a_scene_sees(name, scale):
    full, scaled = preset(name), preset(name, scale=scale)
    # one product and one quotient apart
    assert scaled.size_mm == pytest.approx(full.size_mm, rel=1e-14)
    assert scaled.view_angle_deg == pytest.approx(full.view_angle_deg, rel=1e-14)
    if name == "pinhole2d":
        assert scaled.pixels == (8192 // scale, 4608 // scale)
        assert scaled.gap_mm == pytest.approx(full.gap_mm, rel=1e-14)
    else:
        assert scaled.ei_pixels == full.ei_pixels
        assert scaled.lenses == (full.lenses[0] // scale, full.lenses[1] // scale)
        assert scaled.gap_mm == pytest.approx(full.gap_mm * scale, rel=1e-14)


def test_preset_refusals():
    with pytest.raises(
        ValueError, match=r"unknown camera 'setup9': known are .*pinhole2d, .*setup1, .*setup3, .*setup2"
    ):
        preset("setup9")
    for scale in (3, 0, -1, 512, 1.5):
        with pytest.raises(ValueError, match=rf"setup1: scale {scale} does not divide the 512×256 lenses"):
            preset("setup1", scale=scale)


@pytest.mark.parametrize(("lenses", "fitting"), [((12, 6), "1, 2, 3, 6"), ((7, 5), "1"), ((32, 18), "1, 2")])
def test_a_refused_scale_names_the_scales_that_fit(lenses, fitting):
    camera = IICamera(
        pixels=(lenses[0] * 6, lenses[1] * 6), lenses=lenses, pixel_pitch_mm=0.1, gap_mm=1.0, name="mine"
    )
    with pytest.raises(ValueError, match=rf"one of {fitting} is needed"):
        scaled(camera, 8)
    for scale in map(int, fitting.split(", ")):
        scaled(camera, scale)


GOOD = {"pixels": (8, 6), "lenses": (2, 3), "pixel_pitch_mm": 0.1, "gap_mm": 1.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pixel_pitch_mm": math.nan}, "pixel_pitch_mm is nan"),
        ({"pixel_pitch_mm": 0}, "pixel_pitch_mm is 0"),
        ({"gap_mm": -1}, "gap_mm is -1"),
        ({"gap_mm": math.inf}, "gap_mm is inf"),
        ({"lens_pitch_mm": 0}, "lens_pitch_mm is 0"),
        ({"lattice": "square"}, "unknown lattice 'square': known are rectangular, hexagonal"),
        ({"optics": ["prism"]}, "unknown optical element 'prism': known are pinhole"),
        ({"optics": ["pinhole", "grin"]}, "grin is a lens model: it must be the first"),
        ({"origin_mm": (0, 0)}, "origin_mm is"),
        ({"lenses": (0, 1)}, "lenses is 0×1: two whole numbers of at least 1"),
        ({"pixels": (8.5, 6)}, "pixels is 8.5×6"),
        ({"pixels": 8}, "pixels is 8: two whole numbers"),
        ({"pixels": (8, math.nan)}, "pixels is"),
    ],
)
def test_camera_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        IICamera(**{**GOOD, **change})


def test_json_round_trip():
    camera = preset("setup1", scale=8)
    assert IICamera.from_json(json.loads(json.dumps(camera.to_json()))) == camera


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "fisheye"}, "no camera"),
        ({"colour": 1}, "no such key colour"),
        ({"gap_mm": 0}, "gap_mm is 0"),
        ({"gap_mm": None}, "wrong type"),
        ({"pixels": 5}, "pixels is 5"),
        ({"lenses": ["two", 2]}, "lenses is"),
    ],
)
def test_broken_json(change, message):
    with pytest.raises(ValueError, match=message):
        IICamera.from_json({**preset("setup3", scale=64).to_json(), **change})


def test_json_that_is_no_object_or_lacks_a_key():
    for data in (None, [], {"kind": "lenslet-array"}):
        with pytest.raises(ValueError, match=r"no camera|gap_mm, lenses, pixel_pitch_mm, pixels missing"):
            IICamera.from_json(data)


@pytest.mark.parametrize("name", ["setup1", "plenoptic", "hpo", "grin", "depth-control", "resolution-priority"])
def test_separable_rays_are_the_rays_to_the_bit(name):
    camera, block = preset(name), (slice(300, 341), slice(501, 577))
    x, y, z = camera.separable_rays(*block)
    for part, wanted in enumerate(camera.rays(*block)):
        found = np.broadcast_arrays(x[None, :, part], y[:, None, part], z[part])
        np.testing.assert_array_equal(np.stack(found, axis=-1), wanted)


@pytest.mark.parametrize("name", ["hexagonal", "spherical", "plenoptic1", "multi-focus"])
def test_rays_that_mix_rows_and_columns_are_not_separable(name):
    assert preset(name).separable_rays(slice(3, 40), slice(5, 77)) is None


LENGTHS = ("pixel_pitch_mm", "gap_mm", "lens_pitch_mm", "radius_mm", "aperture_mm", "focal_mm")


@pytest.mark.parametrize("value", [0, -1, 1e-300, 9e-10, 1.1e9, 1e300, math.inf, math.nan])
@pytest.mark.parametrize("name", LENGTHS)
def test_lengths_have_bounds(name, value):
    """On b1dc540 a camera of 1e-300 mm was valid, and its views and properties divided by zero."""
    optics = {
        "radius_mm": {"kind": "spherical-lenslet", "radius_mm": value, "ior": 1.5},
        "aperture_mm": {"kind": "lenslet", "focal_mm": 1, "aperture_mm": value},
        "focal_mm": {"kind": "lens", "z_mm": 9, "focal_mm": value},
    }
    if (name, value) in {("aperture_mm", 0), ("focal_mm", -1)}:  # a pinhole, a diverging lens
        return
    change = {"optics": [optics[name]]} if name in optics else {name: value}
    said = f"{name} is {abs(value) if name == 'focal_mm' else value:g}: a length from 1e-09 to 1e+09 mm is needed"
    with pytest.raises(ValueError, match=re.escape(said)):
        IICamera(**{**GOOD, **change})


@pytest.mark.parametrize("name", ["lens_offset_mm", "origin_mm"])
def test_places_have_bounds(name):
    count = 2 if name == "lens_offset_mm" else 3
    for value in (1.1e9, -1e300, math.nan):
        with pytest.raises(ValueError, match=f"{name} is .*: {count} numbers from -1e.09 to 1e.09 mm are needed"):
            IICamera(**{**GOOD, name: (value,) + (0,) * (count - 1)})


@pytest.mark.slow
@pytest.mark.parametrize("lenses", [(4, 3), (1, 1)])
def test_lengths_within_their_bounds_give_finite_rays_and_reports(lenses):
    """Quotients of extreme lengths are finite, or refused by name."""
    lengths, made = (1e-9, 1.0, 1e9), 0
    for pixel, gap, pitch in itertools.product(lengths, lengths, (None, *lengths)):
        fields = dict(pixels=(8, 6), lenses=lenses, pixel_pitch_mm=pixel, gap_mm=gap, lens_pitch_mm=pitch)
        try:
            camera = IICamera(**fields)
        except ValueError as error:
            assert "lens_pitch_mm is" in str(error)
            continue
        made += 1
        assert all(np.isfinite(part).all() for part in camera.rays())
        assert np.isfinite([*five_viewpoints(camera).values()]).all()
        camera.to_json()
        for call in (properties, report, lambda camera: projection_camera(camera, 10)):
            try:
                call(camera)
            except ValueError as error:
                assert "_mm is" in str(error) or "view_angle_deg is 180" in str(error)
    assert made > 20
