"""Lenses of surfaces ray by ray: closed forms, surfaces without aberration, paraxial limit, another library."""

import hashlib
import json
import math
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ii_core import IICamera, preset
from ii_core.camera import refraction
from ii_core.camera.elements import Bundle
from ii_core.camera.glass import CATALOGUE, LINE_C_NM, LINE_D_NM, LINE_F_NM, Glass, catalogue, glass
from ii_core.camera.prescriptions import lens, lens_names
from ii_core.camera.surfaces import Surface, Surfaces
from ii_core.design.properties import image_planes, through_front_mm

ROUNDING = 1e-12  # millimetres in float64, some hundred operations
GOOD = {"radius_mm": 50.0, "thickness_mm": 5.0, "glass": "F2", "diameter_mm": 20.0, "stop": True}
LAST = {"radius_mm": -50.0}


def rays_at(x, y, z, dx, dy, dz):
    return Bundle(*(np.asarray(a, np.float64) for a in (x, y, z, dx, dy, dz)))


def fan(start_z, heights, target_z=None):
    """Rays in the plane x = 0: parallel to the axis at some heights, or from an axis point to heights at a plane."""
    zero, one = np.zeros_like(heights), np.ones_like(heights)
    if target_z is None:
        return rays_at(zero, heights, start_z * one, zero, zero, one)
    return rays_at(zero, zero, start_z * one, zero, heights, (target_z - start_z) * one)


def columns(bundle):
    """L, unit D and weight."""
    six = np.broadcast_arrays(*bundle[:6])
    return np.stack(six[:3], axis=-1), np.stack(six[3:], axis=-1), bundle.weight


def crossing(bundle):
    """Where rays of the plane x = 0 cross the axis, z."""
    L, D, _ = columns(bundle)
    return L[:, 2] - L[:, 1] * D[:, 2] / D[:, 1]


# -- closed forms


@pytest.mark.parametrize("angle", [0.0, 10.0, 40.0, 70.0])
def test_slab_shifts_a_ray_and_keeps_its_direction(angle):
    n, thickness, theta = 1.5, 10.0, math.radians(angle)
    slab = Surfaces(
        z_mm=5.0,
        surfaces=({"thickness_mm": thickness, "glass": {"ior": n}}, {"stop": True, "diameter_mm": 100.0}),
    )
    ray = rays_at(0, 0, 0, 0, math.tan(theta), 1)
    L, D, weight = columns(slab.pass_on(ray))
    inside = math.asin(math.sin(theta) / n)
    assert weight == 1
    np.testing.assert_allclose(D, [0, math.sin(theta), math.cos(theta)], atol=ROUNDING)
    np.testing.assert_allclose(L, [0, 5 * math.tan(theta) + thickness * math.tan(inside), 15], atol=ROUNDING)


def test_one_sphere_by_the_sines_of_its_angles():
    # Flat side to the pixels: parallel rays meet the sphere alone, at sin I = h/R inside and n·h/R outside.
    n, radius, thickness = 1.6, 50.0, 12.0
    half = Surfaces(
        z_mm=0.0,
        surfaces=(
            {"radius_mm": radius, "thickness_mm": thickness, "glass": n},
            {"stop": True, "diameter_mm": 58.0},
        ),
    )
    heights = np.linspace(1.0, 28.0, 28)
    out = half.pass_on(fan(-1.0, heights))
    before, after = np.arcsin(heights / radius), np.arcsin(n * heights / radius)
    vertex = thickness
    surface = vertex - (radius - radius * np.cos(before))
    np.testing.assert_allclose(crossing(out), surface + heights / np.tan(after - before), rtol=ROUNDING)
    L, _, weight = columns(out)
    np.testing.assert_allclose(L[:, 2], surface, atol=ROUNDING)
    assert (weight == 1).all()


@pytest.mark.parametrize("n", [1.33, 1.5168, 1.9])
def test_ellipsoid_of_eccentricity_one_over_n_has_no_aberration(n):
    # Cartesian oval for a point at infinity: κ = −1/n² images to f = nR/(n − 1) in the glass. A sphere about that
    # focus ends the glass and bends none of its rays.
    radius, thickness = 40.0, 30.0
    focus = n * radius / (n - 1)
    oval = Surfaces(
        z_mm=focus - thickness,
        surfaces=(
            {"radius_mm": radius, "conic": -1 / n**2, "thickness_mm": thickness, "glass": n},
            {"radius_mm": focus - thickness, "stop": True, "diameter_mm": 24.0},
        ),
    )
    heights = np.linspace(-10, 10, 41)
    L, D, weight = columns(oval.pass_on(fan(0.0, heights, target_z=focus - thickness)))
    assert (weight == 1).all() and abs(L[:, 1]).max() > 12  # far from paraxial
    np.testing.assert_allclose(D, np.broadcast_to([0, 0, 1], D.shape), atol=ROUNDING)
    # With a sphere in its place the same rays part: what is tested is the conic.
    sphere = replace(oval, surfaces=(replace(oval.surfaces[0], conic=0.0), oval.surfaces[1]))
    assert abs(columns(sphere.pass_on(fan(0.0, heights, target_z=focus - thickness)))[1][:, 1]).max() > 1e-3


def test_hyperboloid_of_eccentricity_n_has_no_aberration():
    n, radius = 1.5, 30.0
    focus = radius / (n - 1)
    cone = Surfaces(
        z_mm=focus,
        surfaces=(
            {"thickness_mm": 15.0, "glass": n},
            {"radius_mm": -radius, "conic": -(n**2), "stop": True, "diameter_mm": 60.0},
        ),
    )
    _, D, weight = columns(cone.pass_on(fan(0.0, np.linspace(-18, 18, 37), target_z=focus)))
    assert (weight == 1).sum() > 25
    np.testing.assert_allclose(D[weight == 1], np.broadcast_to([0, 0, 1], D[weight == 1].shape), atol=ROUNDING)


@pytest.mark.parametrize("name", ["triplet", "double-gauss"])
def test_rays_near_the_axis_meet_at_the_paraxial_image(name):
    lens_here = lens(name).at(60.0)
    heights = np.array([0.4, 0.2, 0.1])
    image = lens_here.image_mm(-20.0)
    off = abs(crossing(lens_here.pass_on(fan(-20.0, heights, target_z=60.0))) - image)
    assert off[2] < 1e-4 * image
    np.testing.assert_allclose(off[:2] / off[1:], 4, rtol=0.02)  # third order: with the square of the height


def test_published_focal_lengths():
    for name, focal in (("triplet", 50.0), ("double-gauss", 100.0)):
        made = lens(name)
        placed = made.at(made.back_mm)
        # The glasses of today differ from those of the prescriptions in the fourth digit.
        assert placed.focal_mm == pytest.approx(focal, rel=1e-3)
        # The image plane is that of infinity, for best focus: up to a half per cent of f from the paraxial one.
        assert abs(1 / placed.image_mm(0.0)) < 5e-3 / focal
        assert placed.enlarged(0.5).focal_mm == pytest.approx(placed.focal_mm / 2, rel=1e-12)
    assert set(lens_names()) == {"triplet", "double-gauss"}


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(
        st.tuples(st.floats(8, 200), st.booleans(), st.floats(1.2, 1.9), st.floats(-2, 1), st.floats(2, 6)),
        min_size=1,
        max_size=4,
    ),
    y=st.floats(-2, 2),
    slope=st.floats(-0.1, 0.1),
)
def test_rays_are_reversible(values, y, slope):
    # Turned about, with radii of the other sign, a lens sends the reversed ray back to where it came from.
    surfaces = []
    for radius, hollow, n, conic, thickness in values:
        r = -radius if hollow else radius
        surfaces += [
            Surface(radius_mm=r, conic=conic, thickness_mm=thickness, glass=Glass(ior=n)),
            Surface(radius_mm=-2 * r, thickness_mm=thickness),
        ]
    surfaces[-1] = replace(surfaces[-1], thickness_mm=0.0, stop=True, diameter_mm=6.0)
    there = Surfaces(z_mm=10.0, surfaces=tuple(surfaces))
    order = there.surfaces[::-1]
    gaps = [*(s.thickness_mm for s in order[1:]), 0.0]
    glasses = [*(s.glass for s in order[1:]), None]
    back = Surfaces(
        z_mm=-there.end_mm,
        surfaces=tuple(
            replace(s, radius_mm=-s.radius_mm, thickness_mm=gap, glass=after)
            for s, gap, after in zip(order, gaps, glasses, strict=True)
        ),
    )
    L, D, weight = columns(there.pass_on(rays_at(0.3, y, 0.0, 0.02, slope, 1.0)))
    if weight == 0:
        return
    # The mirror image of the scene: z becomes −z.
    far = -(L[2] + 50 * D[2])
    L2, D2, weight2 = columns(back.pass_on(rays_at(L[0] + 50 * D[0], L[1] + 50 * D[1], far, -D[0], -D[1], D[2])))
    assert weight2 == 1
    start = L2 + D2 * ((0.0 - L2[2]) / D2[2])
    # Lengths to 60 mm through eight surfaces, the steepest of R = 8 mm: a few thousand roundings.
    np.testing.assert_allclose(start[:2], [0.3, y], atol=1e-10)
    np.testing.assert_allclose(D2[:2] / D2[2], [-0.02, -slope], atol=1e-10)


# optiland 0.6.3 at 486.1327 nm with our indices: rays from 10 mm before the first vertex, x, y and direction cosines
# there and in the image plane. `benchmarks/accuracy/lens_rays.py` of commit 58549fc
# compared thousands; the library with its dependencies takes 1.3 GB, too much for every test run.
STARTS = ((0.0, 3.0, 0.0, 0.05), (1.0, -2.0, 0.06, 0.0))
IMAGES = {
    "triplet": (
        (0.0, 2.4981186659901153, 0.0, -0.0326202560729319),
        (2.99849382612997, -0.0032324991899801425, 0.012858714582508007, 0.040006230184690156),
    ),
    "double-gauss": (
        (0.0, 4.997270491138759, 0.0, -0.02054097742485521),
        (6.00338712325771, 0.002916776000178034, 0.0012912793003971301, 0.01998934333379345),
    ),
    "conic singlet": (
        (0.0, 1.894329739252099, 0.0, -0.060186585180287376),
        (1.9289870244801757, -0.2663496783472954, 0.00747696796818903, 0.06117641564668418),
    ),
}


def conic_singlet(wavelength_nm: float) -> tuple[Surfaces, float]:
    """Return a lens of N-SF11 with an ellipsoid and a hyperboloid, and its back distance."""
    made = Surfaces(
        z_mm=0.0,
        wavelength_nm=wavelength_nm,
        surfaces=(
            Surface(
                radius_mm=40.0, conic=-0.6, thickness_mm=9.0, glass=CATALOGUE["N-SF11"], diameter_mm=30.0, stop=True
            ),
            Surface(radius_mm=-70.0, conic=-3.0, diameter_mm=30.0),
        ),
    )
    return made, 25.0


def cases():
    """Return functions from the wavelength to a lens and its back distance."""

    def published(name):
        made = lens(name)
        return lambda nm: (made.at(0.0, wavelength_nm=nm), made.back_mm)

    return {
        "triplet": published("triplet"),
        "double-gauss": published("double-gauss"),
        "conic singlet": conic_singlet,
    }


@pytest.mark.parametrize("name", IMAGES)
def test_rays_of_another_library(name):
    placed, back = cases()[name](486.1327)
    for start, image in zip(STARTS, IMAGES[name], strict=True):
        x, y, dx, dy = image
        # Light runs along −z here, and our rays against it.
        ray = rays_at(x, y, -back, -dx, -dy, math.sqrt(1 - dx * dx - dy * dy))
        L, D, weight = columns(placed.pass_on(ray))
        at_start = L + D * ((placed.end_mm + 10 - L[2]) / D[2])
        assert weight == 1
        np.testing.assert_allclose([*at_start[:2], *-D[:2]], start, atol=ROUNDING)


# -- rims, stop, total reflection


def test_rims_and_stop_block_rays():
    made = lens("triplet").at(40.0)
    heights = np.linspace(-12, 12, 481)
    weight = made.pass_on(fan(-30.0, heights, target_z=40.0)).weight
    # The stop's paraxial image towards the pixels bounds the cone from the axis point, up to aberration.
    z, diameter = made.pupil()
    cone = (heights / 70) * (z + 30)
    assert (weight[abs(cone) < 0.97 * diameter / 2] == 1).all()
    assert (weight[abs(cone) > 1.03 * diameter / 2] == 0).all()
    assert np.isin(weight, (0, 1)).all()


def test_weights_of_before_are_kept():
    made = lens("triplet").at(40.0)
    rays = fan(-30.0, np.array([0.0, 1.0, 30.0]), target_z=40.0)._replace(weight=np.array([0.5, 0.25, 1.0]))
    np.testing.assert_array_equal(made.pass_on(rays).weight, [0.5, 0.25, 0.0])


def test_total_reflection_weighs_nothing_and_numbers_stay_finite():
    # A hemisphere's flat face: rays within it reflect totally from sin I > 1/n on.
    n = 1.5
    ball = Surfaces(
        z_mm=10.0,
        surfaces=(
            {"thickness_mm": 25.0, "glass": n, "diameter_mm": 200.0},
            {"radius_mm": -60.0, "stop": True, "diameter_mm": 90.0},
        ),
    )
    # Towards the centre of the sphere, so that the first surface bends nothing: 60 mm ahead.
    angle = np.radians([0.0, 20.0, 41.0, 42.5, 47.0])  # 41.81° is critical
    centre = 10.0 + 60.0
    rays = rays_at(
        0 * angle, -100 * np.sin(angle), centre - 100 * np.cos(angle), 0 * angle, np.sin(angle), np.cos(angle)
    )
    L, D, weight = columns(ball.pass_on(rays))
    np.testing.assert_array_equal(weight, [1, 1, 1, 0, 0])
    np.testing.assert_allclose(D[:3, 1], n * np.sin(angle[:3]), atol=ROUNDING)
    assert np.isfinite(L).all() and np.isfinite(D).all()


def test_rays_that_miss_or_run_back_are_finite_and_blocked():
    made = lens("double-gauss").at(60.0)
    L, D, weight = columns(
        made.pass_on(rays_at([0, 0, 500, 0], [0, 0, 0, 0], [0, 500, 0, 0], 0, [1, 0, 0, 0], [0, 1, 1, -1]))
    )
    np.testing.assert_array_equal(weight, [0, 0, 0, 0])
    assert np.isfinite(L).all() and np.isfinite(D).all()


# -- glass


# n_d and V_d as data sheets print them, typed in apart from the catalogue.
PRINTED = {
    "N-BK7": (1.51680, 64.17), "N-SK2": (1.60738, 56.65), "N-SK16": (1.62041, 60.32), "N-SSK2": (1.62229, 53.27),
    "F2": (1.62004, 36.37), "F5": (1.60342, 38.03), "N-SF11": (1.78472, 25.68), "N-LAK9": (1.69100, 54.71),
    "SF11": (1.78472, 25.76), "SF2": (1.64769, 33.85), "SF5": (1.67270, 32.21), "N-SF5": (1.67271, 32.25),
    "SF6": (1.80518, 25.43), "N-SF6": (1.80518, 25.36), "SF10": (1.72825, 28.41), "N-SF10": (1.72828, 28.53),
    "SF57": (1.84666, 23.83), "N-SF57": (1.84666, 23.78), "N-BAF10": (1.67003, 47.11), "N-BAK4": (1.56883, 55.98),
    "N-LAK22": (1.65113, 55.89), "N-LAK33B": (1.75500, 52.30), "N-LASF9": (1.85025, 32.17), "N-K5": (1.52249, 59.48),
    "N-SSK5": (1.65844, 50.88), "N-KZFS4": (1.61336, 44.49), "N-FK51A": (1.48656, 84.47), "N-PK51": (1.52855, 76.98),
    "N-BALF4": (1.57956, 53.87), "LF5": (1.58144, 40.85), "LLF1": (1.54814, 45.75), "BK7": (1.51680, 64.17),
    "H-K9L": (1.51680, 64.20), "H-ZF6": (1.75520, 27.53), "S-BSL7": (1.51633, 64.14), "S-LAH66": (1.77250, 49.60),
}  # fmt: skip


@pytest.mark.parametrize("name", PRINTED)
def test_glasses_have_their_printed_values(name):
    ior, abbe = PRINTED[name]
    assert glass(name).index(587.5618) == pytest.approx(ior, abs=1e-5)
    assert glass(name).abbe_number == pytest.approx(abbe, abs=0.03)


def test_catalogue_agrees_with_the_data_sheets():
    """Index and Abbe number stand in other tables of the makers than the coefficients: slips of typing differ."""
    assert len(catalogue()) > 400 and {entry.maker for entry in catalogue().values()} >= {"Schott", "Ohara", "CDGM"}
    for name, entry in catalogue().items():
        assert name == name.upper() and name == entry.glass.name
        assert entry.glass.index(LINE_D_NM) == pytest.approx(entry.ior, abs=2e-5), name
        assert entry.glass.abbe_number == pytest.approx(entry.abbe, rel=5e-3), name
        visible = [entry.glass.index(nm) for nm in np.arange(400.0, 701.0, 5.0)]
        assert 1.3 < min(visible) and max(visible) < 2.2, name
        assert (np.diff(visible) < 0).all(), name


def test_a_glass_never_stands_for_its_successor():
    assert glass("SF11") != glass("N-SF11") and glass("SF11").abbe_number > glass("N-SF11").abbe_number + 0.05
    assert glass("n-sf11") == CATALOGUE["N-SF11"]  # small letters alone
    assert glass("N-SF11").to_json() == "N-SF11"
    with pytest.raises(ValueError, match=r"unknown glass 'SK16': near it are N-SK16 \(n 1.62041, V 60.32\)"):
        glass("SK16")
    with pytest.raises(ValueError, match=r"unknown glass 'q+…: known are \d+ names of Schott, Ohara and CDGM"):
        glass("q" * 5000)


def test_index_and_abbe_number_of_a_glass():
    made = Glass(ior=1.62, abbe=36.4)
    assert made.index(587.5618) == pytest.approx(1.62, abs=1e-15)
    assert 0.62 / (made.index(LINE_F_NM) - made.index(LINE_C_NM)) == pytest.approx(36.4, rel=1e-12)
    assert Glass(ior=1.62).abbe_number == math.inf
    assert glass(made.to_json()) == made and glass("F2").to_json() == "F2"


def test_wavelengths_focus_apart():
    # The triplet is corrected for lines F and C: they focus nearer to each other than through one glass.
    triplet = lens("triplet")
    focus = [triplet.at(0.0, wavelength_nm=nm).image_mm(math.inf) for nm in (486.13, 587.56, 656.27)]
    single = [
        Surfaces(
            z_mm=0.0, wavelength_nm=nm,
            surfaces=({**GOOD, "radius_mm": 52.0, "thickness_mm": 2.5, "glass": "N-BK7"}, {"radius_mm": -52.0}),
        ).image_mm(math.inf)
        for nm in (486.13, 587.56, 656.27)
    ]  # fmt: skip
    assert single[0] < single[1] < single[2]  # blue bends more
    assert abs(focus[2] - focus[0]) < 0.2 * abs(single[2] - single[0])


# -- three wavelengths

CHANNELS_NM = (LINE_C_NM, LINE_D_NM, LINE_F_NM)
CROWN, FLINT = CATALOGUE["N-BK7"], CATALOGUE["F2"]
POWER, AHEAD = 1 / 50.0, 20.0  # of the lens, per mm, and its distance from a pinhole, the stop


def through(lenses, slope):
    """Return the slope ahead of a lens of the ray of a slope through the pinhole, for red, green and blue."""
    camera = IICamera(
        pixels=(1, 1), lenses=(1, 1), pixel_pitch_mm=0.01, gap_mm=1.0,
        optics=("pinhole", Surfaces(z_mm=1.0 + AHEAD, surfaces=lenses, wavelengths_nm=CHANNELS_NM)),
    )  # fmt: skip
    slopes = []
    for channel in camera.channel_cameras():
        out = channel.front[0].pass_on(rays_at(0, 0, 1, 0, slope, 1))
        slopes.append(float(np.ravel(out.dy / out.dz)[0]))
    return np.array(slopes)


def thin(power, glass, radius=None):
    """Return the two radii of a thin lens of a power at line d; ``radius`` is that of its scene side."""
    bend = power / (glass.index(LINE_D_NM) - 1)
    radius = 2 / bend if radius is None else radius
    return radius, 1 / (1 / radius - bend)


def test_lateral_colour_of_a_singlet_is_one_over_its_abbe_number():
    """The ray meets a thin lens at height y: lines F and C part by y·φ/V, and nothing else does."""
    front, back = thin(POWER, CROWN)

    def singlet(thickness, diameter):
        scene_side = {"radius_mm": front, "thickness_mm": thickness, "glass": CROWN}
        return {**scene_side, "diameter_mm": diameter, "stop": True}, {"radius_mm": back}

    slope = 0.002  # y = 0.04 mm: aberrations of the third order are 1e-6 of the bend
    red, green, blue = through(singlet(2e-4, 0.1), slope)
    y = AHEAD * slope
    assert slope - green == pytest.approx(y * POWER, rel=1e-4)
    assert red - blue == pytest.approx(y * POWER / CROWN.abbe_number, rel=1e-4)
    # On a screen a focal length away, for the ray at 5.7 degrees: 31 µm, the bend's 2 mm over V.
    red, green, blue = through(singlet(0.2, 5.0), 0.1)
    assert 50 * (red - blue) == pytest.approx(2.0 / 64.17, rel=0.05)


def test_an_achromat_corrects_lateral_colour():
    """Powers of the two glasses as V₁ to −V₂: lines F and C agree, line d keeps the secondary spectrum."""
    v1, v2 = CROWN.abbe_number, FLINT.abbe_number
    first, second = POWER * v1 / (v1 - v2), -POWER * v2 / (v1 - v2)
    front, joined = thin(first, CROWN)
    _, back = thin(second, FLINT, radius=joined)
    doublet = (
        {"radius_mm": front, "thickness_mm": 2e-4, "glass": CROWN, "diameter_mm": 0.1, "stop": True},
        {"radius_mm": joined, "thickness_mm": 2e-4, "glass": FLINT},
        {"radius_mm": back},
    )
    slope = 0.002
    red, green, blue = through(doublet, slope)
    y = AHEAD * slope
    assert slope - green == pytest.approx(y * POWER, rel=1e-4)
    assert abs(red - blue) < 1e-3 * y * POWER / v1  # of the singlet's
    assert 0.01 < abs(red - green) / (y * POWER / v1) < 0.05  # secondary spectrum, f/2000: a thirtieth


def test_channels_are_the_lens_at_their_wavelengths():
    """So what holds for the rays of one wavelength holds for each channel."""
    for name in ("triplet", "double-gauss"):
        three = lens(name).at(40.0, wavelengths_nm=CHANNELS_NM)
        for channel, wavelength in enumerate(CHANNELS_NM):
            assert three.of_channel(channel) == lens(name).at(40.0, wavelength_nm=wavelength)
        assert three.focal_mm == lens(name).at(40.0, wavelength_nm=LINE_D_NM).focal_mm
        assert three.enlarged(2.0).moved(1.0).wavelengths_nm == CHANNELS_NM


def test_cameras_of_three_wavelengths_survive_their_file(tmp_path):
    element = {"kind": "surfaces", "z_mm": 60, "prescription": "triplet", "wavelengths_nm": [610, 550, 465]}
    path = tmp_path / "c.json"
    path.write_text(
        json.dumps({"pixels": [64, 32], "lenses": [8, 4], "pixel_pitch_mm": 0.1, "gap_mm": 1, "optics": [element]})
    )
    camera = preset(path)
    assert IICamera.from_json(camera.to_json()) == camera and camera.front[0].wavelength_nm == 550
    assert [c.front[0].wavelength_nm for c in camera.channel_cameras()] == [610, 550, 465]
    plain = preset("plenoptic1-double-gauss", scale=32)
    assert plain.channel_cameras() == (plain,)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"wavelengths_nm": [610, 550]}, "wavelengths_nm is .610, 550.: three"),
        ({"wavelengths_nm": [610, 550, 100]}, "wavelength_nm is 100"),
        ({"wavelengths_nm": [610, 550, 465], "wavelength_nm": 500}, "one of them is needed"),
        ({"wavelengths_nm": [610, "d", 465]}, "wavelengths_nm of green is 'd'"),
        ({"wavelengths_nm": "rgb"}, "wavelengths_nm is 'rgb'"),
    ],
)
def test_wrong_wavelengths_are_refused(values, message):
    with pytest.raises((ValueError, TypeError), match=message):
        Surfaces(z_mm=0, surfaces=[GOOD, LAST], **values)


# -- cameras


@pytest.mark.parametrize("name", ["plenoptic1-double-gauss", "plenoptic2-triplet"])
def test_scale_keeps_planes_and_field_of_lenses_that_cannot_change(name):
    full = preset(name)
    for scale in (2, 8, 32):
        coarse = preset(name, scale=scale)
        for plane in ("scene", "lenses"):
            z = [
                (image_planes(c)[0]["scene_z_mm"] if plane == "scene" else through_front_mm(c, c.gap_mm))
                + c.origin_mm[2]
                for c in (full, coarse)
            ]
            assert z[1] == pytest.approx(z[0], rel=1e-9)
        assert coarse.front[-1].z_mm + coarse.origin_mm[2] == pytest.approx(full.front[-1].z_mm, rel=1e-12)
        assert [s.radius_mm for s in coarse.front[-1].surfaces] == [s.radius_mm for s in full.front[-1].surfaces]
    # Field: the outermost lens sees the scene in the same direction, half a lens apart.
    ends = []
    for c in (full, preset(name, scale=2)):
        u, v = c.ei_pixels
        _, D = c.rays_at(u // 2, c.pixels[1] // 2 + v // 2, sample=(0, 0))
        x = -(c.pixels[0] - u) / 2 * c.pixel_pitch_mm
        ends.append(D[0] / D[2] / x)
    assert ends[1] == pytest.approx(ends[0], rel=5e-3)


def test_camera_of_surfaces_survives_its_file(tmp_path):
    camera = preset("plenoptic2-triplet", scale=16)
    again = IICamera.from_json(json.loads(json.dumps(camera.to_json())))
    assert again == camera
    for one, two in zip(camera.rays(slice(0, 64)), again.rays(slice(0, 64)), strict=True):
        np.testing.assert_array_equal(one, two)


def test_presets_image_the_plane_that_they_say():
    # Rays of one lens's pixels through the middle of the double Gauss meet in the plane of focus, 210 mm ahead.
    camera = preset("plenoptic1-double-gauss")
    assert through_front_mm(camera, camera.gap_mm) == pytest.approx(210, abs=2)
    assert image_planes(preset("plenoptic2-triplet"))[0]["scene_z_mm"] == pytest.approx(235, abs=2)


def test_prescription_beside_the_camera_file(tmp_path):
    values = {
        "pixels": [64, 32], "lenses": [8, 4], "pixel_pitch_mm": 0.01, "gap_mm": 0.2,
        "optics": [{"kind": "surfaces", "prescription": "mine.json", "z_mm": 50, "enlarge": 2}],
    }  # fmt: skip
    (tmp_path / "camera.json").write_text(json.dumps(values))
    one = {"surfaces": [{"radius_mm": 50, "thickness_mm": 5, "glass": "F2", "stop": True, "diameter_mm": 20}, {}]}
    (tmp_path / "mine.json").write_text(json.dumps(one))
    front = preset(tmp_path / "camera.json").front[0]
    assert (front.surfaces[0].radius_mm, front.surfaces[0].diameter_mm, front.end_mm) == (100, 40, 60)


# -- bad input


@pytest.mark.parametrize(
    ("surfaces", "message"),
    [
        ([], "there are 0: 1 to 200"),
        ([{**GOOD, "stop": False}, LAST], "no surface is the stop"),
        ([GOOD, {**LAST, "stop": True, "diameter_mm": 9}], "surfaces 1, 2 are the stop"),
        ([{**GOOD, "diameter_mm": None}, LAST], "surface 1: the stop has no diameter_mm"),
        ([{**GOOD, "thickness_mm": -2.0}, LAST], "surface 1: thickness_mm is -2: a distance from 0"),
        ([{**GOOD, "thickness_mm": 0.0}, LAST], "surface 1 has glass and thickness_mm 0"),
        ([LAST, GOOD], "surface 2, the last, has glass behind it"),
        ([GOOD, {**LAST, "thickness_mm": 60.0}], "surface 2, the last, has thickness_mm 60: none is needed"),
        ([{**GOOD, "thickness_mm": 1.0}, {**LAST, "radius_mm": -12.0}], "surfaces 1 and 2 cross: the gap"),
        ([{**GOOD, "radius_mm": 8.0}, LAST], "surface 1: diameter_mm is 20: .* is at most 16 wide"),
        ([{**GOOD, "radius_mm": 0.0}, LAST], "surface 1: the size of radius_mm is 0"),
        ([{**GOOD, "radius_mm": "50"}, LAST], "surface 1: radius_mm is '50', a str"),
        ([{**GOOD, "glass": "BK8"}, LAST], "surface 1: unknown glass 'BK8': near it are .*BK7 "),
        ([{**GOOD, "glass": 0.5}, LAST], "surface 1: glass: ior is 0.5"),
        ([{**GOOD, "glass": {"sellmeier": [1, 2]}}, LAST], "surface 1: .*six numbers"),
        ([{**GOOD, "focal": 3}, LAST], "surface 1 has no focal: known are radius_mm"),
        ([{**GOOD, "aspheric": 1e-6}, LAST], "surface 1: aspheric is 1e-06, a float"),
        ([{**GOOD, "aspheric": [0, "1e-6"]}, LAST], "surface 1: aspheric is '1e-6', a str"),
        ([{**GOOD, "aspheric": [0, math.nan]}, LAST], "surface 1: aspheric is nan"),
        ([{**GOOD, "aspheric": [0] * 9}, LAST], "surface 1: aspheric has 9 coefficients: at most 8, of r² to r¹⁶"),
        ([{**GOOD, "aspheric": [0, 1e-3]}, {**LAST, "diameter_mm": 20.0}], "surfaces 1 and 2 cross: the gap"),
        ([GOOD, 5], "surface 2 is 5: an object"),
        # Almost a cone of glass, 55° steep: parallel light within it meets no point at less than the critical angle.
        ([{"conic": -1.5, "radius_mm": 0.01, "thickness_mm": 20.0, "glass": 1.9, "diameter_mm": 18.0},
          {"stop": True, "diameter_mm": 18.0}], "no ray beside the axis passes: surface 1 stops it"),
    ],
)  # fmt: skip
def test_wrong_surfaces_are_one_clear_line(surfaces, message):
    with pytest.raises(ValueError, match=f"^surfaces: .*{message}") as error:
        Surfaces(z_mm=10.0, surfaces=surfaces)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("wavelength", [100.0, 5000.0, math.nan])
def test_wavelengths_that_glass_does_not_have(wavelength):
    with pytest.raises(ValueError, match=r"wavelength_nm is .*: a wavelength from 200 to 2500 nm"):
        Surfaces(z_mm=10.0, surfaces=(GOOD, LAST), wavelength_nm=wavelength)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"z_mm": None}, "z_mm is missing"),
        ({"prescription": "tessar"}, "unknown lens 'tessar': known are double-gauss, triplet"),
        ({"prescription": "a" * 4000}, r"surfaces: prescription is 'a{58}…: at most 255"),
        ({"prescription": "a" * 4000 + ".json"}, "at most 255 characters"),
        ({"kind": "lens"}, "an element with a prescription has"),
        ({"focal_mm": 50}, "no focal_mm"),
        ({"enlarge": -1}, "enlarge is -1"),
    ],
)
def test_wrong_prescriptions_in_camera_files(tmp_path, change, message):
    element = {"kind": "surfaces", "prescription": "triplet", "z_mm": 60, **change}
    element = {key: value for key, value in element.items() if value is not None}
    values = {"pixels": [64, 32], "lenses": [8, 4], "pixel_pitch_mm": 0.01, "gap_mm": 0.2, "optics": [element]}
    (tmp_path / "camera.json").write_text(json.dumps(values))
    with pytest.raises(ValueError, match=message):
        preset(tmp_path / "camera.json")


# -- Zemax files


def zmx(prescription, *, extra="", glass_line="GLAS {} 0 0 1.6 50 0"):
    """The text of a Zemax file of a prescription."""
    lines = ["VERS 140124 258 36214", "MODE SEQ", "NAME a lens", "UNIT MM X W X CM MR CPMM", "PWAV 2"]
    lines += ["WAVM 1 0.4861327 1", "WAVM 2 0.5875618 1", "WAVM 3 0.6562725 1"]
    lines += ["SURF 0", "  TYPE STANDARD", "  CURV 0.0 0 0 0 0", "  DISZ INFINITY", "  DIAM 0 0 0 0 1"]
    for i, s in enumerate(prescription.surfaces, 1):
        last = i == len(prescription.surfaces)
        lines += [f"SURF {i}", *(["  STOP"] if s.stop else []), "  TYPE STANDARD", f"  CURV {s.curvature!r} 0 0 0 0"]
        lines += [f"  CONI {s.conic}"] if s.conic else []
        lines += [f"  DISZ {prescription.back_mm if last else s.thickness_mm!r}"]
        lines += [f"  {glass_line.format(s.glass.name)}"] if s.glass else []
        lines += [f"  DIAM {s.diameter_mm / 2!r} 1 0 0 1"] if s.diameter_mm else []
    lines += [
        f"SURF {len(prescription.surfaces) + 1}",
        "  TYPE STANDARD",
        "  CURV 0.0",
        "  DISZ 0",
        "  DIAM 18 0 0 0 1",
    ]
    return "\n".join(lines) + "\n" + extra


@pytest.mark.parametrize("coding", ["utf-8", "utf-16", "latin-1"])
def test_zemax_files_are_the_same_lens(tmp_path, coding):
    expected = lens("double-gauss")
    path = tmp_path / "gauss.ZMX"
    path.write_bytes(zmx(expected).encode(coding))
    found = lens(path)
    assert (found.back_mm, found.about, found.wavelength_nm) == (expected.back_mm, "a lens", pytest.approx(587.5618))
    heights = np.linspace(-8, 8, 33)
    one, two = (x.at(61.0, wavelength_nm=550.0).pass_on(fan(0.0, heights, target_z=61.0)) for x in (expected, found))
    np.testing.assert_allclose(columns(two)[0], columns(one)[0], atol=ROUNDING)
    np.testing.assert_array_equal(two.weight, one.weight)


def test_zemax_glass_by_its_index_and_planes_of_air(tmp_path):
    text = zmx(lens("triplet"), glass_line="GLAS ___BLANK 1 0 1.6 50 0 0 0 0 0 0")
    dummy = "SURF 1\n  TYPE STANDARD\n  CURV 0\n  DISZ 3\n  DIAM 40 0 0 0 1\n"
    (tmp_path / "a.zmx").write_text(text.replace("SURF 1\n", dummy + "SURF 1\n", 1))
    found = lens(tmp_path / "a.zmx")
    assert len(found.surfaces) == 6 and found.surfaces[0].glass == Glass(name="___BLANK", ior=1.6, abbe=50.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("TYPE STANDARD", "TYPE TOROIDAL"), "surface 0 is of type TOROIDAL"),
        (("GLAS F2", "GLAS MIRROR"), "surface 3 is a mirror"),
        (("GLAS F2 0 0 1.6 50", "GLAS KZFS99"), "surface 3: unknown glass 'KZFS99': near it are KZFSN4"),
        (("GLAS F2 0 0 1.6 50", "GLAS SK16 0 0 1.6 50"), "surface 3: unknown glass 'SK16': near it are N-SK16"),
        (
            ("GLAS F2 0 0 1.6 50", "GLAS F2 1 0 1.5 40"),
            "surface 3: model glass 'F2' has index 1.5 .* 1.62004 and 36.37",
        ),
        (("GLAS F2 0 0 1.6 50", "GLAS ___BLANK 1 0 0 40"), "surface 3: model glass '___BLANK' has the index 0"),
        (("GLAS F2 0 0 1.6 50", "GLAS F2 2 3 1.6 50"), "surface 3 has the glass of surface 3: an earlier surface"),
        (("GLAS F2 0 0 1.6 50", "GLAS F2 2 2 1.6 50"), "surface 3 has the glass of surface 2: an earlier surface"),
        (("GLAS F2 0 0 1.6 50", "GLAS F2 4 0 1.6 50"), "surface 3: glass 'F2' has the solve 4: 0, 1, 2 and 3"),
        (
            ("UNIT MM", "GCAT CDGM MISC\nUNIT MM"),
            "surface 3: glass 'F2' is known from Schott, .* names only CDGM MISC",
        ),
        (("SURF 0\n", "SURF 0\n  GLAS F2 0 0 1.5 40\n"), "surface 0, the object, has glass: a lens in air"),
        (("UNIT MM", "UNIT FURLONG"), "unit 'FURLONG'"),
        (("DISZ 4.75041", "GLAS MIRROR\n  DISZ -4.75041"), "surface 4 is a mirror"),
        (("DISZ 4.75041", "DISZ -4.75041"), "surface 4: thickness is -4.75"),
        (("DISZ 4.75041", "DISZ INFINITY"), "surface 4: thickness is inf"),
        (("  STOP\n", ""), "no surface is the stop"),
        (("CURV 0.0 0 0 0 0\n  DISZ INF", "CURV x\n  DISZ INF"), "surface 0: 'x' is no number"),
        (("SURF", "FACE"), "no Zemax lens file"),
    ],
)
def test_wrong_zemax_files_are_one_clear_line(tmp_path, change, message):
    path = tmp_path / "bad.zmx"
    path.write_text(zmx(lens("triplet")).replace(*change))
    with pytest.raises(ValueError, match=message) as error:
        lens(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("unit", "line", "diameter"), [("MM", "ENPD 10.0", 8.0), ("MM", "FNUM 5.0 0", 16.0), ("CM", "ENPD 1.0", 8.0)]
)
def test_a_zemax_stop_without_a_rim_has_that_of_the_entrance_pupil(tmp_path, unit, line, diameter):
    """20 mm behind a plano-convex lens of f = 100 mm, whose last vertex the parallel rays reach as they came."""
    mm = {"MM": 1, "CM": 10}[unit]
    lines = [
        f"UNIT {unit}",
        line,
        "SURF 0",
        "  DISZ INFINITY",
        "SURF 1",
        f"  DISZ {4 / mm}",
        "  GLAS ___BLANK 1 0 1.5",
    ]
    lines += ["SURF 2", f"  CURV {-mm / 50}", f"  DISZ {20 / mm}", "SURF 3", "  STOP", f"  DISZ {80 / mm}", "SURF 4"]
    path = tmp_path / "lens.zmx"
    path.write_text("\n".join(lines))
    found = lens(path)
    assert found.at(0.0).focal_mm == pytest.approx(100)
    assert [s.diameter_mm for s in found.surfaces] == [None, None, pytest.approx(diameter)]
    for other, said in ("", "no DIAM, and the file no ENPD or FNUM"), ("ENPD 0", "ENPD is 0: the stop of no DIAM"):
        path.write_text("\n".join(lines).replace(line, other))
        with pytest.raises(ValueError, match=said):
            lens(path)


@pytest.mark.parametrize("placeholder", ["1.5 40", "1.5168 64.17", ""])
def test_zemax_numbers_of_catalogue_glasses_are_placeholders(tmp_path, placeholder):
    """A cemented achromat of f = 100 mm; taken for its glasses, 1.5 and 40 made it one of 81 mm."""
    glasses = iter(("N-BK7", "SF5"))
    lines = ["UNIT MM", "GCAT SCHOTT MISC", "SURF 0", "  DISZ INFINITY"]
    for radius, thickness in ((62.75, 4.0), (-45.71, 2.5), (-128.23, 97.09)):
        lines += [f"SURF {len(lines)}", f"  CURV {1 / radius!r}", f"  DISZ {thickness}", "  DIAM 12.7"]
        lines += [f"  GLAS {name} 0 0 {placeholder}"] if (name := next(glasses, "")) else ["  STOP"]
    (tmp_path / "achromat.zmx").write_text("\n".join([*lines, "SURF 9", "  CURV 0"]))
    found = lens(tmp_path / "achromat.zmx")
    assert [s.glass for s in found.surfaces] == [CATALOGUE["N-BK7"], CATALOGUE["SF5"], None]
    assert found.at(0.0).focal_mm == pytest.approx(100.1, abs=0.2)
    assert abs(1 / found.at(0.0).image_mm(-97.09)) < 0.3 / 100**2  # the file's back focal distance, to 0.3 mm


def test_zemax_pickups_and_substitutes(tmp_path):
    """The third glass is that of surface 1; the second one may be replaced in an optimization."""
    crown, flint, last = (f"GLAS {name} 0 0 1.6 50 0" for name in ("N-SK16", "F2", "N-SK16"))
    before, middle, after = zmx(lens("triplet")).split(crown)
    text = before + crown + middle.replace(flint, "GLAS F2 3 0 1.5 40") + last.replace("0 0 1.6", "2 1 1.5") + after
    assert "GLAS F2 3 0" in text and "GLAS N-SK16 2 1" in text
    (tmp_path / "a.zmx").write_text(text)
    assert lens(tmp_path / "a.zmx").surfaces == lens("triplet").surfaces


@pytest.mark.parametrize(("unit", "mm"), [("MM", 1.0), ("IN", 25.4)])
def test_zemax_even_aspheres(tmp_path, unit, mm):
    """Coefficients are in the unit of the file: that of r⁴ per cubic unit."""
    plain = lens("triplet")
    head = "TYPE EVENASPH\n  PARM 1 2e-4\n  PARM 2 1e-6\n  PARM 4 -3e-11\n  PARM 8 0\n  CURV 0.0454"
    text = zmx(plain).replace("TYPE STANDARD\n  CURV 0.0454", head).replace("UNIT MM", f"UNIT {unit}")
    (tmp_path / "asphere.zmx").write_text(text)
    found = lens(tmp_path / "asphere.zmx").surfaces
    expected = (2e-4 / mm, 1e-6 / mm**3, 0.0, -3e-11 / mm**7)
    np.testing.assert_allclose(found[0].aspheric, expected, rtol=1e-14)
    assert [x.radius_mm for x in found] == pytest.approx([x.radius_mm * mm for x in plain.surfaces], rel=1e-14)
    (tmp_path / "sphere.zmx").write_text(zmx(plain).replace("TYPE STANDARD", "TYPE EVENASPH\n  PARM 2 0"))
    assert lens(tmp_path / "sphere.zmx").surfaces == plain.surfaces
    (tmp_path / "nine.zmx").write_text(text.replace("PARM 8 0", "PARM 9 1e-20"))
    with pytest.raises(ValueError, match="surface 1: PARM 9 of an even asphere: 1 to 8 are read"):
        lens(tmp_path / "nine.zmx")


# -- even aspheres


def expansion(radius, conic, terms=8):
    """Coefficients of r², r⁴, … in the sag of a conic: the binomial series of its root."""
    k, c = 1 + conic, 1 / radius
    return [
        math.comb(2 * i - 2, i - 1) / i / 2 ** (2 * i - 1) * k ** (i - 1) * c ** (2 * i - 1)
        for i in range(1, terms + 1)
    ]


def test_conics_are_those_of_before_to_the_last_bit():
    """Sums of the rays of version 0.1 before aspheres; products, quotients and roots are rounded alike everywhere."""
    sums = {
        "triplet": "a14b43b7da1a14d7",
        "double-gauss": "91343ce7eaf75be5",
        "conic singlet": "153a5df2f3eafde8",
    }
    steps = np.arange(-40, 41) / 128
    dx, dy = np.meshgrid(steps, steps)
    for name, expected in sums.items():
        placed, back = cases()[name](486.1327)
        out = placed.pass_on(rays_at(0.5, -0.25, -back, dx, dy, 1.0))
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in out)).hexdigest()
        assert digest[:16] == expected, name
        assert out.weight.sum() > 500


def test_parabola_by_its_conic_and_by_its_coefficient():
    radius, tail = 25.0, {"thickness_mm": 6.0, "glass": 1.6, "diameter_mm": 22.0, "stop": True}
    back = {"radius_mm": -90.0}
    made = [
        Surfaces(z_mm=10.0, surfaces=({**front, **tail}, back))
        for front in ({"radius_mm": radius, "conic": -1.0}, {"aspheric": [1 / (2 * radius)]})
    ]
    x, y = np.meshgrid(np.linspace(-8, 8, 17), np.linspace(-8, 8, 17))
    one, two = (m.pass_on(rays_at(0.3, -1.0, -20.0, x - 0.3, y + 1.0, 30.0)) for m in made)
    np.testing.assert_array_equal(one.weight, two.weight)
    assert 100 < one.weight.sum() < x.size
    for a, b in zip(columns(one)[:2], columns(two)[:2], strict=True):
        np.testing.assert_allclose(b, a, atol=10 * ROUNDING)
    np.testing.assert_allclose(made[1].paraxial(), made[0].paraxial(), rtol=1e-14)
    assert made[1].pupil() == pytest.approx(made[0].pupil(), rel=1e-14)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_hyperboloid_by_its_expansion_focuses_to_a_point(share):
    """κ = −n² towards air has no aberration for a point at infinity; ``share`` of its curvature is in the radius."""
    n, radius, half = 1.5, 30.0, 8.0
    focus = radius / (n - 1)

    def made(back):
        return Surfaces(z_mm=focus, surfaces=({"thickness_mm": 5.0, "glass": n}, back))

    rim = {"diameter_mm": 2 * half, "stop": True}
    conic = made({"radius_mm": -radius, "conic": -(n**2), **rim})
    coefficients = np.array(expansion(-radius, -(n**2)))
    base = {} if share == 0 else {"radius_mm": -radius / share, "conic": -(n**2)}
    if share:
        coefficients -= expansion(-radius / share, -(n**2))
    series = made({**base, "aspheric": coefficients.tolist(), **rim})
    assert series.focal_mm == pytest.approx(conic.focal_mm, rel=1e-12)
    heights = np.linspace(-9, 9, 73)
    # Rays of the focus leave parallel to the axis: reversed, collimated light meets in a point.
    (L1, _, w1), (L2, D2, w2) = (columns(m.pass_on(fan(0.0, heights, target_z=focus))) for m in (conic, series))
    np.testing.assert_array_equal(w1, w2)
    assert 40 < w2.sum() < heights.size
    on = w2 > 0
    np.testing.assert_allclose(L2[on], L1[on], atol=1e-6)
    np.testing.assert_allclose(D2[on], np.broadcast_to([0, 0, 1], D2[on].shape), atol=1e-7)


@pytest.mark.parametrize("radius", [None, 1.6, -3.0])
def test_normals_of_aspheres_are_the_slope_of_the_sag(radius):
    """The deviation of parallel rays by Snell's law from the slope by finite differences."""
    n = 1.54
    surface = Surface(
        radius_mm=radius, conic=-0.6, aspheric=(0.02, 0.01, 0.004, -0.012, 0.02, -0.015, 0.004, -0.001),
        diameter_mm=1.8, thickness_mm=1.0, glass=Glass(ior=n),
    )  # fmt: skip
    made = Surfaces(z_mm=0.0, surfaces=(surface, {"stop": True, "diameter_mm": 1.8}))
    heights = np.linspace(-0.88, 0.88, 23)
    L, D, weight = columns(made.pass_on(fan(-1.0, heights)))
    assert (weight == 1).all()
    np.testing.assert_allclose(L[:, 2], 1.0 - np.array([surface.sag(h) for h in heights]), atol=ROUNDING)
    step = 1e-5
    slope = np.array([(surface.sag(h + step) - surface.sag(h - step)) / (2 * step) for h in heights])
    inside = np.arctan(slope)
    np.testing.assert_allclose(np.arctan2(D[:, 1], D[:, 2]), inside - np.arcsin(n * np.sin(inside)), atol=1e-9)
    assert surface.vertex_curvature == pytest.approx((0 if radius is None else 1 / radius) + 0.04, rel=1e-15)
    near = made.paraxial()
    np.testing.assert_allclose(-1 / near.c, (1 / surface.vertex_curvature) / (n - 1), rtol=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    radius=st.floats(2, 20), hollow=st.booleans(), conic=st.floats(-5, 1),
    shares=st.lists(st.floats(-0.01, 0.01), min_size=1, max_size=8),
    slopes=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
)  # fmt: skip
def test_rays_meet_aspheres_where_they_were_made_to(radius, hollow, conic, shares, slopes):
    """Rays through points of the surface; one that does not converge would be stopped."""
    half = 0.5 * radius / math.sqrt(max(1 + conic, 1))
    surface = Surface(
        radius_mm=-radius if hollow else radius, conic=conic, diameter_mm=2 * half, stop=True,
        aspheric=[share * half / half ** (2 * i) for i, share in enumerate(shares, 1)],
    )  # fmt: skip
    made = Surfaces(z_mm=0.0, surfaces=(surface,))
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    r = 0.999 * half * np.sqrt((np.arange(24) + 0.5) / 24)
    x, y, z = r * np.cos(5 * angles), r * np.sin(5 * angles), -np.array([surface.sag(float(a)) for a in r])
    ahead = 4 * radius
    out = made.pass_on(rays_at(x - slopes[0] * ahead, y - slopes[1] * ahead, z - ahead, *slopes, 1.0))
    step = 1e-6 * half
    tilt = np.array([(surface.sag(float(a) + step) - surface.sag(float(a) - step)) / (2 * step) for a in r])
    facing = 1 + tilt * (slopes[0] * np.cos(5 * angles) + slopes[1] * np.sin(5 * angles))
    clear = facing > 0.3  # others graze the surface, and may meet it before
    assert (out.weight[clear] == 1).all()
    np.testing.assert_allclose(columns(out)[0][clear], np.stack([x, y, z], axis=-1)[clear], atol=1e-11)


def test_rays_that_miss_an_asphere_are_finite_and_blocked():
    deep = {"radius_mm": 5.0, "aspheric": [0, 1e-3, -1e-4], "diameter_mm": 9.0, "stop": True}
    made = Surfaces(z_mm=0.0, surfaces=(deep,))
    far = rays_at(
        [0, 1e100, 40, 0, 7], [0, 0, 0, 1e9, 0], -30.0, [0, 0, 1, 0, -1e-9], [0, 1, 0, -3, 0], [1, 1, 1, 1, 1]
    )
    L, D, weight = columns(made.pass_on(far))
    np.testing.assert_array_equal(weight, [1, 0, 0, 0, 0])
    assert np.isfinite(L).all() and np.isfinite(D).all()


def test_aspheres_enlarge_and_survive_their_file():
    surface = {**GOOD, "conic": -0.5, "aspheric": [1e-4, 2e-6, 0, -1e-11, 0, 0]}
    made = Surfaces(z_mm=20.0, surfaces=(surface, LAST))
    assert made.surfaces[0].aspheric == (1e-4, 2e-6, 0.0, -1e-11)
    again = Surfaces(**{k: v for k, v in json.loads(json.dumps(made.to_json())).items() if k != "kind"})
    assert again == made and "aspheric" not in made.to_json()["surfaces"][1]
    twice = made.enlarged(2.0)
    assert twice.focal_mm == pytest.approx(2 * made.focal_mm, rel=1e-14)
    assert twice.surfaces[0].sag(14.0) == pytest.approx(2 * made.surfaces[0].sag(7.0), rel=1e-14)
    heights = np.linspace(-8, 8, 9)
    small, large = made.pass_on(fan(0.0, heights)), twice.pass_on(fan(0.0, 2 * heights))
    np.testing.assert_allclose(large.dy, small.dy, atol=ROUNDING)


def test_the_kernel_without_compilation():
    """Rays through an asphere, a conic, a stop and a plane; some are stopped at each, some run backwards."""
    made = Surfaces(
        z_mm=5.0,
        surfaces=(
            {**GOOD, "thickness_mm": 6.0, "aspheric": [1e-4, -2e-5], "stop": False},
            {"radius_mm": -40.0, "conic": -1.5, "thickness_mm": 2.0, "diameter_mm": 18.0},
            {"thickness_mm": 1.0, "diameter_mm": 11.0, "stop": True},
            {},
        ),
    )
    rng = np.random.default_rng(0)
    coordinates = np.concatenate([rng.normal(0, 4, (2, 600)), np.zeros((1, 600)), rng.normal(0, 0.4, (3, 600))])
    coordinates[5] += 0.9
    found = coordinates.copy()
    stopped = refraction.traced(found, made._met)
    assert set(stopped) == {0, 1, 2, 3, 4}
    with patch.object(refraction, "_trace", refraction._trace.py_func), np.errstate(all="ignore"):
        np.testing.assert_array_equal(refraction.traced(coordinates, made._met), stopped)
    np.testing.assert_array_equal(coordinates, found)
