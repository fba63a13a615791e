"""Invalid scenes: one error that names the field and its value."""

import math

import numpy as np
import pytest

from raytrace_ii import Background, Body, Fog, Light, Material, Scene
from raytrace_ii.scene.textures import Checker, Image, VertexColours
from tests.support.trace_scenes import BLACK, WHITE, body, wall

PLAIN = Image(np.ones((2, 2, 3), np.float32))
CUT = Image(np.ones((2, 2, 3), np.float32), alpha=np.ones((2, 2), np.float32))


@pytest.mark.parametrize("field", ["colour", "mirror", "transmission", "absorption_per_mm", "emission"])
@pytest.mark.parametrize("value", [(-0.1, 0, 0), (0, math.nan, 0), (0, 0, math.inf), (0.5, 0.5), 0.5])
def test_a_materials_colours(field, value):
    with pytest.raises(ValueError, match=rf"^{field} is .*: 3 finite numbers of at least 0 are needed$"):
        Material(**{field: value})


@pytest.mark.parametrize(
    ("field", "bad"),
    [
        ("ior", [0, -1.5, math.nan, math.inf, (1.5, 0, 1.5), (1.5, math.nan, 1.5), (1.4, 1.5)]),
        ("shininess", [0, -1, math.nan, math.inf]),
        ("specular", [-0.1, math.nan, math.inf]),
        ("normal_scale", [-1, math.nan]),
        ("alpha_cutoff", [-0.1, 1.1, math.nan]),
        ("priority", [1.5, math.nan, "high"]),
    ],
)
def test_a_materials_numbers(field, bad):
    for value in bad:
        with pytest.raises(ValueError, match=rf"^{field} is .* needed$"):
            Material(**{field: value})


def test_values_on_the_border_are_taken():
    assert Material(emission=(0, 100, 0), specular=0, ior=(1.4, 1.5, 1.6), priority=-3).iors == (1.4, 1.5, 1.6)
    assert Material(ior=1.3).iors == (1.3,) * 3
    assert Material(texture=CUT, alpha_cutoff=1).alpha_cutoff == 1


def test_cut_outs_need_alpha_and_normal_maps_need_coordinates():
    for texture in (None, PLAIN, VertexColours()):
        with pytest.raises(ValueError, match=r"alpha_cutoff is 0\.5: an image texture with alpha is needed"):
            Material(texture=texture, alpha_cutoff=0.5)
    for texture in (VertexColours(), Checker((WHITE, BLACK), (1, 1, 1))):
        with pytest.raises(ValueError, match="a normal map needs a texture on the surface or none"):
            Material(texture=texture, normal_map=PLAIN)
    Material(texture=Checker((WHITE, BLACK), (1, 1, 1), on_surface=True), normal_map=PLAIN)
    mesh = wall(5)
    with pytest.raises(ValueError, match="object 'x': a normal map needs texture coordinates, there are none"):
        Body(name="x", vertices=mesh.vertices, faces=mesh.faces, material=Material(normal_map=PLAIN))


def test_lights():
    good = {"kind": "spot", "vector": (0, 0, 0), "colour": WHITE}
    for field, value, says in (
        ("colour", (-1, 0, 0), "colour of a spot light is .*at least 0"),
        ("vector", (math.inf, 0, 0), "vector of a spot light is .*finite"),
        ("direction", (0, math.nan, 1), "direction of a spot light is .*finite"),
        ("direction", (0, 0, 0), "spot light has the direction zero"),
        ("cone_deg", (30, 20), "inner angle below the outer"),
        ("cone_deg", (20, 20), "inner angle below the outer"),
        ("cone_deg", (0, 91), "at most 90"),
        ("cone_deg", (-1, 20), "cone_deg is .*at least 0"),
        ("cone_deg", (0, math.nan), "cone_deg is .*finite"),
        ("cone_deg", 20, "cone_deg is 20: 2 finite numbers"),
    ):
        with pytest.raises(ValueError, match=says):
            Light(**{**good, field: value})


def test_surroundings():
    ball = body(wall(5))
    for make, says in (
        (lambda: Background(horizon=(-1, 0, 0)), "horizon of the background is"),
        (lambda: Background(nadir=(0, math.nan, 0)), "nadir of the background is"),
        (lambda: Background(spread_deg=0), "spread_deg of the background is 0"),
        (lambda: Background(spread_deg=math.nan), "spread_deg of the background is nan"),
        (lambda: Background(turn_deg=math.inf), "turn_deg of the background is inf"),
        (lambda: Background(intensity=-1), "intensity of the background is -1"),
        (lambda: Fog(colour=(0, -1, 0), density_per_mm=1), "colour of the fog is"),
        (lambda: Scene(bodies=[ball], ambient=(0, 0, -0.1)), "ambient is"),
        (lambda: Scene(bodies=[ball], ambient=(0, 0, math.nan)), "ambient is"),
    ):
        with pytest.raises(ValueError, match=says):
            make()
