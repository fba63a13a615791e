"""Rasterised views: the nearest of all faces in every pixel, by rays and triangles of textbook algebra."""

import numpy as np
import pytest

from ii_core import IICamera, preset
from ii_core.camera import optics
from raytrace_ii import load_scene, render
from raytrace_ii.rendering import job
from raytrace_ii.sampling.samples import EvenRays
from raytrace_ii.tracing import raster
from raytrace_ii.tracing.intersect import first_of_same
from raytrace_ii.tracing.kernels import raster as kernels
from raytrace_ii.tracing.raster import Raster, parallel_views
from raytrace_ii.tracing.tracer import start_tables
from tests.support.slow import first_fast
from tests.support.trace_scenes import hall, on_planes, sphere

SMALL = IICamera(pixels=(60, 40), lenses=(15, 10), pixel_pitch_mm=0.1, gap_mm=2.0)
CAMERAS = {
    "four pixels a lens": SMALL,
    "more columns of views than lanes": IICamera(pixels=(120, 15), lenses=(6, 3), pixel_pitch_mm=0.1, gap_mm=2.0),
    "more rows of lenses than a group": IICamera(pixels=(34, 74), lenses=(17, 37), pixel_pitch_mm=0.1, gap_mm=0.5),
    "odd": IICamera(pixels=(45, 35), lenses=(9, 7), pixel_pitch_mm=0.1, gap_mm=2.0),
    "rays from before the lenses": IICamera(
        pixels=(60, 40), lenses=(15, 10), pixel_pitch_mm=0.1, gap_mm=2.0, start_mm=3.0
    ),
}
TURNED = np.eye(4)
TURNED[:3, :3] = [[0.96, 0, 0.28], [0, 1, 0], [-0.28, 0, 0.96]]
TURNED[:3, 3] = 1.5, -0.7, -2
NONE = np.empty(0, np.int32)


@pytest.fixture(autouse=True)
def always_rasterised(monkeypatch):
    monkeypatch.setattr(raster, "MOST_ROWS", 1e9)


def rasterised(camera, corners, pose=None, same=NONE):
    pose = np.eye(4) if pose is None else pose
    views = parallel_views(camera.separable_rays(), camera.lenses, pose)
    return Raster(views, np.ascontiguousarray(corners, np.float32), same).faces(slice(0, camera.pixels[1]))


def met(camera, corners, pose=None, sample=(0.5, 0.5)):
    """Return of every ray and face the distance, infinite if it is missed, and how far inside the ray passes.

    Cramer's rule in float64. What lies within the margin outside a face counts as met. A face seen edge-on may be
    met anywhere along the ray.
    """
    pose = np.eye(4) if pose is None else pose
    L, D = (array.reshape(-1, 3) for array in camera.rays(sample=sample))
    L, D = L @ pose[:3, :3].T + pose[:3, 3], D @ pose[:3, :3].T
    p = np.asarray(corners, np.float32).astype(np.float64)
    sides = np.linalg.norm(p[:, 1] - p[:, 0], axis=1) * np.linalg.norm(p[:, 2] - p[:, 0], axis=1)
    t, inside, size = on_planes(L, D, corners)
    edge_on = np.abs(size) < EDGE_ON * sides
    t, inside = np.where(edge_on, 0.0, t), np.where(edge_on & (inside > -1), 0.0, inside)
    inside = np.where(np.isfinite(inside) & (t >= 0), inside, -np.inf)
    return np.where(inside >= -MARGIN, t, np.inf), inside


MARGIN, TIE, EDGE_ON = 1e-6, 1e-6, 1e-6  # of a face's side, of a distance, of sides and ray


def assert_nearest(faces, camera, corners, pose=None, sure=0.95, sample=(0.5, 0.5)):
    """Compare with all rays and faces; at an edge, or where two faces are equally near, either may count."""
    distances, inside = met(camera, corners, pose, sample)
    faces = faces.ravel()
    nearest = np.where(inside > MARGIN, distances, np.inf)  # those that are met for sure
    right = np.where(np.isfinite(nearest.min(axis=1)), nearest.argmin(axis=1), -1)
    reach = nearest.min(axis=1) * (1 + TIE)
    open_ = np.isfinite(distances) & (distances <= reach[:, None])
    clear = open_.sum(axis=1) == (right >= 0)
    assert clear.mean() > sure
    np.testing.assert_array_equal(faces[clear], right[clear])
    hit = ~clear & (faces >= 0)
    assert open_[hit, faces[hit]].all()
    assert (right[~clear & (faces < 0)] < 0).all()
    return right


def soup(n, size, seed, depth=(1, 40)):
    generator = np.random.default_rng(seed)
    middle = np.column_stack([generator.uniform(-6, 6, n), generator.uniform(-5, 5, n), generator.uniform(*depth, n)])
    return (middle[:, None] + generator.normal(0, size, (n, 3, 3))).astype(np.float32)


@pytest.mark.parametrize("name", first_fast(CAMERAS, 2))
def test_the_nearest_face_is_found_in_every_pixel(name):
    camera = CAMERAS[name]
    for pose in (None, TURNED):
        faces = rasterised(camera, corners := soup(300, 1.2, 1), pose)
        right = assert_nearest(faces, camera, corners, pose)
        assert len(np.unique(right)) > 30 and (right < 0).any()


@pytest.mark.parametrize("name", first_fast(CAMERAS, 2))
def test_the_nearest_face_is_found_at_each_place_of_a_set_of_samples(name):
    camera, corners = CAMERAS[name], soup(300, 1.2, 1)
    rays = camera.separable_rays()
    even = EvenRays.of(camera, start_tables(rays, TURNED), TURNED)
    planes = even.planes(3, 4)
    some = Raster(parallel_views(rays, camera.lenses, TURNED, planes, even.steps), corners, NONE)
    found = []
    for plane in range(4):
        across, down = (0.5 + np.tile(of[plane], many) for of, many in zip(planes, camera.lenses, strict=True))
        places = np.stack(np.broadcast_arrays(across, down[:, None]), axis=-1)
        found.append(some.faces(slice(0, camera.pixels[1]), plane))
        assert_nearest(found[-1], camera, corners, TURNED, sample=places)
    assert (found[0] != found[1]).mean() > 0.02
    assert not some._lists


def slivers(n=200):
    """Long faces a thousandth as wide."""
    generator = np.random.default_rng(3)
    at, way = soup(n, 0, 4)[:, 0], generator.normal(0, 4, (n, 3))
    return np.stack([at, at + way, at + way / 2 + generator.normal(0, 4e-3, (n, 3))], axis=1)


def along_rays(camera):
    """Faces that contain rays of the middle of the picture, with others behind them."""
    L, D = (array[::5, ::7].reshape(-1, 3) for array in camera.rays())
    near, far, beside = L + 5 * D, L + 9 * D, L + 5 * D + np.array([0.3, 0.2, 0.1])
    return np.concatenate([np.stack([near, far, beside], axis=1), soup(100, 3, 5, (20, 30))])


@pytest.mark.parametrize(
    ("corners", "sure"),
    [
        (slivers(), 0.95),
        (along_rays(SMALL), 0.7),
        (soup(300, 1.5, 6, (-30, 30)), 0.95),  # through the lenses, and behind them
        (soup(60, 3, 7) * [3, 3, 1], 0.95),  # beside the picture
        (soup(12, 3000, 8, (500, 4000)), 0.95),
        (soup(3, 1e8, 8, (1e7, 2e7)), 0.9),
        (soup(200, 1e-3, 9), 0.95),  # smaller than the distance of rays
        (np.repeat(soup(40, 2, 10), 3, axis=1)[:, :3], 0.95),  # points
    ],
    ids=["slivers", "along rays", "behind", "beside", "huge", "endless", "tiny", "points"],
)
def test_faces_of_all_shapes_and_places(corners, sure):
    assert_nearest(rasterised(SMALL, corners), SMALL, corners, sure=sure)


def test_nothing_is_seen_of_nothing():
    assert (rasterised(SMALL, soup(20, 1, 0, (-50, -10))) == -1).all()
    assert (rasterised(SMALL, soup(20, 1, 0)[:0]) == -1).all()


@pytest.mark.parametrize("seed", range(3))
def test_no_ray_passes_between_faces_that_share_edges(seed):
    """A wall of thin and thick faces, corners on rays and beside them, before another one."""
    generator = np.random.default_rng(seed)
    L, D = (array.reshape(-1, 3) for array in SMALL.rays())
    places = (L + 8 * D / D[:, 2:])[generator.permutation(len(L))[:60]]
    x = np.unique(np.concatenate([[-40, 40], places[:, 0], generator.uniform(-5, 5, 20)]))
    y = np.unique(np.concatenate([[-40, 40], places[:, 1], generator.uniform(-5, 5, 20)]))
    grid = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((len(x), len(y)), places[0, 2])], axis=-1)
    grid[1:-1, 1:-1, 2] += generator.normal(0, 0.3, (len(x) - 2, len(y) - 2))
    a, b, c, d = (part.reshape(-1, 3) for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]))
    wall = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    behind = np.array([[[-99, -99, 20], [99, -99, 20], [0, 99, 20]]])
    for pose in (None, TURNED):
        faces = rasterised(SMALL, np.concatenate([behind, wall]), pose)
        assert faces.min() >= 1 or pose is not None
        assert (faces >= 0).all() and (faces == 0).mean() < 0.01


def test_a_closed_body_hides_what_is_in_it():
    mesh = sphere(3.0, 40)
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)] + [0, 0, 9]
    faces = rasterised(SMALL, np.concatenate([corners, soup(300, 0.3, 2, (8.5, 9.5)) * [0.1, 0.1, 1]]))
    assert (faces >= 0).mean() > 0.2 and faces.max() < len(corners)


def test_the_first_of_faces_in_one_place_counts():
    corners = soup(40, 2, 11)
    twice = np.concatenate([corners, corners[:, [1, 2, 0]]])
    same = first_of_same(twice)
    np.testing.assert_array_equal(rasterised(SMALL, twice, same=same), rasterised(SMALL, corners))


def test_any_rows_have_the_faces_of_the_picture():
    camera, corners = CAMERAS["more rows of lenses than a group"], soup(200, 1, 12)
    views = parallel_views(camera.separable_rays(), camera.lenses, np.eye(4))
    some = Raster(views, corners, NONE)
    whole = some.faces(slice(0, 74))
    assert len(np.unique(whole)) > 20
    for rows in (slice(0, 1), slice(3, 6), slice(30, 35), slice(31, 74), slice(73, 74)):
        np.testing.assert_array_equal(some.faces(rows), whole[rows])


def test_lists_are_made_once_and_let_go_after_the_last_row(monkeypatch):
    """Two groups of rows of lenses, by tiles of five: one call counts, one lists; then nothing is held."""
    camera, calls = CAMERAS["more rows of lenses than a group"], []
    views = parallel_views(camera.separable_rays(), camera.lenses, np.eye(4))
    monkeypatch.setattr(raster, "list_faces", lambda *of: (calls.append(1), kernels.list_faces(*of)))
    picture = Raster(views, soup(200, 1.0, 2), NONE)
    for row in range(0, camera.pixels[1], 10):
        picture.faces(slice(row, min(row + 10, camera.pixels[1])))
    assert len(calls) == 2
    assert not picture._lists


def test_the_kernels_do_what_their_source_says(monkeypatch):
    camera, corners = IICamera(pixels=(24, 12), lenses=(6, 3), pixel_pitch_mm=0.1, gap_mm=2.0), soup(25, 1.5, 13)
    compiled = rasterised(camera, corners)
    for name in ("list_faces", "draw_faces", "read_faces"):
        monkeypatch.setattr(raster, name, getattr(kernels, name).py_func)
    np.testing.assert_array_equal(rasterised(camera, corners), compiled)
    assert len(np.unique(compiled)) > 5


def test_only_even_cameras_have_parallel_views():
    array = {"pixel_pitch_mm": 0.1, "gap_mm": 2.0}
    regular = {"pixels": (60, 40), "lenses": (15, 10), **array}
    others = [
        IICamera(**regular, viewer_mm=300.0),
        IICamera(pixels=(60, 40), lenses=(1, 1), **array),
        IICamera(pixels=(60, 4), lenses=(15, 1), **array),
        IICamera(**regular, lattice="hexagonal"),
        IICamera(**regular, optics=(optics.Pinhole(), optics.Lens(z_mm=4, focal_mm=50, diameter_mm=30))),
    ]
    for camera in others:
        rays = camera.separable_rays()
        assert rays is None or parallel_views(rays, camera.lenses, np.eye(4)) is None
    x, y, z = SMALL.separable_rays()
    assert parallel_views((x, y, z), SMALL.lenses, TURNED) is not None
    for row, column in ((7, 0), (7, 1)):
        moved = x.copy()
        moved[row, column] += 1e-5
        assert parallel_views((moved, y, z), SMALL.lenses, TURNED) is None


def traced(monkeypatch):
    """Have Embree find all hits."""
    monkeypatch.setattr(job.Job, "_strip", lambda *_: [])


def assert_alike(ours, theirs, ties):
    """Codes differ by one at most, but for so many ties between faces."""
    apart = np.abs(ours.picture.pixels.astype(int) - theirs.picture.pixels).max(axis=-1) > 1
    assert apart.sum() <= ties
    assert np.count_nonzero(ours.object_id != theirs.object_id) <= ties
    assert ours.stats.rays["primary"] == theirs.stats.rays["primary"]


@pytest.mark.parametrize(
    "name", first_fast(["cuboid", "apples", "twins", "car", "objects", "dolphin", "mountains", "hairdo"])
)
def test_pictures_are_those_of_embree(name, monkeypatch):
    scene, camera = load_scene(name), preset("setup1", scale=32)
    ours = render(scene, camera)
    traced(monkeypatch)
    assert_alike(ours, render(scene, camera), 3)


@pytest.mark.parametrize("samples", [2, 9])
def test_sets_of_samples_are_those_of_embree(samples, monkeypatch):
    scene, camera = hall(), preset("setup1", scale=32)
    ours = render(scene, camera, samples=samples)
    traced(monkeypatch)
    assert_alike(ours, render(scene, camera, samples=samples), 3)


def test_a_camera_in_any_pose_and_type_of_pixel(monkeypatch):
    scene, camera = hall(), preset("setup1", scale=64)
    ours = render(scene, camera, pose=TURNED, dtype="uint16")
    traced(monkeypatch)
    theirs = render(scene, camera, pose=TURNED, dtype="uint16")
    assert np.mean(ours.picture.pixels != theirs.picture.pixels) < 1e-3
    assert len(np.unique(ours.picture.pixels)) > 100


@pytest.mark.parametrize("samples", first_fast([1, 3]))
def test_same_bits_for_all_workers_tiles_and_rows(monkeypatch, samples):
    scene, camera = hall(), preset("setup1", scale=16)
    found = []
    faces = Raster.faces
    monkeypatch.setattr(Raster, "faces", lambda self, *rows: found.append(rows) or faces(self, *rows))
    whole = render(scene, camera, workers=1, samples=samples)
    assert len(found) == 2 * samples
    for workers, rays in ((3, 65536), (2, 500), (2, 3000), (1, 10**6)):
        monkeypatch.setattr(job, "TILE_RAYS", rays)
        again = render(scene, camera, workers=workers, samples=samples)
        for name in ("depth", "normal", "object_id"):
            np.testing.assert_array_equal(getattr(again, name), getattr(whole, name))
        np.testing.assert_array_equal(again.picture.pixels, whole.picture.pixels)
        assert again.stats.rays == whole.stats.rays


def test_pictures_of_few_pixels_and_many_faces_are_traced(monkeypatch):
    monkeypatch.undo()
    views = parallel_views(SMALL.separable_rays(), SMALL.lenses, np.eye(4))
    assert Raster(views, soup(300, 1, 0), NONE).pays
    assert not Raster(views, soup(4000, 1, 0), NONE).pays
    assert not Raster(views, soup(1500, 1, 0), NONE).pays  # many of which are seen
    assert Raster(views, soup(1500, 1, 0, (-40, -9)), NONE).pays  # and of which none is
