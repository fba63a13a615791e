"""Every optical element against closed form, ray by ray and in pictures."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from ii_core import IICamera, camera_names, depth_of_disparity, disparity_of_depth, orthoscopic, preset, view_image
from ii_core.camera.optics import (
    Bundle,
    Grin,
    Lens,
    Lenslet,
    Lenticular,
    Pinhole,
    SphericalLenslet,
    Under,
    chain,
    unit_disk,
)
from ii_core.camera.optics import element as element_of
from ii_core.camera.presets import preset_cameras, scaled
from ii_core.camera.surfaces import surfaces_of
from ii_core.picture.view import view_positions
from raytrace_ii import Background, Scene, render
from raytrace_ii.shapes.primitives import Mesh
from tests.support.trace_scenes import WHITE, body, ramp, wall

GAP = 0.75
# Rays of millimetres in float64, a few operations each: 1e-12 is thousands of roundings.
ROUNDING = 1e-12


def disk(n=41):
    """Places all over the unit disk, its rim among them."""
    angle, radius = np.linspace(0, 40, n), np.sqrt(np.linspace(0, 1, n))
    return radius * np.cos(angle), radius * np.sin(angle)


def under(px=0.1, py=-0.05, ax=0.0, ay=0.0, *, gap=GAP, cell=(0.4, 0.4), k=0, l=0, hexagonal=False):
    """Points of pixels under a lens on the axis."""
    as_array = [np.asarray(x, float) for x in (px, py, ax, ay)]
    px, py, ax, ay = as_array
    return Under(
        px=px, py=py, cx=np.float64(0), cy=np.float64(0), k=np.asarray(k), l=np.asarray(l), ax=ax, ay=ay, gap=gap,
        cell=cell, hexagonal=hexagonal,
    )  # fmt: skip


def columns(bundle):
    """L and D of a bundle, (n, 3)."""
    six = np.broadcast_arrays(*bundle[:6])
    return np.stack(six[:3], axis=-1), np.stack(six[3:], axis=-1)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def at_depth(L, D, z):
    """Where rays meet a plane."""
    return L[..., :2] + D[..., :2] / D[..., 2:] * (z - L[..., 2:])


# -- the thin lens


@pytest.mark.parametrize("focal", [0.5, 0.7, 0.74, 0.76, 0.9, 3.0])
def test_thin_lens_images_a_pixel_at_one_point(focal):
    u = under(0.12, -0.07, *disk())
    L, D = columns(Lenslet(focal_mm=focal, aperture_mm=0.3).leave(u))
    image = focal * GAP / (GAP - focal)  # from the lens plane (2.3); behind it if negative
    points = at_depth(L, D, GAP + image)
    # On the line from the pixel through the lens centre, (0, 0, Λ).
    expected = -np.array([0.12, -0.07]) * image / GAP
    np.testing.assert_allclose(points, np.broadcast_to(expected, points.shape), atol=ROUNDING * (1 + abs(image)))
    np.testing.assert_allclose(np.hypot(L[:, 0], L[:, 1]).max(), 0.15, rtol=ROUNDING)  # the aperture's rim
    assert (L[:, 2] == GAP).all()


def test_gap_of_the_focal_length_makes_parallel_rays():
    _, D = columns(Lenslet(focal_mm=GAP, aperture_mm=0.3).leave(under(0.12, -0.07, *disk())))
    np.testing.assert_allclose(unit(D), np.broadcast_to(unit(D[:1]), D.shape), atol=1e-15)
    np.testing.assert_allclose(D[0] / D[0, 2] * GAP, [-0.12, 0.07, GAP], rtol=1e-15)


@pytest.mark.parametrize("side", [-1, 1])
def test_rays_are_continuous_at_a_gap_of_the_focal_length(side):
    u = under(0.12, -0.07, *disk())
    _, parallel = columns(Lenslet(focal_mm=GAP, aperture_mm=0.3).leave(u))
    for off in (1e-1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15):
        _, D = columns(Lenslet(focal_mm=GAP * (1 + side * off), aperture_mm=0.3).leave(u))
        assert np.isfinite(D).all()
        # x' = (a − p)/Λ − a/f: away from Λ = f slopes change by a·(1/Λ − 1/f), at most the aperture's radius times
        # the relative step over f; 1.2 for 1/(1 − 0.1), and one rounding.
        assert abs(D / GAP - parallel / GAP).max() <= 1.2 * 0.15 / GAP * off + 1e-15


def test_aperture_zero_is_the_pinhole():
    camera = preset("setup1", scale=64)
    pinhole = camera.rays(slice(0, 40), slice(0, 40))
    for aperture in (None, 0, 0.0):
        lens = replace(camera, optics=(Lenslet(focal_mm=5, aperture_mm=aperture),))
        for place in ((0.5, 0.5), (0.9, 0.1)):
            for got, expected in zip(lens.rays(slice(0, 40), slice(0, 40), place=place), pinhole, strict=True):
                np.testing.assert_array_equal(got, expected)


def test_focal_lengths_repeat_over_rows_and_columns_of_lenses():
    focal = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    camera = IICamera(
        pixels=(21, 10), lenses=(7, 5), pixel_pitch_mm=0.1, gap_mm=1.5,
        optics=(Lenslet(focal_mm=focal, aperture_mm=0.2),),
    )  # fmt: skip
    _, D = camera.rays(place=(1.0, 0.5))  # the rim to the right: a = 0.1
    _, centre = camera.rays()
    change = (D[..., 0] - centre[..., 0]) / camera.gap_mm  # a/Λ − a/f
    found = 0.1 / (0.1 / 1.5 - change)
    expected = [[focal[n // 2 % 2][m // 3 % 3] for m in range(21)] for n in range(10)]
    np.testing.assert_allclose(found, expected, rtol=ROUNDING)


def test_place_on_the_aperture_is_even_over_the_disk():
    grid = (np.arange(400) + 0.5) / 400
    x, y = unit_disk(np.stack(np.meshgrid(grid, grid), axis=-1))
    r2 = x * x + y * y
    assert r2.max() <= 1
    # Moments of the even disk: ⟨x⟩ = 0, ⟨x²⟩ = ⟨y²⟩ = 1/4, ⟨xy⟩ = 0, ⟨r⁴⟩ = 1/3, ⟨r⁶⟩ = 1/4. Midpoints of 400 cells
    # are off by h²/24 times the second derivative, h = 1/200 across the disk, which is at most 30 here.
    for value, expected in (
        (x, 0), (y, 0), (x * x, 1 / 4), (y * y, 1 / 4), (x * y, 0), (r2**2, 1 / 3), (r2**3, 1 / 4),
    ):  # fmt: skip
        assert value.mean() == pytest.approx(expected, abs=3e-5)
    # Evenly in every ring and sector: equal areas hold equal shares of 160 000 places, up to the cells they cut.
    share = np.histogram2d(r2.ravel(), np.arctan2(y, x).ravel(), [4, 8], [[0, 1], [-np.pi, np.pi]])[0] / x.size
    np.testing.assert_allclose(share, 1 / 32, rtol=0.02)
    assert [float(c) for c in unit_disk(np.array([0.5, 0.5]))] == [0, 0]


# -- the lens in front


@pytest.mark.parametrize("focal", [25.0, 8.0, -12.0])
@pytest.mark.parametrize("distance", [5.0, 24.0, 60.0])
def test_front_lens_images_points(focal, distance):
    lens = Lens(z_mm=70.0, focal_mm=focal)
    source = np.array([3.0, -2.0, 70.0 - distance])
    x, y = (20 * c for c in disk())
    rays = Bundle(*source, x - source[0], y - source[1], np.float64(distance))
    L, D = columns(lens.pass_on(rays))
    image = 1 / (1 / focal - 1 / distance)  # 1/a + 1/b = 1/f
    points = at_depth(L, D, 70.0 + image)
    expected = -source[:2] * image / distance
    # Distances up to 600 mm: rounding relative to them.
    np.testing.assert_allclose(points, np.broadcast_to(expected, points.shape), atol=ROUNDING * (20 + abs(image)))
    assert (L[:, 2] == 70).all()


def test_front_lens_leaves_central_rays_alone():
    lens = Lens(z_mm=40.0, focal_mm=25.0, diameter_mm=1e-3)
    rays = Bundle(*(np.array([v]) for v in (3.0, -1.5, 10.0, -1.0, 0.5, 10.0)))
    L, D = columns(lens.pass_on(rays))
    np.testing.assert_allclose(L, [[0, 0, 40]], atol=ROUNDING)
    np.testing.assert_allclose(D, [[-1, 0.5, 10]], atol=ROUNDING)


def test_front_lens_blocks_beside_its_rim_and_what_never_reaches_it():
    lens = Lens(z_mm=10.0, focal_mm=25.0, diameter_mm=4.0)
    x = np.array([0.0, 1.999, 2.0, 2.001, 0.0, 0.0, 0.0, 0.0])
    dz = np.array([1, 1, 1, 1, 0, -1, 1, 1e-300])
    z = np.array([0.0, 0, 0, 0, 0, 0, 10.5, 0])
    one = np.ones(8)
    out = lens.pass_on(Bundle(x, 0 * x, z, 0 * x, 0 * x, dz, 0.5 * one))
    np.testing.assert_array_equal(out.weight, [0.5, 0.5, 0.5, 0, 0, 0, 0, 0.5])
    assert all(np.isfinite(a).all() for a in out)
    assert lens.pass_on(Bundle(x[:2], x[:2] * 0, z[:2], 0 * x[:2], 0 * x[:2], dz[:2])).weight is None
    # What was blocked before stays so.
    out = lens.pass_on(Bundle(x, 0 * x, z, 0 * x, 0 * x, one, 0 * one))
    assert not out.weight.any()
    # A sideways ray is blocked whatever its slope.
    out = lens.pass_on(Bundle(x, x, z, one, -one, 0 * one))
    assert not out.weight.any() and all(np.isfinite(a).all() for a in out)


def test_two_lenses_are_the_product_of_their_matrices():
    first, second = Lens(z_mm=20.0, focal_mm=15.0), Lens(z_mm=32.0, focal_mm=-40.0)
    generator = np.random.default_rng(0)
    x, y, u, v = generator.uniform(-1, 1, (4, 50))
    rays = Bundle(x, y, np.zeros(50), 2 * u, 2 * v, np.full(50, 2.0))
    L, D = columns(second.pass_on(first.pass_on(rays)))

    def walk(d):
        return np.array([[1, d], [0, 1]])

    def bend(f):
        return np.array([[1, 0], [-1 / f, 1]])

    matrix = bend(-40.0) @ walk(12.0) @ bend(15.0) @ walk(20.0)
    for axis, (height, slope) in enumerate(((x, u), (y, v))):
        expected = matrix @ np.stack([height, slope])
        np.testing.assert_allclose(L[:, axis], expected[0], atol=100 * ROUNDING)  # heights of tens of mm
        np.testing.assert_allclose(D[:, axis] / D[:, 2], expected[1], atol=ROUNDING)


# -- gradient-index rods


def binary(optics=()):
    """A camera whose every coordinate is exact in binary: mirror images are the same numbers."""
    return IICamera(pixels=(64, 32), lenses=(8, 4), pixel_pitch_mm=0.125, gap_mm=2.0, optics=optics)


def turned(array, camera):
    """Every elementary image rotated by 180°."""
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    field = array.reshape(l, v, k, u, *array.shape[2:])
    return field[:, ::-1, :, ::-1].reshape(array.shape)


def stripes(z=20.0, half=30.0):
    """Return a plane with colours that vary in x and y, and a bar before it."""
    plane = wall(z, half)
    bar = wall(z * 0.7, 1.0)
    return Scene(
        bodies=[ramp(plane, half), body(bar, name="bar", at=(1, 0.5, 0), colour=(0.9, 0.1, 0.2))],
        ambient=WHITE, background=Background(),
    )  # fmt: skip


def test_gradient_index_is_the_plain_array_with_each_image_turned():
    plain, grin = binary(), binary((Grin(),))
    for got, expected in zip(grin.rays(), plain.rays(), strict=True):
        np.testing.assert_array_equal(got, turned(expected, plain))
    scene = stripes()
    picture, expected = render(scene, grin).picture, render(scene, plain).picture
    assert grin.erect and picture.erect and not plain.erect
    np.testing.assert_array_equal(picture.pixels, orthoscopic(expected).pixels)
    assert len(np.unique(picture.pixels)) > 30
    for viewpoint in ((0, 0, -40.0), (3.0, -2.0, -25.0)):
        for one, other in zip(view_image(picture, viewpoint), view_image(expected, viewpoint), strict=True):
            # The viewer looks through the same pixels of either picture; weights of 1/2 may round to either side.
            assert abs(one.astype(int) - other.astype(int)).max() <= 1


def test_gradient_index_of_a_preset_is_the_plain_array_turned():
    plain, grin = preset("setup1", scale=32), preset("grin", scale=32)
    for got, expected in zip(grin.rays(), plain.rays(), strict=True):
        np.testing.assert_allclose(got, turned(expected, plain), atol=ROUNDING)


# -- horizontal parallax only


def test_lenticular_rays_have_no_vertical_part():
    camera = preset("hpo", scale=32)
    for sample in ((0.5, 0.5), (0.1, 0.8)):
        L, D = camera.rays(slice(0, 128), slice(0, 256), sample)
        assert (D[..., 1] == 0).all()
        y = camera.size_mm[1] / 2 - (np.arange(128) + sample[1]) * camera.pixel_pitch_mm
        np.testing.assert_array_equal(L[..., 1], np.broadcast_to(y[:, None], (128, 256)))
        plain, expected = preset("setup1", scale=32).rays(slice(0, 128), slice(0, 256), sample)
        np.testing.assert_array_equal(D[..., 0], expected[..., 0])
        np.testing.assert_array_equal(L[..., 0], plain[..., 0])


def test_views_of_lenticulars_do_not_change_with_height():
    camera = IICamera(
        pixels=(64, 24), lenses=(8, 24), pixel_pitch_mm=0.125, gap_mm=2.0, optics=(Lenticular(),), name="hpo"
    )
    picture = render(stripes(), camera).picture
    here = view_image(picture, (2.0, 0.0, -40.0))
    for height in (-30.0, 5.0, 400.0):
        for one, other in zip(view_image(picture, (2.0, height, -40.0)), here, strict=True):
            np.testing.assert_array_equal(one, other)
        for one, other in zip(
            view_positions(camera, (2.0, height, -40.0)), view_positions(camera, (2.0, 0, -40.0)), strict=True
        ):
            np.testing.assert_array_equal(one, other)
    assert here[1].all()
    sideways, _ = view_image(picture, (-4.0, 0.0, -40.0))
    assert (sideways != here[0]).any()
    # Through row l a viewer sees row l of pixels.
    np.testing.assert_array_equal(view_positions(camera, (2.0, 7.0, -40.0))[1], np.arange(24))


# -- spherical lenslets


def glass_rays(lens, u):
    """L and D of a lenslet, and by its own geometry the rays before and in the glass and the sphere's normal."""
    bundle = lens.leave(u)
    L, D = columns(bundle)
    ax, ay = (lens.aperture_mm or 0) / 2 * u.ax, (lens.aperture_mm or 0) / 2 * u.ay
    entry = np.stack(np.broadcast_arrays(ax, ay, u.gap), axis=-1) + 0 * L
    pixel = np.stack(np.broadcast_arrays(u.px, u.py, 0.0), axis=-1) + 0 * L
    centre = np.array([0, 0, u.gap + lens.thickness(u.cell) - lens.radius_mm])
    return L, D, unit(entry - pixel), unit(L - entry), L - centre, bundle.weight > 0


def test_spherical_lenslet_obeys_snell_at_both_faces():
    lens = SphericalLenslet(radius_mm=0.4, ior=1.62, aperture_mm=0.38)
    place = disk(400)
    generator = np.random.default_rng(1)
    u = under(*generator.uniform(-0.2, 0.2, (2, 400)), *place)
    L, D, before, within, normal, through = glass_rays(lens, u)
    assert through.sum() > 150 and not through.all()
    L, before, within, normal, D = (a[through] for a in (L, before, within, normal, unit(D)))
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 0.4, rtol=ROUNDING)  # it leaves from the sphere
    flat, normal = np.array([0, 0, 1.0]), normal / 0.4
    # n1·(d1 × N) = n2·(d2 × N): Snell's sines and the common plane in one. 1e-11: L − entry is a short difference.
    np.testing.assert_allclose(np.cross(before, flat), 1.62 * np.cross(within, flat), atol=1e-11)
    np.testing.assert_allclose(1.62 * np.cross(within, normal), np.cross(D, normal), atol=1e-11)
    assert (np.einsum("ij,ij->i", D, normal) > 0).all() and (D[:, 2] > 0).all()
    # L is a height profile: the sphere over the flat face.
    thickness = 0.4 - math.sqrt(0.16 - 0.08)
    height = thickness - 0.4 + np.sqrt(0.16 - L[:, 0] ** 2 - L[:, 1] ** 2)
    np.testing.assert_allclose(L[:, 2] - GAP, height, atol=ROUNDING)
    assert np.ptp(height) > 0.03


def test_spherical_lenslet_conserves_the_optical_invariant():
    lens = SphericalLenslet(radius_mm=0.4, ior=1.5, aperture_mm=2.0)
    step = 1e-4
    generator = np.random.default_rng(2)
    for px, py, ax, ay in generator.uniform(-0.08, 0.08, (20, 4)):
        # The four coordinates of a ray, each half a step either way.
        start = np.array([px, py, ax, ay]) + step / 2 * np.concatenate([np.eye(4), -np.eye(4)])
        L, D, before, *_, through = glass_rays(lens, under(*start.T))
        assert through.all()
        at_pixels = np.column_stack([start[:, :2], before[:, :2]])
        after = np.column_stack([at_depth(L, D, 5.0), unit(D)[:, :2]])
        jacobian = [(rays[:4] - rays[4:]) / step for rays in (at_pixels, after)]
        ratio = np.linalg.det(jacobian[1]) / np.linalg.det(jacobian[0])
        # Dx·Dy·d(cos)·d(cos) is kept. Central differences of 1e-4 over lengths of 0.1–0.4 mm are off by their square,
        # about 1e-6 times the third derivatives.
        assert ratio == pytest.approx(1, abs=2e-5)


def test_spherical_lenslet_tends_to_the_thin_lens():
    radius, ior = 1.0, 1.5
    focal = radius / (ior - 1)
    px, py = (c * 0.45 for c in disk(25))
    place = [c[::-1] * 0.9 for c in disk(25)]
    errors, pitches = [], [0.4 / 2**i for i in range(6)]
    for pitch in pitches:
        u = under(px * pitch, py * pitch, *place, gap=focal, cell=(pitch, pitch))
        _, thin = columns(Lenslet(focal_mm=focal, aperture_mm=pitch).leave(u))
        bundle = SphericalLenslet(radius_mm=radius, ior=ior, aperture_mm=pitch).leave(u)
        assert (bundle.weight == 1).mean() > 0.9
        _, exact = columns(bundle)
        slope = exact[:, :2] / exact[:, 2:] - thin[:, :2] / thin[:, 2:]
        errors.append(np.linalg.norm(slope, axis=-1).max() / pitch)
    # Slopes grow with the pitch h. By symmetry what is left out is odd in h: aberrations go with h³, and so does the
    # glass, whose thickness h²/4R shifts rays of slope h. Relative to the slope: order 2.
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.polyfit(np.log(pitches[1:]), np.log(errors[1:]), 1)[0] == pytest.approx(2, abs=0.01)
    assert order[-1] == pytest.approx(2, abs=1e-3)
    assert errors[-1] < 1e-4


def test_total_reflection_in_a_lenslet_blocks_the_ray():
    lens = SphericalLenslet(radius_mm=0.3, ior=1.8, aperture_mm=0.38)
    generator = np.random.default_rng(3)
    u = under(*generator.uniform(-0.3, 0.3, (2, 2000)), *unit_disk(generator.random((2000, 2))))
    L, D, _, within, normal, through = glass_rays(lens, u)
    cosine = np.einsum("ij,ij->i", within, normal / 0.3)
    total = 1.8 * np.sqrt(1 - cosine**2) > 1
    inside = (abs(L[:, :2]) < 0.2).all(axis=1) & (L[:, 2] > GAP)
    np.testing.assert_array_equal(through, inside & ~total)
    assert (inside & total).sum() > 20 and through.sum() > 200 and (~inside).sum() > 20
    assert np.isfinite(L).all() and np.isfinite(D).all()


def test_rays_that_enter_beside_their_lenslet_are_blocked():
    wide = SphericalLenslet(radius_mm=0.3, ior=1.5, aperture_mm=4.0)
    bundle = wide.leave(under(0.0, 0.0, *disk(200)))
    L, D = columns(bundle)
    assert np.isfinite(L).all() and np.isfinite(D).all()
    x, y = (2 * c for c in disk(200))
    assert not bundle.weight[(abs(x) > 0.2) | (abs(y) > 0.2)].any()
    assert bundle.weight[0] == 1
    # Also one that, slanting, leaves the glass over its own cell: it came through the neighbour's flat face.
    flatter = replace(wide, radius_mm=0.6)
    bundle = flatter.leave(under(np.array([0.5, 0.5]), 0.0, np.array([0.205, 0.195]) / 2, 0.0))
    assert (abs(bundle.lx) < 0.2).all() and bundle.weight.tolist() == [0, 1]


def test_hexagonal_lenslets_own_the_nearest_points():
    lens = SphericalLenslet(radius_mm=0.4, ior=1.5, aperture_mm=0.6)
    for ratio in (0.3, math.sqrt(3) / 2, 2.0):
        cell = (0.4, 0.4 * ratio)
        u = under(0.0, 0.0, hexagonal=True, cell=cell)
        x, y = np.random.default_rng(4).uniform(-0.5, 0.5, (2, 3000))
        centres = np.array([[(i + j % 2 / 2) * cell[0], j * cell[1]] for i in range(-4, 5) for j in range(-6, 7)])
        distance = np.hypot(x[:, None] - centres[:, 0], y[:, None] - centres[:, 1]).min(axis=1)
        np.testing.assert_array_equal(u.owns(x, y), distance >= np.hypot(x, y))
    # The corner above the centre, a ninth of a row pitch beyond the middle between rows, is the lens's own.
    corner = under(0.0, 0.0, ax=0.0, ay=0.18 / 0.3, hexagonal=True, cell=(0.4, 0.4 * math.sqrt(3) / 2), gap=2.0)
    assert lens.leave(corner).weight == 1
    assert lens.leave(corner._replace(hexagonal=False)).weight == 0


def test_a_sphere_too_small_for_its_cell_is_refused():
    lens = SphericalLenslet(radius_mm=0.5, ior=1.5)
    with pytest.raises(ValueError, match=r"radius_mm is 0\.5: at least half the cell's diagonal, 0\.707107"):
        IICamera(pixels=(4, 4), lenses=(2, 2), pixel_pitch_mm=0.5, gap_mm=1, optics=(lens,))
    exact = SphericalLenslet(radius_mm=math.hypot(1, 1) / 2, ior=1.5)  # a half sphere over the corners
    camera = IICamera(pixels=(4, 4), lenses=(2, 2), pixel_pitch_mm=0.5, gap_mm=1, optics=(exact,))
    assert all(np.isfinite(a).all() for a in camera.rays())


# -- sets of cameras, and scale


def test_stacked_sensors_share_their_lens_plane():
    for scale in (1, 8):
        cameras = preset_cameras("stacked-sensors", scale=scale)
        planes = [camera.rays_at(0, 0)[0][2] for camera in cameras]
        np.testing.assert_allclose(planes, planes[0], rtol=1e-15)
        gaps = [camera.gap_mm for camera in cameras]
        assert len(set(gaps)) == 3
        # Each focuses elsewhere by (2.3), one lens array for all of them at full size.
        # On b1dc540 two of the three lay behind it, at −3.4 and −1.5 mm; that they differed did not show this.
        images = [f * g / (g - f) for g, f in ((c.gap_mm, c.lens_model.focal_mm) for c in cameras)]
        np.testing.assert_allclose(np.array(images) + planes[0], np.array([15, 40, 120]) + 0.184088454, rtol=1e-5)


@pytest.mark.slow
def test_moving_lenslets_interleave_evenly():
    cameras = preset_cameras("moving-lenslets", scale=16)
    L = np.concatenate([camera.rays()[0].reshape(-1, 3) for camera in cameras])
    pitch = cameras[0].lens_pitch_mm[0]
    for axis in (0, 1):
        places = np.unique(np.round(L[:, axis], 9))
        assert len(places) == 2 * cameras[0].lenses[axis]
        np.testing.assert_allclose(np.diff(places), pitch / 2, atol=1e-8)  # rounded to 1e-9 above
    pairs = np.unique(np.round(L[:, :2], 9), axis=0)
    assert len(pairs) == 4 * 32 * 16  # every place is taken once


def test_positions_of_multi_view_cameras():
    for scale in (1, 8):
        cameras = preset_cameras("multi-view", scale=scale)
        L = np.array([camera.rays_at(0, 0)[0] for camera in cameras])
        np.testing.assert_allclose(L[:, 0], [-24, -12, 0, 12, 24], atol=ROUNDING)
        assert np.ptp(L[:, 1:], axis=0).tolist() == [0, 0]


def test_scale_leaves_cameras_of_an_array_where_they_stand():
    camera = replace(preset("setup1"), origin_mm=(24.0, -3.0, 0.5))
    assert scaled(camera, 8).origin_mm == (24.0, -3.0, 4.0)


SCALES = {"hdtv": 5}


@pytest.mark.parametrize("name", sorted(camera_names()))
def test_scale_keeps_sensor_angle_and_rays_through_lens_centres(name):
    scale = SCALES.get(name, 2)
    for full, small in zip(preset_cameras(name), preset_cameras(name, scale=scale), strict=True):
        assert small.size_mm == pytest.approx(full.size_mm, rel=1e-14)  # a product and a quotient
        assert small.view_angle_deg == pytest.approx(full.view_angle_deg, rel=1e-12)
        # Up to the lens plane, from pixels to lens centres, directions are the same numbers. Focus: see below.
        full, small = (replace(c, optics=c.optics[:1], origin_mm=(0, 0, 0)) for c in (full, small))
        (width, height) = small.pixels
        cols, rows = slice(width // 2 - 40, width // 2 + 40), slice(height // 2 - 40, height // 2 + 40)
        if full.lenses == (1, 1):  # pixels grow: their corners are corners of finer ones
            wide = slice(cols.start * scale, cols.stop * scale, scale), slice(rows.start * scale, None, scale)
            _, D = full.rays(wide[1], wide[0], sample=(0, 0))
            _, coarse = small.rays(rows, cols, sample=(0, 0))
            np.testing.assert_allclose(unit(coarse), unit(D[: len(coarse)]), atol=ROUNDING)
            continue
        # The middle of the finer array, magnified about the origin.
        dx, dy = (full.pixels[0] - width) // 2, (full.pixels[1] - height) // 2
        finer = slice(rows.start + dy, rows.stop + dy), slice(cols.start + dx, cols.stop + dx)
        L, D, share = full.weighted_rays(*finer)
        coarse_L, coarse_D, coarse_share = small.weighted_rays(rows, cols)
        # The sensor is 50 mm: 1e-11 is its rounding. A spherical lenslet's rays are not those through its lens centre
        # alone; `spherical` images 39 km, not infinity, for its radius has nine digits, and those 39 km stay.
        rounding = 1e-8 if name == "spherical" else 1e-10
        np.testing.assert_allclose(coarse_L, scale * L, atol=rounding)
        np.testing.assert_allclose(unit(coarse_D), unit(D), atol=rounding)
        np.testing.assert_array_equal(coarse_share, share)


def meeting_mm(L, D):
    """Where a bundle of rays is narrowest, z; infinite for parallel rays."""
    slopes = D[:, :2] / D[:, 2:]
    start = L[:, :2] - slopes * L[:, 2:]
    slopes, start = slopes - slopes.mean(axis=0), start - start.mean(axis=0)
    return -(start * slopes).sum() / (slopes**2).sum() if abs(slopes).max() > 1e-9 else math.inf


def focus_planes_mm(camera):
    """Return planes in focus, by rays: the image of the middle pixel by the apertures of four neighbouring lenses,
    or inf; and the point where all rays through one lens centre meet beyond the lenses in front."""
    planes, (k, l) = {}, (n // 2 for n in camera.lenses)
    radius, angle = np.meshgrid([0.1, 0.2], np.linspace(0, 2 * np.pi, 8, endpoint=False))
    places = np.stack([0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle)], axis=-1).reshape(-1, 2)
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x, y = camera.lens_lattice.centres(np.array(k + i), np.array(l + j))
        m, n = int(x), int(y)
        if camera.samples_aperture:
            # 1e-3 of the aperture: spherical lenses image points only near their axes
            near = (places - 0.5) * (1e-3 if camera.lens_model.kind == "spherical-lenslet" else 1.0) + 0.5
            L, D, _ = camera.weighted_rays_at(m, n, (x - m, y - n), near[:, None])  # a rim may block some
            planes["aperture", (k + i) % 2, (l + j) % 2] = meeting_mm(L[:, 0], D[:, 0])
    if camera.front and not camera.samples_aperture:
        x, y = camera.lens_lattice.centres(np.array(k), np.array(l))
        L, D = camera.rays_at(np.arange(int(x) - 3, int(x) + 4), int(y))
        planes["lens plane"] = meeting_mm(L, D)
    return planes


@pytest.mark.parametrize("scale", [2, 4, 8, 32])
@pytest.mark.parametrize("name", sorted(camera_names()))
def test_scale_keeps_every_plane_in_focus(name, scale):
    # Both older tests of scale missed that planes moved: one, above, demanded that every ray be magnified about the
    # origin, apertures and all, which moves an image from 40 mm to 40·scale, and took lenses in front off before it
    # looked; the other, in test_ii_core_camera, looks at pinholes.
    full = preset_cameras(name)
    if any(n % scale for camera in full for n in (*camera.lenses, *camera.pixels)):
        pytest.skip("scale does not divide the lenses, or one lens: no focus")
    if surfaces_of(full[0].front):
        pytest.skip(
            "its lens has aberrations, other ones under every lens: test_surfaces looks at its paraxial planes"
        )
    for camera, coarse in zip(full, preset_cameras(name, scale=scale), strict=True):
        expected, found = focus_planes_mm(camera), focus_planes_mm(coarse)
        assert found.keys() == expected.keys()
        for key, plane in expected.items():
            # Slopes differ by a hundredth over the aperture: 1e-14 of rounding is 1e-12 of the plane, and 9 digits
            # of focal lengths count alike at either scale. `spherical` images 39 km: 1e-9 of parallel.
            assert found[key] == pytest.approx(plane, rel=1e-8), key


def test_focus_planes_of_presets_in_closed_form():
    # Closed form, z from the pixels: Λ + 40; 1/b = 1/50 − 1/(85 − Λ − 10); 1/b = 1/50 − 1/(75 − Λ).
    for name, planes in {
        "resolution-priority": [40.182687],
        "multi-focus": [20.182687, 40.182687, 80.182687, math.inf],
        "plenoptic2": [85 + 1 / (1 / 50 - 1 / 74.269251)],
        "plenoptic1": [75 + 1 / (1 / 50 - 1 / 74.817313)],
        "depth-control": [30 + 1 / (1 / 25 - 1 / 29.817313)],
    }.items():
        for scale in (1, 8):
            found = sorted(set(np.round(list(focus_planes_mm(preset(name, scale=scale)).values()), 4)))
            assert found == pytest.approx(planes, rel=1e-5)  # focal lengths have nine digits


@pytest.mark.parametrize("scale", [2, 8])
@pytest.mark.parametrize(
    "optics",
    [
        (SphericalLenslet(radius_mm=0.1, ior=1.5, aperture_mm=0.05),),  # focused on about 38 mm
        (SphericalLenslet(radius_mm=0.102, ior=1.5, aperture_mm=0.05), Lens(z_mm=30, focal_mm=8)),
        (Lenslet(focal_mm=((0.181, 0.182), (0.184, 0.19)), aperture_mm=0.09), Lens(z_mm=60, focal_mm=-25)),
        (Lenslet(focal_mm=0.182, aperture_mm=0.09), Lens(z_mm=60, focal_mm=20), Lens(z_mm=90, focal_mm=35)),
        (Lens(z_mm=60, focal_mm=20), Lens(z_mm=90, focal_mm=35)),
    ],
)
@pytest.mark.parametrize("z", [0.0, 0.05])
def test_scale_keeps_planes_of_any_chain(optics, scale, z):
    camera = replace(preset("setup1"), optics=optics, origin_mm=(0, 0, z))
    expected, found = focus_planes_mm(camera), focus_planes_mm(scaled(camera, scale))
    assert expected
    for key, plane in expected.items():
        assert found[key] == pytest.approx(plane, rel=1e-6), key  # rays near the axis: aberration of 1e-3 squared
    assert scaled(camera, 1) == camera


def test_a_lens_in_front_keeps_its_place_in_the_scene():
    camera = replace(preset("plenoptic1"), origin_mm=(0, 0, 0.5))
    lens, coarse = camera.front[0], scaled(camera, 4)
    assert coarse.front[0].z_mm + coarse.origin_mm[2] == pytest.approx(lens.z_mm + 0.5, rel=1e-14)
    assert coarse.front[0].diameter_mm == lens.diameter_mm


@pytest.mark.parametrize(
    ("optics", "message"),
    [
        (
            (Lenslet(focal_mm=0.18, aperture_mm=0.09),),
            "scale 128: lens plane moves by 23.2.* mm, lenslets focus 12.2",
        ),
        ((Lens(z_mm=20, focal_mm=25),), "scale 128: lens at z_mm 20: the lens plane moves by 23.2"),
        ((SphericalLenslet(radius_mm=0.099, ior=1.5),), "scale 128: lens plane moves by 23.2"),
    ],
)
def test_a_scale_that_loses_a_plane_is_refused(optics, message):
    with pytest.raises(ValueError, match=message):
        scaled(replace(preset("setup1"), optics=optics), 128)


# -- chains


def test_three_words_in_a_camera_file_are_three_elements():
    camera = preset("grin-hexagonal-depth-control", scale=8)
    assert [type(e).__name__ for e in camera.optics] == ["Grin", "Lens"] and camera.lattice == "hexagonal"
    rows, cols = slice(40, 90), slice(100, 180)
    L, D, share = camera.weighted_rays(rows, cols)
    n, m = np.mgrid[rows, cols]
    pitch, (width, height) = camera.pixel_pitch_mm, camera.size_mm
    px, py = (m + 0.5) * pitch - width / 2, height / 2 - (n + 0.5) * pitch
    k, l = camera.lens_lattice.nearest(m, n)
    cx = (k + 0.5 + l % 2 / 2) * camera.lens_pitch_mm[0] - 512 / 8 * camera.lens_pitch_mm[0] / 2
    cy = 296 / 8 * camera.lens_pitch_mm[1] / 2 - (l + 0.5) * camera.lens_pitch_mm[1]
    # erect: along (p − c), then the lens at z = 30: f = 25 at full size, the same plane imaged onto the lenses
    power = 1 / 25 + 1 / (30 - camera.gap_mm) - 1 / (30 - camera.gap_mm / 8)
    slope = np.stack([px - cx, py - cy], axis=-1) / camera.gap_mm
    place = np.stack([cx, cy], axis=-1) + slope * (30 - camera.gap_mm)
    # The camera's pitch is kept to a billionth of a pixel; over 64 lenses that is 1e-8 pixels, below 1e-9 mm.
    np.testing.assert_allclose(L[..., :2], place, atol=1e-8)
    assert (L[..., 2] == 30).all() and share is None
    np.testing.assert_allclose(D[..., :2] / D[..., 2:], slope - place * power, atol=1e-8)


@pytest.mark.parametrize("name", sorted(camera_names()))
def test_every_preset_survives_json(name):
    for camera in preset_cameras(name):
        back = IICamera.from_json(json.loads(json.dumps(camera.to_json())))
        assert back == camera
        assert back.lens_lattice == camera.lens_lattice


def test_elements_survive_json():
    for built in (
        Pinhole(),
        Grin(),
        Lenticular(),
        Lenslet(focal_mm=1),
        Lenslet(focal_mm=((1.0, 2.0), (3.0, 4.0)), aperture_mm=0),
        SphericalLenslet(radius_mm=1, ior=1, aperture_mm=0),
        Lens(z_mm=30, focal_mm=-5, diameter_mm=3),
    ):
        assert element_of(json.loads(json.dumps(built.to_json()))) == built
    assert chain(["grin", {"kind": "lens", "z_mm": 3, "focal_mm": 2}])[0] == Grin()
    assert chain([{"kind": "lens", "z_mm": 3, "focal_mm": 2}])[0] == Pinhole()  # nothing over the lenslets


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("prism", "unknown optical element 'prism': known are pinhole, grin, lenticular, lenslet"),
        ({"focal_mm": 1}, "unknown optical element None"),
        ({"kind": ["lens"]}, r"unknown optical element \['lens'\]"),
        (7, "unknown optical element 7"),
        (None, "unknown optical element None"),
        ({"kind": "grin", "pitch": 3}, "grin has no pitch: known are none"),
        ({"kind": "lenslet", "f": 3}, "lenslet has no f: known are aperture_mm, focal_mm"),
        ({"kind": "lenslet"}, "lenslet: .*focal_mm"),
        ({"kind": "lenslet", "focal_mm": None}, "lenslet: focal_mm is None, a NoneType: a number"),
        ({"kind": "lenslet", "focal_mm": 0}, "lenslet: focal_mm is 0: a length from 1e-09 to 1e.09 mm"),
        ({"kind": "lenslet", "focal_mm": math.nan}, "lenslet: focal_mm is nan"),
        ({"kind": "lenslet", "focal_mm": "long"}, "lenslet: focal_mm is 'long', a str: a number"),
        ({"kind": "lenslet", "focal_mm": []}, r"lenslet: focal_mm is \[\]: one length, or rows"),
        ({"kind": "lenslet", "focal_mm": [1, 2]}, r"lenslet: focal_mm is \[1, 2\]: one length, or rows"),
        ({"kind": "lenslet", "focal_mm": [[1, 2], [3]]}, "lenslet: focal_mm is .*: one length, or rows"),
        ({"kind": "lenslet", "focal_mm": [[1, -2]]}, "lenslet: focal_mm is -2: a length from"),
        ({"kind": "lenslet", "focal_mm": 1, "aperture_mm": -1}, "lenslet: aperture_mm is -1: a length from"),
        ({"kind": "lenslet", "focal_mm": 1, "aperture_mm": "wide"}, "lenslet: aperture_mm is 'wide'"),
        ({"kind": "lenslet", "focal_mm": 1, "aperture_mm": math.inf}, "lenslet: aperture_mm is inf"),
        ({"kind": "lens", "z_mm": 3}, "lens: .*focal_mm"),
        ({"kind": "lens", "z_mm": 3, "focal_mm": 0}, "lens: the size of focal_mm is 0: a length from"),
        ({"kind": "lens", "z_mm": "near", "focal_mm": 1}, "lens: z_mm is 'near'"),
        ({"kind": "lens", "z_mm": 3, "focal_mm": 1, "diameter_mm": 0}, "lens: diameter_mm is 0"),
        ({"kind": "spherical-lenslet", "radius_mm": 1}, "spherical-lenslet: .*ior"),
        (
            {"kind": "spherical-lenslet", "radius_mm": 1, "ior": 0.9},
            "spherical-lenslet: ior is 0.9: a number from 1",
        ),
        ({"kind": "spherical-lenslet", "radius_mm": None, "ior": 1.5}, "spherical-lenslet: radius_mm is None"),
    ],
)
def test_invalid_elements_are_refused(data, message):
    with pytest.raises(ValueError, match=message):
        element_of(data)


def lens_at(z):
    return {"kind": "lens", "z_mm": z, "focal_mm": 3}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lens_pitch_mm": [0.1]}, r"lens_pitch_mm is \[0.1\]: one length, or two"),
        ({"lens_pitch_mm": [0.1, 0.1, 0.1]}, "lens_pitch_mm is .*: one length, or two"),
        ({"optics": "grin"}, "optics are 'grin': a list of elements"),
        ({"optics": 5}, "optics are 5: a list of elements"),
        ({"optics": [lens_at(0.5)]}, "lens: z_mm is 0.5: what stands behind it is at 1"),
        ({"optics": [lens_at(9), lens_at(8)]}, "lens: z_mm is 8: what stands behind it is at 9"),
        ({"optics": [lens_at(9), "grin"]}, "grin is a lens model: it must be the first"),
    ],
)
def test_invalid_cameras_are_refused(change, message):
    data = {"pixels": [8, 6], "lenses": [2, 3], "pixel_pitch_mm": 0.1, "gap_mm": 1.0, **change}
    with pytest.raises(ValueError, match=message):
        IICamera.from_json(data)


# -- pictures


def test_blocked_rays_cost_nothing_and_leave_the_pixel_black():
    rim = Lens(z_mm=10.0, focal_mm=25.0, diameter_mm=5.0)
    camera = binary((Pinhole(), rim))
    shot = render(Scene(bodies=[body(wall(30.0, 200.0), colour=WHITE)], ambient=WHITE), camera)
    _, D, share = camera.weighted_rays()
    blocked = share == 0
    assert 0.1 < blocked.mean() < 0.9
    assert shot.stats.rays["primary"] == (~blocked).sum()
    assert (shot.picture.pixels[blocked] == 0).all() and (shot.picture.pixels[~blocked] == 255).all()
    assert np.isnan(shot.depth[blocked]).all() and (shot.object_id[blocked] == -1).all()
    assert (shot.normal[blocked] == 0).all()
    np.testing.assert_allclose(shot.depth[~blocked], 30, rtol=1e-6)  # float32
    assert (camera.rays()[1][blocked] == 0).all() and (D[blocked] != 0).any()
    dark = render(Scene(bodies=[body(wall(30.0, 200.0))]), binary((Pinhole(), replace(rim, diameter_mm=1e-9))))
    assert dark.stats.rays["primary"] == 0 and not dark.picture.pixels.any()


def test_a_pixel_half_in_the_rim_s_shade_is_half_as_bright():
    # Λ = f: parallel rays 1 mm wide, half of them beside a rim through their middle.
    camera = IICamera(
        pixels=(1, 1), lenses=(1, 1), pixel_pitch_mm=0.01, gap_mm=1.0,
        optics=(Lenslet(focal_mm=1.0, aperture_mm=1.0), Lens(z_mm=1.0, focal_mm=1e9, diameter_mm=math.sqrt(0.5))),
    )  # fmt: skip
    scene = Scene(bodies=[body(wall(30.0, 200.0), colour=WHITE)], ambient=WHITE)
    shot = render(scene, camera, samples=1024, dtype="float32")
    # Half of the aperture's area lies within √½ of its radius; 32 × 32 strata, of which the rim cuts about 100.
    assert shot.picture.pixels[0, 0] == pytest.approx([0.5] * 3, abs=0.01)
    assert shot.stats.rays["primary"] == pytest.approx(512, abs=11)


def edge_scene(z):
    """White to the right of x = 0, black to the left."""
    corners = np.array([[0, -60, z], [60, -60, z], [60, 60, z], [0, 60, z]], float)
    return Scene(bodies=[body(Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]])), colour=WHITE)], ambient=WHITE)


def profile(camera, z):
    """Return where the middle of each pixel sees a plane at z, in mm from the edge, and the pixel's whiteness."""
    shot = render(edge_scene(z), camera, samples=256, dtype="float32", support=())
    pinhole = replace(camera, optics=())
    x = at_depth(*pinhole.rays(), z)[0, :, 0]
    return x, shot.picture.pixels[:, :, 0].mean(axis=0)


def part_of_disk(x, diameter):
    """Share of a disk's area to the right of an edge that lies at −x from its centre."""
    t = np.clip(2 * x / diameter, -1, 1)
    return 0.5 + (t * np.sqrt(1 - t * t) + np.arcsin(t)) / np.pi


def one_lens(focal, aperture=1.0):
    """A single lens, 2 mm before pixels so fine that only the aperture blurs."""
    return IICamera(
        pixels=(160, 16), lenses=(1, 1), pixel_pitch_mm=0.001, gap_mm=2.0,
        optics=(Lenslet(focal_mm=focal, aperture_mm=aperture),),
    )  # fmt: skip


FOOTPRINT = 0.001 / 2  # of a pixel, per mm of distance


@pytest.mark.parametrize("z", [22.0, 42.0, 82.0])
def test_depth_priority_blurs_by_the_aperture_at_every_depth(z):
    x, white = profile(one_lens(2.0), z)
    # 256 strata, of which the edge cuts some 20, over 16 rows of pixels: a deviation of 0.002 to 0.0035 was measured
    # on more rows, with a mean that is nought. 4 of them.
    np.testing.assert_allclose(white, part_of_disk(x, 1.0), atol=0.014)
    assert white.min() < 0.01 and white.max() > 0.99
    assert width(x, white) == pytest.approx(1.0, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("z", [22.0, 32.0, 62.0])
def test_resolution_priority_is_sharp_at_its_image_plane_alone(z):
    image = 40.0  # from the lens plane: focused at z = 42
    camera = one_lens(1 / (1 / 2.0 + 1 / image))
    x, white = profile(camera, image + 2.0)
    cut = (white > 0.002) & (white < 0.998)
    assert cut.sum() <= 1 and width(x, white) < 2 * FOOTPRINT * image  # the pixel that the edge goes through, if any
    x, white = profile(camera, z)
    blur = abs(1 - (z - 2.0) / image)  # × an aperture of 1 mm: similar triangles
    # As above, and the footprint over a blur of half a millimetre smooths the steps at its rims, a hundredth.
    np.testing.assert_allclose(white, part_of_disk(x, blur), atol=0.025)
    assert width(x, white) == pytest.approx(blur, rel=0.02)


def width(x, white):
    """Return the diameter of the blur disk of an edge, which is four times its standard deviation."""
    step, middle = np.diff(white), (x[1:] + x[:-1]) / 2
    mean = (step * middle).sum() / step.sum()
    return 4 * math.sqrt(max(0.0, (step * (middle - mean) ** 2).sum() / step.sum()))


@pytest.mark.parametrize(
    ("name", "error"),
    [("depth-control", 1e-9), ("plenoptic1", 1e-9), ("plenoptic2", 1e-9), ("plenoptic1-double-gauss", 0.02)],
)
def test_disparity_behind_lenses_is_that_of_rays_to_a_point(name, error):
    """Rays of neighbouring lenses, and of neighbouring pixels under one, tell how views move at a depth."""
    camera = preset(name, scale=4)
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    row, col = l // 2 * v + v // 2, k // 2 * u + u // 2
    start, way = (ray[0, [col, col + 1, col + u]] for ray in camera.rays(rows=slice(row, row + 1)))
    for z in 150.0, 240.0, 1000.0, 1e7:
        x = start[:, 0] + (z - start[:, 2]) * way[:, 0] / way[:, 2]
        found = float(disparity_of_depth(camera, z))
        assert found == pytest.approx((x[1] - x[0]) / (x[2] - x[0]), rel=error, abs=error)
        assert float(depth_of_disparity(camera, found)) == pytest.approx(z, rel=1e-6)
    assert np.isnan(disparity_of_depth(camera, camera.front[-1].end_mm - 1)) and camera.front
    assert np.isinf(depth_of_disparity(camera, disparity_of_depth(camera, np.inf) - 1e-3))


def test_disparity_of_infinity():
    """A sky of infinite depth moves without bound where views are parallel, by δP·d/(Λ·δL) where they meet at d."""
    parallel = IICamera(pixels=(40, 40), lenses=(4, 4), pixel_pitch_mm=0.1, gap_mm=2.0)
    assert disparity_of_depth(parallel, np.inf) == -np.inf and disparity_of_depth(parallel, 2.0) == 0
    meeting = replace(parallel, viewer_mm=80.0, lens_pitch_mm=None)
    far, at_infinity = disparity_of_depth(meeting, [1e12, np.inf])
    assert at_infinity == pytest.approx(-80 * 0.1 / (2 * meeting.lens_pitch_mm[0])) and far == pytest.approx(
        at_infinity
    )
