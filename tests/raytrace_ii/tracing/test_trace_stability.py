"""Numerical limits of the tracer: self-hits, leaks, grazing light, extreme scales, bad geometry and rays."""

import math

import numpy as np
import pytest

from raytrace_ii import Background, Body, Light, Material, Scene, trace
from raytrace_ii.shapes.primitives import Mesh, rotation
from raytrace_ii.tracing.packing import LIFT
from tests.support.trace_scenes import BLACK, UNIFORM, WHITE, body, box, floor, lamp, sphere, spread, sun, wall

LIGHT = np.array([0.5, 0.7, -0.4]) / np.linalg.norm([0.5, 0.7, -0.4])
ROOM = Mesh(*(lambda m: (m.vertices, m.faces))(box(2, 2, 2)))  # no textures, half extent 1


def from_all_around(centre, radius, n, seed=0):
    """Rays from three radii off to points inside nine tenths of the radius, unit directions."""
    generator = np.random.default_rng(seed)
    start, aim = 3 * radius * spread(generator, n), 0.9 * radius * spread(generator, n)
    directions = aim - start
    return start + centre, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def acne_and_leaks(mesh, scale, at, light, n=4000):
    """Rays that hit; points that face the light and are dark; points that face away and are lit; worst n·l."""
    scene = Scene(bodies=[body(mesh, scale=scale, at=at, flat=True, colour=WHITE)], lights=[light])
    seen = trace(scene, *from_all_around(np.asarray(at), scale, n))
    cosine, lit = seen.normal @ LIGHT, seen.radiance[:, 0] > 0
    # a hundredth: a lamp 1000 radii off stands in the light's direction to a thousandth
    facing, away = (seen.object_id == 0) & (cosine > 1e-2), (seen.object_id == 0) & (cosine < -1e-2)
    assert facing.sum() > n / 4 or not (seen.object_id == 0).any()
    error = np.abs(seen.radiance[facing, 0] - cosine[facing]).max(initial=0)
    return (seen.object_id == 0).sum(), (facing & ~lit).sum(), (away & lit).sum(), error


@pytest.mark.parametrize("offset", [0, 10, 1000])
@pytest.mark.parametrize("scale", [1e-6, 1e-4, 1e-3, 1.0, 1e3, 1e5, 1e9])
@pytest.mark.parametrize("mesh", [sphere(1, 96), box(2, 2, 2)], ids=["sphere", "box"])
def test_a_convex_body_is_lit_where_it_faces_the_light_and_dark_elsewhere(mesh, scale, offset):
    at = np.array([offset, offset / 3, -offset / 2]) * scale
    hit, acne, leaks, error = acne_and_leaks(mesh, scale, at, sun(LIGHT))
    assert (hit, acne, leaks) == (4000, 0, 0)
    assert error < 1e-7, "n·l of float32 normals"
    hit, acne, leaks, error = acne_and_leaks(mesh, scale, at, lamp(at + LIGHT * 1000 * scale))
    assert (hit, acne, leaks) == (4000, 0, 0)
    assert error < 2e-3, "a lamp 1000 radii off"


@pytest.mark.parametrize("offset", [1e4, 1e5, 1e6])
def test_far_from_the_origin_only_the_form_suffers(offset):
    """A ball of 1 mm a kilometre off, where float32 steps by 0.06 mm: crumpled, but neither acne nor leaks."""
    at = np.array([offset, offset / 3, -offset / 2])
    hit, acne, leaks, _ = acne_and_leaks(sphere(1, 96), 1.0, at, sun(LIGHT))
    assert hit > 3900 and (acne, leaks) == (0, 0)


def test_limits_of_scale():
    """Embree takes products of three lengths in float32: a size of 1e-12 mm works, and 1e12 mm.

    100 000 rays, of which some 350 meet the small faces at the poles: their lift of 4e-18 mm, times twice their area
    of 2.8e-28 mm², is less than float32's smallest step. 1000 rays, as this test once took, met three.
    """
    n = 100_000
    for mesh, smallest, largest in ((sphere(1, 96), 1e-12, 1e13), (box(2, 2, 2), 1e-12, 1e12)):
        for scale in (smallest, largest):
            assert acne_and_leaks(mesh, scale, (0, 0, 0), sun(LIGHT), n)[:3] == (n, 0, 0), scale
        # beyond, rays miss or shadows fail, without an error or a NaN
        assert acne_and_leaks(mesh, largest * 10, (0, 0, 0), sun(LIGHT), 1000)[0] == 0
        hit, acne, _, error = acne_and_leaks(mesh, smallest * 1e-4, (0, 0, 0), sun(LIGHT), 1000)
        assert (hit < 1000 or acne > 0) and math.isfinite(error)


def on_edges_and_vertices(mesh, n, seed=0):
    generator = np.random.default_rng(seed)
    face, side = generator.integers(0, len(mesh.faces), n), generator.integers(0, 3, n)
    a, b = mesh.vertices[mesh.faces[face, side]], mesh.vertices[mesh.faces[face, (side + 1) % 3]]
    return a + (b - a) * generator.random((n, 1)), mesh.vertices[generator.integers(0, len(mesh.vertices), n)]


@pytest.mark.parametrize("at", [(0, 0, 0), (0.3, 0.1, 0.2), (10, -7, 4), (1000, 300, 200)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_closed_room_is_dark(scale, at):
    """Light and bright sky outside, the camera inside, rays to every edge and corner: nothing comes in.

    A hit just on an edge lies in the neighbouring wall too. Rays that start there leak, up to 5 % of those aimed at
    edges, unless they are pulled off it first, by more than float32's step at the room's place.
    """
    n, at = 10_000, np.asarray(at) * scale
    room = body(ROOM, scale=scale, at=at)
    lights = [lamp(at + scale * np.array([5, 6, 7]), (100,) * 3), sun((-0.3, 1, 0.2), (100,) * 3)]
    scene = Scene(bodies=[room], background=UNIFORM, lights=lights)
    generator = np.random.default_rng(1)
    edges, vertices = on_edges_and_vertices(ROOM, n)
    start = at + 0.5 * scale * spread(generator, n)
    for aim in (at + scale * edges, at + scale * vertices, at + scale * 0.9 * spread(generator, n)):
        seen = trace(scene, start, aim - start)
        assert (seen.object_id == 0).all() and (seen.radiance == 0).all()


def test_a_closed_room_of_mirrors_is_dark():
    """No light enters over any number of bounces."""
    room = body(ROOM, mirror=WHITE)
    scene = Scene(bodies=[room], background=UNIFORM, lights=[lamp((5, 6, 7))], max_depth=12)
    edges, vertices = on_edges_and_vertices(ROOM, 5000)
    generator = np.random.default_rng(2)
    start = 0.5 * spread(generator, 5000)
    for aim in (edges, vertices, 0.9 * spread(generator, 5000)):
        seen = trace(scene, start, aim - start)
        assert seen.count.rays["reflection"] == 12 * 5000
        assert (seen.radiance == 0).all()


def test_rays_at_a_balls_vertices_may_slip_through():
    """Embree's robust mode joins edges without a gap; where six faces meet, about one ray in ten thousand passes."""
    n, mesh = 40_000, sphere(1, 32)
    edges, vertices = on_edges_and_vertices(mesh, n)
    start = 0.5 * spread(np.random.default_rng(1), n)
    scene = Scene(bodies=[body(mesh, flat=True)])
    assert (trace(scene, start, edges - start).object_id == 0).all()
    assert (trace(scene, start, vertices - start).object_id < 0).sum() < 20


@pytest.mark.parametrize("turn", [(0, 0, 0), (13, 27, -31)])
@pytest.mark.parametrize("size", [1.0, 100.0, 1e4])
def test_grazing_light_and_grazing_looks_see_no_shadow_on_a_plane(size, turn):
    """Light and camera both down to 1e-4 rad over the plane: all lit, and as brightly as the cosine says.

    Lights of 100, for the cosine of one of 1 would be too dark to count.
    """
    matrix, at = rotation(turn), np.array([3.0, 4.0, 50.0])
    up, along, ahead = matrix @ [0, 1, 0], matrix @ [1, 0, 0], matrix @ [0, 0, 1]
    plane = body(floor(size), turn=turn, at=at, colour=WHITE)
    generator = np.random.default_rng(0)
    points = generator.uniform(-0.49, 0.49, (3000, 2)) * size @ np.array([along, ahead]) + at
    lift = LIFT * np.abs(plane.vertices).max()
    for angle in (1e-2, 1e-3, 1e-4):
        look = -math.cos(angle) * ahead - math.sin(angle) * up
        towards = math.cos(angle) * along + math.sin(angle) * up
        start = points - look * size * 0.3
        far = trace(
            Scene(bodies=[plane], lights=[sun(towards, (100,) * 3)]), start, np.broadcast_to(look, start.shape)
        )
        assert (far.object_id == 0).all()
        # the normal is float32: 1e-7 off in a cosine of 1e-4
        np.testing.assert_allclose(far.radiance[:, 0], 100 * math.sin(angle), rtol=2e-7 / angle)
        near = lamp(at + 10 * size * towards, (100,) * 3)
        seen = trace(Scene(bodies=[plane], lights=[near]), start, np.broadcast_to(look, start.shape))
        # the ray to the lamp starts a lift above the plane; a lamp not higher than that is behind it
        height, reach = 10 * size * math.sin(angle), 10.5 * size
        assert height > 2 * lift
        assert seen.radiance[:, 0].min() > 100 * 0.95 * (height - 1.2 * lift) / reach


def test_a_lamp_lower_than_the_lift_is_behind_the_plane():
    """The limit of grazing light: 4e-6 of the largest coordinate."""
    plane = body(floor(1), at=(0, 0, 50), colour=WHITE)
    lift = LIFT * 50.5
    for height, lit in ((0.5 * lift, False), (2 * lift, True)):
        scene = Scene(bodies=[plane], lights=[lamp((5, height, 50), (1e5,) * 3)])
        assert (trace(scene, [(0, 1, 50)], [(0, -1, 0)]).radiance[0, 0] > 0) == lit


# Bodies around cameras and lights


def test_a_camera_in_a_body_sees_its_inside():
    shell = body(sphere(5, 64), at=(0, 0, 10), colour=(0.5,) * 3)
    directions = spread(np.random.default_rng(0), 500)
    start = np.broadcast_to([0.5, 0.2, 10.0], directions.shape)
    outside = trace(Scene(bodies=[shell], lights=[sun((0, 1, 0))], background=UNIFORM), start, directions)
    assert (outside.object_id == 0).all() and (outside.radiance == 0).all()
    inside = trace(Scene(bodies=[shell], lights=[lamp((0, 0, 10))]), start, directions)
    # from the middle of a ball light falls straight on its inside; faces lean by up to 4°
    np.testing.assert_allclose(inside.radiance, 0.5, rtol=3e-3)
    # the outward normals are recorded, not turned to the camera
    assert (np.einsum("ij,ij->i", inside.normal, directions) > 0).all()


def test_a_lamp_in_a_body_lights_nothing_outside():
    shell = body(sphere(5, 64), at=(0, 0, 20))
    ground = body(floor(200), at=(0, -8, 20), name="floor")
    scene = Scene(bodies=[shell, ground], lights=[lamp((1, 0, 20))])
    directions = np.column_stack([*np.random.default_rng(0).uniform(-0.5, 0.5, (2, 2000)), np.ones(2000)])
    seen = trace(scene, np.zeros_like(directions), directions)
    assert set(np.unique(seen.object_id)) == {-1, 0, 1} and (seen.radiance == 0).all()


def test_a_lamp_in_glass_shines_out():
    glass = body(sphere(5, 64), at=(0, 0, 20), transmission=WHITE)
    ground = body(floor(200), at=(0, -8, 20), name="floor", colour=WHITE)
    scene = Scene(bodies=[glass, ground], lights=[lamp((0, 0, 20))])
    below = trace(scene, [(0, -7, 20)], [(0, -1, 0)]).radiance[0]
    np.testing.assert_allclose(below, 0.96, rtol=1e-3)  # one face straight on


# Bad geometry


def test_a_scene_or_a_body_of_nothing_is_refused():
    with pytest.raises(ValueError, match="scene 'void' has no geometry: at least one object is needed"):
        Scene(bodies=[], name="void")
    vertices, faces = np.eye(3), np.array([[0, 1, 2]])
    for v, f in ((vertices, faces[:0]), (vertices[:, :2], faces), (vertices, faces[0]), (vertices[0], faces)):
        with pytest.raises(ValueError, match="object 'x' has no geometry: triangles are needed"):
            Body(name="x", vertices=v, faces=f, material=Material())


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
def test_vertices_that_are_no_numbers_are_refused(value):
    vertices = np.eye(3)
    vertices[1, 2] = value
    with pytest.raises(
        ValueError, match=r"object 'x': vertex 1 is \[0.0, 1.0, .*\]: finite float32 numbers are needed"
    ):
        Body(name="x", vertices=vertices, faces=np.array([[0, 1, 2]]), material=Material())


def test_faces_and_normals_must_fit_their_vertices():
    for index, says in ((3, "a face names vertex 3, there are 3"), (-1, "a face names vertex -1, there are 3")):
        with pytest.raises(ValueError, match=says):
            Body(name="x", vertices=np.eye(3), faces=np.array([[0, 1, index]]), material=Material())
    for what in ("normals", "texture_coordinates"):
        with pytest.raises(ValueError, match=rf"{what} are \(2, 3\), vertices \(3, 3\)"):
            Body(
                name="x",
                vertices=np.eye(3),
                faces=np.array([[0, 1, 2]]),
                material=Material(),
                **{what: np.eye(3)[:2]},
            )


def test_normals_and_texture_coordinates_that_are_no_numbers_are_refused():
    values = np.eye(3)
    values[2, 0] = np.nan
    for what in ("normals", "texture_coordinates"):
        with pytest.raises(ValueError, match=rf"object 'x': {what} of vertex 2 are \[nan, 0.0, 1.0\]: finite"):
            Body(name="x", vertices=np.eye(3), faces=np.array([[0, 1, 2]]), material=Material(), **{what: values})


def test_depth_and_lights_out_of_range_are_refused():
    ball = body(sphere(1, 8))
    with pytest.raises(ValueError, match="max_depth is -1"):
        Scene(bodies=[ball], max_depth=-1)
    with pytest.raises(ValueError, match="unknown light 'laser': known are point, directional, spot"):
        Light(kind="laser", vector=(0, 0, 1), colour=WHITE)
    with pytest.raises(ValueError, match="directional light has the direction zero"):
        sun((0, 0, 0))
    for vector in ((0, math.nan, 1), (math.inf, 0, 0)):
        for kind in ("point", "directional"):
            with pytest.raises(ValueError, match="finite"):
                Light(kind=kind, vector=vector, colour=WHITE)


def test_faces_without_area_are_not_there():
    """Points, needles and repeated corners among good faces: the good ones look the same."""
    good = wall(20, 30)
    extra = np.array([[0, 0, 5.0], [1, 1, 5], [2, 2, 5]])  # in a line, before the wall
    vertices = np.concatenate([good.vertices, extra])
    faces = np.concatenate([[[4, 4, 4], [4, 5, 5], [4, 5, 6]], good.faces, [[0, 0, 1], [6, 5, 4]]])
    directions = np.column_stack([*np.random.default_rng(0).uniform(-0.5, 0.5, (2, 3000)), np.ones(3000)])
    directions[:2] = (0.1, 0.1, 1), (0.2, 0.2, 1)  # at the needle
    room = {"lights": [lamp((3, 9, 2))], "ambient": (0.1,) * 3}
    plain = trace(Scene(bodies=[body(good, mirror=(0.2,) * 3)], **room), np.zeros_like(directions), directions)
    mixed = trace(
        Scene(bodies=[body(Mesh(vertices, faces), mirror=(0.2,) * 3)], **room), np.zeros_like(directions), directions
    )
    assert np.isfinite(mixed.radiance).all()
    for name in ("radiance", "depth", "normal", "object_id"):
        np.testing.assert_array_equal(getattr(mixed, name), getattr(plain, name))
    nothing = trace(Scene(bodies=[body(Mesh(extra, np.array([[0, 1, 2]])))]), np.zeros_like(directions), directions)
    assert (nothing.object_id == -1).all()


@pytest.mark.slow
def test_needles_and_slivers_give_numbers():
    """Triangles down to a width of nothing in float32."""
    for width in 10.0 ** np.arange(0, -46, -3):
        needle = Mesh(np.array([[-5, 0, 10], [5, width, 10], [5, 0, 10.0]]), np.array([[0, 2, 1]]))
        scene = Scene(
            bodies=[body(needle, mirror=(0.3,) * 3, transmission=(0.3,) * 3, specular=1)],
            lights=[lamp((0, 5, 0)), sun((0, 1, -1))],
            background=UNIFORM,
        )
        y = np.linspace(-1, 1, 101)[:, None] * width
        directions = np.column_stack([np.full(101, 2.0), y, np.full(101, 10.0)])
        seen = trace(scene, np.zeros_like(directions), directions)
        assert np.isfinite(seen.radiance).all() and (seen.radiance >= 0).all()


def test_the_first_of_coincident_faces_is_always_seen():
    """Two bodies in the same place: the first wins, in packets and alone, and neither shades the other."""
    red, blue = body(wall(20, 30), name="red", colour=(1, 0, 0)), body(wall(20, 30), name="blue", colour=(0, 0, 1))
    directions = np.column_stack([*np.random.default_rng(0).uniform(-0.5, 0.5, (2, 3000)), np.ones(3000)])
    scene = Scene(bodies=[red, blue], lights=[sun((0.3, 0.4, -1))])
    first = trace(scene, np.zeros_like(directions), directions)
    np.testing.assert_allclose(first.depth, 20, rtol=1e-6)
    cosine = 1 / np.linalg.norm([0.3, 0.4, 1])
    expected = np.array([[cosine, 0, 0], [0, 0, cosine]])[first.object_id]
    np.testing.assert_allclose(first.radiance, expected, rtol=1e-6)
    again = trace(Scene(bodies=[red, blue], lights=[sun((0.3, 0.4, -1))]), np.zeros_like(directions), directions[::1])
    np.testing.assert_array_equal(first.object_id, again.object_id)
    one_by_one = [trace(scene, [(0, 0, 0)], [d]).object_id[0] for d in directions[:200]]
    np.testing.assert_array_equal(first.object_id[:200], one_by_one)
    assert (first.object_id == 0).all()


def test_a_huge_face_beside_tiny_ones():
    """Grains of 0.02 mm over a floor of 20 km: found and lit, but without shadows.

    The floor's rays start 4e-6 of its coordinates, 40 mm, off: over the grains. A floor of 2 m is small enough.
    """
    ground = body(floor(2e7), colour=WHITE)
    generator = np.random.default_rng(0)
    centres = np.column_stack([generator.uniform(-1, 1, 40), np.full(40, 0.5), generator.uniform(-1, 1, 40)])
    grains = [body(sphere(0.01, 12), at=c, name=str(i), colour=(1, 0, 0)) for i, c in enumerate(centres)]
    scene = Scene(bodies=[ground, *grains], lights=[sun((1, 10, 0))])
    down = np.broadcast_to([0.0, -1, 0], centres.shape)
    seen = trace(scene, centres + np.array([0, 1, 0]), down)
    np.testing.assert_array_equal(seen.object_id, np.arange(1, 41))
    assert (seen.radiance[:, 0] > 0.9).all()
    beside = centres - [0.05, 0.1, 0]
    shaded = trace(scene, beside, down)
    assert (shaded.object_id == 0).all() and (shaded.radiance[:, 0] > 0.9).all()
    ground = body(floor(2000), colour=WHITE)
    shaded = trace(Scene(bodies=[ground, *grains], lights=[sun((1, 10, 0))]), beside, down)
    assert (shaded.object_id == 0).all() and (shaded.radiance[:, 0] == 0).all()


# Bad rays


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -np.inf, 1e-200, 1e200])
def test_rays_without_a_direction_are_refused(value):
    directions = np.ones((3, 4, 3))
    directions[1, 2] = (value if value in (1e-200, 1e200) else 0.0, value, 0.0)
    with pytest.raises(ValueError, match=r"ray \[1, 2\] from .* direction other than zero"):
        trace(Scene(bodies=[body(sphere(1, 8))]), np.zeros((3, 4, 3)), directions)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_rays_from_nowhere_are_refused(value):
    locations = np.zeros((2, 5, 3))
    locations[0, 3, 1] = value
    with pytest.raises(ValueError, match=r"ray \[0, 3\] from .*(nan|inf).*: a finite place"):
        trace(Scene(bodies=[body(sphere(1, 8))]), locations, np.ones((2, 5, 3)))


def test_rays_must_be_threes_and_pairs():
    scene = Scene(bodies=[body(sphere(1, 8))])
    for locations, directions in ((np.zeros((4, 3)), np.ones((5, 3))), (np.zeros((4, 2)), np.ones((4, 2)))):
        with pytest.raises(ValueError, match=r"the same \(\.\.\., 3\) is needed"):
            trace(scene, locations, directions)


def test_no_rays_see_nothing_and_one_ray_is_a_row():
    scene = Scene(bodies=[body(sphere(1, 8))], background=Background(horizon=(0.2, 0.3, 0.4)))
    assert trace(scene, np.zeros((0, 3)), np.zeros((0, 3))).radiance.shape == (0, 3)
    assert trace(scene, (5, 5, 5), (1, 0, 0)).radiance == pytest.approx(np.array([[0.2, 0.3, 0.4]]))


def test_the_length_of_a_direction_does_not_matter():
    scene = Scene(bodies=[body(sphere(5), at=(0, 0, 20), specular=0.4)], lights=[lamp((9, 9, 0))], ambient=(0.1,) * 3)
    directions = np.column_stack([*np.random.default_rng(0).uniform(-0.3, 0.3, (2, 500)), np.ones(500)])
    unit = trace(scene, np.zeros_like(directions), directions)
    for length in (2.0**-60, 2.0**100):  # powers of two: not a bit of the unit vector changes
        other = trace(scene, np.zeros_like(directions), directions * length)
        np.testing.assert_array_equal(unit.radiance, other.radiance)
        np.testing.assert_array_equal(unit.depth, other.depth)


@pytest.mark.slow
def test_black_is_black():
    """A scene without light is black, for all materials."""
    bodies = [body(sphere(3), at=(0, 0, 20), mirror=(0.5,) * 3, transmission=(0.5,) * 3), body(wall(40), specular=1)]
    directions = np.column_stack([*np.random.default_rng(0).uniform(-0.3, 0.3, (2, 500)), np.ones(500)])
    seen = trace(Scene(bodies=bodies, lights=[lamp((0, 0, 1), BLACK)]), np.zeros_like(directions), directions)
    assert (seen.radiance == 0).all()


@pytest.mark.slow
def test_rays_through_corners_of_faces_seldom_slip_through():
    """Embree's robust mode closes edges, not corners: a few of a hundred rays aimed at corners miss, others never."""
    x = (np.arange(100) + 0.5) / 50 - 1
    corners = np.column_stack([*(50 * c.ravel() for c in np.meshgrid(x, x)), np.full(10_000, 60.0)])
    i = np.arange(10_000).reshape(100, 100)
    a, b, c, d = (one.ravel() for one in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    scene = Scene(bodies=[body(Mesh(corners, faces), colour=WHITE)])
    eye = np.array([0.3, 1.7, -33.9])

    def missed(places):
        return np.isnan(trace(scene, np.broadcast_to(eye, places.shape), places - eye).depth).mean()

    assert missed(corners[i[1:-1, 1:-1].ravel()]) < 0.03
    assert missed(corners[faces].mean(axis=1)) == 0
