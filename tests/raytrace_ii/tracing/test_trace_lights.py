"""Fog, vertex colours, spot lights, emissive surfaces and equirectangular surroundings, in closed form."""

import math

import numpy as np
import pytest

from raytrace_ii import Background, Fog, Light, Scene, load_scene, trace
from raytrace_ii.scene.textures import Image, VertexColours
from raytrace_ii.tracing.packing import packed
from tests.support.trace_scenes import BLACK, UNIFORM, WHITE, body, box, floor, lamp, sphere, spread, wall


def spot_on_floor(x, *, cone_deg=(20, 30), colour=WHITE):
    """Return the light of a floor at x under a spot light 10 mm above that shines straight down."""
    light = Light(kind="spot", vector=(0, 10, 0), colour=colour, direction=(0, -3, 0), cone_deg=cone_deg)
    scene = Scene(bodies=[body(floor(400), colour=WHITE)], lights=[light])
    starts = np.column_stack([x, np.full_like(x, 5.0), np.full_like(x, 0.1)])
    return trace(scene, starts, np.broadcast_to([0, -1, 0], starts.shape))


def test_a_spot_light_fades_between_its_cones_by_gltfs_formula():
    x = 10 * np.tan(np.radians(np.linspace(0, 40, 401)))
    angle = np.arctan2(np.hypot(x, 0.1), 10)
    inner, outer = np.cos(np.radians([20, 30]))
    share = np.clip((np.cos(angle) - outer) / (inner - outer), 0, 1) ** 2
    # a shadow ray starts 8e-4 mm up, of 10: 1e-4 of the cosine, times the cone's steepness of 2·1/(inner − outer)
    np.testing.assert_allclose(spot_on_floor(x).radiance[:, 0], share * np.cos(angle), atol=2e-3)
    assert (share == 1).sum() > 150 and (share == 0).sum() > 50


def test_a_spot_lights_edges_and_its_saved_rays():
    x = np.array([10 * math.tan(math.radians(a)) for a in (0.5, 19.9, 29.9, 30.1, 80)])
    seen = spot_on_floor(x, colour=(1e5,) * 3)  # bright: the edge itself is dark
    assert (seen.radiance[:3, 0] > 0).all() and (seen.radiance[3:] == 0).all()
    assert seen.count.rays["shadow"] == 3, "none where its light cannot come"
    point = Light(kind="point", vector=(0, 10, 0), colour=WHITE)
    scene = Scene(bodies=[body(floor(400), colour=WHITE)], lights=[point])
    near = trace(scene, [(1.0, 5, 0.1)], [(0, -1, 0)]).radiance
    np.testing.assert_array_equal(spot_on_floor(np.array([1.0])).radiance, near), "all of it in the inner cone"


def test_a_surface_gives_off_light_on_both_sides_and_lights_nothing_else():
    glow = (0.5, 3.0, 0.0)
    lamp = body(wall(20), colour=BLACK, emission=glow)
    far = body(wall(30, 500), colour=WHITE)
    for start, direction in (((0, 0, 0), (0, 0, 1)), ((0, 0, 25), (0, 0, -1))):
        np.testing.assert_allclose(trace(Scene(bodies=[lamp, far]), [start], [direction]).radiance, [glow])
    np.testing.assert_array_equal(trace(Scene(bodies=[lamp, far]), [(0, 0, 25)], [(0, 0, 1)]).radiance, [BLACK])
    mirror = body(wall(-10), colour=BLACK, mirror=(0.5,) * 3)
    seen = trace(Scene(bodies=[lamp, mirror]), [(0, 0, 0)], [(0, 0, -1)]).radiance
    np.testing.assert_allclose(seen, [0.5 * np.array(glow)], rtol=1e-6)


@pytest.mark.parametrize("albedo", [0.0, 0.5, 1.0])
def test_a_furnace_of_glowing_walls_is_even(albedo):
    """A wall that emits the share that it does not reflect shows 1 in surroundings of 1, also in a mirror ball."""
    room = body(sphere(50, 32), colour=(albedo,) * 3, emission=(1 - albedo,) * 3)
    ball = body(sphere(5, 48), at=(0, 0, 20), mirror=WHITE)
    matt = body(sphere(5, 48), at=(20, 0, 0), colour=WHITE)
    directions = spread(np.random.default_rng(0), 2000)
    seen = trace(Scene(bodies=[room, ball, matt], ambient=WHITE), np.zeros_like(directions), directions)
    assert set(np.unique(seen.object_id)) == {0, 1, 2}
    np.testing.assert_allclose(seen.radiance, 1, rtol=1e-6)


# Surroundings


def sky(pixels, **options):
    """Return the light of a scene of a surrounding image alone."""
    image = Image(np.asarray(pixels, np.float32))
    nothing = body(sphere(1), at=(1e3, 2e3, 3.3e3), scale=1e-3)
    scene = Scene(bodies=[nothing], background=Background(image=image, **options))
    return lambda *directions: trace(scene, np.zeros((len(directions), 3)), directions).radiance[:, 0]


AXES = {"ahead": (0, 0, 1), "right": (1, 0, 0), "behind": (0, 0, -1), "left": (-1, 0, 0)}


def compass(width=360, height=180):
    """Red is longitude in degrees from the centre, to the right; a second image has the elevation."""
    longitude = (np.arange(width) + 0.5) / width * 360 - 180
    elevation = 90 - (np.arange(height) + 0.5) / height * 180
    return (np.repeat(np.broadcast_to(values, (height, width))[..., None], 3, axis=2)
            for values in (longitude, elevation[:, None]))  # fmt: skip


def test_the_images_centre_is_ahead_its_right_half_right_and_its_top_up():
    longitude, elevation = compass()
    around = sky(longitude)(AXES["ahead"], AXES["right"], AXES["left"], (1, 0, 1), (-1, 0, 1))
    np.testing.assert_allclose(around, [0, 90, -90, 45, -45], atol=1e-4)
    # behind, the image's two edges meet: half way from 179.5° to −179.5°
    np.testing.assert_allclose(sky(longitude)(AXES["behind"]), 0, atol=1e-4)
    np.testing.assert_allclose(sky(longitude)((0.05, 0, -1), (-0.05, 0, -1)) / 180, [0.984, -0.984], atol=1e-3)
    up, down, slanting, level = sky(elevation)((0, 1, 0), (0, -1, 0), (0, 1, 1), AXES["right"])
    # the poles show the middle of the last row, half a row from the pole
    np.testing.assert_allclose([up, down, slanting, level], [89.5, -89.5, 45, 0], atol=1e-4)


@pytest.mark.parametrize("turn_deg", [0, 90, -30, 450])
def test_a_turn_takes_the_centre_from_ahead_towards_right(turn_deg):
    longitude, _ = compass()
    angle = math.radians(turn_deg)
    centre = (math.sin(angle), 0, math.cos(angle))
    right = (math.cos(angle), 0, -math.sin(angle))
    np.testing.assert_allclose(sky(longitude, turn_deg=turn_deg)(centre, right), [0, 90], atol=1e-4)


def test_an_even_image_is_an_even_sky_and_stands_in_the_gradients_place():
    directions = spread(np.random.default_rng(1), 500)
    even = sky(np.full((5, 7, 3), 0.25), intensity=3.0, horizon=WHITE)
    np.testing.assert_allclose(even(*directions), 0.75, rtol=1e-6)
    ball = body(sphere(5), at=(0, 0, 20), transmission=WHITE)
    image = Image(np.ones((4, 8, 3), np.float32))
    around = [trace(Scene(bodies=[ball], background=b), [(0, 0, 0)], [(0.1, 0, 1)]).radiance
              for b in (UNIFORM, Background(image=image))]  # fmt: skip
    np.testing.assert_allclose(*around, rtol=1e-6)


# Ray length


def test_the_length_of_a_ray_is_to_its_hit_from_its_start():
    directions = np.array([[0, 0, 2.0], [0.3, -0.4, 1], [0, 0, -1]])
    start = np.array([1.0, 2.0, 3.0])
    seen = trace(Scene(bodies=[body(wall(23, 90))]), np.broadcast_to(start, (3, 3)), directions)
    np.testing.assert_allclose(seen.ray_length, [20, 20 * math.sqrt(1.25), math.nan], rtol=1e-6)
    np.testing.assert_array_equal(np.isnan(seen.depth), [False, False, True])


def test_shadow_rays_of_smooth_surfaces_end_at_the_lamp():
    """They start on the smooth surface, up to 0.7 mm off the faces: an edge just beside the lamp hides none of it."""
    bodies = [body(sphere(10, 8), at=(0, 0, 40), colour=WHITE)]
    x, y = np.random.default_rng(0).uniform(-7, 7, (2, 2000))
    rays = np.column_stack([x, y, np.full(2000, 10.0)]), np.broadcast_to((0.0, 0.0, 1.0), (2000, 3))
    free, beside = (
        trace(Scene(bodies=bodies + more, lights=[lamp((0, 0, 5))]), *rays)
        for more in ([], [body(wall(5.05, 20), at=(side, 0, 0)) for side in (20.05, -20.05)])
    )
    np.testing.assert_array_equal(free.radiance, beside.radiance)
    assert free.radiance.mean() > 0.3


HAZE, DENSITY = (0.5, 0.6, 0.9), 0.03
FOG = Fog(colour=HAZE, density_per_mm=DENSITY)


def fogged(bodies, direction=(0, 0, 1), *, fog=FOG, background=UNIFORM):
    scene = Scene(bodies=bodies, fog=fog, ambient=WHITE, background=background)
    return trace(scene, [[0, 0, 0]], [direction]).radiance[0]


def faded(colour, distance):
    clear = math.exp(-DENSITY * distance)
    return clear * np.array(colour) + (1 - clear) * np.array(HAZE)


@pytest.mark.parametrize("direction", [(0, 0, 1), (0.3, -0.2, 1)])
def test_light_fades_exponentially_in_fog(direction):
    colour = (0.8, 0.2, 0.1)
    distance = 40 * np.linalg.norm(direction)
    np.testing.assert_allclose(fogged([body(wall(40), colour=colour)], direction), faded(colour, distance), rtol=2e-6)


def test_the_sky_is_seen_as_it_is():
    np.testing.assert_allclose(fogged([body(wall(-5), colour=BLACK)]), WHITE)


def test_fog_lies_on_both_ways_of_a_reflection():
    sky = Background(horizon=(0.2, 0.4, 0.1), zenith=(0.2, 0.4, 0.1), nadir=(0.2, 0.4, 0.1))
    mirror = body(wall(20), colour=BLACK, mirror=WHITE)
    np.testing.assert_allclose(fogged([mirror], background=sky), faded(sky.horizon, 20), rtol=2e-6)
    behind = body(wall(-10), colour=WHITE)
    np.testing.assert_allclose(fogged([mirror, behind]), faded(faded(WHITE, 30), 20), rtol=2e-6)


def test_there_is_no_fog_inside_bodies():
    pane = body(box(50, 50, 8), at=(0, 0, 20), colour=BLACK, transmission=WHITE, ior=1.0)
    colour = (0.9, 0.1, 0.3)
    got = fogged([pane, body(wall(50), colour=colour)])
    # 16 mm to the pane, 8 mm in it, 26 mm from it; the pane's own faces lift rays by a hair
    np.testing.assert_allclose(got, faded(faded(colour, 26), 16), rtol=2e-5)


def test_a_scene_without_fog_is_the_limit_of_thin_fog():
    bodies = [body(wall(40), colour=(0.8, 0.2, 0.1))]
    np.testing.assert_allclose(fogged(bodies, fog=None), (0.8, 0.2, 0.1), rtol=1e-6)
    thin = Fog(colour=HAZE, density_per_mm=1e-12)
    np.testing.assert_allclose(fogged(bodies, fog=thin), fogged(bodies, fog=None), rtol=1e-6)
    assert packed(Scene(bodies=bodies)).fog.size == 0


@pytest.mark.parametrize("density", [0, -1, math.nan, math.inf])
def test_fog_of_no_density_is_refused(density):
    with pytest.raises(ValueError, match="density"):
        Fog(colour=HAZE, density_per_mm=density)


def test_fog_from_a_file(tmp_path):
    ball = '[material.m]\n[[object]]\nmaterial = "m"\nshape = "sphere"\nradius_mm = 1\n'
    text = '[fog]\ncolour = "#ffffff"\ndensity_per_mm = {}\n' + ball
    path = tmp_path / "a.toml"
    path.write_text(text.format(0.01))
    assert load_scene(path).fog == Fog(colour=WHITE, density_per_mm=0.01)
    path.write_text(text.format(0))
    with pytest.raises(ValueError, match=r"fog.density_per_mm: 0: a number greater than 0 is needed"):
        load_scene(path)


def test_vertex_colours_run_straight_across_a_face():
    mesh = wall(10, half=5)
    colours = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)], float)
    painted = body(mesh, coordinates=colours, texture=VertexColours(), colour=WHITE)
    scene = Scene(bodies=[painted], ambient=WHITE)
    triangle = mesh.faces[0]
    for shares in ((0.2, 0.3, 0.5), (0.6, 0.3, 0.1), (1 / 3, 1 / 3, 1 / 3)):
        point = shares @ mesh.vertices[triangle]
        got = trace(scene, [[0, 0, 0]], [point]).radiance[0]
        np.testing.assert_allclose(got, shares @ colours[triangle], atol=2e-6)
