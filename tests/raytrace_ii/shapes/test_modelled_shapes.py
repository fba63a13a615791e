"""Implicit bodies, terrain and strands: watertightness, size, colours."""

import math

import numpy as np
import pytest
from pydantic import TypeAdapter

from raytrace_ii import load_scene
from raytrace_ii.files.toml_schema import AnyShape
from raytrace_ii.tracing.kernels.noise import terrain
from tests.raytrace_ii.shapes.test_shapes import corners, face_normals, merged

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def shape(**parameters):
    return TypeAdapter(AnyShape).validate_python(parameters)


def implicit(*parts, cell=0.25, **more):
    return shape(shape="implicit", parts=list(parts), cell_mm=cell, **more)


def ball(radius, at=(0, 0, 0), **more):
    return {"part": "ball", "radii_mm": (radius,) * 3, "at_mm": at, **more}


def volume(mesh):
    p = corners(mesh)
    return np.einsum("ij,ij->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6


BODIES = {
    "ball": implicit(ball(3)),
    "egg": implicit({"part": "ball", "radii_mm": (3, 2, 4), "rotate_deg": (20, 30, 40)}),
    "block": implicit({"part": "block", "size_mm": (3, 4, 5), "round_mm": 0.8, "rotate_deg": (0, 25, 0)}),
    "capsule": implicit({"part": "capsule", "at_mm": (0, 0, 0), "to_mm": (3, 4, 0), "radius_mm": 1}),
    "tube": implicit(
        {"part": "tube", "points_mm": [(0, 0, 0, 1), (4, 2, 0, 1.5), (8, 0, 3, 0.8)]}, ball(1, (2, 4, 0), blend_mm=1)
    ),
    "dumb-bell": implicit(ball(2, (3, 0, 0), mirrored=True), {
        "part": "capsule", "at_mm": (-3, 0, 0), "to_mm": (3, 0, 0), "radius_mm": 0.8, "blend_mm": 1,
    }),
    "bitten": implicit(ball(3), ball(2, (3, 0, 0), op="cut", blend_mm=0.5)),
}  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_implicit_bodies_are_closed_outward_and_smooth(name):
    mesh = BODIES[name].mesh()
    sewn = merged(mesh)
    assert sewn.is_watertight and sewn.is_winding_consistent
    assert volume(mesh) > 0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=1e-9)
    size = np.linalg.norm(np.cross(*(corners(mesh)[:, i] - corners(mesh)[:, 0] for i in (1, 2))), axis=1)
    assert (size > 0).all(), "no face without area"
    # slivers apart, whose own normals are rounding noise
    facing = np.einsum("fj,fj->f", mesh.normals[mesh.faces].mean(axis=1), face_normals(mesh))[size > 1e-4]
    assert facing.min() > 0.5


def test_a_ball_approaches_the_sphere_with_the_square_of_the_cell():
    errors = []
    for cell in (0.6, 0.3, 0.15):
        mesh = implicit(ball(3), cell=cell).mesh()
        off = np.abs(np.linalg.norm(mesh.vertices, axis=1) - 3)
        assert off.max() < cell**2 / 8 / 3 * 1.5  # the sagitta of a cell's edge on the sphere
        radial = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
        assert np.einsum("ij,ij->i", mesh.normals, radial).min() > 0.999
        errors.append(abs(volume(mesh) / (4 / 3 * math.pi * 27) - 1))
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4, rtol=0.25)


def test_parts_join_cut_and_keep_in_closed_form():
    one = 4 / 3 * math.pi * 27
    lens = math.pi * (4 * 3 + 2) * (2 * 3 - 2) ** 2 / 12  # of two spheres of radius 3 whose middles are 2 apart
    second = {"at": (2, 0, 0)}
    for op, expected in (("add", 2 * one - lens), ("cut", one - lens), ("keep", lens)):
        mesh = implicit(ball(3), ball(3, **second, op=op), cell=0.12).mesh()
        assert volume(mesh) == pytest.approx(expected, rel=0.01), op
    apart = implicit(ball(2, (4, 0, 0), mirrored=True)).mesh()
    assert len(merged(apart).split()) == 2
    assert volume(apart) == pytest.approx(2 * 4 / 3 * math.pi * 8, rel=0.02)
    np.testing.assert_allclose(np.sort(apart.vertices[:, 0]), -np.sort(apart.vertices[:, 0])[::-1], atol=0.05)


def test_a_blend_only_adds_where_parts_meet():
    hard, soft = (implicit(ball(2), ball(2, (3, 0, 0), blend_mm=blend)).mesh() for blend in (0.0, 1.5))
    assert volume(soft) > volume(hard) * 1.01
    # far from the joint both are the same
    ends = [mesh.vertices[mesh.vertices[:, 0] < -1.2] for mesh in (hard, soft)]
    for end in ends:
        np.testing.assert_allclose(np.linalg.norm(end, axis=1), 2, atol=0.01)


def test_a_grown_body_is_larger_all_round():
    mesh = implicit(ball(2), grow_mm=0.5, cell=0.2).mesh()
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 2.5, atol=0.02)


def test_a_straight_tube_is_a_capsule_and_a_bent_one_keeps_its_radius():
    straight = implicit({"part": "tube", "points_mm": [(0, 0, 0, 1), (3, 0, 0, 1), (6, 0, 0, 1)]}, cell=0.15).mesh()
    assert volume(straight) == pytest.approx(math.pi * 6 + 4 / 3 * math.pi, rel=0.01)
    turn = np.linspace(0, math.pi, 9)
    ring = [(5 * math.cos(t), 5 * math.sin(t), 0, 1) for t in turn]
    mesh = implicit({"part": "tube", "points_mm": ring, "steps": 24}, cell=0.2).mesh()
    middle = mesh.vertices[mesh.vertices[:, 1] > 1.5]
    from_circle = np.hypot(np.hypot(middle[:, 0], middle[:, 1]) - 5, middle[:, 2])
    np.testing.assert_allclose(from_circle, 1, atol=0.03)


def test_parts_give_their_vertices_colours():
    mesh = implicit(ball(2, colour=RED), ball(2, (5, 0, 0), colour=BLUE)).mesh()
    left = mesh.vertices[:, 0] < 2.3
    np.testing.assert_allclose(mesh.colours[left], np.broadcast_to(RED, (left.sum(), 3)), atol=1e-9)
    np.testing.assert_allclose(mesh.colours[~left & (mesh.vertices[:, 0] > 3)][:, 2], 1, atol=1e-9)
    painted = implicit(ball(2, colour=RED), ball(1, (2, 0, 0), op="paint", colour=BLUE)).mesh()
    np.testing.assert_allclose(volume(painted), volume(implicit(ball(2)).mesh()))
    distance = np.linalg.norm(painted.vertices - [2, 0, 0], axis=1)
    assert (painted.colours[distance < 0.8] == BLUE).all() and (painted.colours[distance > 1.2] == RED).all()
    assert implicit(ball(2)).mesh().colours is None


def test_a_front_texture_is_projected_along_z():
    mesh = implicit(ball(2), front_mm=(-1, -2, 3, 2)).mesh()
    np.testing.assert_allclose(mesh.uv, (mesh.vertices[:, :2] - [-1, -2]) / [4, 4])


FIELD = {"shape": "heightfield", "size_mm": (20, 30), "cells": (24, 36), "height_mm": 3, "feature_mm": 7}


def test_terrain_lies_where_it_is_put_and_faces_up():
    mesh = shape(**FIELD, ridged=True, rise_mm=5, seed=3).mesh()
    assert len(mesh.vertices) == 25 * 37 and len(mesh.faces) == 24 * 36 * 2
    np.testing.assert_allclose(mesh.vertices[:, [0, 2]].min(axis=0), [-10, 0])
    np.testing.assert_allclose(mesh.vertices[:, [0, 2]].max(axis=0), [10, 30])
    assert (face_normals(mesh)[:, 1] > 0).all() and (mesh.normals[:, 1] > 0).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    rise = 5 * mesh.vertices[:, 2] / 30
    assert (mesh.vertices[:, 1] - rise >= 0).all() and (mesh.vertices[:, 1] - rise <= 3).all(), "ridges: 0 to height"
    assert mesh.uv.min() == 0 and mesh.uv.max() == 1 and mesh.colours is None


def test_terrain_is_decided_by_its_seed_and_flat_without_height():
    a, b, c = (shape(**FIELD, seed=seed).mesh().vertices for seed in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 0.5
    flat = shape(**{**FIELD, "height_mm": 0}, rise_mm=-2).mesh()
    np.testing.assert_allclose(flat.vertices[:, 1], -2 * flat.vertices[:, 2] / 30)


def test_wider_rows_stand_further_apart_and_swell():
    mesh = shape(**FIELD, widen=4, swell=True, ridged=True).mesh()
    rows = mesh.vertices.reshape(37, 25, 3)
    width = np.ptp(rows[:, :, 0], axis=1)
    np.testing.assert_allclose(width[[0, -1]], [20, 80])
    steps = np.diff(rows[:, 0, 2])
    np.testing.assert_allclose(steps[1:] / steps[:-1], 4 ** (1 / 36))
    assert rows[-1, :, 1].max() <= 3 and rows[0, :, 1].max() <= 3 / 4


def test_terrain_is_coloured_by_height_and_slope():
    flat = {**FIELD, "height_mm": 0}
    colours = [(-1, RED), (1, BLUE)]
    ground = shape(**flat, colours=colours, steep=(0, 1, 0)).mesh()
    np.testing.assert_allclose(ground.colours, [[0.5, 0, 0.5]] * 925)  # halfway, in linear light
    cliff = shape(**flat, rise_mm=90, colours=colours, steep=(0, 1, 0)).mesh()
    np.testing.assert_allclose(cliff.colours, [[0, 1, 0]] * 925, atol=1e-9)


def test_terrain_kernel_equals_its_python_source():
    generator = np.random.default_rng(5)
    x, z = generator.uniform(-9, 9, (2, 3, 4))
    for ridged in (False, True):
        compiled, plain = np.empty((3, 4)), np.empty((3, 4))
        terrain(x, z, 7, 5, 0.5, ridged, compiled)
        with np.errstate(over="ignore"):  # hashes wrap
            terrain.py_func(x, z, 7, 5, 0.5, ridged, plain)
        np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-13)


HAIR = {"shape": "strands", "count": 400, "radii_mm": (7, 10, 9), "length_mm": 20, "width_mm": 0.1, "steps": 6}


def test_strands_grow_from_the_head_and_leave_the_face_free():
    mesh = shape(**HAIR, volume=0.2, seed=4).mesh()
    assert len(mesh.faces) == 400 * 6 * 2 and len(mesh.vertices) == 400 * 7 * 2
    strands = mesh.vertices.reshape(400, 7, 2, 3)
    line = strands.mean(axis=2)
    radii = np.array([7, 10, 9])
    np.testing.assert_allclose(np.linalg.norm(line[:, 0] / radii, axis=1), 1.01)
    above = line[:, 1:][line[:, 1:, 1] > 0]
    assert np.linalg.norm(above / radii, axis=1).min() > 0.95, "none grows through the head"
    face = (line[..., 2] < -4) & (np.abs(line[..., 0]) < 3) & (line[..., 1] < 2)
    assert not face.any()
    assert line[:, -1, 1].mean() < line[:, 0, 1].mean(), "hair falls"
    width = np.linalg.norm(strands[:, :, 0] - strands[:, :, 1], axis=-1)
    np.testing.assert_allclose(width, np.broadcast_to(0.1 * np.linspace(1, 0.35, 7), (400, 7)), rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    assert mesh.uv.min() == 0 and mesh.uv.max() == 1
    assert mesh.colours.min() >= 0 and mesh.colours.max() <= 1


def test_strands_are_decided_by_their_seed():
    a, b, c = (shape(**HAIR, wave_mm=1, seed=seed).mesh() for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.vertices, b.vertices)
    np.testing.assert_array_equal(a.colours, b.colours)
    assert (a.vertices != c.vertices).any()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda: implicit(ball(1, op="cut")), "first part"),
        (lambda: implicit(ball(1), cell=1e-4), "cells: at most"),
        (lambda: implicit(ball(1), cell=0), "greater than 0"),
        (lambda: implicit(ball(-1)), "greater than 0"),
        (lambda: implicit(ball(1), front_mm=(1, 0, 0, 1)), "front_mm"),
        (lambda: implicit(ball(1), ball(1, (9, 0, 0), op="keep")).mesh(), "leave nothing"),
        (lambda: implicit(), "at least 1"),
        (lambda: shape(**FIELD, widen=0.5), "greater than or equal to 1"),
        (lambda: shape(**FIELD, colours=[(1, RED), (1, BLUE)]), "higher than the one before"),
        (lambda: shape(**{**HAIR, "steps": 1}), "greater than or equal to 2"),
        (lambda: shape(**{**HAIR, "colours": ["#00000g", "#000000"]}), "#rrggbb"),
    ],
)
def test_wrong_parameters_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        wrong()


def scene_file(tmp_path, text):
    path = tmp_path / "a.toml"
    path.write_text(
        '[material.m]\ncolour = "#ffffff"\n[texture.v]\nkind = "vertex"\n[material.v]\ntexture = "v"\n' + text
    )
    return path


def test_a_scene_file_s_mistakes_are_named(tmp_path):
    head = '[[object]]\nmaterial = "m"\nshape = "implicit"\ncell_mm = 0.5\n'
    wrong = {
        'parts = [{ part = "ball", radii_mm = [1, 1, 1], radius_mm = 2 }]': (
            r"parts\.0\.radius_mm: no such key: known are op,.*radii_mm"
        ),
        'parts = [{ part = "cube" }]': "unknown part 'cube': known are ball, block, capsule, tube",
    }  # fmt: skip
    for text, said in wrong.items():
        with pytest.raises(ValueError, match=said):
            load_scene(scene_file(tmp_path, head + text))
    with pytest.raises(ValueError, match="vertex colours needs them, the mesh has none"):
        load_scene(scene_file(tmp_path, '[[object]]\nmaterial = "v"\nshape = "sphere"\nradius_mm = 1\n'))
