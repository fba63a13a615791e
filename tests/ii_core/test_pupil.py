"""Spherical aberration in point-spread functions: Seidel's sum, traced spots, Maréchal's peak, and the wave."""

import math

import numpy as np
import pytest
from scipy.signal import resample

from ii_core import IICamera, IIPicture
from ii_core.camera.optics import SphericalLenslet
from ii_core.waves.spread import FIRST_ZERO, SpreadMaps, _kernel, spread_maps, spread_picture
from ii_core.waves.wave import lens_spread
from tests.support.slow import first_fast

IOR = 1.5


def camera(radius, aperture, gap, *, pitch=1.0, u=5, k=1):
    """Plano-convex lenses of a pitch of 1 mm, with a stop on their flat faces."""
    optics = (SphericalLenslet(radius_mm=radius, ior=IOR, aperture_mm=aperture),)
    return IICamera(pixels=(k * u, u), lenses=(k, 1), pixel_pitch_mm=pitch / u, gap_mm=gap, optics=optics)


def paraxial(radius, thickness, distance, height):
    """Height on the flat face, slope behind it, and Seidel's S_I of both faces (Welford, §8.2)."""
    y, u, total = height, height / distance, 0.0
    for curvature, n, after, step in ((1 / radius, 1.0, IOR, thickness), (0.0, IOR, 1.0, 0.0)):
        invariant = n * (u + y * curvature)
        bent = (n * u - y * curvature * (after - n)) / after
        total -= invariant**2 * y * (bent / after - u / n)
        y, u = y + step * bent, bent
    return y, u, total


def traced(radius, thickness, distance, height):
    """Height on the flat face and slope behind it of an exact ray in the plane of the axis, from the object on."""
    sag = radius - math.sqrt(radius**2 - height**2)
    before, normal = math.atan2(height, distance + sag), math.asin(height / radius)
    inside = math.asin(math.sin(before + normal) / IOR) - normal
    flat = height + (thickness - sag) * math.tan(inside)
    return flat, math.tan(math.asin(IOR * math.sin(inside)))


@pytest.mark.parametrize("distance", [1e12, 40.0, 12.0])
def test_aberration_of_a_slow_lens_is_seidels_sum(distance):
    """At f/16 and in paraxial focus: 16·W₀₄₀·Λ/δL with W₀₄₀ = S_I/8; the fifth order is below 1 %."""
    radius, aperture = 4.0, 0.5
    thickness = radius - math.sqrt(radius**2 - 0.5)
    y, u, _ = paraxial(radius, thickness, distance, 1.0)
    height = aperture / 2 / y  # on the sphere, of the ray through the rim of the stop
    made = camera(radius, aperture, -y / u)
    maps = spread_maps(made, distance + thickness + made.gap_mm)
    w040 = paraxial(radius, thickness, distance, height)[2] / 8
    assert w040 > 0
    assert abs(maps.aberration_mm[2, 2]) == pytest.approx(16 * w040 * made.gap_mm / aperture, rel=0.01)
    assert maps.defocus_mm[2, 2] < 0.02 * abs(maps.aberration_mm[2, 2])


@pytest.mark.parametrize(("gap", "distance"), [(1.7, 1e12), (1.5, 1e12), (2.1, 1e12), (2.2, 12.0), (1.7, 12.0)])
def test_rays_from_the_scene_end_where_the_maps_say(gap, distance):
    """At f/3.4, before, behind and in focus: exact rays from the object, within 2 % of the rim's."""
    radius, aperture = 1.0, 0.6
    thickness = radius - math.sqrt(radius**2 - 0.5)
    flat, slope = np.transpose([traced(radius, thickness, distance, h) for h in np.linspace(1e-4, 0.4, 400)])
    share = np.linspace(0.1, 1, 10)
    hit = np.interp(share * aperture / 2, flat, flat + gap * slope)
    maps = spread_maps(camera(radius, aperture, gap), distance + thickness + gap)
    said = (maps.defocus_mm[2, 2] * share + maps.aberration_mm[2, 2] * share**3) / 2
    np.testing.assert_allclose(said * np.sign(hit[0]), hit, atol=0.02 * abs(hit).max())


def point(maps, side):
    pixels = np.zeros((side, side, 3), np.float32)
    pixels[side // 2, side // 2] = 1
    return spread_picture(IIPicture(pixels, (1, 1), (side, side)), maps).pixels[..., 1]


def alike(side, disk, ring, aberration):
    """The same widths, pixels, for every ray."""
    one = np.ones((side, side), np.float32)
    return SpreadMaps(disk * one, ring * np.ones((side, side, 3), np.float32), 1.0, aberration * one)


@pytest.mark.parametrize(("waves", "share", "spread"), [(0.2, 0.0, 2 / 3), (0.7, -0.5, 1 / 6)])
def test_peak_of_small_aberrations_is_marechals(waves, share, spread):
    """exp(−(2πσ)²), σ = 2W/(3√5) where rays near the axis focus and W/(6√5) in the best focus, by 1 %."""
    ring, side = 8.0, 60  # 9 samples of the pupil from its middle to the rim
    aberration = 16 * waves * ring / FIRST_ZERO
    got, peak = (_kernel(share * a, ring, a, side).max() for a in (aberration, 0.0))
    assert got / peak == pytest.approx(math.exp(-((2 * math.pi * waves * spread) ** 2) / 5), abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("ring", [1e-3, 0.3])
@pytest.mark.parametrize(("disk", "rms"), [(0.0, 1 / 4), (-8.0, 1 / 12)])
def test_spot_of_third_order_has_the_closed_forms_radius(ring, disk, rms):
    """a/4 where rays near the axis focus, a/12 in the best focus d = −2a/3; by rays, and by the wave."""
    aberration, side = 12.0, 61
    light = point(alike(side, disk, ring, aberration), side)
    x = np.arange(side) - side // 2
    radius = np.hypot(*np.meshgrid(x, x))
    light = np.where(radius < 8, light - light[0, 0], 0)  # the squares of far rings' radii have no finite mean
    width = math.sqrt((light * radius**2).sum() / light.sum() - 1 / 3)  # less that of two pixels
    assert width == pytest.approx(rms * aberration, rel=0.04 if ring < 0.1 else 0.2)


@pytest.mark.parametrize(
    ("depth", "waves"), first_fast([(math.inf, 0.5), (16.0, -2.0), (math.inf, 1.0), (16.0, 2.0), (8.0, 1.5)])
)
def test_it_is_the_wave_with_its_aberration(depth, waves):
    """Columns around a point against the angular spectrum: 1 % of the light of a column, as without aberration."""
    width, gap, nm, pixel = 0.1, 1.0, 550.0, 0.004
    w040 = waves * nm * 1e-6
    x, wave = lens_spread(width, gap, nm, depth_mm=depth, spherical_mm=w040, dimensions=2)
    rows, x = resample(wave.sum(axis=0), 8 * len(x), x)
    triangles = np.clip(1 - abs(x - (np.arange(61) - 30)[:, None] * pixel) / pixel, 0, None)
    wanted = triangles @ rows / 8
    widths = width * gap / depth / pixel, FIRST_ZERO * nm * 1e-6 * gap / width / pixel
    # rays of the rim cross first, which counters a focus behind the pixels
    got = point(alike(61, *widths, -16 * w040 * gap / width / pixel), 61).sum(axis=0)
    np.testing.assert_allclose(got, wanted, atol=0.01)


def test_oblique_rays_have_the_curvature_of_the_field():
    """At the border of a lens of f/3.4 the focus has moved; the middle has that of the axis, every lens the same."""
    made = camera(1.0, 0.6, 1.9, u=15, k=3)
    maps = spread_maps(made)
    np.testing.assert_array_equal(maps.defocus_mm[:, :15], maps.defocus_mm[:, 30:])
    assert maps.defocus_mm[0, 0] > maps.defocus_mm[7, 7] + 0.05
    np.testing.assert_allclose(maps.defocus_mm[:, :15], maps.defocus_mm[:, 14::-1], rtol=1e-5, atol=1e-7)


def test_a_focus_that_is_given_makes_the_lens_ideal_and_places_in_the_glass_are_refused():
    made = camera(1.0, 0.6, 1.7)
    assert spread_maps(made, focal_mm=1.7).aberration_mm is None
    with pytest.raises(ValueError, match=r"0\.1 mm from the lens plane: one outside the lens, which is 0\.29"):
        spread_maps(made, 1.8)
