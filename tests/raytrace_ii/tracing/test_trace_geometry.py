"""Hit points: closed forms, float64 triangles, any pose, disparity in pictures."""

import math

import numpy as np
import pytest

from ii_core import IICamera, elementary_images, preset, refocus, sub_images
from raytrace_ii import Scene, load_scene, render, trace
from raytrace_ii.scene.textures import Noise
from raytrace_ii.shapes.primitives import Mesh, rotation
from tests.support.trace_scenes import UNIFORM, WHITE, body, box, lamp, sphere, spread, sun, texture_at, wall

# float32 keeps 6e-8 of a coordinate; a hit is put together from three vertices and (u, v): ten roundings at most.
FLOAT32 = 1e-6


def hit_points(locations, directions, seen):
    """Hit points from depth, which is z for an unmoved camera."""
    steps = (seen.depth - locations[:, 2]) / directions[:, 2]
    return locations + steps[:, None] * directions


def moller_trumbore(origin, direction, corners):
    """Distances of one ray to every triangle, inf where it misses, and the smallest barycentric coordinate."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    inverse = 1 / np.einsum("ij,ij->i", e1, p)
    s = origin - a
    u = np.einsum("ij,ij->i", s, p) * inverse
    q = np.cross(s, e1)
    v = q @ direction * inverse
    t = np.einsum("ij,ij->i", e2, q) * inverse
    least = np.minimum(np.minimum(u, v), 1 - u - v)
    return np.where((least >= 0) & (t > 0), t, np.inf), least


def test_a_sphere_is_hit_between_its_inscribed_and_its_own_radius():
    """A face of n segments reaches √2·π/n from its middle, so it lies up to R(1 − cos(√2·π/n)) under the sphere."""
    generator = np.random.default_rng(1)
    for radius, segments, centre in ((3.0, 96, (2.0, -1.0, 40.0)), (0.02, 24, (0, 0, 5.0)), (700.0, 200, (0, 0, 0))):
        scene = Scene(bodies=[body(sphere(radius, segments), at=centre)])
        start = np.asarray(centre) + 3 * radius * spread(generator, 4000)
        aim = np.asarray(centre) + 0.9 * radius * spread(generator, 4000)
        seen = trace(scene, start, aim - start)
        assert (seen.object_id == 0).all()
        flat = np.abs((aim - start)[:, 2]) < 0.1 * radius  # z says little about where such a ray hits
        points = hit_points(start, aim - start, seen)[~flat] - centre
        distance = np.linalg.norm(points, axis=1) / radius
        slack = FLOAT32 * 10 * (1 + np.abs(centre).max() / radius)  # ten: z taken to a point along a slanting ray
        assert distance.max() <= 1 + slack
        assert distance.min() >= math.cos(math.sqrt(2) * math.pi / segments) - slack
        # a face's normal leaves the radius by its own half extent at most
        facing = np.einsum("ij,ij->i", seen.normal[~flat], points) / radius / distance
        assert facing.min() >= math.cos(math.sqrt(2) * math.pi / segments) - slack


@pytest.mark.slow
def test_sphere_hits_approach_the_closed_form_as_the_segments_squared():
    start = np.array([[0.3, -0.2, 0.0]])
    direction = np.array([[0.02, 0.03, 1.0]])
    centre, radius = np.array([0.5, 0.4, 20.0]), 3.0
    unit = direction[0] / np.linalg.norm(direction)
    along = (centre - start[0]) @ unit
    exact = along - math.sqrt(radius**2 - (np.linalg.norm(centre - start[0]) ** 2 - along**2))
    for segments in (24, 96, 384, 500):
        seen = trace(Scene(bodies=[body(sphere(radius, segments), at=centre)]), start, direction)
        behind = seen.depth[0] / unit[2] - exact
        sagitta = radius * (1 - math.cos(math.sqrt(2) * math.pi / segments))
        # hit head on within 8°: the way along the ray is the sagitta over cos 8°, below 1.02
        assert -1e-5 * exact <= behind <= 1.02 * sagitta + 1e-5 * exact
    assert sagitta < 1e-5 * exact * 2, "the finest is a sphere to 1e-5"


def test_plane_hits_have_the_closed_form():
    generator = np.random.default_rng(2)
    turn = rotation((20, -35, 10))
    normal, at = turn @ [0, 0, -1.0], np.array([4.0, -7.0, 60.0])
    mesh = wall(0, 80)
    scene = Scene(bodies=[body(mesh, at=at, turn=(20, -35, 10))])
    start = generator.uniform(-5, 5, (3000, 3))
    direction = np.column_stack([generator.uniform(-0.3, 0.3, (3000, 2)), np.ones(3000)])
    seen = trace(scene, start, direction * generator.uniform(0.01, 100, (3000, 1)))
    exact = start[:, 2] + (at - start) @ normal / (direction @ normal)
    assert (seen.object_id == 0).all()
    np.testing.assert_allclose(seen.depth, exact, rtol=1e-5)
    np.testing.assert_allclose(seen.normal, np.broadcast_to(normal, seen.normal.shape), atol=FLOAT32)


def test_triangle_hits_agree_with_float64():
    """A soup of triangles, brute force: which is nearest, how far, which way it faces."""
    generator = np.random.default_rng(3)
    corners = generator.uniform(-10, 10, (60, 3, 3)) + np.array([0, 0, 30])
    bodies = [
        body(Mesh(corners[i : i + 20].reshape(-1, 3), np.arange(60).reshape(20, 3)), name=str(i)) for i in (0, 20, 40)
    ]
    start = generator.uniform(-12, 12, (2500, 3)) + np.array([0, 0, 10])
    direction = np.column_stack([generator.uniform(-0.8, 0.8, (2500, 2)), np.ones(2500)])
    seen = trace(Scene(bodies=bodies), start, direction)
    clear = 0
    for i in range(len(start)):
        t, least = moller_trumbore(start[i], direction[i], corners)
        order = np.argsort(t)
        # Rays within 1e-4 of an edge, and triangles within 1e-4 of each other, depend on float32 rounding.
        near_edge = (np.abs(least) < 1e-4).any()
        if near_edge or (np.isfinite(t[order[1]]) and t[order[1]] - t[order[0]] < 1e-3):
            continue
        clear += 1
        if not np.isfinite(t[order[0]]):
            assert seen.object_id[i] == -1 and np.isnan(seen.depth[i]) and (seen.normal[i] == 0).all()
            continue
        nearest = order[0]
        assert seen.object_id[i] == nearest // 20
        a, b, c = corners[nearest]
        normal = np.cross(b - a, c - a)
        np.testing.assert_allclose(seen.normal[i], normal / np.linalg.norm(normal), atol=1e-5)
        # a ray along a triangle meets it up to 1/cosine as far off as float32 puts the triangle
        cosine = abs(normal @ direction[i]) / np.linalg.norm(normal) / np.linalg.norm(direction[i])
        np.testing.assert_allclose(seen.depth[i], start[i, 2] + t[nearest], rtol=1e-5 + FLOAT32 / cosine)
    assert clear > 2300


def test_depth_is_along_the_cameras_axis_from_its_origin():
    """A camera set up elsewhere, looking along world x: depth of a wall at x = 100 from x = 30 is 70 all over."""
    pose = np.eye(4)
    pose[:3, :3] = rotation((0, 90, 0))  # z towards x
    pose[:3, 3] = (30, 5, -8)
    np.testing.assert_allclose(pose[:3, :3] @ [0, 0, 1], [1, 0, 0], atol=1e-15)
    scene = Scene(bodies=[body(wall(0, 300), turn=(0, 90, 0), at=(100, 0, 0))])
    shot = render(scene, preset("setup1", scale=64), pose=pose)
    np.testing.assert_allclose(shot.depth, 70, rtol=FLOAT32)
    np.testing.assert_allclose(shot.normal, np.broadcast_to([-1.0, 0, 0], shot.normal.shape), atol=FLOAT32)


def still_life(move, shift):
    """Bodies and lights moved by a rotation and a shift. A sky without a horizon: it does not turn with them."""

    def moved(point):
        return move @ np.asarray(point) + shift

    bodies = [
        body(sphere(5, 64), name="ball", at=(-6, 1, 40), specular=0.5),
        body(box(7, 6, 5), name="box", at=(8, -2, 50), turn=(10, 30, 5), mirror=(0.4,) * 3),
        body(wall(90, 60), name="wall", colour=(0.6, 0.5, 0.4)),
    ]
    turned = [
        body(
            Mesh(moved_all(b.vertices, move, shift), b.faces, None if b.normals is None else b.normals @ move.T),
            name=b.name,
            **{k: getattr(b.material, k) for k in ("specular", "mirror", "colour")},
        )
        for b in bodies
    ]
    lights = [sun(move @ [0.3, 0.8, -0.6], (0.5,) * 3), lamp(moved((-20, 15, 10)), (0.4,) * 3)]
    return Scene(bodies=turned, lights=lights, background=UNIFORM, ambient=(0.1,) * 3)


def moved_all(points, move, shift):
    return points @ move.T + shift


@pytest.mark.parametrize(("turn", "shift"), [((0, 0, 0), (12.5, -30, 7)), ((25, -140, 66), (100.0, 40, -250))])
def test_camera_and_scene_moved_together_see_the_same(turn, shift):
    """float32 places the moved scene to 1e-7 of 300 mm; only pixels on an edge or shadow's border may change."""
    camera = preset("setup1", scale=32)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(turn), shift
    here = render(still_life(np.eye(3), np.zeros(3)), camera, dtype="float32")
    there = render(still_life(pose[:3, :3], np.asarray(shift)), camera, dtype="float32", pose=pose)
    same = here.object_id == there.object_id
    assert same.mean() > 0.999
    assert len(np.unique(here.object_id)) == 3
    off = np.abs(here.depth - there.depth)[same]
    # 300 mm · 1e-7 · ten, over the cosine of a grazing hit on the ball
    assert np.nanquantile(off, 0.995) < 3e-4 and np.nanmax(off) < 0.2
    colour = np.abs(here.picture.pixels - there.picture.pixels).max(axis=-1)
    # highlights and mirrored edges magnify: 99 of 100 pixels agree to a tenth of an 8-bit step all the same
    assert np.quantile(colour, 0.99) < 0.1 / 255
    # the ball's faces are ½ mm wide, and float32 places their corners to 3e-5 mm at 300 mm
    turned_back = there.normal @ pose[:3, :3]
    assert np.quantile(np.abs(turned_back - here.normal)[same], 0.99) < 1e-4


def test_the_identity_pose_changes_nothing():
    scene, camera = load_scene("apples"), preset("setup1", scale=64)
    a, b = render(scene, camera), render(scene, camera, pose=np.eye(4))
    np.testing.assert_array_equal(a.picture.pixels, b.picture.pixels)


# Disparity
#
# A lens at X and a pixel p from under it: the ray starts at (X, Λ) along (−p, Λ), so a wall at z shows
# f(X − p·(z − Λ)/Λ). Between neighbouring sub-images p grows by δP to the right, the picture's content moves
# δP·(z − Λ)/Λ to the right, which is δP·(z − Λ)/(Λ·δL) sub-image pixels; on pixels downwards alike.
# A point at (x, z) lies under lens X at p = (X − x)·Λ/(z − Λ): from one elementary image to the next, to the right or
# downwards, it moves Λ·δL/((z − Λ)·δP) pixels to the right or downwards.


def noise_wall(z, size):
    """A wall of smooth noise lit by itself, and its red at any points of it."""
    texture = Noise(((0.0, 0.0, 0.0), WHITE), (size, size, size), contrast=0.7)
    mesh = wall(z, 40)
    scene = Scene(
        bodies=[body(mesh, coordinates=mesh.vertices, texture=texture, colour=WHITE)], ambient=WHITE, max_depth=0
    )

    def colour(x, y):
        across, down = np.meshgrid(x, y)
        points = np.stack([across, down, np.full_like(across, z)], axis=-1)
        return texture_at(texture, points.reshape(-1, 3))[:, 0].reshape(across.shape)

    return scene, colour


# Odd pixels under a lens: one lies on its axis.
ODD = IICamera(pixels=(40 * 7, 30 * 7), lenses=(40, 30), pixel_pitch_mm=0.1, gap_mm=1.5)
LENS_X = (np.arange(40) + 0.5) * 0.7 - 14
LENS_Y = 10.5 - (np.arange(30) + 0.5) * 0.7


def test_a_wall_refocused_on_is_its_texture_at_the_lenses():
    step = 2  # sub-image pixels between neighbouring sub-images: whole, so that refocusing interpolates nothing
    z = ODD.gap_mm + step * ODD.gap_mm * ODD.lens_pitch_mm[0] / ODD.pixel_pitch_mm
    scene, colour = noise_wall(z, 2.8)  # four lenses to a feature
    shot = render(scene, ODD, dtype="float32")
    np.testing.assert_allclose(shot.depth, z, rtol=FLOAT32)
    truth = colour(LENS_X, LENS_Y)
    assert truth.std() > 0.1
    sharp = refocus(shot.picture, float(shot.depth[0, 0]))[..., 0]
    inner = (slice(6, -6), slice(6, -6))  # three sub-images of shift 2 on each side do not reach the border
    # float32 moves points of a wall 22 mm off by 1e-6 mm, through a slope below one per mm
    np.testing.assert_allclose(sharp[inner], truth[inner], atol=1e-5)
    for other in (0.5 * z, 0.7 * z, 1.4 * z, 2 * z):
        blurred = refocus(shot.picture, other)[..., 0]
        assert np.abs(blurred - truth)[inner].mean() > 0.05
        assert blurred[inner].std() < 0.8 * truth[inner].std()


@pytest.mark.parametrize("step", [1, 2, 3])
def test_neighbouring_sub_images_move_by_the_disparity(step):
    z = ODD.gap_mm + step * ODD.gap_mm * ODD.lens_pitch_mm[0] / ODD.pixel_pitch_mm
    scene, _ = noise_wall(z, 2.8)
    views = sub_images(render(scene, ODD, dtype="float32").picture)[..., 0]
    # to the right: what SI_u shows at k, SI_{u+1} shows at k + step; and downwards
    np.testing.assert_allclose(views[3, 1:, :, step:], views[3, :-1, :, :-step], atol=1e-5)
    np.testing.assert_allclose(views[1:, 3, step:], views[:-1, 3, :-step], atol=1e-5)
    assert np.abs(views[3, 1:, :, :-step] - views[3, :-1, :, step:]).mean() > 0.1, "not to the left"


def test_a_point_moves_from_elementary_image_to_image_by_the_disparity():
    camera = IICamera(pixels=(5 * 64, 3 * 64), lenses=(5, 3), pixel_pitch_mm=0.02, gap_mm=2.0)
    z, radius = 40.0, 1.2  # 1.2 mm is 3 pixels
    ball = body(sphere(radius, 64), at=(0.4, -0.3, z), colour=WHITE)
    scene = Scene(bodies=[ball], ambient=WHITE)
    eis = elementary_images(render(scene, camera, dtype="float32", samples=64).picture)[..., 0]
    mass = eis.sum(axis=(2, 3))
    assert (mass > 20).all(), "every lens sees it"
    u = (eis.sum(axis=2) @ np.arange(64)) / mass
    v = (eis.sum(axis=3) @ np.arange(64)) / mass
    step = camera.gap_mm * camera.lens_pitch_mm[0] / ((z - camera.gap_mm) * camera.pixel_pitch_mm)
    assert step == pytest.approx(3.37, abs=0.01)
    # 64 samples per pixel of a disc of 3 pixels' radius put its centroid to a few hundredths of a pixel; 16 samples
    # passed by the choice of the seed: with other seeds, 5 of 12 exceeded the tolerance (largest of 18 differences)
    np.testing.assert_allclose(np.diff(u, axis=1), step, atol=0.05)
    np.testing.assert_allclose(np.diff(v, axis=0), step, atol=0.05)
    np.testing.assert_allclose(np.diff(u, axis=0), 0, atol=0.05)
    np.testing.assert_allclose(np.diff(v, axis=1), 0, atol=0.05)
    # and where it lies under the middle lens: at −(x, y)·Λ/(z − Λ), right of and below the axis for x < 0 and y > 0
    scale = camera.gap_mm / (z - camera.gap_mm) / camera.pixel_pitch_mm
    assert u[1, 2] == pytest.approx(31.5 - 0.4 * scale, abs=0.05)
    assert v[1, 2] == pytest.approx(31.5 - 0.3 * scale, abs=0.05)
