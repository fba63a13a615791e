"""Invalid scenes: one error that names the field and its value."""

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest

from raytrace_ii import Background, Body, Fog, Light, Material, Scene, load_scene
from raytrace_ii.scene import hashing
from raytrace_ii.scene.hashing import SceneHashes
from raytrace_ii.scene.keyframes import Track, looking_pose
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


# -- content hashes of scenes that follow one another


@pytest.fixture(scope="module")
def scene():
    return load_scene("cuboid")


def moved(scene, number, what="vertices"):
    """The scene with one changed value in an array of one body, the other arrays shared."""
    bodies = list(scene.bodies)
    values = getattr(bodies[number], what).copy()
    values.reshape(-1)[-1] += 1e-9 if values.dtype.kind == "f" else -1
    bodies[number] = replace(bodies[number], **{what: values})
    return replace(scene, bodies=bodies)


def test_the_hash_is_that_of_the_content_whatever_came_before(scene):
    others = [moved(scene, i, what) for i, body in enumerate(scene.bodies) for what in ("vertices", "faces")]
    others.append(replace(scene, ambient=(0.5, 0.5, 0.25)))
    every = [scene, *others]
    alone = [SceneHashes().of(one) for one in every]
    assert len(set(alone)) == len(every)
    hashes = SceneHashes()
    for i in (0, 1, 0, *range(len(every))):
        assert hashes.of(every[i]) == alone[i]
    copied = replace(scene, bodies=[replace(b, vertices=np.array(b.vertices)) for b in scene.bodies])
    assert hashes.of(copied) == alone[0]


def test_shared_arrays_are_hashed_once_and_kept_of_one_scene(scene, monkeypatch):
    sizes, sha256 = [], hashlib.sha256

    def counted(*data):
        sizes.append(sum(np.asarray(one).nbytes for one in data))
        return sha256(*data)

    monkeypatch.setattr(hashing.hashlib, "sha256", counted)
    hashes, later = SceneHashes(), moved(scene, 0)
    hashes.of(scene)
    del sizes[:]
    hashes.of(later)
    assert sum(sizes) == later.bodies[0].vertices.nbytes
    del sizes[:]
    hashes.of(scene)  # memory holds the arrays of the last scene alone: those that moved are hashed again
    assert sum(sizes) == scene.bodies[0].vertices.nbytes


# -- keyframes against closed forms; the pose of a camera that looks at a point


def test_straight_lines_between_keyframes_and_the_ends_beyond_them():
    track = Track([2, 4, 8], [[0.0], [10.0], [-2.0]])
    for frame, value in ((0, 0), (2, 0), (3, 5), (4, 10), (5, 7), (8, -2), (99, -2)):
        assert track.at(frame) == pytest.approx(value)


def test_two_smooth_keyframes_are_smoothstep():
    track = Track([0, 10], [[0.0], [1.0]], "smooth")
    for frame in np.linspace(0, 10, 11):
        s = frame / 10
        assert track.at(frame)[0] == pytest.approx(3 * s**2 - 2 * s**3, abs=1e-12)


def test_a_smooth_track_has_no_kink_at_a_keyframe():
    track = Track([0, 3, 10], [[0.0], [5.0], [6.0]], "smooth")
    before, after = track.at(3) - track.at(3 - 1e-6), track.at(3 + 1e-6) - track.at(3)
    np.testing.assert_allclose(before / 1e-6, 6 / 10, rtol=1e-4)  # the slope between its neighbours
    np.testing.assert_allclose(after / 1e-6, 6 / 10, rtol=1e-4)


def test_steps_hold_until_the_next_keyframe():
    track = Track([0, 5], [[1.0, 2.0], [3.0, 4.0]], "step")
    assert track.at(4.999).tolist() == [1, 2] and track.at(5).tolist() == [3, 4]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (([0, 0], [[1], [2]]), "growing"),
        (([], []), "at least one"),
        (([0, 1], [[1]]), "a value for each"),
        (([0, 1], [[1], [1, 2]]), "all of one length"),
        (([0], [[1]], "cubic"), "linear, smooth, step"),
    ],
)
def test_invalid_tracks_are_refused(arguments, named):
    with pytest.raises(ValueError, match=named):
        Track(*arguments)


def test_a_camera_that_looks_ahead_is_only_moved():
    pose = looking_pose((1, 2, 3), (1, 2, 50))
    np.testing.assert_allclose(pose, [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])


def test_a_looking_camera_is_rigid_level_and_sees_the_point_ahead():
    pose = looking_pose((5, -4, 10), (-20, 9, 90))
    turn = pose[:3, :3]
    np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)
    assert turn[1, 0] == pytest.approx(0) and turn[1, 1] > 0
    seen = turn.T @ (np.array([-20, 9, 90]) - pose[:3, 3])
    np.testing.assert_allclose(seen[:2], 0, atol=1e-12)
    assert seen[2] > 0


def test_roll_turns_x_towards_y():
    pose = looking_pose((0, 0, 0), (0, 0, 1), 90)
    np.testing.assert_allclose(pose[:3, 0], [0, 1, 0], atol=1e-12)


def test_a_camera_cannot_look_straight_up():
    with pytest.raises(ValueError, match="straight above"):
        looking_pose((0, 0, 0), (0, 5, 0))
