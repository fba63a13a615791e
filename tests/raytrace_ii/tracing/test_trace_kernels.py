"""Compiled kernels against their Python source, through whole scenes."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ii_core import preset
from raytrace_ii import trace
from raytrace_ii.rendering.job import Job
from raytrace_ii.scene.textures import Image
from raytrace_ii.tracing import tracer
from raytrace_ii.tracing.embree import lane_masks
from raytrace_ii.tracing.intersect import Intersector, first_of_same
from raytrace_ii.tracing.kernels import appearance, attributes, sky, spawn, way
from raytrace_ii.tracing.kernels.arrays import ShadowRays
from raytrace_ii.tracing.kernels.lanes import work
from raytrace_ii.tracing.kernels.light import keep_unblocked
from raytrace_ii.tracing.kernels.media import fresnel
from raytrace_ii.tracing.kernels.packets import NO_CALLS, Tools
from raytrace_ii.tracing.kernels.start import start_rays, start_separable_rays
from tests.support.pictures import scene
from tests.support.slow import first_fast
from tests.support.trace_scenes import WHITE, body, hall, sphere, wall

NAMES = ("start_rays", "add_unblocked", "pass_faces", "pass_clear_face", "start_inside", "tell_inside")


def crowded():
    """The hall, its camera in water, with more water in the glass, a prism's colours and a wall half cut out."""
    mesh, alpha = wall(25, 9), np.array([[0, 1], [1, 0]], np.float32)
    sieve = body(
        mesh,
        coordinates=np.column_stack([mesh.uv, np.zeros(4)]),
        texture=Image(np.ones((2, 2, 3), np.float32), alpha=alpha),
        normal_map=Image(np.full((1, 1, 3), (0.6, 0.5, 0.9), np.float32)),
        alpha_cutoff=0.5,
    )
    water = body(sphere(6, 24), at=(0, -1, 31), transmission=WHITE, ior=(1.32, 1.33, 1.35), priority=-1)
    sea = body(sphere(20, 24), transmission=WHITE, ior=1.33, absorption_per_mm=(0.01, 0, 0))
    scene = hall(max_depth=4)
    return replace(scene, bodies=[*scene.bodies, sieve, water, sea])


@pytest.mark.slow
@pytest.mark.parametrize("glass", [True, False])
def test_tracing_in_python_sees_the_same(glass, monkeypatch):
    """Python keeps float32 where numba continues in float64: the same rays, except rare ones on an edge."""
    scene = hall(max_depth=4)
    if not glass:  # without glass, shadow rays take the shorter path
        bodies = [body for body in scene.bodies if not body.material.transmissive]
        scene = replace(scene, bodies=bodies)
    assert (agree(scene, monkeypatch).count.rays["refraction"] > 0) == glass


@pytest.mark.slow
def test_passing_in_python_sees_the_same(monkeypatch):
    compiled = agree(crowded(), monkeypatch)
    assert compiled.count.rays["passed"] > 600 and compiled.count.rays["refraction"] > 600


@pytest.mark.parametrize(
    ("name", "stages"),
    first_fast(
        [
            ("apples", {"paint"}),
            ("car", {"paint", "reflect"}),
            ("cuboid", {"footprints", "look_closely"}),
            ("dolphin", {"paint", "attenuate", "reflect"}),
            ("objects", {"attenuate", "look_closely", "spawn"}),
        ]
    ),
)
def test_a_scene_compiles_only_the_stages_it_needs(name, stages):
    """One function of all stages took 16 s more to compile for Apples, which uses the fewest."""
    camera = preset("setup1", scale=256)
    job = Job(scene(name), camera, 1, 0, np.eye(4), "uint8", ())
    job.tile(slice(0, 8), slice(0, 64))
    assert {stage.py_func.__name__ for stage in job._tracer()._addresses} == stages


def agree(scene, monkeypatch):
    """Trace with compiled kernels and with their source, compare, and return the first."""
    camera = preset("setup1", scale=64)
    m, n = np.random.default_rng(0).integers(0, camera.pixels, (600, 2)).T
    compiled = trace(scene, *camera.rays_at(m, n))
    for name in NAMES:
        monkeypatch.setattr(tracer, name, getattr(tracer, name).py_func)
    # Python can call neither Embree nor a stage by address: Embree's hits come in arrays, the function stands for its
    # address and a tuple for its place
    monkeypatch.setattr(Intersector, "tools", lambda *_: Tools(NO_CALLS, NO_CALLS, NO_CALLS, *lane_masks()))
    monkeypatch.setattr(tracer, "way_kernel", lambda width: way.way_kernel(width).py_func)
    monkeypatch.setattr(tracer, "addresses", lambda stages, _: {stage: stage.py_func for stage in stages})
    monkeypatch.setattr(way, "call", lambda stage, *arguments: stage(*arguments))
    monkeypatch.setattr(way, "address_of", lambda generation: generation)
    monkeypatch.setattr(way, "ticks", lambda: 0)
    for module in (appearance, attributes, sky, spawn, way):
        monkeypatch.setattr(module, "value_at", lambda generation: generation)
    plain = trace(scene, *camera.rays_at(m, n))
    np.testing.assert_array_equal(compiled.object_id, plain.object_id)
    np.testing.assert_allclose(compiled.depth, plain.depth, rtol=1e-6)
    np.testing.assert_array_equal(compiled.normal, plain.normal)
    for kind, count in compiled.count.rays.items():
        assert abs(count - plain.count.rays[kind]) <= 2 + count // 100
    off = np.abs(compiled.radiance - plain.radiance).max(axis=1)
    assert np.quantile(off, 0.99) < 1e-4 and off.max() < 0.5
    assert compiled.count.rays["reflection"] > 0
    return compiled


def test_start_rays_name_the_first_bad_one():
    locations, directions = np.zeros((6, 3)), np.ones((6, 3))
    directions[4] = 0
    directions[2, 1] = np.nan
    rows = [np.empty((6, 3), np.float32) for _ in range(3)]
    out = (*rows, np.empty(6, np.int32), np.empty((6, 2), np.int32))
    all_of_it, as_they_come = np.empty(0), np.empty(0, np.int32)
    for function in (start_rays, start_rays.py_func):
        assert function(locations, directions, all_of_it, as_they_come, np.eye(3), np.zeros(3), *out) == (6, 2)
        two = locations[:2], directions[:2]
        assert function(*two, all_of_it, as_they_come, np.eye(3), np.ones(3), *out) == (2, -1)
        np.testing.assert_array_equal(rows[0][:2], 1)
        np.testing.assert_allclose(rows[1][:2], 3**-0.5, rtol=1e-7)
        np.testing.assert_array_equal(rows[2][:2], 1)


def test_rays_without_light_are_left_out():
    locations, directions = np.arange(12.0).reshape(4, 3), np.ones((4, 3))
    directions[1] = 0  # blocked: its direction is not used
    rows = [np.empty((4, 3), np.float32) for _ in range(3)]
    pixels, inside = np.empty(4, np.int32), np.empty((4, 0), np.int32)
    for function in (start_rays, start_rays.py_func):
        shares = np.array([0.25, 0, 0, 1])
        for order, row, left in (([], [0, 3], [0, 3]), ([3, 1, 0, 2], [0, 2], [3, 0])):
            order = np.array(order, np.int32)
            found = function(locations, directions, shares, order, np.eye(3), np.zeros(3), *rows, pixels, inside)
            assert found == (2, -1)
            assert pixels[:2].tolist() == row
            np.testing.assert_array_equal(rows[0][:2], locations[left])
            np.testing.assert_array_equal(rows[2][:2, 0], shares[left])


def test_rays_by_row_and_column_are_those_one_by_one():
    rng = np.random.default_rng(0)
    x, y, z = rng.normal(size=(5, 2)), rng.normal(size=(7, 2)), np.array([1.0, 4.0])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    grid = np.empty((2, 7, 5, 3))
    for k in range(2):
        grid[k, ..., 0], grid[k, ..., 1], grid[k, ..., 2] = x[:, k], y[:, k, None], z[k]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, np.arange(3.0)
    expected = [np.empty((35, 3), np.float32) for _ in range(3)]
    pixels, inside = np.empty(35, np.int32), np.empty((35, 0), np.int32)
    order = rng.permutation(35).astype(np.int32)
    start_rays(*grid.reshape(2, 35, 3), np.empty(0), order, turn, np.arange(3.0), *expected, pixels, inside)
    start = tracer.start_tables((x, y, z), pose)
    start = start._replace(rows=order // 5 - 1, columns=order % 5 - 2, top=1, left=2)
    for function in (start_separable_rays, start_separable_rays.py_func):
        found = [np.empty((35, 3), np.float32) for _ in range(2)]
        function(start, work(), *found)
        np.testing.assert_array_equal(found, expected[:2])


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, 1e200])
def test_rows_and_columns_of_unusable_rays_are_reported(wrong):
    sizes = (10, 6, 2)
    for where in range(18):
        flat = np.ones(18)
        flat[where] = wrong
        x, y, z = np.split(flat, np.cumsum(sizes)[:-1])
        assert tracer.start_tables((x.reshape(5, 2), y.reshape(3, 2), z), np.eye(4)) is None
    assert tracer.start_tables((np.zeros((5, 2)), np.zeros((3, 2)), np.zeros(2)), np.eye(4)) is None, "no direction"


def test_shadow_rays_that_arrive_are_packed_to_the_front():
    rng = np.random.default_rng(0)
    blocked = rng.choice(np.array([0, -1], np.int32), 50)
    rows = [rng.normal(size=shape).astype(np.float32) for shape in ((50, 3), (50, 3), (50,), (50, 3))]
    rows += [rng.integers(0, 99, 50).astype(np.int32), rng.integers(-1, 9, (50, 2)).astype(np.int32)]
    for function in (keep_unblocked, keep_unblocked.py_func):
        packed = [row.copy() for row in rows]
        kept = function(blocked, ShadowRays(*packed))
        assert kept == (blocked == -1).sum()
        for row, array in zip(rows, packed, strict=True):
            np.testing.assert_array_equal(array[:kept], row[blocked == -1])


def test_a_part_of_a_kernel_runs_as_python_when_called_from_python():
    # It has no code that takes Python's arguments apart: compiled code called like that would end the process.
    assert fresnel(1.0, 1.5) == pytest.approx((0.04, 1.0), rel=1e-14)
    fresnel.compile((numba.float64, numba.float64))  # as a kernel that calls it does
    assert fresnel(1.0, 1.5) == pytest.approx((0.04, 1.0), rel=1e-14)


def by_loops(corners):
    """The first face with the same set of corners, by comparing all pairs."""
    sets = [sorted(map(tuple, face.tolist())) for face in corners]
    return [sets.index(face) for face in sets]


@given(data=st.lists(st.lists(st.sampled_from([0.0, -0.0, 1.0, 1e-38, -2.5]), min_size=9, max_size=9), max_size=30))
def test_as_by_comparison_of_all_pairs(data):
    corners = np.array(data, np.float32).reshape(-1, 3, 3)
    found, expected = first_of_same(corners), by_loops(corners)
    if found is None:
        assert expected == list(range(len(corners)))
    else:
        np.testing.assert_array_equal(found, expected)


def test_one_copy_in_many_blocks_is_found():
    corners = np.random.default_rng(0).random((600_000, 3, 3), dtype=np.float32)
    assert first_of_same(corners) is None
    corners[599_999] = corners[7][[2, 0, 1]]
    found = first_of_same(corners)
    assert found[599_999] == 7 and (np.delete(found, 599_999) == np.arange(599_999)).all()
