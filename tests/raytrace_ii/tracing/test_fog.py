"""Fog and vertex colours, in closed form."""

import math

import numpy as np
import pytest

from raytrace_ii import Background, Fog, Scene, load_scene, trace
from raytrace_ii.scene.textures import VertexColours
from raytrace_ii.tracing.packing import packed
from tests.support.trace_scenes import BLACK, UNIFORM, WHITE, body, box, wall

HAZE, DENSITY = (0.5, 0.6, 0.9), 0.03
FOG = Fog(colour=HAZE, density_per_mm=DENSITY)


def seen(bodies, direction=(0, 0, 1), *, fog=FOG, background=UNIFORM):
    scene = Scene(bodies=bodies, fog=fog, ambient=WHITE, background=background)
    return trace(scene, [[0, 0, 0]], [direction]).radiance[0]


def faded(colour, distance):
    clear = math.exp(-DENSITY * distance)
    return clear * np.array(colour) + (1 - clear) * np.array(HAZE)


@pytest.mark.parametrize("direction", [(0, 0, 1), (0.3, -0.2, 1)])
def test_light_fades_exponentially_in_fog(direction):
    colour = (0.8, 0.2, 0.1)
    distance = 40 * np.linalg.norm(direction)
    np.testing.assert_allclose(seen([body(wall(40), colour=colour)], direction), faded(colour, distance), rtol=2e-6)


def test_the_sky_is_seen_as_it_is():
    np.testing.assert_allclose(seen([body(wall(-5), colour=BLACK)]), WHITE)


def test_fog_lies_on_both_ways_of_a_reflection():
    sky = Background(horizon=(0.2, 0.4, 0.1), zenith=(0.2, 0.4, 0.1), nadir=(0.2, 0.4, 0.1))
    mirror = body(wall(20), colour=BLACK, mirror=WHITE)
    np.testing.assert_allclose(seen([mirror], background=sky), faded(sky.horizon, 20), rtol=2e-6)
    behind = body(wall(-10), colour=WHITE)
    np.testing.assert_allclose(seen([mirror, behind]), faded(faded(WHITE, 30), 20), rtol=2e-6)


def test_there_is_no_fog_inside_bodies():
    pane = body(box(50, 50, 8), at=(0, 0, 20), colour=BLACK, transmission=WHITE, ior=1.0)
    colour = (0.9, 0.1, 0.3)
    got = seen([pane, body(wall(50), colour=colour)])
    # 16 mm to the pane, 8 mm in it, 26 mm from it; the pane's own faces lift rays by a hair
    np.testing.assert_allclose(got, faded(faded(colour, 26), 16), rtol=2e-5)


def test_a_scene_without_fog_is_the_limit_of_thin_fog():
    bodies = [body(wall(40), colour=(0.8, 0.2, 0.1))]
    np.testing.assert_allclose(seen(bodies, fog=None), (0.8, 0.2, 0.1), rtol=1e-6)
    thin = Fog(colour=HAZE, density_per_mm=1e-12)
    np.testing.assert_allclose(seen(bodies, fog=thin), seen(bodies, fog=None), rtol=1e-6)
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
