"""Columns along light: what they tell of points, against all faces by textbook algebra; pictures with and without."""

from dataclasses import replace

import numpy as np
import pytest

from ii_core import preset
from raytrace_ii import Light, Scene, load_scene, render
from raytrace_ii.tracing import packing
from raytrace_ii.tracing.columns import MOST_LAMPS, SIZES, columns_across, light_columns
from raytrace_ii.tracing.kernels import lanes as at
from raytrace_ii.tracing.kernels.columns import NUMBERS, TOLD, draw_sheets, find_mates, is_rim, tell
from raytrace_ii.tracing.kernels.tables import DIRECTIONAL, POINT
from raytrace_ii.tracing.packing import packed
from tests.support.slow import first_fast
from tests.support.trace_scenes import body, box, floor, on_planes, sphere


def bowl():
    """The lower part of a ball, open."""
    ball = sphere(2, 24)
    low = ball.vertices[ball.faces][:, :, 1].max(axis=1) < 0.5
    return replace(ball, faces=ball.faces[low])


AS_THEY_ARE = np.array([1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0])  # a matrix from u, v and h
SUN, LAMP = (DIRECTIONAL, (0.3, -1.0, 0.4)), (POINT, (3.0, 9.0, -2.0))
FLOOR = body(floor(40.0), at=(0, -3, 0))
BODIES = {
    "a ball over a floor": [body(sphere(2, 24)), FLOOR],
    "balls that meet": [body(sphere(2, 24)), body(sphere(1.5, 24), at=(1.5, 0.7, 0)), FLOOR],
    "boxes on each other": [body(box(3, 1, 3)), body(box(1, 2, 1), at=(0.4, 1.5, 0)), FLOOR],
    "sheets without thickness": [body(floor(3.0), at=(0, y, 0.4 * y), turn=(20 * y, 0, 9)) for y in (0, 1, 2)],
    "a bowl": [body(bowl()), FLOOR],
    "twice the same": [body(sphere(2, 12)), body(sphere(2, 12)), FLOOR],
}


def row(lamp):
    kind, place = lamp
    place = np.asarray(place) / (np.linalg.norm(place) if kind == DIRECTIONAL else 1)
    return [kind, *place, 1, 1, 1, 0, 0, 0, 0, 0]


def shaded(points, ways, corners):
    """Whether a face surely lies on the way from a point, and whether one may: within rounding of its border."""
    t, inner, _ = on_planes(points, ways, corners)
    met = (inner > -1e-4) & (t > 0) & (t < 1)
    return (met & (inner > 1e-4)).any(axis=1), met.any(axis=1)


def told(columns, points, normals, ways):
    """Whether each point is told to be lit, and whether in shadow."""
    single, lit, dark = at.work().single, [], []
    for first in range(0, len(points), at.BLOCK):
        for start, values in ((at.OX, points), (at.GX, normals), (at.LX, ways)):
            single[start : start + 3 * at.BLOCK] = values[first : first + at.BLOCK].T.reshape(-1)
        single[at.WANTED : at.WANTED + at.BLOCK] = 1
        unknown = tell(columns, 0, single)
        wanted, left = single[at.WANTED : at.WANTED + at.BLOCK] > 0, single[at.LEFT : at.LEFT + at.BLOCK] > 0
        assert unknown == left.sum() and not (wanted & left).any()
        lit.append(wanted.copy())
        dark.append(~wanted & ~left)
    return np.concatenate(lit), np.concatenate(dark)


@pytest.mark.parametrize(("name", "lamp"), first_fast([(name, lamp) for lamp in (SUN, LAMP) for name in BODIES], 7))
def test_what_is_told_is_true(name, lamp):
    scene = packed(Scene(name="columns", bodies=tuple(BODIES[name])))
    corners, normals = scene.corners, scene.faces[: len(scene.corners), :3]
    columns = light_columns(corners, normals, np.array([row(lamp)]), 128, True)
    rng = np.random.default_rng(5)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    faces = rng.choice(len(corners), 512, p=np.sqrt(area) / np.sqrt(area).sum())
    shares = rng.dirichlet((1, 1, 1), len(faces))
    points = (shares[:, :, None] * corners[faces]).sum(axis=1)
    ways = np.tile(-100 * np.asarray(lamp[1]), (len(points), 1)) if lamp[0] == DIRECTIONAL else lamp[1] - points
    facing = normals[faces] * np.sign((normals[faces] * ways).sum(axis=1, keepdims=True))
    points += 2e-4 * facing
    lit, dark = told(columns, points, facing, ways)
    surely, perhaps = shaded(points, ways, corners)
    assert not (lit & surely).any() and not (dark & ~perhaps).any()
    if name != "twice the same":  # edges of four faces are rims
        assert lit.mean() > 0.1 and (lit | dark).mean() > 0.3


def test_without_solid_faces_nothing_is_told_to_be_dark():
    scene = packed(Scene(name="columns", bodies=tuple(BODIES["a ball over a floor"])))
    below = np.tile([[0.3, -2.99, 0.2]], (16, 1))  # in the middle of the ball's shadow
    up = np.tile([[0.0, 1.0, 0.0]], (16, 1))
    sun = np.array([row((DIRECTIONAL, (0.0, -1.0, 0.0)))])
    for solid in (True, False):
        columns = light_columns(scene.corners, scene.faces[: len(scene.corners), :3], sun, 64, solid)
        lit, dark = told(columns, below, up, up)
        assert not lit.any() and dark.all() == solid


def test_a_lamp_among_the_faces_has_no_columns():
    scene = packed(Scene(name="columns", bodies=(body(sphere(5, 12)),)))
    lamps = np.array([row((POINT, (0, 0, 0))), row((POINT, (0, 9, 0)))])
    columns = light_columns(scene.corners, scene.faces[: len(scene.corners), :3], lamps, 32, True)
    assert columns.turns.reshape(-1, NUMBERS)[:, TOLD].tolist() == [0, 1]


def test_mates_of_edges():
    a, b, c, d, e = np.eye(5, 3, dtype=np.float32)
    d[:] = 1, 1, 1
    faces = np.array([[a, b, c], [b, a, d], [c, b, -e * 0]])  # −0 at the last corner, which is 0
    more = np.concatenate([faces, [[c, b, e]]])  # the same face again
    for corners, wanted in (
        (faces, [3, 8 - 2, -1, 0, -1, -1, 1, -1, -1]),
        (more, [3, -2, -1, 0, -1, -1, -2, 10, 11]),
    ):
        mates = np.empty(3 * len(corners), np.int32)
        find_mates(corners.astype(np.float32).reshape(-1), np.full(64, -1, np.int32), mates)
        assert mates[: len(wanted)].tolist() == wanted


@pytest.mark.parametrize(
    ("side", "height", "rim"), [(1, -2, False), (1, 2, True), (1, 0.2, False), (-1, 0.5, True), (0, -1, True)]
)
def test_rims_are_folds_and_steep_valleys(side, height, rim):
    """A level face left of an edge and another one, whose third corner is ``side`` to the right of it."""
    corners = np.array([[[0, 0, 0], [0, 1, 0], [-1, 0, 0]], [[0, 1, 0], [0, 0, 0], [side, 0, height]]], np.float32)
    mates = np.empty(6, np.int32)
    find_mates(corners.reshape(-1), np.full(16, -1, np.int32), mates)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    seen = corners.transpose(0, 2, 1).reshape(2, 9).astype(float)
    assert [bool(is_rim(seen[f], seen[1 - f], normals, mates, 3 * f)) for f in (0, 1)] == [rim, rim]


def test_a_sheet_is_counted_where_its_edge_passes_the_middle_of_a_column():
    size, across = 8, np.array([0.0, 8.0, 8.0, 0.0])
    for i in range(4):  # a square in u and v, parted by a diagonal through the middles of columns
        a, b, c, d = np.roll(np.stack([across, np.roll(across, 1), 0 * across]), i, axis=1).T
        corners = np.array([(a, b, c), (c, d, a)], np.float32).reshape(-1)
        sheets, layers = np.full((size**2, 3), -np.inf, np.float32), np.zeros(size**2, np.uint8)
        draw_sheets(AS_THEY_ARE, corners, size, 1e-3, np.empty(9), sheets, layers)
        layers = layers.reshape(size, size)
        on = np.eye(size, dtype=bool)
        on = on if (layers[0, 0] > 1) else on[::-1]
        assert (layers[on] == 2).all() and (layers[~on] == 1).all()


def test_columns_are_made_for_large_pictures_only():
    assert columns_across(10**5, 10**5, 1) == columns_across(10**9, 10**5, 0) == 0
    assert columns_across(10**9, 10**5, 1) == max(SIZES)
    sizes = [columns_across(rays, 80_000, 1) for rays in range(0, 40_000_000, 500_000)]
    assert sizes == sorted(sizes) and set(sizes) == {0, *SIZES}
    assert columns_across(10**9, 10**5, MOST_LAMPS) == columns_across(10**9, 10**5, 10 * MOST_LAMPS)


@pytest.mark.parametrize("name", first_fast(["cuboid", "objects", "apples", "twins", "car", "dolphin", "hairdo"], 2))
def test_pictures_are_the_same(name, monkeypatch):
    scene, camera = load_scene(name), preset("setup1", scale=16)
    plain = render(scene, camera, workers=1).picture.pixels
    monkeypatch.setattr(packing, "columns_across", lambda *_: 256)
    seen = render(scene, camera, workers=1)
    assert packed(scene).columns(0).size == 256 and np.isfinite(packed(scene).columns(0).known).mean() > 0.05
    assert np.array_equal(seen.picture.pixels, render(scene, camera, workers=2).picture.pixels)
    off = np.abs(seen.picture.pixels.astype(int) - plain).max(axis=-1)
    assert off.max() <= 1 and (off > 0).sum() <= 2  # light of several lamps is added in another order


def test_many_lamps():
    lamps = tuple(
        Light(kind="directional", vector=(0.1 * i - 0.5, -1.0, 0.3), colour=(0.1, 0.1, 0.1))
        for i in range(MOST_LAMPS + 2)
    )
    scene = packed(Scene(name="columns", bodies=(FLOOR,), lights=lamps))
    columns = light_columns(scene.corners, scene.faces[: len(scene.corners), :3], scene.lights, 16, True)
    assert columns.turns.reshape(-1, NUMBERS)[:, TOLD].tolist() == [1] * MOST_LAMPS + [0, 0]
