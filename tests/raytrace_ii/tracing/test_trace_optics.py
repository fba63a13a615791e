"""Reflection, refraction, Fresnel term and absorption, in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from raytrace_ii import Background, Material, Scene, trace
from raytrace_ii.scene.textures import Checker
from raytrace_ii.shapes.primitives import Mesh
from raytrace_ii.tracing.kernels.media import fresnel
from raytrace_ii.tracing.kernels.srgb import encode_srgb
from raytrace_ii.tracing.kernels.tables import LEAST_WEIGHT
from raytrace_ii.tracing.packing import LIFT
from tests.support.trace_scenes import (
    BLACK,
    UNIFORM,
    WHITE,
    body,
    box,
    floor,
    lamp,
    ramp,
    reflectance,
    sphere,
    spread,
    sun,
    wall,
)

# Radiance is float32 and the sum of a few terms, each from cosines that are right to about 1e-7.
RTOL = 2e-6


def looked(scene, origin, direction):
    """Radiance along one ray."""
    return trace(scene, [origin], [direction]).radiance[0].astype(float)


# Fresnel


@pytest.mark.parametrize("ior", [1.33, 1.5, 2.4])
def test_fresnel_at_normal_incidence_and_at_brewsters_angle(ior):
    for ratio in (ior, 1 / ior):
        assert fresnel(1.0, ratio)[0] == pytest.approx(((ior - 1) / (ior + 1)) ** 2, rel=1e-12)
        brewster = math.atan(1 / ratio)  # tan θ = n2/n1
        # no reflection of the p part: half of the s part is left, sin²(θi − θt) with θi + θt = 90°
        only_s = math.cos(2 * brewster) ** 2 / 2
        assert fresnel(math.cos(brewster), ratio)[0] == pytest.approx(only_s, rel=1e-9)


def test_fresnel_at_the_critical_angle():
    ratio = 1.5
    critical = math.asin(1 / ratio)
    reflected, behind = fresnel(math.cos(critical + 1e-6), ratio)
    assert (reflected, behind) == (1.0, 0.0)
    reflected, behind = fresnel(math.cos(critical - 1e-6), ratio)
    # Just before, sin θt = 1 − 1e-6·ratio·cos θc, so cos θt = √(2e-6·ratio·cos θc); 1e-3 for the next order
    assert behind == pytest.approx(math.sqrt(2e-6 * ratio * math.cos(critical)), rel=1e-3)
    assert 0.98 < reflected < 1
    assert fresnel(0.0, 1 / 1.5)[0] == 1.0, "all is reflected at grazing incidence"


@given(angle=st.floats(1e-3, math.pi / 2 - 1e-3), ratio=st.floats(0.3, 3.5).filter(lambda r: abs(r - 1) > 1e-2))
def test_fresnel_keeps_energy_and_agrees_with_the_angle_formulas(angle, ratio):
    cosine = math.cos(angle)
    reflected, behind = fresnel(cosine, ratio)
    plain = fresnel.py_func(cosine, ratio)
    # sines of compiled and interpreted code are the same; sums may be contracted
    np.testing.assert_allclose((reflected, behind), plain, rtol=1e-12)
    if ratio * math.sin(angle) >= 1:
        assert (reflected, behind) == (1.0, 0.0)
        return
    assert behind == pytest.approx(math.sqrt(1 - (ratio * math.sin(angle)) ** 2), abs=1e-9)
    # amplitudes that pass, and the power they carry: n2 cos θt / (n1 cos θi)
    s = 2 * ratio * cosine / (ratio * cosine + behind)
    p = 2 * ratio * cosine / (cosine + ratio * behind)
    passed = behind / (ratio * cosine) * (s * s + p * p) / 2
    assert reflected + passed == pytest.approx(1, abs=1e-9)
    refracted = math.asin(ratio * math.sin(angle))
    if abs(angle - refracted) > 1e-4:
        s = math.sin(angle - refracted) / math.sin(angle + refracted)
        p = math.tan(angle - refracted) / math.tan(angle + refracted)
        assert reflected == pytest.approx((s * s + p * p) / 2, rel=1e-6, abs=1e-9)


# Glass


@pytest.mark.parametrize("degrees", [0, 10, 35, 60, 80])
def test_a_slab_shifts_a_ray_and_leaves_its_direction(degrees):
    """Two walls of known colour ramps at different depths read off where the ray goes: shift and direction."""
    angle, thick, ior = math.radians(degrees), 7.0, 1.5
    inner = math.asin(math.sin(angle) / ior)
    direction = np.array([math.sin(angle) * 0.6, math.sin(angle) * 0.8, math.cos(angle)])
    shift = thick * (math.tan(angle) - math.tan(inner))  # to the side, in the plane of incidence, along a wall
    slab = body(box(260, 260, thick), at=(0, 0, 10), transmission=WHITE, ior=ior)
    for z in (20.0, 60.0):
        half = 500.0
        # two bounces: in, out, the wall; not those reflected inside
        scene = Scene(bodies=[ramp(wall(z, half), half), slab], ambient=WHITE, max_depth=2)
        r, g, b = looked(scene, (3, -2, 0), direction * 5)
        assert b == pytest.approx((1 - reflectance(math.cos(angle), ior)) ** 2, rel=1e-5)
        seen = (np.array([r, g]) / b * 2 - 1) * half
        straight = np.array([3, -2]) + math.tan(angle) * z * np.array([0.6, 0.8])
        # Each face's ray starts a lift behind it and is pulled as far to its middle; the ramp's colour is float32.
        lift = LIFT * 130
        atol = 4 * lift * (1 + math.tan(angle)) + 4 * half * 2**-24 / b
        np.testing.assert_allclose(seen, straight - shift * np.array([0.6, 0.8]), atol=atol)


def test_glass_of_the_airs_own_index_is_not_there():
    clear = body(sphere(5), at=(0, 0, 20), transmission=WHITE, ior=1.0)
    scene = Scene(bodies=[ramp(wall(60, 100), 100), clear], ambient=WHITE)
    without = Scene(bodies=[ramp(wall(60, 100), 100)], ambient=WHITE)
    directions = np.column_stack([np.linspace(-0.3, 0.3, 41), np.full(41, 0.03), np.ones(41)])
    starts = np.zeros_like(directions)
    # rays go straight on but for the lift off each face, 1e-4 mm of the 200 mm ramp
    np.testing.assert_allclose(
        trace(scene, starts, directions).radiance, trace(without, starts, directions).radiance, atol=2e-6
    )


def test_total_reflection_beyond_the_critical_angle():
    """From inside a slab: up to 41.8° the sky is seen through the face, beyond it only the slab's own walls."""
    slab = body(box(4000, 4000, 10), transmission=WHITE, ior=1.5)
    scene = Scene(bodies=[slab], background=UNIFORM, max_depth=1)
    critical = math.asin(1 / 1.5)
    for angle in (0.0, 0.3, critical - 1e-3):
        expected = 1 - reflectance(math.cos(math.asin(1.5 * math.sin(angle))), 1.5)
        # just below the critical angle the transmitted share rises with the root of what is left: 1e-7 becomes 1e-4
        np.testing.assert_allclose(
            looked(scene, (0, 0, 0), (math.sin(angle), 0, math.cos(angle))), expected, rtol=3e-4
        )
    for angle in (critical + 1e-3, 1.2):
        np.testing.assert_array_equal(looked(scene, (0, 0, 0), (math.sin(angle), 0, math.cos(angle))), 0)


@pytest.mark.parametrize("max_depth", range(9))
def test_absorption_and_inner_reflections_of_a_slab(max_depth):
    """Under a sky of 1 on all sides: R from the front, then what leaves after k ways through the slab.

    The ray inside after k − 1 reflections has been born in generation k; what leaves it is born in k + 1, which must
    not be beyond max_depth. R + Σ_{k=1}^{max_depth−1} (1 − R)² R^{k−1} a^k, with a = exp(−α·d).
    """
    ior, thick = 3.0, 4.0  # a quarter of the light comes back from each face
    absorption = np.array([0.0, 0.05, 0.3])
    slab = body(box(50, 50, thick), at=(0, 0, 20), transmission=WHITE, ior=ior, absorption_per_mm=tuple(absorption))
    scene = Scene(bodies=[slab], background=UNIFORM, max_depth=max_depth)
    r, a = ((ior - 1) / (ior + 1)) ** 2, np.exp(-absorption * thick)
    expected = np.full(3, r if max_depth else 0.0)
    for k in range(1, max_depth):
        term = (1 - r) ** 2 * r ** (k - 1) * a**k
        if term.max() >= LEAST_WEIGHT:  # the seventh is not
            expected = expected + term
    # a ray starts 1e-4 mm behind its face (its coordinates reach 25): that times α of 0.3
    np.testing.assert_allclose(looked(scene, (0.3, 0.2, 0), (0, 0, 1)), expected, atol=3e-5)
    if max_depth == 8:
        whole = r + (1 - r) ** 2 * a / (1 - r * a)
        np.testing.assert_allclose(expected, whole, atol=r**6)


def test_a_clear_body_under_an_even_sky_is_invisible():
    """The furnace: without absorption nothing is lost, however light is bent and split."""
    glass = [
        body(sphere(5, 64), at=(0, 0, 20), transmission=WHITE),
        body(box(5, 6, 4), at=(9, 1, 25), turn=(20, 40, 0)),
    ]
    glass[1] = body(box(5, 6, 4), at=(9, 1, 25), turn=(20, 40, 0), transmission=WHITE)
    generator = np.random.default_rng(0)
    directions = np.column_stack(
        [generator.uniform(-0.4, 0.8, 4000), generator.uniform(-0.4, 0.4, 4000), np.ones(4000)]
    )
    radiance = trace(
        Scene(bodies=glass, background=UNIFORM, max_depth=40), np.zeros_like(directions), directions
    ).radiance
    # What is cut off are weights below 1.5e-4, a few of them on each path; in a box some light is shut in for good.
    assert radiance.max() <= 1 + 1e-5
    assert np.quantile(radiance, 0.05) > 1 - 2e-3
    assert np.median(radiance) > 1 - 2e-4


def test_a_camera_inside_glass_sees_through_one_face():
    """From the middle of a ball every way out is along the normal."""
    absorption, radius = (0.1, 0.2, 0.0), 5.0
    ball = body(sphere(radius, 96), at=(0, 0, 3), transmission=WHITE, ior=1.5, absorption_per_mm=absorption)
    scene = Scene(bodies=[ball], background=UNIFORM, max_depth=1)
    expected = (1 - reflectance(1.0, 1.5)) * np.exp(-radius * np.array(absorption))
    # the faceted ball is up to 0.1 % nearer than its radius: 0.1 % of α·r = 1
    for direction in ((0, 0, 1), (1, 2, -3), (-1, 0.1, 0)):
        np.testing.assert_allclose(looked(scene, (0, 0, 3), direction), expected, rtol=2e-3)


def test_absorption_follows_a_ray_from_a_mirror_to_a_wall_inside_glass():
    """In through a face, 10 mm to a mirror at 45°, 5 mm up to a ceiling, all in the same glass."""
    absorption = np.array([0.02, 0.1, 0.3])
    glass = body(box(40, 40, 40), at=(0, 0, 30), transmission=WHITE, ior=1.5, absorption_per_mm=tuple(absorption))
    mirror = body(wall(0, 3), at=(0, 0, 20), turn=(45, 0, 0), mirror=WHITE, name="mirror")
    ceiling = body(floor(20), at=(0, 5, 20), turn=(180, 0, 0), colour=WHITE, name="ceiling")
    expected = (1 - reflectance(1.0, 1.5)) * np.exp(-15 * absorption)
    seen = looked(Scene(bodies=[glass, mirror, ceiling], ambient=WHITE, max_depth=2), (0, 0, 0), (0, 0, 1))
    # the front's and the mirror's rays start 2e-4 mm off: that times α of 0.3
    np.testing.assert_allclose(seen, expected, rtol=3e-4)


# Mirrors


def test_a_mirror_shows_what_the_mirrored_camera_sees():
    generator = np.random.default_rng(5)
    mirror = body(wall(50, 100), mirror=(1.0, 0.8, 0.7))  # nothing is left for its own colour
    start = generator.uniform(-3, 3, (3000, 3))
    direction = np.column_stack([generator.uniform(-0.5, 0.5, (3000, 2)), np.ones(3000)])
    flipped_start, flipped = start * [1, 1, -1] + [0, 0, 100], direction * [1, 1, -1]
    picture = ramp(wall(-30, 200), 200)  # behind the camera
    room = {"ambient": WHITE, "lights": [lamp((20, 30, 10))]}
    seen = trace(Scene(bodies=[picture, mirror], **room), start, direction).radiance
    direct = trace(Scene(bodies=[picture], **room), flipped_start, flipped).radiance
    # places to 1e-4 mm on a ramp of 1/400 a mm, and as much for the lamp's direction
    np.testing.assert_allclose(seen, direct * np.float32([1.0, 0.8, 0.7]), atol=5e-6)
    assert np.ptp(direct[:, 0]) > 0.2

    mesh = wall(-30, 200)
    checked = body(mesh, coordinates=mesh.vertices, texture=Checker((WHITE, BLACK), (9.0, 9.0, 9.0)), colour=WHITE)
    seen = trace(Scene(bodies=[checked, mirror], ambient=WHITE), start, direction).radiance
    direct = trace(Scene(bodies=[checked], ambient=WHITE), flipped_start, flipped).radiance
    assert 0.3 < direct.mean() < 0.7
    # only rays within 1e-4 mm of a field's border of 9 mm may fall on its other side: one in 10,000
    assert (seen != direct * np.float32([1.0, 0.8, 0.7])).any(axis=1).sum() <= 2


@pytest.mark.parametrize("max_depth", [0, 1, 2, 7, 15])
def test_between_two_mirrors_light_adds_up_as_a_geometric_series(max_depth):
    """Each mirror keeps 0.2 of the light and shows it as its own colour, of ambient light 1."""
    mirrors = [body(wall(z, 50), mirror=(0.8,) * 3, colour=WHITE) for z in (-5, 5)]
    scene = Scene(bodies=mirrors, ambient=WHITE, max_depth=max_depth)
    # Σ 0.2·0.8^k to max_depth is 1 − 0.8^(max_depth + 1)
    np.testing.assert_allclose(looked(scene, (1, 2, 0), (0.01, 0.02, 1)), 1 - 0.8 ** (max_depth + 1), rtol=RTOL)


def test_recursion_ends_when_a_weight_is_too_small_to_see():
    mirrors = [body(wall(z, 50), mirror=(0.5,) * 3, colour=WHITE) for z in (-5, 5)]
    seen = trace(Scene(bodies=mirrors, ambient=WHITE, max_depth=60), [(1, 2, 0)], [(0, 0, 1)])
    # 0.5^k ≥ 0.5/255/12.92 up to k = 12
    assert seen.count.rays["reflection"] == math.floor(math.log2(1 / LEAST_WEIGHT)) == 12
    assert abs(seen.radiance[0, 0] - 1) < LEAST_WEIGHT


def test_depth_zero_has_local_light_only():
    mirror = body(wall(20), mirror=(0.75,) * 3, colour=(0.8, 0.4, 0.2))
    scene = Scene(bodies=[mirror], ambient=WHITE, background=UNIFORM, max_depth=0)
    np.testing.assert_allclose(looked(scene, (0, 0, 0), (0, 0, 1)), 0.25 * np.array([0.8, 0.4, 0.2]), rtol=RTOL)


def bent(mesh, normal):
    """Return a mesh with the same vertex normal everywhere."""
    return Mesh(mesh.vertices, mesh.faces, np.broadcast_to(np.asarray(normal, float), mesh.vertices.shape))


def test_a_bent_normal_cannot_send_a_reflection_into_its_face():
    """Steeply bent, the mirror would show what is behind it: the face's own normal takes over."""
    angle = math.radians(70)
    sky = Background(horizon=(0.2, 0.3, 0.4), zenith=WHITE, nadir=BLACK)
    mirror = body(bent(wall(20), (0, math.sin(angle), -math.cos(angle))), mirror=WHITE)
    seen = looked(Scene(bodies=[mirror], background=sky, max_depth=1), (0, 0, 0), (0, 0, 1))
    np.testing.assert_allclose(seen, (0.2, 0.3, 0.4), rtol=RTOL)
    # bent by less, it is the bent normal that counts: by 20° up, the ray leaves 40° up
    angle = math.radians(20)
    mirror = body(bent(wall(20), (0, math.sin(angle), -math.cos(angle))), mirror=WHITE)
    seen = looked(Scene(bodies=[mirror], background=sky, max_depth=1), (0, 0, 0), (0, 0, 1))
    np.testing.assert_allclose(
        seen, np.array([0.2, 0.3, 0.4]) * (1 - math.sin(2 * angle)) + math.sin(2 * angle), rtol=RTOL
    )


def test_a_bent_normal_cannot_send_refracted_light_back():
    """Leaving glass nearly along the face and along its bent normal, light would turn round: it is dropped."""
    pane = body(bent(wall(5, 500), (0, 0.8, -0.6)), transmission=WHITE, ior=1.5)
    direction = np.array([0, 1 - 0.005, -0.1]) / np.linalg.norm([0, 1 - 0.005, -0.1])
    seen = trace(Scene(bodies=[pane], background=UNIFORM, max_depth=1), [(0, 0, 10)], [direction])
    reflected, behind = fresnel(float(direction @ [0, 0.8, -0.6]), 1.5)
    assert behind > 0 and seen.count.rays["refraction"] == 0
    np.testing.assert_allclose(seen.radiance[0], reflected, rtol=1e-5)


# Light and shadow


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
def test_a_pane_casts_a_coloured_shadow(degrees):
    """Two faces let 1 − R of their colour through each, and absorption takes its part along the slanting way."""
    angle, thick, ior = math.radians(degrees), 2.0, 1.5
    towards = np.array([math.sin(angle), math.cos(angle), 0])
    ground = body(floor(400), colour=WHITE)
    colour, absorption = (0.9, 0.5, 0.2), (0.0, 0.1, 0.4)
    pane = body(
        box(300, thick, 300), at=(0, 10, 0), transmission=colour, absorption_per_mm=absorption, ior=ior, name="pane"
    )
    expected = (
        np.array(colour) ** 2
        * (1 - reflectance(math.cos(angle), ior)) ** 2
        * np.exp(-np.array(absorption) * thick / math.cos(angle))
    )
    for light in (sun(towards), lamp(towards * 4000)):
        free = looked(Scene(bodies=[ground], lights=[light]), (0, 5, 0), (0.02, -1, 0.03))
        dimmed = looked(Scene(bodies=[ground, pane], lights=[light]), (0, 5, 0), (0.02, -1, 0.03))
        # the way inside starts a lift, 6e-4 mm, behind the face: twice as long at 60°, times α of 0.4
        np.testing.assert_allclose(dimmed / free, expected, rtol=1e-3)


def test_a_pane_is_as_dark_to_look_through_as_its_shadow():
    colour, ior = (0.9, 0.5, 0.2), 1.5
    pane = body(box(300, 2, 300), at=(0, 10, 0), transmission=colour, ior=ior)
    sky = Background(horizon=WHITE, zenith=WHITE, nadir=WHITE)
    # depth 2 is the way through both faces and the first face's own reflection, nothing that goes to and fro
    seen = looked(Scene(bodies=[pane], background=sky, max_depth=2), (0, 5, 0), (0, 1, 0))
    r = reflectance(1.0, ior)
    np.testing.assert_allclose(seen, np.array(colour) ** 2 * (1 - r) ** 2 + r * np.array(colour), rtol=1e-5)


def test_panes_multiply_and_what_is_opaque_between_them_blocks():
    ground = body(floor(400), colour=WHITE)
    panes = [body(box(300, 1, 300), at=(0, y, 0), transmission=(0.9, 0.6, 0.3), name=f"{y}") for y in (10, 20, 30)]
    one = looked(Scene(bodies=[ground, panes[0]], lights=[sun((0, 1, 0))]), (0, 5, 0), (0, -1, 0))
    three = looked(Scene(bodies=[ground, *panes], lights=[sun((0, 1, 0))]), (0, 5, 0), (0, -1, 0))
    np.testing.assert_allclose(three, one**3, rtol=1e-5)
    lid = body(box(300, 1, 300), at=(0, 25, 0), name="lid")
    dark = looked(
        Scene(bodies=[ground, *panes, lid], lights=[sun((0, 1, 0)), lamp((0, 40, 0))]), (0, 5, 0), (0, -1, 0)
    )
    np.testing.assert_array_equal(dark, 0)
    # a lamp between the panes is dimmed by the one below it only
    between = looked(Scene(bodies=[ground, *panes], lights=[lamp((0, 15, 0))]), (0, 5, 0), (0, -1, 0))
    np.testing.assert_allclose(between, one, rtol=1e-5)
    # and a lamp below them all is not dimmed
    below = looked(Scene(bodies=[ground, *panes], lights=[lamp((0, 8, 0))]), (0, 5, 0), (0, -1, 0))
    np.testing.assert_allclose(below, 1, rtol=1e-5)


def test_light_through_very_many_panes_is_given_up():
    """64 faces are the most a shadow ray goes through: what is left by then is nothing."""
    ground = body(floor(400), colour=WHITE)
    panes = [body(box(300, 0.1, 300), at=(0, 10 + y, 0), transmission=WHITE, ior=1.01) for y in range(40)]
    assert looked(Scene(bodies=[ground, *panes], lights=[sun((0, 1, 0))]), (0, 5, 0), (0, -1, 0))[0] == 0
    lit = looked(Scene(bodies=[ground, *panes[:31]], lights=[sun((0, 1, 0))]), (0, 5, 0), (0, -1, 0))[0]
    assert lit == pytest.approx((1 - (0.01 / 2.01) ** 2) ** 62, rel=1e-4)


def test_matt_light_goes_with_the_cosine_and_not_with_distance():
    ground = body(floor(400), colour=(0.8, 0.4, 0.2))
    colour = (0.5, 1.0, 0.25)
    for point in np.array([[0.0, 0, 0], [10, 0, -4], [60, 0, 50], [150, 0, 0]]):
        away = np.array([5, 12, -3]) - point
        cosine = away[1] / np.linalg.norm(away)
        for light in (lamp((5, 12, -3), colour), sun(away, colour), sun(away * 1e6, colour)):
            seen = looked(Scene(bodies=[ground], lights=[light]), point + np.array([1, 20, 2]), (-1, -20, -2))
            np.testing.assert_allclose(seen, cosine * np.array([0.8, 0.4, 0.2]) * colour, rtol=2e-4)
        two = looked(
            Scene(bodies=[ground], lights=[light, light], ambient=(0.1,) * 3),
            point + np.array([1, 20, 2]),
            (-1, -20, -2),
        )
        np.testing.assert_allclose(two, (2 * cosine * np.array(colour) + 0.1) * [0.8, 0.4, 0.2], rtol=2e-4)
    from_below = looked(Scene(bodies=[ground], lights=[lamp((5, -12, -3))]), (0, 20, 0), (0, -1, 0))
    np.testing.assert_array_equal(from_below, 0)
    # seen from below, the other side of an open face is lit by what is below
    other = looked(Scene(bodies=[ground], lights=[sun((0, -1, 0))]), (0, -20, 0), (0, 1, 0))
    np.testing.assert_allclose(other, [0.8, 0.4, 0.2], rtol=RTOL)


@pytest.mark.parametrize("inside", [False, True])
def test_smooth_shading_goes_by_the_true_normal_inside_and_out(inside):
    """With normals v/R at its vertices a flat face of a ball has P/|P| between them, exactly."""
    ball = body(sphere(5, 10), colour=WHITE)
    directions = spread(np.random.default_rng(0), 2000)
    starts = np.zeros_like(directions) if inside else -20 * directions
    light = (3.0, 1.0, -0.5) if inside else (3e3, 1e3, -5e2)
    seen = trace(Scene(bodies=[ball], lights=[lamp(light)]), starts, directions)
    steps = (seen.depth - starts[:, 2]) / directions[:, 2]
    points = starts + steps[:, None] * directions
    normal = points / np.linalg.norm(points, axis=1, keepdims=True) * (-1 if inside else 1)
    towards = np.array(light) - points
    cosine = np.einsum("ij,ij->i", normal, towards) / np.linalg.norm(towards, axis=1)
    # where z gives the point well; also on faces that turn away from the light themselves
    sure = (np.abs(cosine) > 1e-3) & (np.abs(directions[:, 2]) > 0.1)
    away = np.einsum("ij,ij->i", seen.normal, towards) * (-1 if inside else 1) < 0
    assert sure.sum() > 500 and (inside or (away & sure & (cosine > 0)).sum() > 10)
    np.testing.assert_allclose(seen.radiance[sure, 0], cosine[sure].clip(0), atol=3e-5)


@pytest.mark.parametrize("length", [1.0, 0.125, 8.0])
@pytest.mark.parametrize(("above", "dark"), [(1.5, False), (2.5, True)])
def test_shadow_rays_start_on_the_smooth_surface(above, dark, length):
    """That is in the corners' tangent planes, twice as high as the ball over its face (Hanika 2021).

    What is lower throws no shadow there, whatever the length of the normals: this test tried unit ones alone.
    """
    ball = replace(sphere(5, 12), normals=sphere(5, 12).normals * length)
    face = ball.vertices[ball.faces[len(ball.faces) // 2 + 3]]
    middle = face.mean(axis=0)
    up = middle / np.linalg.norm(middle)
    rise = 5 - np.linalg.norm(middle)
    hidden = middle + above * rise * up
    side = np.cross(up, (0, 1, 0)) / np.linalg.norm(np.cross(up, (0, 1, 0)))
    cover = np.array([hidden + 0.2 * (a * side + b * np.cross(up, side)) for a, b in ((-1, -1), (1, -1), (0, 1))])
    sheet = body(Mesh(cover, np.array([[0, 1, 2]])), colour=WHITE)
    look = up + 9 * side  # from the side, between cover and face
    scene = Scene(bodies=[body(ball, colour=WHITE), sheet], lights=[sun(up)])
    radiance = looked(scene, middle + 0.04 * look, -look)
    assert (radiance.max() == 0) == dark


def test_the_length_of_vertex_normals_says_nothing():
    """Bodies made in code may bring normals of any length: light, mirror and shadow rays are the same."""
    ball = sphere(5, 16)
    stretched = replace(ball, normals=ball.normals / 8)
    directions = spread(np.random.default_rng(1), 4000)
    one, other = (
        trace(
            Scene(bodies=[body(mesh, colour=WHITE, specular=0.5, mirror=(0.2, 0.2, 0.2))], lights=[sun((1, 2, -1))]),
            -20 * directions,
            directions,
        ).radiance
        for mesh in (ball, stretched)
    )
    assert (one > 0).any()
    np.testing.assert_array_equal(other, one)  # the length is a power of two


def test_a_shadow_ends_where_the_straight_line_says():
    """A sheet from x = 0 on, 6 mm up; a lamp 15 mm up at x = −2: the border is at x = −2 + 2·15/9."""
    ground, sheet = body(floor(400), colour=WHITE), body(floor(20), at=(10, 6, 0))
    x = np.linspace(1.0, 1.7, 7001)
    starts = np.column_stack([x, np.full_like(x, 3.0), np.full_like(x, 0.2)])
    for light, border in ((lamp((-2, 15, 0.2)), -2 + 2 * 15 / 9), (sun((-1.3, 6, 0)), 1.3)):
        seen = trace(Scene(bodies=[ground, sheet], lights=[light]), starts, np.broadcast_to([0, -1, 0], starts.shape))
        lit = seen.radiance[:, 0] > 0
        # the shadow ray starts 8e-4 mm over the floor (its coordinates reach 200): 3e-4 mm at this slope
        assert (lit[x < border - 1e-3]).all() and (~lit[x > border + 1e-3]).all()
        assert np.count_nonzero(np.diff(lit)) == 1, "a hard edge"


def test_a_lamp_is_not_blocked_by_what_stands_behind_it():
    ground = body(floor(100), colour=WHITE)
    for y, lit in ((9.9, False), (9.998, False), (10.01, True), (50.0, True)):
        lid = body(box(50, 0.001, 50), at=(0, y, 0))
        seen = looked(Scene(bodies=[ground, lid], lights=[lamp((0, 10, 0))]), (0, 5, 0), (0, -1, 0))
        assert (seen[0] > 0) == lit, y
    # what is nearer to the lamp than 1e-4 of its distance, here 1e-3 mm, does not count
    lid = body(box(50, 0.0001, 50), at=(0, 10 - 0.0005, 0))
    assert looked(Scene(bodies=[ground, lid], lights=[lamp((0, 10, 0))]), (0, 5, 0), (0, -1, 0))[0] > 0


@pytest.mark.parametrize("shininess", [1.0, 20.0, 300.0])
def test_highlight_of_blinn_and_phong(shininess):
    """In the mirror's direction its full strength; beside it cosⁿ of the angle between normal and half-way vector."""
    ground = body(floor(100), colour=BLACK, specular=0.6, shininess=shininess)
    towards = np.array([0.5, 1.0, 0.2])
    towards /= np.linalg.norm(towards)
    light = sun(towards, (1.0, 0.5, 0.25))
    mirrored = towards * [-1, 1, -1]  # where the viewer stands
    seen = looked(Scene(bodies=[ground], lights=[light]), mirrored * 10, -mirrored)
    np.testing.assert_allclose(seen, 0.6 * np.array([1.0, 0.5, 0.25]), rtol=1e-5)
    for viewer in ([0.1, 1, 0], [-0.4, 1, -0.3], [-0.9, 0.3, 0.4]):
        viewer = np.array(viewer) / np.linalg.norm(viewer)
        half = (viewer + towards) / np.linalg.norm(viewer + towards)
        expected = 0.6 * half[1] ** shininess
        seen = looked(Scene(bodies=[ground], lights=[light]), viewer * 10, -viewer)
        if expected > 2 * LEAST_WEIGHT:
            # a power n magnifies the cosine's 1e-7 n times
            assert seen[0] == pytest.approx(expected, rel=1e-6 * max(shininess, 5))
        else:
            assert seen[0] <= 2 * LEAST_WEIGHT
    matt = body(floor(100), colour=(0.3,) * 3, specular=0.6, shininess=shininess)
    seen = looked(Scene(bodies=[matt], lights=[light]), mirrored * 10, -mirrored)
    assert seen[0] == pytest.approx(0.6 + 0.3 * towards[1], rel=1e-5)


def test_matt_light_is_what_mirror_and_glass_leave():
    for mirror, transmission in ((0.3, 0.0), (0.0, 0.6), (0.3, 0.6), (1.0, 0.0)):
        plate = body(floor(100), colour=WHITE, mirror=(mirror,) * 3, transmission=(transmission,) * 3)
        seen = looked(Scene(bodies=[plate], ambient=WHITE, max_depth=0), (0, 5, 0), (0, -1, 0))
        np.testing.assert_allclose(seen, 1 - mirror - transmission, atol=1e-7)


# Sky


@pytest.mark.parametrize("spread_deg", [10.0, 40.0, 90.0])
def test_sky_runs_with_the_sine_from_horizon_to_zenith_and_nadir(spread_deg):
    horizon, zenith, nadir = np.array([0.9, 0.8, 0.7]), np.array([0.1, 0.2, 0.6]), np.array([0.3, 0.0, 0.1])
    sky = Background(horizon=tuple(horizon), zenith=tuple(zenith), nadir=tuple(nadir), spread_deg=spread_deg)
    scene = Scene(bodies=[body(sphere(1), at=(0, 0, -1000))], background=sky)
    top = math.sin(math.radians(spread_deg))
    for degrees in (0.0, 2.0, spread_deg / 2, spread_deg, (spread_deg + 90) / 2, 90.0):
        elevation = math.radians(degrees)
        for sign, pole in ((1, zenith), (-1, nadir)):
            direction = (0.6 * math.cos(elevation), sign * math.sin(elevation), 0.8 * math.cos(elevation))
            share = min(math.sin(elevation) / top, 1)
            np.testing.assert_allclose(
                looked(scene, (0, 0, 0), direction), horizon + share * (pole - horizon), atol=5e-7
            )  # 1/sin 10° of float32's 6e-8


def test_kernels_of_light_equal_their_python_source():
    generator = np.random.default_rng(0)
    radiance = generator.uniform(-0.2, 1.3, (200, 3)).astype(np.float32)
    curve, order = np.linspace(0, 255, 4097) ** 1.1 / 255**0.1, generator.permutation(200)
    a, b = np.empty((200, 3), np.uint8), np.empty((200, 3), np.uint8)
    encode_srgb(radiance, order, 0.5, curve, a)
    encode_srgb.py_func(radiance, order, 0.5, curve, b)
    np.testing.assert_array_equal(a, b)


def test_materials_of_more_than_all_light_are_refused():
    with pytest.raises(ValueError, match=r"mirror 0\.7 and transmission 0\.4 are more than all the light"):
        Material(mirror=(0.1, 0.7, 0), transmission=(0.4, 0, 0))
