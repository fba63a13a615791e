"""Takes: motion in scene files and in glTF files, against known positions."""

import numpy as np
import pytest

from raytrace_ii import load_scene, load_take
from tests.support.gltf_files import SQUARE, SQUARE_FACES, Gltf

BALLS = """
[[light]]
kind = "directional"
direction = [0, -1, 1]

[material.any]

[[object]]
name = "still"
shape = "sphere"
radius_mm = 3
position_mm = [0, 0, 40]
material = "any"

[[object]]
name = "ball a"
shape = "sphere"
radius_mm = 2
material = "any"

[[object]]
name = "ball b"
shape = "sphere"
radius_mm = 2
material = "any"
"""
MOVES = """
[animation]
frames = 11
fps = 10

[[animation.track]]
of = "object.ball *"
key = "position_mm"
frames = [0, 10]
values = [[0, 0, 20], [10, 0, 30]]

[[animation.track]]
of = ["object.ball a"]
key = "scale"
frames = [0, 10]
values = [1, 3]

[[animation.track]]
of = "light.0"
key = "direction"
frames = [0, 5]
values = [[0, -1, 1], [1, -1, 0]]
how = "step"

[[animation.track]]
of = "camera"
key = "position_mm"
frames = [0, 10]
values = [[0, 0, 0], [0, 4, 0]]
"""


def take_of(folder, text, **options):
    path = folder / "moving.toml"
    path.write_text(text, encoding="utf-8")
    return load_take(path, **options)


def body(scene, name):
    (found,) = [b for b in scene.bodies if b.name == name]
    return found


def middle(body):
    return (body.vertices.min(axis=0) + body.vertices.max(axis=0)) / 2


def test_keys_move_by_their_tracks(tmp_path):
    take = take_of(tmp_path, BALLS + MOVES)
    assert (take.frames, take.fps, take.seconds) == (11, 10, 1.1)
    scene = take.scene_at(0.5)
    for name, size in (("ball a", 2), ("ball b", 1)):
        ball = body(scene, name)
        np.testing.assert_allclose(middle(ball), [5, 0, 25], atol=1e-9)
        assert np.ptp(ball.vertices[:, 1]) == pytest.approx(4 * size, rel=1e-2)  # a polyhedron within the ball
    assert scene.lights[0].vector == (1, -1, 0) and take.scene_at(0.499).lights[0].vector == (0, -1, 1)
    np.testing.assert_allclose(take.pose_at(0.25)[:3, 3], [0, 1, 0])


def test_a_still_scene_has_the_values_of_its_tables(tmp_path):
    take_of(tmp_path, BALLS + MOVES)
    assert middle(body(load_scene(tmp_path / "moving.toml"), "ball a")).tolist() == pytest.approx([0, 0, 0])


def test_what_does_not_move_is_the_same_object(tmp_path):
    take = take_of(tmp_path, BALLS + MOVES)
    first, later = take.scene_at(0.0), take.scene_at(0.3)
    assert body(first, "still") is body(later, "still") and body(first, "ball a") is not body(later, "ball a")
    assert body(first, "ball a").faces is body(later, "ball a").faces, "the shape is made once"
    camera = BALLS + "\n[animation]\nframes = 3\n[[animation.track]]" + MOVES.rpartition("[[animation.track]]")[2]
    take = take_of(tmp_path, camera)
    assert take.scene_at(0.0) is take.scene_at(0.1), "the tree of a still scene is kept"


def test_a_camera_looks_at_a_moving_point(tmp_path):
    text = (
        BALLS
        + """
[animation]
frames = 3
[[animation.track]]
of = "camera"
key = "look_at_mm"
frames = [0, 2]
values = [[-10, 0, 40], [10, 0, 40]]
"""
    )
    take = take_of(tmp_path, text, fps=1)
    for second, x in ((0, -10), (1, 0), (2, 10)):
        ahead = take.pose_at(second)[:3, 2]
        np.testing.assert_allclose(ahead, np.array([x, 0, 40]) / np.hypot(x, 40), atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("object.ball *", "object.bal", "no object has this name, known are still, ball a, ball b"),
        ("light.0", "light.3", "the file has 1 lights"),
        ('of = "camera"', 'of = "sky"', "known are scene, background"),
        ('of = "camera"', 'of = "fog"', r"no \[fog\]"),
        ('key = "scale"', 'key = "sclae"', "sclae"),
        ("values = [1, 3]", "values = [1, -3]", "frame 5: object.1.scale"),
        ("values = [1, 3]", "values = [1]", "a value for each"),
        (
            'key = "scale"\nframes = [0, 10]\nvalues = [1, 3]',
            'key = "radius_mm"\nframes = [0, 8]\nvalues = [1, -3]',
            r"frame 5: object.1 \(ball a\): radius_mm",
        ),
        ('of = ["object.ball a"]\nkey = "scale"', 'of = ["object.ball a"]\nkey = "position_mm"', "by another track"),
        ("values = [[0, 0, 0], [0, 4, 0]]", "values = [0, 1]", "3 numbers"),
        ("frames = 11", "frames = 0", "frames: 0"),
        ("frames = 11", "frames = 11\nshutter = 1", "shutter: no such key: known are frames, fps, track"),
        ('how = "step"', 'how = "jump"', "unknown 'jump': known are"),
    ],
)
def test_faults_are_named_before_rendering(tmp_path, old, new, named):
    text = BALLS + MOVES
    assert old in text
    with pytest.raises(ValueError, match=named) as caught:
        take_of(tmp_path, text.replace(old, new))
    assert "moving.toml" in str(caught.value)


def test_a_scene_without_animation_does_not_move(tmp_path):
    with pytest.raises(ValueError, match="does not move"):
        take_of(tmp_path, BALLS)
    with pytest.raises(ValueError, match="from 0 to"):
        take_of(tmp_path, BALLS + MOVES).scene_at(-1)


# glTF


def arm(gltf, **skin):
    """A strip of two squares whose outer end follows a joint at its middle, as the joint turns about z by 90°."""
    strip = [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]]
    joints = np.array([[0, 0, 0, 0]] * 4 + [[1, 0, 0, 0]] * 2, np.uint8)
    weights = np.array([[1, 0, 0, 0]] * 6, np.float32)
    faces = [[0, 2, 1], [2, 3, 1], [2, 4, 3], [4, 5, 3]]
    mesh = gltf.mesh(strip, faces, JOINTS_0=joints, WEIGHTS_0=weights, NORMAL=np.tile([0, 0, 1.0], (6, 1)))
    elbow = gltf.node(root=False, translation=[1, 0, 0], name="elbow")
    root = gltf.node(children=[elbow], name="shoulder")
    back = np.eye(4)
    back[3, 0] = -1  # column by column: moved by −1 along x
    inverse = gltf.accessor(np.stack([np.eye(4).ravel(), back.ravel()]).astype(np.float32))
    gltf.add("skins", {"joints": [root, elbow], "inverseBindMatrices": inverse, **skin})
    gltf.node(mesh=mesh, skin=0, translation=[100, 0, 0], name="arm")  # which a skin makes meaningless
    return elbow


def accessor(gltf, values):
    return gltf.accessor(np.asarray(values, np.float32))


def clip(gltf, name, node, path, times, values, **sampler):
    samplers = [{"input": accessor(gltf, times), "output": accessor(gltf, values), **sampler}]
    channels = [{"sampler": 0, "target": {"node": node, "path": path}}]
    gltf.add("animations", {"name": name, "channels": channels, "samplers": samplers})


@pytest.fixture
def flexed(tmp_path):
    gltf = Gltf()
    elbow = arm(gltf)
    half = np.sqrt(0.5)
    clip(gltf, "Flex", elbow, "rotation", [0, 1], [[0, 0, 0, 1], [0, 0, half, half]])
    clip(gltf, "Jump", elbow, "translation", [0, 2], [[1, 0, 0], [1, 4, 0]], interpolation="STEP")
    gltf.save(tmp_path / "arm.glb")
    return tmp_path


def vertices(folder, seconds, name="Flex"):
    text = f'[[object]]\nmesh = "arm.glb"\nclip = "{name}"\nclip_s = {seconds}'
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    (shown,) = load_scene(folder / "scene.toml").bodies
    return shown.vertices, shown


def test_a_skin_follows_its_joints(flexed):
    rest, shown = vertices(flexed, 0.0)
    np.testing.assert_allclose(rest, [[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]], atol=1e-7)
    np.testing.assert_allclose(shown.normals, np.tile([0, 0, -1], (6, 1)), atol=1e-7)  # z → −z
    for seconds, degrees in ((1.0, 90), (0.5, 45), (1.5, 45)):  # a clip is repeated
        bent, _ = vertices(flexed, seconds)
        np.testing.assert_allclose(bent[:4], rest[:4], atol=1e-7)
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        np.testing.assert_allclose(bent[4:], [[1 + c, s, 0], [1 + c - s, s + c, 0]], atol=1e-6)


@pytest.mark.parametrize("kind", ["int8", "int16"])
def test_rounded_quaternions_turn_at_constant_speed(kind, tmp_path):
    """Keys of 8 bits are up to 1 % from unit length: without scaling, the turn was off by 0.47°."""
    gltf = Gltf()
    elbow = arm(gltf)
    most = np.iinfo(kind).max
    half = np.radians(80) / 2
    exact = np.array([[0, 0, 0, 1], [0, 0, np.sin(half), np.cos(half)]])
    short = np.round(exact * [[0.6 * most], [most]]).astype(kind)  # unequal lengths show the fault at any rounding
    times = accessor(gltf, [0, 1])
    samplers = [{"input": times, "output": gltf.accessor(short, normalized=True)}]
    channels = [{"sampler": 0, "target": {"node": elbow, "path": "rotation"}}]
    gltf.add("animations", {"name": "Flex", "channels": channels, "samplers": samplers})
    gltf.save(tmp_path / "arm.glb")
    whole = 2 * np.arctan2(*short[1, 2:].astype(float))  # of the rounded key
    for share in (0.25, 0.5, 0.75):
        bent, _ = vertices(tmp_path, share)
        x, y = bent[4, :2] - [1, 0]
        assert np.arctan2(y, x) == pytest.approx(share * whole, abs=1e-6)


def test_a_key_of_length_0_is_no_rotation(tmp_path):
    gltf = Gltf()
    clip(gltf, "Flex", arm(gltf), "rotation", [0, 1], [[0, 0, 0, 1], [0, 0, 0, 0]])
    gltf.save(tmp_path / "arm.glb")
    with pytest.raises(ValueError, match="output: a quaternion of length 0"):
        vertices(tmp_path, 0.5)


def test_stepped_keys_hold(flexed):
    low, _ = vertices(flexed, 1.99, "Jump")
    high, _ = vertices(flexed, 2.0, "Jump")
    assert low[4].tolist() == pytest.approx([2, 0, 0]) and high[4].tolist() == pytest.approx([2, 4, 0])


def test_a_clip_runs_in_a_take(flexed):
    text = '[[object]]\nmesh = "arm.glb"\nclip = "Flex"\nclip_speed = 2\n[animation]\nframes = 5\nfps = 10\n'
    (flexed / "scene.toml").write_text(text, encoding="utf-8")
    take = load_take(flexed / "scene.toml")
    expected, _ = vertices(flexed, 0.6)
    (flexed / "scene.toml").write_text(text, encoding="utf-8")
    (shown,) = take.scene_at(0.3).bodies
    np.testing.assert_allclose(shown.vertices, expected)


def test_a_gltf_file_alone_is_a_take_in_the_same_place(flexed):
    take = load_take(flexed / "arm.glb", clip="Flex", fps=8)
    assert (take.frames, take.fps) == (8, 8)
    first, last = (take.scene_at(t).bodies[0].vertices for t in (0.0, 1.0))
    np.testing.assert_allclose(first[:4], last[:4])
    assert np.abs(first[4] - last[4]).max() > 1


@pytest.mark.parametrize("interpolation", ["LINEAR", "CUBICSPLINE"])
def test_morph_targets_are_added_by_their_weights(tmp_path, interpolation):
    gltf = Gltf()
    mesh = gltf.mesh(SQUARE, SQUARE_FACES)
    primitive = gltf.json["meshes"][mesh]["primitives"][0]
    primitive["targets"] = [{"POSITION": accessor(gltf, [[0, 0, k] for k in range(4)])}]
    node = gltf.node(mesh=mesh)
    weights = [[0.0], [1.0]] if interpolation == "LINEAR" else [[0.0]] * 2 + [[0.0]] * 2 + [[1.0]] + [[0.0]]
    clip(gltf, "", node, "weights", [0, 1], weights, interpolation=interpolation)
    gltf.save(tmp_path / "arm.glb")
    still, _ = vertices(tmp_path, 0.0, "clip 0")
    moved, _ = vertices(tmp_path, 0.25, "clip 0")
    share = 0.25 if interpolation == "LINEAR" else 3 * 0.25**2 - 2 * 0.25**3  # at rest at both ends
    np.testing.assert_allclose(moved - still, [[0, 0, -k * share] for k in range(4)], atol=1e-7)


def test_faults_of_a_clip_are_named(flexed):
    with pytest.raises(ValueError, match=r"arm.glb: unknown clip 'Run': known are Flex, Jump"):
        vertices(flexed, 0, "Run")
    with pytest.raises(ValueError, match="unknown clip 'Run'"):
        load_take(flexed / "arm.glb", clip="Run")
    (flexed / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    with pytest.raises(ValueError, match="does not move"):
        load_take(flexed / "a.obj")


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"joints": [0, 9]}, "joint nodes.9 is not in the scene"),
        ({"joints": [0]}, "joint 1 is named, the skin has 1"),
        ({"inverseBindMatrices": 0}, "2 matrices are needed"),
    ],
)
def test_damaged_skins_are_refused(tmp_path, change, named):
    gltf = Gltf()
    arm(gltf, **change)
    path = gltf.save(tmp_path / "arm.glb")
    with pytest.raises(ValueError, match=named):
        load_scene(path)


def test_damaged_keyframes_are_refused(tmp_path):
    for times, values, named in (
        ([1, 0], [[0, 0, 0]] * 2, "times that grow"),
        ([0, 1], [[0, 0, 0]] * 3, "2 of 3 are needed"),
        ([0, 1], [[0, 0]] * 3, "2 of 3 are needed"),
    ):
        gltf = Gltf()
        node = gltf.node(mesh=gltf.mesh(SQUARE, SQUARE_FACES))
        clip(gltf, "Go", node, "translation", times, values)
        gltf.save(tmp_path / "arm.glb")
        with pytest.raises(ValueError, match=named):
            vertices(tmp_path, 0, "Go")


def test_tables_nested_too_deeply(tmp_path):
    """For still scenes this was an error of one line; a take ended in a RecursionError."""
    (tmp_path / "deep.toml").write_text(f"{BALLS}{MOVES}x = {'[' * 5000}\n")
    with pytest.raises(ValueError, match="nested too deeply"):
        load_take(tmp_path / "deep.toml")


def test_a_body_that_only_changes_its_place_keeps_its_normals(tmp_path):
    """Its normals are hashed once and turned once; ball a changes its size too, and gets new ones."""
    text = BALLS + MOVES.replace("[1, 3]", "[[1, 1, 1], [1, 2, 3]]")
    take = take_of(tmp_path, text)
    early, late = take.scene_at(0.1), take.scene_at(0.7)
    a, b = ((body(early, name), body(late, name)) for name in ("ball a", "ball b"))
    assert b[0].normals is b[1].normals and a[0].normals is not a[1].normals
    again = take_of(tmp_path, text).scene_at(0.7)
    for moved, alone in zip(late.bodies, again.bodies, strict=True):
        np.testing.assert_array_equal(moved.vertices, alone.vertices)
        np.testing.assert_array_equal(moved.normals, alone.normals)
