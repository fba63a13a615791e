"""Primitive shapes: watertight, outward, of the right size, textures unmirrored."""

import math
import warnings

import numpy as np
import pytest
import trimesh

from raytrace_ii import load_scene
from raytrace_ii.shapes.primitives import (
    Box,
    BoxGrid,
    Cylinder,
    Plane,
    Revolve,
    Sphere,
    boxes,
    rotation,
    smooth_curve,
)
from raytrace_ii.shapes.watertight import flaw
from tests.support.trace_scenes import box, sphere, wall

VASE = [(0, 0), (3, 0), (2, 4), (4, 7), (0, 9)]
SHAPES = {
    "sphere": Sphere(shape="sphere", radius_mm=3, segments=48),
    "coarse sphere": Sphere(shape="sphere", radius_mm=3, segments=3),
    "odd sphere": Sphere(shape="sphere", radius_mm=3, segments=7),
    "box": Box(shape="box", size_mm=(2, 3, 5)),
    "cylinder": Cylinder(shape="cylinder", radius_mm=2, height_mm=5, segments=48),
    "frustum": Cylinder(shape="cylinder", radius_mm=2, top_mm=1, height_mm=5, segments=48),
    "cone": Cylinder(shape="cylinder", radius_mm=2, top_mm=0, height_mm=5, segments=48),
    "revolve": Revolve(shape="revolve", profile_mm=VASE, segments=48),
    "lobed": Revolve(shape="revolve", profile_mm=VASE, lobes=5, lobe_depth=0.3, sideways_mm=(2, -1), segments=60),
    "grid": BoxGrid(shape="box_grid", count=(3, 2, 4), spacing_mm=(3, 3, 3), box_mm=2, jitter=0.5, grow=0.1, tiles=3),
}
CLOSED = [name for name in SHAPES if name != "grid"]


def merged(mesh):
    """Return the mesh with merged seams, right-handed as trimesh needs it."""
    flipped = trimesh.Trimesh(mesh.vertices * [1, 1, -1], mesh.faces[:, ::-1], process=False)
    flipped.merge_vertices(merge_norm=True, merge_tex=True)
    return flipped


def corners(mesh):
    return mesh.vertices[mesh.faces]


def face_normals(mesh):
    p = corners(mesh)
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


@pytest.mark.parametrize("name", SHAPES)
def test_meshes_are_closed_and_outward(name):
    mesh = SHAPES[name].mesh()
    sewn = merged(mesh)
    assert sewn.is_watertight and sewn.is_winding_consistent
    # in our left-handed frame (v1 − v0) × (v2 − v0) points out: the signed volume is positive
    p = corners(mesh)
    volume = np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6
    assert volume > 0
    assert sewn.volume == pytest.approx(volume)
    assert (np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) > 0).all(), "no face without area"


def prism(segments):
    """Area of a regular polygon in a circle of radius 1."""
    return segments / 2 * math.sin(2 * math.pi / segments)


@pytest.mark.parametrize(
    ("name", "volume"),
    [
        ("box", 2 * 3 * 5),
        ("cylinder", prism(48) * 2**2 * 5),
        ("frustum", prism(48) * (2**2 + 2 * 1 + 1) * 5 / 3),
        ("cone", prism(48) * 2**2 * 5 / 3),
    ],
)
def test_volumes_of_polyhedra_are_exact(name, volume):
    assert merged(SHAPES[name].mesh()).volume == pytest.approx(volume, rel=1e-12)


def test_a_sphere_s_volume_approaches_the_closed_form_from_below():
    errors = []
    for segments in (12, 24, 48, 96):
        mesh = Sphere(shape="sphere", radius_mm=3, segments=segments).mesh()
        np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 3, rtol=1e-12)
        errors.append(1 - merged(mesh).volume / (4 / 3 * math.pi * 27))
    # every part lies within the sagitta: between 0 and 3·(1 − cos(√2 π/n)), and a quarter with every doubling
    assert 0 < errors[-1] < 3 * (1 - math.cos(math.sqrt(2) * math.pi / 96))
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4, rtol=0.1)


def test_a_body_of_revolution_has_the_volume_of_its_frustums():
    """Guldin by pieces: the profile's polyline turned, as polygons."""
    r, y = smooth_curve(np.array(VASE, float), 64).T
    r = np.maximum(r, 0)
    frustums = (y[1:] - y[:-1]) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2) / 3
    mesh = SHAPES["revolve"].mesh()
    assert merged(mesh).volume == pytest.approx(prism(48) * frustums.sum(), rel=1e-9)


@pytest.mark.parametrize("name", SHAPES)
def test_texture_coordinates_fill_their_square(name):
    uv = SHAPES[name].mesh().uv
    assert uv.min() == pytest.approx(0, abs=1e-12) and uv.max() == pytest.approx(1, abs=1e-12)
    assert (uv >= 0).all() and (uv <= 1 + 1e-12).all()


@pytest.mark.parametrize("name", [name for name, shape in SHAPES.items() if not isinstance(shape, Box | BoxGrid)])
def test_vertex_normals_are_unit_and_outward(name):
    mesh = SHAPES[name].mesh()
    used = np.unique(mesh.faces)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals[used], axis=1), 1, rtol=1e-12)
    facing = np.einsum("fcj,fj->fc", mesh.normals[mesh.faces], face_normals(mesh))
    # A vertex normal is the mean of its faces' or the true surface's: on the coarsest sphere, of three segments,
    # they lean by up to a right angle; elsewhere by little. The apex of a cone has its slope's normal for each.
    assert facing.min() > (0 if "coarse" in name else 0.3)


def test_normals_of_sphere_cylinder_and_cone_are_the_surfaces_own():
    mesh = SHAPES["sphere"].mesh()
    np.testing.assert_allclose(mesh.normals, mesh.vertices / 3, atol=1e-12)
    for name, slope in (("cylinder", 0.0), ("frustum", 1 / 5), ("cone", 2 / 5)):
        mesh = SHAPES[name].mesh()
        side = np.abs(mesh.normals[:, 1]) < 0.9
        assert side.sum() == 2 * 49
        around = mesh.normals[side]
        np.testing.assert_allclose(around[:, 1], slope / math.hypot(1, slope), atol=1e-12)
        base = side & (mesh.vertices[:, 1] == 0)
        out = mesh.vertices[base][:, [0, 2]] / 2
        np.testing.assert_allclose(mesh.normals[base][:, [0, 2]] * math.hypot(1, slope), out, atol=1e-12)
        for y, down in ((0.0, -1), (5.0, 1)):
            cap = ~side & (mesh.vertices[:, 1] == y)
            if name != "cone" or y == 0:
                np.testing.assert_allclose(
                    mesh.normals[cap], np.broadcast_to([0, down, 0], (cap.sum(), 3)), atol=1e-12
                )


def test_flat_shapes_have_no_vertex_normals():
    for shape in (SHAPES["box"], SHAPES["grid"], Plane(shape="plane", size_mm=(1, 2))):
        assert shape.mesh().normals is None


def test_a_plane_lies_in_y_0_and_faces_up():
    mesh = Plane(shape="plane", size_mm=(4, 10)).mesh()
    np.testing.assert_array_equal(np.ptp(mesh.vertices, axis=0), [4, 0, 10])
    np.testing.assert_allclose(face_normals(mesh), [[0, 1, 0]] * 2)
    # for a viewer who stands on it and looks along z: u to the right, v away
    np.testing.assert_allclose(mesh.uv, mesh.vertices[:, [0, 2]] / [4, 10] + 0.5)


def texture_axes(mesh):
    """∂P/∂u and ∂P/∂v of every face."""
    p, uv = corners(mesh), mesh.uv[mesh.faces]
    edges = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=2)
    steps = np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=2)
    solved = edges @ np.linalg.inv(steps)
    return solved[:, :, 0], solved[:, :, 1]


@pytest.mark.parametrize("name", ["box", "grid"])
def test_no_side_of_a_box_shows_its_texture_mirrored(name):
    """From outside the eye looks along −n; in a left-handed frame right × up = ahead, so up × ahead = right."""
    mesh = SHAPES[name].mesh()
    u, v = texture_axes(mesh)
    size = np.linalg.norm(u, axis=1, keepdims=True), np.linalg.norm(v, axis=1, keepdims=True)
    np.testing.assert_allclose(np.cross(v / size[1], -face_normals(mesh)), u / size[0], atol=1e-12)
    if name == "box":
        standing = np.abs(face_normals(mesh)[:, 1]) < 0.5
        np.testing.assert_allclose(v[standing] / size[1][standing], [[0, 1, 0]] * standing.sum(), atol=1e-12)


@pytest.mark.parametrize("name", ["sphere", "cylinder", "revolve"])
def test_textures_go_round_a_body_unmirrored(name):
    """The sign of the same rule, where a side stands upright: (v × −n)·u > 0."""
    mesh = SHAPES[name].mesh()
    uv = mesh.uv[mesh.faces]
    normal = face_normals(mesh)
    area = np.linalg.det(np.stack([uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=1))
    sides = (np.abs(normal[:, 1]) < 0.7) & (np.abs(area) > 1e-9)
    assert sides.sum() > 50
    part = type(mesh)(mesh.vertices, mesh.faces[sides], None, mesh.uv)
    u, v = texture_axes(part)
    assert (np.einsum("ij,ij->i", np.cross(v, -normal[sides]), u) > 0).all()
    assert (v[:, 1] > 0).all(), "v runs up"


def test_rotation_turns_each_axis_towards_the_next():
    np.testing.assert_allclose(rotation((0, 0, 90)) @ [1, 0, 0], [0, 1, 0], atol=1e-15)  # z: x towards y
    np.testing.assert_allclose(rotation((90, 0, 0)) @ [0, 1, 0], [0, 0, 1], atol=1e-15)  # x: y towards z
    np.testing.assert_allclose(rotation((0, 90, 0)) @ [0, 0, 1], [1, 0, 0], atol=1e-15)  # y: z towards x
    # first x, then y, then z
    np.testing.assert_allclose(
        rotation((20, 30, 40)), rotation((0, 0, 40)) @ rotation((0, 30, 0)) @ rotation((20, 0, 0)), atol=1e-15
    )
    matrix = rotation((12, -77, 161))
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(matrix) == pytest.approx(1)


def test_a_grid_holds_its_boxes():
    grid = BoxGrid(shape="box_grid", count=(4, 3, 2), spacing_mm=(5, 6, 7), box_mm=2)
    mesh = grid.mesh()
    assert len(mesh.faces) == 4 * 3 * 2 * 12
    centres = mesh.vertices.reshape(-1, 24, 3).mean(axis=1)
    for axis, (count, spacing) in enumerate(zip((4, 3, 2), (5, 6, 7), strict=True)):
        expected = (np.arange(count) - (count - 1) / 2) * spacing
        np.testing.assert_allclose(np.unique(np.round(centres[:, axis], 9)), expected, atol=1e-9)
    parts = merged(mesh).split()
    assert len(parts) == 24
    np.testing.assert_allclose([part.volume for part in parts], 8)
    # rows further back stand wider apart
    wide = BoxGrid(shape="box_grid", count=(2, 1, 3), spacing_mm=(5, 5, 5), box_mm=1, grow=0.5).mesh()
    centres = wide.vertices.reshape(-1, 24, 3).mean(axis=1)
    for z, half in ((-5, 2.5), (0, 3.75), (5, 5.0)):
        np.testing.assert_allclose(np.sort(centres[np.isclose(centres[:, 2], z), 0]), [-half, half])


def test_a_grid_is_decided_by_its_seed():
    def mesh(seed):
        return BoxGrid(
            shape="box_grid", count=(3, 3, 3), spacing_mm=(3, 3, 3), box_mm=1, jitter=1, tiles=4, seed=seed
        ).mesh()

    a, b, c = mesh(1), mesh(1), mesh(2)
    np.testing.assert_array_equal(a.vertices, b.vertices)
    np.testing.assert_array_equal(a.uv, b.uv)
    assert (a.vertices != c.vertices).any() and (a.uv != c.uv).any()
    # jitter turns and shifts boxes but leaves their size
    np.testing.assert_allclose([part.volume for part in merged(a).split()], 1)


def test_each_side_of_a_grids_box_shows_one_whole_tile():
    mesh = BoxGrid(shape="box_grid", count=(5, 5, 1), spacing_mm=(3, 3, 3), box_mm=1, tiles=3).mesh()
    tiles = mesh.uv.reshape(-1, 4, 2) * 3
    low = tiles.min(axis=1)
    np.testing.assert_allclose(tiles.max(axis=1) - low, 1)
    np.testing.assert_allclose(low, np.round(low), atol=1e-12)
    assert len(np.unique(np.round(low), axis=0)) == 9


def test_smooth_curves_pass_through_their_points():
    points = np.array([(0, 0), (3, 1), (2, 4), (5, 5)], float)
    curve = smooth_curve(points, 30)
    assert curve.shape == (31, 2)
    np.testing.assert_allclose(curve[::10], points, atol=1e-12)
    line = smooth_curve(np.array([(1, 0), (2, 2), (3, 4)], float), 7)
    np.testing.assert_allclose(line[:, 1], 2 * (line[:, 0] - 1), atol=1e-12)


def test_turned_boxes_stand_where_they_are_put():
    mesh = boxes(np.array([[1.0, 2, 3]]), np.array([[2.0, 4, 6]]), rotation((0, 0, 90))[None])
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [-1, 1, 0], atol=1e-12)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [3, 3, 6], atol=1e-12)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Sphere(shape="sphere", radius_mm=0),
        lambda: Sphere(shape="sphere", radius_mm=-1),
        lambda: Sphere(shape="sphere", radius_mm=math.nan),
        lambda: Sphere(shape="sphere", radius_mm=math.inf),
        lambda: Sphere(shape="sphere", radius_mm=1, segments=2),
        lambda: Box(shape="box", size_mm=(1, 0, 1)),
        lambda: Plane(shape="plane", size_mm=(1, -1)),
        lambda: Cylinder(shape="cylinder", radius_mm=1, height_mm=0),
        lambda: Cylinder(shape="cylinder", radius_mm=1, height_mm=1, top_mm=-1),
        lambda: Revolve(shape="revolve", profile_mm=[(0, 0)]),
        lambda: Revolve(shape="revolve", profile_mm=[(0, 0), (math.nan, 1)]),
        lambda: BoxGrid(shape="box_grid", count=(0, 1, 1), spacing_mm=(1, 1, 1), box_mm=1),
        lambda: Box(shape="box", size_mm=(1, 1, 1), colour="red"),
    ],
)
def test_parameters_out_of_range_are_refused(wrong):
    with pytest.raises(ValueError):
        wrong()


# -- watertightness of meshes, and the warning for open glass


def pieces(mesh):
    """Every face with corners of its own, as STL files have them."""
    return mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3)


@pytest.mark.parametrize("mesh", [sphere(segments=24), box(1, 2, 3)], ids=["ball", "box"])
@pytest.mark.parametrize("at", [(0, 0, 0), (30, -20, 1e4)])
def test_shapes_are_closed_whatever_the_numbers_of_their_corners(mesh, at):
    assert flaw(mesh.vertices + at, mesh.faces) is None
    soup, faces = pieces(mesh)
    assert flaw(soup + at, faces) is None
    single = (soup + at).astype(np.float32)  # as a file of single precision holds it, each corner rounded its own way
    up = np.random.default_rng(0).random(single.shape) < 0.5
    assert flaw(np.where(up, np.nextafter(single, np.float32(np.inf)), single), faces) is None


def test_open_turned_and_inside_out_meshes_are_reported():
    ball = sphere(segments=24)
    assert flaw(wall(10).vertices, wall(10).faces).startswith("4 of its edges are open")
    assert flaw(ball.vertices, ball.faces[1:]).startswith("3 of its edges")
    turned = np.concatenate([ball.faces[:1, ::-1], ball.faces[1:]])
    assert flaw(ball.vertices, turned).startswith("3 of its edges")
    assert flaw(ball.vertices, ball.faces[:, ::-1]) == "its faces look inwards"
    assert flaw(ball.vertices, np.repeat(ball.faces, 2, axis=0)) is None, "doubled faces do no harm"


def test_a_shell_and_boxes_that_touch_are_closed():
    ball, cube = sphere(segments=24), box(1, 1, 1)
    shell = np.concatenate([ball.vertices, 0.8 * ball.vertices])
    assert flaw(shell, np.concatenate([ball.faces, ball.faces[:, ::-1] + len(ball.vertices)])) is None
    pair = np.concatenate([cube.vertices, cube.vertices + np.array([1, 1, 0])])  # along one edge, of four faces
    assert flaw(pair, np.concatenate([cube.faces, cube.faces + len(cube.vertices)])) is None


def test_faces_without_area_are_no_faces():
    cube = box(1, 1, 1)
    assert flaw(cube.vertices, np.concatenate([cube.faces, [[0, 0, 1], [2, 2, 2]]])) is None


SHEET = """
[material.glass]
transmission = 0.9
{}
[[object]]
name = "pane"
shape = "plane"
position_mm = [0, 0, 30]
size_mm = [9, 9]
material = "glass"
[[object]]
shape = "plane"
size_mm = [2, 2]
material = "glass"
[[object]]
shape = "sphere"
radius_mm = 3
material = "glass"
"""


def test_glass_without_an_inside_is_named_in_one_warning(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SHEET.format(""), encoding="utf-8")
    with pytest.warns(UserWarning) as caught:
        load_scene(path)
    (warning,) = caught
    assert str(warning.message).startswith(f"{path}: glass without an inside: 'pane' (4 of its edges are open")
    assert "'plane 1'" in str(warning.message) and "sphere" not in str(warning.message)
    assert warning.filename == __file__


@pytest.mark.parametrize("sheet", ["ior = 1", "ior = [1, 1, 1]"])
def test_a_sheet_that_neither_bends_nor_absorbs_needs_no_inside(tmp_path, sheet):
    path = tmp_path / "scene.toml"
    path.write_text(SHEET.format(sheet), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_scene(path)
    path.write_text(SHEET.format(sheet + "\nabsorption_per_mm = [0.1, 0, 0]"), encoding="utf-8")
    with pytest.warns(UserWarning, match="without an inside"):
        load_scene(path)


def test_the_reference_scenes_glass_is_closed():
    bodies = [body for body in load_scene("objects").bodies if body.material.fills]
    assert [flaw(body.vertices, body.faces) for body in bodies] == [None, None]
