"""Normal maps and cut-outs."""

import math

import numpy as np
import pytest

from raytrace_ii import Background, Scene, trace
from raytrace_ii.scene.textures import Image, normal_map
from raytrace_ii.shapes.primitives import Mesh, rotation
from raytrace_ii.tracing.packing import packed
from tests.support.trace_scenes import BLACK, UNIFORM, WHITE, body, floor, hall, lamp, sphere, sun, wall

FLAT = Image(np.full((2, 2, 3), (0.5, 0.5, 1.0), np.float32))


def tilted(x, y, z):
    """Return a map with a single tangent-space normal, stored as 0…1."""
    vector = np.array([x, y, z]) / math.sqrt(x * x + y * y + z * z)
    return Image(np.broadcast_to((vector + 1) / 2, (2, 2, 3)).astype(np.float32))


def papered(mesh, image, *, uv=None, **more):
    """A body with a normal map on its (u, v)."""
    uv = mesh.uv if uv is None else uv
    return body(mesh, coordinates=np.column_stack([uv, np.zeros(len(uv))]), normal_map=image, **more)


def raised(mesh, y):
    """A floor of 20 mm at a height, with (u, v) from corner to corner."""
    return Mesh(mesh.vertices + np.array([0, y, 0]), mesh.faces, mesh.normals, (mesh.vertices[:, [0, 2]] + 10) / 20)


def fan(n=2000):
    return np.column_stack([*np.random.default_rng(0).uniform(-0.4, 0.4, (2, n)), np.ones(n)])


# Normal maps


@pytest.mark.parametrize("scale", [0.0, 1.0, 3.0])
def test_a_flat_map_changes_nothing_to_the_bit(scale):
    ball, directions = sphere(5, 24), fan()
    room = {"lights": [sun((1, 2, -1)), lamp((-9, 3, 4))], "ambient": (0.1,) * 3, "background": hall().background}
    material = {"specular": 0.5, "mirror": (0.2, 0.3, 0.1), "at": (0, 0, 20)}
    plain = trace(Scene(bodies=[body(ball, **material)], **room), np.zeros_like(directions), directions)
    image = FLAT if scale else tilted(0.3, -0.4, 0.8)
    mapped = Scene(bodies=[papered(ball, image, normal_scale=scale, **material)], **room)
    seen = trace(mapped, np.zeros_like(directions), directions)
    np.testing.assert_array_equal(plain.radiance, seen.radiance)
    np.testing.assert_array_equal(plain.normal, seen.normal)


@pytest.mark.parametrize("turn", [(0, 0, 0), (20, -35, 60)])
@pytest.mark.parametrize(("x", "y"), [(0.3, 0.0), (0.0, 0.3), (-0.2, 0.4)])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_a_tilted_map_tilts_the_light(x, y, scale, turn):
    """On a wall whose u grows to the right and v upwards the map's x is right and y up, z towards the viewer."""
    matrix = rotation(turn)
    towards = matrix @ np.array([0.2, 0.5, -1.0])
    towards /= np.linalg.norm(towards)
    image = tilted(x, y, 1)
    x, y, z = 2 * image.pixels[0, 0].astype(float) - 1
    normal = matrix @ np.array([scale * x, scale * y, -z])
    normal /= np.linalg.norm(normal)
    start, ahead = matrix @ np.array([1.0, 2.0, 10.0]), matrix @ np.array([0, 0, 1.0])
    scene = Scene(
        bodies=[papered(wall(20), image, normal_scale=scale, colour=WHITE, turn=turn)], lights=[sun(towards)]
    )
    seen = trace(scene, [start], [ahead]).radiance[0]
    np.testing.assert_allclose(seen, normal @ towards, rtol=1e-6)


@pytest.mark.parametrize(("mirror_u", "mirror_v"), [(False, False), (True, False), (False, True), (True, True)])
def test_mirrored_coordinates_mirror_the_map(mirror_u, mirror_v):
    """Where u grows to the left the map's x points left, handedness or not."""
    mesh = wall(20)
    uv = np.abs(mesh.uv - [mirror_u, mirror_v])
    image = tilted(0.3, 0.2, 1)
    x, y, z = (2 * image.pixels[0, 0].astype(float) - 1) * [-1 if mirror_u else 1, -1 if mirror_v else 1, -1]
    scene = Scene(bodies=[papered(mesh, image, uv=uv, colour=WHITE)], lights=[sun((0.6, 0, -0.8))])
    seen = trace(scene, [(1, 2, 0)], [(0, 0, 1)]).radiance[0]
    np.testing.assert_allclose(seen, np.array([x, y, z]) @ [0.6, 0, -0.8], rtol=1e-6)


def test_the_back_of_a_mapped_face_is_its_cast():
    """A dent seen from the front is a bump from behind: x and y of the normal stay in the face, z turns."""
    image = tilted(0.3, 0.2, 1)
    x, _, z = 2 * image.pixels[0, 0].astype(float) - 1
    scene = Scene(bodies=[papered(wall(20), image, colour=WHITE)], lights=[sun((0.6, 0, 0.8))])
    seen = trace(scene, [(1, 2, 40)], [(0, 0, -1)]).radiance[0]
    np.testing.assert_allclose(seen, -0.6 * x + 0.8 * z, rtol=1e-6)


def test_a_mapped_mirror_reflects_by_the_mapped_normal():
    angle = math.radians(20)
    sky = Background(horizon=(0.2, 0.3, 0.4), zenith=WHITE, nadir=BLACK)
    mirror = papered(wall(20), tilted(0, math.tan(angle), 1), mirror=WHITE)
    seen = trace(Scene(bodies=[mirror], background=sky, max_depth=1), [(0, 0, 0)], [(0, 0, 1)]).radiance[0]
    np.testing.assert_allclose(
        seen, np.array([0.2, 0.3, 0.4]) * (1 - math.sin(2 * angle)) + math.sin(2 * angle), rtol=1e-6
    )


def test_no_tilt_turns_a_normal_from_the_viewer_nor_gives_nonsense():
    steep = papered(wall(20), tilted(0.99, 0, 0.05), colour=WHITE)
    direction = np.array([[0.97, 0, 0.25]])
    seen = trace(Scene(bodies=[steep], lights=[sun((0, 0, -1))]), [(-60.0, 0, 0)], direction).radiance[0]
    np.testing.assert_allclose(seen, 1, rtol=1e-6)
    for uv in (np.zeros((4, 2)), np.column_stack([np.arange(4), np.arange(4)])):  # no directions to tilt in
        odd = papered(wall(20), tilted(0.3, 0.3, 0.9), uv=uv, colour=WHITE)
        np.testing.assert_allclose(
            trace(Scene(bodies=[odd], lights=[sun((0, 0, -1))]), [(0, 0, 0)], [(0, 0, 1)]).radiance, 1, rtol=1e-6
        )
    nothing = papered(wall(20), Image(np.full((2, 2, 3), 0.5, np.float32)), colour=WHITE)  # no normal at all
    assert np.isfinite(
        trace(Scene(bodies=[nothing], lights=[sun((0, 0, -1))]), [(0, 0, 0)], [(0, 0, 1)]).radiance
    ).all()


def test_eight_bits_are_off_flat_by_half_a_code():
    """128 is not ½: the map's own rounding, 1/255, which tilts light by as much."""
    scene = Scene(bodies=[papered(wall(20), normal_map(np.full((1, 1, 3), (128, 128, 255), np.uint8)), colour=WHITE)],
                  lights=[sun((0.6, 0, -0.8))])  # fmt: skip
    seen = trace(scene, [(0, 0, 0)], [(0, 0, 1)]).radiance[0]
    np.testing.assert_allclose(seen, 0.8 + 0.6 / 255, atol=2e-5)


# Cut-outs

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
HALF = Image(np.ones((2, 2, 3), np.float32), alpha=np.array([[0, 1], [0, 1]], np.float32))  # the left is away


def sieve(mesh=None, image=HALF, **more):
    mesh = wall(20) if mesh is None else mesh
    coordinates = np.column_stack([mesh.uv, np.zeros(len(mesh.uv))])
    return body(mesh, coordinates=coordinates, texture=image, alpha_cutoff=0.5, **{"colour": RED, **more})


def test_a_cut_out_shows_what_is_behind_it_at_its_place():
    """Alpha runs straight from 0 at u = ¼ to 1 at ¾, and back over the edge: below ½ up to u = ½."""
    behind = body(wall(40, 200), colour=BLUE, name="behind")
    scene = Scene(bodies=[sieve(name="sieve"), behind], ambient=WHITE, max_depth=0)
    x = np.linspace(-49, 49, 392)
    direction = np.column_stack([x, np.full_like(x, 3.0), np.full_like(x, 20.0)])
    seen = trace(scene, np.zeros_like(direction), direction)
    gone = x < 0
    names = np.array([b.name for b in scene.bodies])[seen.object_id]
    np.testing.assert_array_equal(names, np.where(gone, "behind", "sieve"))
    np.testing.assert_allclose(seen.radiance, np.where(gone[:, None], BLUE, RED), rtol=1e-6)
    np.testing.assert_allclose(seen.depth, np.where(gone, 40, 20), rtol=1e-6)
    np.testing.assert_allclose(
        seen.ray_length, np.where(gone, 2, 1) * np.linalg.norm(direction, axis=1), rtol=2e-5
    )  # on behind the sieve by a lift and a pull of 2e-4 mm each
    assert seen.count.rays["passed"] == gone.sum()


def test_many_sieves_cost_no_depth_and_the_sky_is_behind_the_last():
    sieves = [sieve(wall(10 + i), name=str(i)) for i in range(30)]
    scene = Scene(bodies=sieves, background=UNIFORM, max_depth=0)
    np.testing.assert_array_equal(trace(scene, [(-5, 0, 0)], [(0, 0, 1)]).radiance, [WHITE])
    assert trace(scene, [(5, 0, 0)], [(0, 0, 1)]).object_id[0] >= 0


def test_the_shadow_of_a_cut_out_has_its_hole():
    ground = body(floor(400), colour=WHITE, name="ground")
    mesh = floor(20)
    lid = sieve(raised(mesh, 6))
    x = np.linspace(-14.93, 14.93, 601)
    starts = np.column_stack([x, np.full_like(x, 3.0), np.full_like(x, 0.2)])
    for light in (sun((0, 1, 0)), lamp((0.0, 4000, 0.2))):
        seen = trace(Scene(bodies=[ground, lid], lights=[light]), starts, np.broadcast_to([0, -1, 0], starts.shape))
        clear = (np.abs(x) > 0.02) & (np.abs(x - 10) > 0.02)  # the lamp's shadow is 1.5 ‰ larger
        np.testing.assert_array_equal(seen.radiance[clear, 0] == 0, ((x > 0) & (x < 10))[clear])
        assert clear.sum() > 590


def test_cut_out_and_coloured_shadows_together():
    """Half a sieve over a pane: under its hole the pane's colour, under the rest none."""
    ground = body(floor(400), colour=WHITE)
    mesh = floor(20)
    pane = body(raised(mesh, 3), transmission=(0.9, 0.5, 0.1), ior=1.0)
    lid = sieve(raised(mesh, 6))
    scene = Scene(bodies=[ground, pane, lid], lights=[sun((0, 1, 0))])
    seen = trace(scene, [(-5, 1, 0.2), (5, 1, 0.2)], [(0, -1, 0)] * 2).radiance
    np.testing.assert_allclose(seen, [(0.9, 0.5, 0.1), BLACK], rtol=1e-6)


def test_a_cut_out_in_a_mirror_and_in_glass():
    mirror = body(wall(60, 300), mirror=WHITE)
    behind = body(wall(-20, 300), colour=BLUE, name="behind")
    scene = Scene(bodies=[mirror, behind, sieve(wall(-10))], ambient=WHITE, max_depth=1)
    seen = trace(scene, [(-5, 0, 0), (5, 0, 0)], [(0, 0, 1)] * 2).radiance
    np.testing.assert_allclose(seen, [BLUE, RED], rtol=1e-6)
    # a pane of which half is away: no Fresnel there, and no colour
    pane = sieve(wall(20), transmission=(0.5,) * 3, ior=1.0)
    seen = trace(Scene(bodies=[pane, body(wall(30, 300), colour=WHITE)], ambient=WHITE, max_depth=1),
                 [(-5, 0, 0), (5, 0, 0)], [(0, 0, 1)] * 2).radiance  # fmt: skip
    np.testing.assert_allclose(seen, [WHITE, (1.0, 0.5, 0.5)], rtol=1e-6)


def test_a_scene_without_cut_outs_pays_nothing_for_them():
    whole = body(wall(20), coordinates=np.zeros((4, 3)), texture=HALF, colour=RED)
    arrays = packed(Scene(bodies=[whole]))
    assert not arrays.passes and not arrays.lets_through and arrays.opaque_faces == 2
    seen = trace(Scene(bodies=[whole], ambient=WHITE), [(-5, 0, 0)], [(0, 0, 1)])
    assert seen.object_id[0] == 0 and seen.count.rays["passed"] == 0
