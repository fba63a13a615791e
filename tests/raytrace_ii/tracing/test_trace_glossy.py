"""Rough mirrors against the integral of the GGX lobe, texture maps, partial coverage."""

import math

import numpy as np
import pytest

from ii_core import IICamera, preset
from raytrace_ii import Background, Scene, render, trace
from raytrace_ii.rendering import job
from raytrace_ii.scene.textures import Image
from raytrace_ii.shapes.primitives import Mesh, rotation
from raytrace_ii.tracing.kernels.glossy import glossy_direction
from raytrace_ii.tracing.packing import packed
from tests.support.slow import first_fast
from tests.support.trace_scenes import BLACK, UNIFORM, WHITE, body, floor, lamp, sphere, sun, wall

SLOPE = Background(horizon=(0.5,) * 3, zenith=(1.0, 0.5, 0.0), nadir=(0.0, 0.5, 1.0))  # red grows straight with y
GREY = Image(np.full((1, 1, 3), 0.5, np.float32))


def lobe_mean(roughness, elevation, value, steps=600):
    """∫ value(ω) D(h) G2 / 4 cos θ dω over the hemisphere about z, for light seen along a ray from ``elevation``.

    Cook–Torrance with GGX and Smith's height-correlated G2 (Heitz 2014), F = 1; midpoint rule over facets h, which
    resolves any lobe: dω = 4 (v·h) dh.
    """
    alpha = roughness**2
    v = np.array([math.cos(elevation), 0.0, math.sin(elevation)])
    # facets' slopes tan θ = α t, t = tan(½πs)
    s, phi = (np.arange(steps) + 0.5) / steps, 2 * math.pi * (np.arange(steps) + 0.5) / steps
    tangent = alpha * np.tan(math.pi / 2 * s)
    slope = alpha * math.pi / 2 * (1 + np.tan(math.pi / 2 * s) ** 2)  # d tan θ / ds
    cos = 1 / np.sqrt(1 + tangent**2)
    h = np.stack(np.broadcast_arrays(
        (tangent * cos)[:, None] * np.cos(phi), (tangent * cos)[:, None] * np.sin(phi), cos[:, None]
    ), axis=-1)  # fmt: skip
    # D(θ) sin θ dθ = D tan θ cos³ θ d tan θ, D = α² / (π cos⁴ (α² + tan²)²)
    weight = alpha**2 * tangent / (math.pi * cos * (alpha**2 + tangent**2) ** 2) * slope
    weight = weight[:, None] / steps * 2 * math.pi / steps
    vh = h @ v
    out = 2 * vh[..., None] * h - v

    def smith(c):
        return (np.sqrt(1 + alpha**2 * (1 / np.maximum(c, 1e-9) ** 2 - 1)) - 1) / 2

    shown = (vh > 0) & (out[..., 2] > 0)
    g2 = 1 / (1 + smith(v[2]) + smith(out[..., 2]))
    return (weight * np.where(shown, g2 * vh / v[2], 0) * value(out)).sum()


def reflected(roughness, elevation, background, n=40000):
    """Return mean light, and its standard error, that a rough floor in empty space reflects along one ray."""
    ground = Scene(bodies=[body(floor(), mirror=WHITE, roughness=roughness)], background=background, max_depth=1)
    ahead = np.array([-math.cos(elevation), -math.sin(elevation), 0.0])
    seen = trace(ground, np.broadcast_to(-9 * ahead, (n, 3)), np.broadcast_to(ahead, (n, 3))).radiance.astype(float)
    return seen.mean(axis=0), seen.std(axis=0) / math.sqrt(n)


@pytest.mark.parametrize("elevation", [0.1, 0.6, math.pi / 2])
@pytest.mark.parametrize("roughness", first_fast([0.5, 0.1, 1.0]))
def test_a_rough_mirror_reflects_the_integral_of_the_lobe(roughness, elevation):
    """In a white furnace the single-scattering albedo; under a sky that grows with height the lobe's mean height."""
    albedo = lobe_mean(roughness, elevation, lambda out: 1.0)
    got, error = reflected(roughness, elevation, UNIFORM)
    assert albedo <= 1 and got[0] <= 1
    assert abs(got[0] - albedo) < 4 * error[0] + 1e-4, (got, albedo)
    height = lobe_mean(roughness, elevation, lambda out: 0.5 + 0.5 * out[..., 2])
    got, error = reflected(roughness, elevation, SLOPE)
    # noise within a lobe of 16 stratified rays is less than that of single ones
    assert abs(got[0] - height) < 4 * error[0] + 1e-4, (got, height)


def test_rays_of_a_lobe_that_would_enter_the_face_leave_it():
    """Under a bent normal half of the lobe points into the floor: mirrored at it, all rays see the sky."""
    flat, bent, ahead = floor(), np.array([-0.6, 0.8, 0.0]), np.array([-math.cos(1.2), -math.sin(1.2), 0.0])
    mesh = Mesh(flat.vertices, flat.faces, np.broadcast_to(bent, flat.vertices.shape))
    scene = Scene(bodies=[body(mesh, mirror=WHITE, roughness=0.5)], background=UNIFORM, max_depth=1)
    n = 10_000
    seen = trace(scene, np.broadcast_to(-9 * ahead, (n, 3)), np.broadcast_to(ahead, (n, 3))).radiance[:, 0]
    albedo = lobe_mean(0.5, math.asin(-ahead @ bent), lambda out: 1.0)
    assert abs(seen.mean() - albedo) < 4 * seen.std() / math.sqrt(n) + 1e-4, (seen.mean(), albedo)


@pytest.mark.parametrize("elevation", [0.05, 0.7, math.pi / 2])
def test_no_roughness_is_the_mirror(elevation):
    turn = rotation((20, 130, 70))
    normal, ahead = turn @ (0.0, 0.0, 1.0), turn @ (-math.cos(elevation), 0.0, -math.sin(elevation))
    for across, around in np.random.default_rng(0).random((50, 2)):
        *out, share = glossy_direction(1e-7, across, around, *ahead, *normal)
        np.testing.assert_allclose(out, ahead - 2 * (ahead @ normal) * normal, atol=1e-4)
        assert share == pytest.approx(1, abs=1e-6)
        *out, _ = glossy_direction(0.5, across, around, *ahead, *normal)
        assert np.linalg.norm(out) == pytest.approx(1, abs=1e-9)


def test_a_nearly_smooth_mirror_shows_the_mirrors_picture():
    def shot(roughness):
        ball = body(sphere(8, 48), at=(0, 0, 40), mirror=(0.9, 0.8, 0.7), roughness=roughness)
        ground = body(floor(), at=(0, -9, 50))
        scene = Scene(bodies=[ball, ground], lights=[sun((1, 2, -1))], background=SLOPE, max_depth=2)
        return render(scene, preset("setup1", scale=64), support=()).picture.pixels.astype(int)

    assert np.abs(shot(0.0) - shot(0.003)).max() <= 1
    assert np.abs(shot(0.0) - shot(0.5)).max() > 50


@pytest.mark.slow
def test_glossy_pictures_are_independent_of_workers_and_tiles(monkeypatch):
    """To the bit, by workers and tiles; another seed gives other noise; more samples less."""
    camera = preset("setup1", scale=128)
    rough = body(wall(30), mirror=WHITE, roughness=0.6)
    scene = Scene(bodies=[rough, body(sphere(3), at=(0, 0, 12), emission=WHITE)], background=SLOPE)
    for samples in (1, 4, (4, 8)):
        first = render(scene, camera, samples=samples, seed=3, workers=1).picture.pixels
        with monkeypatch.context() as patch:
            patch.setattr(job, "TILE_RAYS", 300)
            np.testing.assert_array_equal(first, render(scene, camera, samples=samples, seed=3).picture.pixels)
        assert (first != render(scene, camera, samples=samples, seed=4).picture.pixels).any()
    truth = render(scene, camera, samples=1024, dtype="float32").picture.pixels
    # the sphere in front is sharp: only what the wall mirrors is looked at
    wall_only = render(scene, camera).object_id == 0
    errors = [
        np.sqrt(((render(scene, camera, samples=n, dtype="float32").picture.pixels - truth)[wall_only] ** 2).mean())
        for n in (16, 64, 256)
    ]
    assert errors[0] > 1.5 * errors[1] > 2.2 * errors[2], errors


# Maps


def papered(mesh, **material):
    return body(mesh, coordinates=np.column_stack([mesh.uv, np.zeros(len(mesh.uv))]), **material)


def at_texels(scene, size, z=20.0, half=50.0):
    """Radiance of rays from far away straight onto the centres of the texels of a wall, row 0 on top."""
    rows, columns = size
    x = ((np.arange(columns) + 0.5) / columns * 2 - 1) * half
    y = -((np.arange(rows) + 0.5) / rows * 2 - 1) * half
    start = np.stack(np.broadcast_arrays(x[None, :], y[:, None], z - 10.0), axis=-1)
    return trace(scene, start, np.broadcast_to([0.0, 0.0, 1.0], start.shape)).radiance.reshape(rows, columns, 3)


def test_an_emission_map_gives_off_its_texels():
    texels = np.random.default_rng(1).random((4, 6, 3), np.float32)
    glow = papered(wall(20), colour=BLACK, emission=(1.0, 2.0, 0.5), emission_map=Image(texels))
    np.testing.assert_allclose(at_texels(Scene(bodies=[glow]), (4, 6)), texels * [1, 2, 0.5], rtol=1e-5)


def test_metal_of_a_map_mirrors_the_texture():
    """Texels of metal mirror their colour, the others are matt; all conserve energy."""
    rng = np.random.default_rng(2)
    colours, metal = rng.random((3, 5, 3), np.float32), rng.random((3, 5)).astype(np.float32)
    look = Image(np.stack([np.zeros_like(metal), np.zeros_like(metal), metal], axis=-1))
    sheet = papered(
        wall(20), colour=WHITE, texture=Image(colours), mirror=(0.04,) * 3, metallic=1.0, metallic_roughness_map=look,
    )  # fmt: skip
    scene = Scene(bodies=[sheet], background=Background(horizon=(0.5,) * 3), ambient=(0.25,) * 3, max_depth=1)
    metal = metal[..., None]
    matt = 0.25 * (1 - metal) * 0.96 * colours
    mirrored = 0.5 * ((1 - metal) * 0.04 + metal * colours)
    np.testing.assert_allclose(at_texels(scene, (3, 5)), matt + mirrored, rtol=1e-5)


def test_roughness_of_a_map_widens_the_lobe():
    """Left half a mirror, right half rough: the mean height of what is seen, texel by texel, is the lobe's."""
    half = np.array([[[0, 0.25, 0], [0, 1, 0]]], np.float32)
    sheet = papered(wall(20), mirror=WHITE, roughness=0.8, metallic_roughness_map=Image(half), metallic=0.0)
    n = 40000
    for x, roughness in ((-25.0, 0.2), (25.0, 0.8)):
        start = np.broadcast_to([x, 0.0, 10.0], (n, 3))
        seen = trace(
            Scene(bodies=[sheet], background=UNIFORM, max_depth=1), start, np.broadcast_to([0, 0, 1.0], (n, 3))
        )
        got = seen.radiance[:, 0].astype(float)
        assert abs(got.mean() - lobe_mean(roughness, math.pi / 2, lambda out: 1.0)) < 4 * got.std() / n**0.5 + 1e-4


def test_a_map_gives_the_highlight_its_width():
    """A lamp's highlight on texels of roughness 0.3 and 0.6 is that of the closed form of each."""
    look = Image(np.array([[[0, 0.3, 0], [0, 0.6, 0]]], np.float32))
    for x, roughness in ((-25.0, 0.3), (25.0, 0.6)):
        sheet = papered(
            wall(20), colour=BLACK, specular=1.0, mirror=(0.04,) * 3, roughness=1.0, metallic_roughness_map=look
        )
        scene = Scene(bodies=[sheet], lights=[lamp((x + 4.0, 0, 5))], max_depth=0)
        got = trace(scene, [[x, 0, 5]], [[0, 0, 1.0]]).radiance[0, 0]
        exponent = 2 / roughness**4 - 2
        half = math.cos(math.atan2(4.0, 15.0) / 2)
        assert got == pytest.approx(0.04 * (1 - roughness) * (exponent + 2) / 8 * half**exponent, rel=1e-4)


# Blending


def test_a_blended_texel_lies_over_what_is_behind():
    """α·c + (1 − α)·background in every texel, with a factor and without, of emitted, matt and mirrored light."""
    rng = np.random.default_rng(4)
    colours, alpha = rng.random((4, 5, 3), np.float32), rng.random((4, 5)).astype(np.float32)
    for factor in (1.0, 0.7):
        pane = papered(
            wall(20), colour=WHITE, texture=Image(colours, alpha=alpha), alpha_blend=factor, emission=(0.1, 0, 0),
            mirror=(0.25,) * 3,
        )  # fmt: skip
        behind = body(wall(60, 500), colour=BLACK, emission=(0.2, 0.6, 0.9))
        scene = Scene(
            bodies=[pane, behind], ambient=(0.5,) * 3, background=Background(horizon=(0.8,) * 3), max_depth=1
        )
        share = factor * alpha[..., None].astype(float)
        own = 0.75 * 0.5 * colours + [0.1, 0, 0] + 0.25 * 0.8
        truth = share * own + (1 - share) * [0.2, 0.6, 0.9]
        np.testing.assert_allclose(at_texels(scene, (4, 5)), truth, rtol=1e-5)


def test_a_blended_surface_throws_its_share_of_shadow():
    """Two panes of α = 0.4 and a texture's leave 0.6 (1 − α) of a lamp's light; so does the way of the eye."""
    alpha = np.array([[0.1, 0.5], [0.8, 1.0]], np.float32)
    # Texels of four equal parts: rays start 4e-6 of the ground beside the place seen, where alpha must not lean.
    image = Image(np.ones((4, 4, 3), np.float32), alpha=alpha.repeat(2, axis=0).repeat(2, axis=1))
    high = papered(wall(30), colour=BLACK, texture=image, alpha_blend=1.0)
    low = body(wall(40), colour=BLACK, alpha_blend=0.4)
    ground = body(wall(50, 500), colour=WHITE)
    scene = Scene(bodies=[high, low, ground], lights=[sun((0, 0, -1))], max_depth=4)
    left = 0.6 * (1 - alpha[..., None].astype(float))
    for z, light in ((20.0, left**2), (55.0, left)):  # from before the panes, and from behind them
        seen = at_texels(scene, (2, 2), z)
        np.testing.assert_allclose(seen, np.broadcast_to(light, (2, 2, 3)), rtol=1e-5, atol=1e-7)


def test_the_last_generation_takes_a_blended_surface_as_there():
    pane = body(wall(20), colour=WHITE, alpha_blend=0.5)
    scene = Scene(bodies=[pane], ambient=WHITE, background=Background(horizon=BLACK), max_depth=0)
    np.testing.assert_allclose(at_texels(scene, (1, 1)), 1.0)
    np.testing.assert_allclose(at_texels(scene.with_depth(1), (1, 1)), 0.5)


@pytest.mark.parametrize(
    ("material", "says"),
    [
        ({"roughness": 1.5}, "roughness is 1.5"),
        ({"metallic": -0.1}, "metallic is -0.1"),
        ({"alpha_blend": math.nan}, "alpha_blend is nan"),
        ({"metallic": 0.5, "colour": (2.0, 0.5, 0.5)}, "at most 1 is needed of a metal"),
        ({"emission_map": GREY}, "an emission map needs texture coordinates"),
        ({"metallic_roughness_map": GREY}, "a metallic-roughness map needs texture coordinates"),
    ],
)
def test_invalid_parameters_are_refused(material, says):
    with pytest.raises(ValueError, match=says):
        body(wall(20), **material)


def test_a_scene_that_is_not_glossy_keeps_no_keys():
    camera = IICamera(pixels=(8, 8), lenses=(2, 2), pixel_pitch_mm=0.1, gap_mm=1.0)
    for roughness, glossy in ((0.0, False), (0.5, True)):
        scene = Scene(bodies=[body(wall(20), mirror=WHITE, roughness=roughness)])
        assert packed(scene).glossy == glossy
        stats = render(scene, camera).stats
        assert stats.rays["reflection"] + stats.skipped["reflection"] == 64 * (16 if glossy else 1)
    assert not packed(Scene(bodies=[body(wall(20), roughness=0.5)])).glossy, "nothing reflects"
