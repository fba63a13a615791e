"""Nested glass: bodies inside, touching and overlapping each other, by priority, in closed form."""

import math

import numpy as np
import pytest

from raytrace_ii import Scene, trace
from raytrace_ii.scene.textures import Image
from raytrace_ii.shapes.primitives import Mesh
from raytrace_ii.tracing.packing import packed
from tests.support.trace_scenes import (
    BLACK,
    UNIFORM,
    WHITE,
    body,
    box,
    floor,
    lamp,
    reflectance,
    sphere,
    spread,
    sun,
    wall,
)

GLASS, WATER, ICE = 1.5, 1.33, 1.31


def slab(near, far, ior, *, half=300.0, **more):
    """A body between two depths, much wider than deep."""
    middle, depth = (near + far) / 2, far - near
    return body(
        box(2 * half, 2 * half, depth), at=(0, 0, middle), ior=ior, **{"transmission": WHITE, "name": "slab", **more}
    )


def passed(angle, *iors):
    """Return the transmittance of a stack of parallel media: Fresnel at each face, at Snell's angles."""
    share = 1.0
    for n1, n2 in zip((1.0, *iors), (*iors, 1.0), strict=True):
        share *= 1 - reflectance(math.cos(math.asin(math.sin(angle) / n1)), n2 / n1)
    return share


def shifted(angle, *layers):
    """Return the lateral shift of a ray by a stack of (thickness, ior)."""
    return sum(t * (math.tan(angle) - math.tan(math.asin(math.sin(angle) / n))) for t, n in layers)


def grey_ramp(z, half):
    """A wall that grows from 0 to 1 in all channels with x from −half to half."""
    mesh = wall(z, half)
    texels = np.repeat(np.array([[[0.0], [1.0]]], np.float32), 3, axis=2)
    coordinates = np.column_stack([0.5 + mesh.vertices[:, :2] / (4 * half), np.zeros(4)])
    return body(mesh, coordinates=coordinates, colour=WHITE, texture=Image(texels), name="ramp")


STACKS = {
    "touching, of one priority": [(12, 15, 0, 0)],
    "touching, the glass higher": [(12, 15, 1, 0)],
    "touching, the water higher": [(12, 15, 0, 1)],
    "overlapping, the glass higher": [(11.5, 15.5, 1, 0)],
    "overlapping by a hair": [(12 - 1e-5, 15 + 1e-5, 1, 0)],
    "apart by less than float32 tells": [(12 + 1e-7, 15 - 1e-7, 1, 0)],
}


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("stack", STACKS, ids=lambda s: s)
@pytest.mark.parametrize("order", [1, -1])
def test_glass_water_glass_is_the_product_of_its_four_faces(stack, degrees, order):
    angle, (near, far, high, low) = math.radians(degrees), STACKS[stack][0]
    panes = [
        slab(10, 12, GLASS, priority=high),
        slab(near, far, WATER, priority=low),
        slab(15, 17, GLASS, priority=high),
    ][::order]
    direction = (math.sin(angle), 0, math.cos(angle))
    half = 100.0
    # four bounces: the four faces; hidden ones cost none, and there is none left to go to and fro
    scene = Scene(bodies=[grey_ramp(30, half), *panes], ambient=WHITE, max_depth=4)
    start = (-10.0, 0.1, 0.0)
    seen = trace(scene, [start], [direction])
    x = -10 + 30 * math.tan(angle) - shifted(angle, (2, GLASS), (3, WATER), (2, GLASS))
    share = passed(angle, GLASS, WATER, GLASS)
    # twice four lifts (1.2e-3 mm each, for coordinates reach 300 mm) on a ramp of 200 mm
    np.testing.assert_allclose(seen.radiance[0], share * (x / half + 1) / 2, atol=1e-4)
    white = Scene(bodies=[body(wall(30, half), colour=WHITE), *panes], ambient=WHITE, max_depth=4)
    np.testing.assert_allclose(trace(white, [start], [direction]).radiance[0], share, rtol=1e-5)


def test_absorption_in_overlapping_bodies():
    """Bodies of the air's own index absorb along their part of the way: 4 mm shared by two of 10 mm."""
    red, blue = np.array([0.1, 0.0, 0.02]), np.array([0.0, 0.05, 0.2])
    for first, second, own in ((1, 0, (10, 6)), (0, 1, (6, 10)), (0, 0, (10, 6)), (5, 5, (10, 6)), (-1, -2, (10, 6))):
        bodies = [
            slab(10, 20, 1.0, absorption_per_mm=tuple(red), priority=first),
            slab(16, 26, 1.0, absorption_per_mm=tuple(blue), priority=second),
        ]
        seen = trace(Scene(bodies=bodies, background=UNIFORM), [(0.1, 0.2, 0)], [(0, 0, 1)]).radiance[0]
        # each leg starts a lift, 1e-3 mm, late
        np.testing.assert_allclose(seen, np.exp(-own[0] * red - own[1] * blue), rtol=2e-3)


def test_ice_in_water_in_a_bowl():
    """A ball of ice in a box of water between walls of glass that overlap it, straight through the middle."""
    water = slab(10, 30, WATER)
    ice = body(sphere(4, 64), at=(0, 0, 20), ior=ICE, transmission=WHITE, priority=2, name="ice")
    glass = [slab(8, 10.5, GLASS, priority=1), slab(29.5, 32, GLASS, priority=1)]
    scene = Scene(bodies=[water, ice, *glass], background=UNIFORM, max_depth=6)
    outer = body(wall(40), colour=WHITE)
    seen = trace(Scene(bodies=[outer, *scene.bodies], ambient=WHITE, max_depth=6), [(0, 0, 0)], [(1e-4, 2e-4, 1)])
    np.testing.assert_allclose(seen.radiance[0], passed(0, GLASS, WATER, ICE, WATER, GLASS), rtol=1e-5)
    # and nothing is lost on all the ways together
    directions = np.column_stack([*np.random.default_rng(0).uniform(-0.15, 0.15, (2, 300)), np.ones(300)])
    whole = trace(scene.with_depth(40), np.zeros_like(directions), directions).radiance
    assert whole.max() <= 1 + 1e-5 and np.median(whole) > 1 - 1e-3


def test_a_ray_tracks_all_bodies_that_can_overlap():
    plain = body(wall(50))
    ball = [body(sphere(2, 12), at=(x, 0, 20), transmission=WHITE) for x in (0, 10, 20)]
    touching = body(sphere(3, 12), at=(5, 0, 20), transmission=WHITE)  # both neighbours at once
    assert [packed(Scene(bodies=[plain, *some])).nested for some in ([], ball, [*ball, touching])] == [0, 1, 3]
    assert not packed(Scene(bodies=[plain, *ball])).passes and packed(Scene(bodies=[plain, *ball, touching])).passes
    many = [slab(10 + 0.1 * i, 20 + 0.1 * i, 1.01) for i in range(20)]
    crowded = Scene(bodies=many, background=UNIFORM)
    assert packed(crowded).nested == 8
    assert np.isfinite(trace(crowded, [(0, 0, 0)], [(0, 0, 1)]).radiance).all()


# Rays that start inside


def test_a_camera_in_ice_in_water_sees_through_both():
    absorption = np.array([0.1, 0.2, 0.0])
    water = slab(-20, 20, WATER, absorption_per_mm=tuple(absorption))
    ice = body(sphere(5, 96), ior=ICE, transmission=WHITE, name="ice", priority=1)
    scene = Scene(bodies=[body(wall(30), colour=WHITE), water, ice], ambient=WHITE, max_depth=2)
    seen = trace(scene, [(0, 0, 0)], [(0, 0, 1)]).radiance[0]
    expected = passed(0, ICE, WATER) / (1 - reflectance(1.0, ICE)) * np.exp(-15 * absorption)
    np.testing.assert_allclose(seen, expected, rtol=1e-3)  # the ball's faces lie up to 0.1 % deep, and α·5 is 1
    # of one priority the water, entered first, is all there is
    flat = Scene(bodies=[water, body(sphere(5, 96), transmission=WHITE, ior=ICE)], background=UNIFORM, max_depth=1)
    seen = trace(flat, [(0, 0, 0)], [(0, 0, 1)])
    np.testing.assert_allclose(seen.radiance[0], (1 - reflectance(1.0, WATER)) * np.exp(-20 * absorption), rtol=1e-3)


def test_opaque_bodies_in_glass_are_seen_from_inside():
    absorption = np.array([0.02, 0.1, 0.3])
    glass = slab(-20, 30, GLASS, absorption_per_mm=tuple(absorption))
    paper = body(wall(12), colour=WHITE)
    seen = trace(Scene(bodies=[glass, paper], ambient=WHITE), [(0, 0, 2)], [(0.3, 0.4, 1)]).radiance[0]
    np.testing.assert_allclose(seen, np.exp(-10 * math.sqrt(1.25) * absorption), rtol=1e-5)
    outside = trace(Scene(bodies=[glass, paper], ambient=WHITE), [(0, 0, 2), (900, 0, 2)], [(0, 0, 1), (0, 1, 0)])
    assert outside.count.rays["passed"] == 1, "only the ray that starts within the bounds is asked"


def test_a_camera_in_the_hollow_of_a_shell_is_in_air():
    """Within the bounds, but the first face ahead is entered, not left."""
    outer, inner = sphere(10, 48), sphere(6, 48)
    shell = Mesh(
        np.concatenate([outer.vertices, inner.vertices]),
        np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
    )
    bulb = body(shell, transmission=WHITE, absorption_per_mm=(0.1, 0.2, 0.4))
    seen = trace(Scene(bodies=[bulb], background=UNIFORM, max_depth=2), [(0, 0, 0)], [(0, 0, 1)]).radiance[0]
    straight = (1 - reflectance(1.0, GLASS)) ** 2 * np.exp(-4 * np.array([0.1, 0.2, 0.4]))
    np.testing.assert_allclose(seen, straight, rtol=5e-3)  # faces up to 0.4 % deep in 10 mm, times α


@pytest.mark.parametrize(("inner", "outer"), [(GLASS, None), (GLASS, WATER), (2.4, None), (WATER, ICE)])
def test_total_reflection_begins_at_the_critical_angle(inner, outer):
    """Rays from within the denser body, 1e-6 rad to either side of asin(n2/n1)."""
    bodies = [slab(-10, 10, inner, priority=1)]
    if outer:
        bodies.append(slab(10, 40, outer))
    critical = math.asin((outer or 1.0) / inner)
    angles = critical + np.array([-1e-2, -1e-6, 1e-6, 1e-2])
    for angle in angles:
        direction = (math.sin(angle), 0, math.cos(angle))
        count = trace(Scene(bodies=bodies, background=UNIFORM, max_depth=1), [(0, 0, 0)], [direction]).count.rays
        assert (count["refraction"], count["reflection"]) == ((1, 1) if angle < critical else (0, 1)), (
            angle - critical
        )


# Shadows


@pytest.mark.parametrize("degrees", [0.0, 40.0, 65.0])
def test_a_shadow_through_glass_water_glass_is_that_of_the_bent_way(degrees):
    """Shadow rays are straight, but each face has the Fresnel loss of the refracted path."""
    angle = math.radians(degrees)
    towards = (math.sin(angle), math.cos(angle), 0)
    ground = body(floor(1000), colour=WHITE)
    panes = [
        body(box(900, t, 900), at=(0, y, 0), ior=n, transmission=c, priority=p, name=str(y))
        for t, y, n, c, p in (
            (2, 11, GLASS, (0.9, 0.8, 1), 1),
            (3, 13.5, WATER, WHITE, 0),
            (2, 16, GLASS, WHITE, 1),
        )
    ]
    lit, dimmed = (
        trace(Scene(bodies=b, lights=[sun(towards)]), [(0, 5, 0.3)], [(0, -1, 0)]).radiance[0]
        for b in ([ground], [ground, *panes])
    )
    # the lower pane's colour counts at both its faces, the water's at its own none: they are the glass's
    colour = np.array([0.9, 0.8, 1]) ** 2
    np.testing.assert_allclose(dimmed / lit, colour * passed(angle, GLASS, WATER, GLASS), rtol=1e-5)


def test_absorption_of_a_shadow_reaches_to_the_lamp_and_from_the_paper():
    absorption = np.array([0.02, 0.1, 0.3])
    glass = slab(-20, 30, 1.0, absorption_per_mm=tuple(absorption))
    paper = body(wall(20), colour=WHITE)
    # a shadow ray ends 1e-4 of its way, 1e-3 mm, before the lamp: that times α of 0.3
    inside = Scene(bodies=[glass, paper], lights=[lamp((0, 0, 10))])
    seen = trace(inside, [(1, 0, 19)], [(-1, 0, 1)]).radiance[0]
    np.testing.assert_allclose(seen, np.exp(-(10 + math.sqrt(2)) * absorption), rtol=5e-4)
    outside = Scene(bodies=[glass, paper], lights=[lamp((0, 0, -40))])
    np.testing.assert_allclose(
        trace(outside, [(1, 0, 19)], [(-1, 0, 1)]).radiance[0], np.exp(-(40 + math.sqrt(2)) * absorption), rtol=1e-3
    )


def test_a_lamp_in_a_ball_of_ice_in_water():
    ground = body(floor(200), at=(0, -30, 0), colour=WHITE)
    water = body(box(60, 40, 60), transmission=WHITE, ior=WATER, name="water")
    ice = body(sphere(5, 64), transmission=WHITE, ior=ICE, priority=1, name="ice")
    seen = trace(Scene(bodies=[ground, water, ice], lights=[lamp((0, 0, 0))]), [(0, -25, 0)], [(0, -1, 0)])
    np.testing.assert_allclose(seen.radiance[0], passed(0, ICE, WATER) / (1 - reflectance(1, ICE)), rtol=1e-4)


# Dispersion


def test_dispersion_sends_each_channel_its_own_way():
    iors = (1.45, 1.5, 1.6)
    directions = np.array([(math.sin(a), 0, math.cos(a)) for a in np.radians([0, 20, 50, 70])])
    starts = np.zeros_like(directions)

    def seen(ior, **more):
        glass = body(box(400, 400, 9), at=(0, 0, 20), turn=(0, 15, 0), transmission=WHITE, ior=ior)
        return trace(Scene(bodies=[grey_ramp(60, 300), glass], ambient=WHITE, **more), starts, directions)

    split = seen(iors)
    for c, ior in enumerate(iors):
        np.testing.assert_allclose(split.radiance[:, c], seen(ior).radiance[:, c], rtol=2e-6)
    assert np.ptp(split.radiance[3]) > 0.005
    count = seen(iors, max_depth=2).count.rays
    assert count["refraction"] == 4 * (3 + 3), "split in three once, and out by three"


def test_three_equal_indices_are_one():
    ball = {"at": (0, 0, 20), "transmission": WHITE}
    directions = spread(np.random.default_rng(0), 800) * 0.2 + [0, 0, 1]
    one, three = (
        trace(Scene(bodies=[body(sphere(5, 32), ior=ior, **ball), body(wall(40))], ambient=WHITE,
                    lights=[sun((1, 2, -1))]), np.zeros_like(directions), directions)
        for ior in (1.5, (1.5, 1.5, 1.5))
    )  # fmt: skip
    np.testing.assert_array_equal(one.radiance, three.radiance)
    assert one.count.rays == three.count.rays


def test_a_dispersing_furnace_stays_white():
    ball = body(sphere(5, 48), at=(0, 0, 20), ior=(1.4, 1.5, 1.7), transmission=WHITE)
    directions = np.column_stack([*np.random.default_rng(0).uniform(-0.25, 0.25, (2, 500)), np.ones(500)])
    seen = trace(
        Scene(bodies=[ball], background=UNIFORM, max_depth=40), np.zeros_like(directions), directions
    ).radiance
    assert seen.max() <= 1 + 1e-5 and np.median(seen) > 1 - 1e-3


# Rays that are not traced


def test_weak_rays_are_counted_and_strong_light_makes_them_count():
    mirror = body(wall(20), mirror=(1e-4,) * 3, colour=BLACK)
    glow = body(wall(-20), colour=BLACK, emission=(1000.0, 1000.0, 1000.0), name="glow")
    dim = trace(Scene(bodies=[mirror]), [(0, 0, 0)], [(0, 0, 1)])
    assert dim.count.skipped["reflection"] == 1 and dim.count.rays["reflection"] == 0
    bright = trace(Scene(bodies=[mirror, glow]), [(0, 0, 0)], [(0, 0, 1)])
    np.testing.assert_allclose(bright.radiance[0], 0.1, rtol=1e-5)
    assert bright.count.rays["reflection"] == 1
    faint = trace(Scene(bodies=[body(wall(20))], lights=[sun((0, 0, -1), (1e-5,) * 3)]), [(0, 0, 0)], [(0, 0, 1)])
    assert faint.count.skipped["shadow"] == 1 and faint.count.rays["shadow"] == 0
