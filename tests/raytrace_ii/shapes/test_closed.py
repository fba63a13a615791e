"""Watertightness of meshes, and the warning for open glass."""

import warnings

import numpy as np
import pytest

from raytrace_ii import load_scene
from raytrace_ii.shapes.watertight import flaw
from tests.support.trace_scenes import box, sphere, wall


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
