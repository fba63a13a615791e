"""Adaptive supersampling: positions, allocation, remaining error."""

import numpy as np
import pytest

from benchmarks.accuracy.sample_places import measured, squares
from ii_core import IICamera, preset
from ii_core.camera import optics
from raytrace_ii import Scene, render, trace
from raytrace_ii.rendering import job
from raytrace_ii.sampling import sample_kernels
from raytrace_ii.sampling.sample_places import MOST, doubling_places, fixed_places
from raytrace_ii.sampling.samples import EvenRays, camera_rays
from raytrace_ii.scene.textures import Checker, Noise
from raytrace_ii.tracing.kernels.lanes import work
from raytrace_ii.tracing.kernels.start import start_separable_rays
from raytrace_ii.tracing.tracer import start_tables
from tests.support.slow import first_fast
from tests.support.trace_scenes import BLACK, UNIFORM, WHITE, body, hall, sphere, wall

SMALL = preset("setup1", scale=64)  # 128×64 px, 8×4 lenses
ONE_LENS = IICamera(pixels=(24, 16), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=2.0)
CODES = job.CURVES["uint8"]
NO_TABLE, NO_LENS = np.empty((0, 2)), (0, 0)


def codes(linear):
    """8-bit sRGB, not rounded."""
    return np.interp(linear, np.linspace(0, 1, len(CODES)), CODES)


def adaptive(scene, camera, least=4, most=64, **more):
    return render(scene, camera, samples=(least, most), dtype="float32", **{"support": ("samples",), **more})


def half_plane(z=20.0):
    """White beside black, the border a slanted line through the picture's middle."""
    turned = body(wall(z, 100), turn=(0, 0, 20), colour=WHITE)
    half = type(wall(z))(turned.vertices + np.array([94, 34.2, 0]), turned.faces)
    return Scene(bodies=[body(half, colour=WHITE)], ambient=WHITE)


@pytest.mark.parametrize(("step", "n"), [(0.0, 16), (0.0, 64), (0.4, 16)])
def test_the_standard_error_is_that_of_four_independent_means(step, n):
    """s²/4 of the four, with three degrees of freedom; what a pixel beside its neighbours hides adds step²/n³."""
    means = np.array([0.1, 0.2, 0.3, 0.4])
    quarters, found = np.broadcast_to(means[:, None] * n / 4, (1, 4, 3)).copy(), np.empty(1)
    curve = np.linspace(0, 255, 256)
    sample_kernels.standard_errors(quarters, np.zeros(1, np.int64), np.full((1, 3), step), n, curve, found)
    assert found[0] == pytest.approx(255 * np.sqrt(means.var(ddof=1) / 4 + step**2 / n**3), rel=1e-9)


@pytest.mark.parametrize("pair", [0, 1])
def test_first_samples_of_every_power_of_two_lie_one_in_each_cell_of_every_grid(pair):
    m, n = np.array([3, 4, 8191]), np.array([5, 5, 77])
    for bits in range(9):
        out = np.empty((3 << bits, 2))
        sample_kernels.places(7, m, n, 8192, 0, 1 << bits, pair, NO_TABLE, NO_LENS, out)
        for points in out.reshape(3, -1, 2):
            assert (points >= 0).all() and (points < 1).all()
            for across in range(bits + 1):
                cells = (points * [1 << across, 1 << (bits - across)]).astype(int)
                assert len(np.unique(cells, axis=0)) == 1 << bits


def test_places_come_in_any_portions_and_differ_by_seed_pixel_and_pair():
    m, n = np.arange(40) % 8, np.arange(40) // 8

    def places(seed, first, count, pair):
        out = np.empty((40 * count, 2))
        sample_kernels.places(seed, m, n, 8, first, count, pair, NO_TABLE, NO_LENS, out)
        return out.reshape(40, count, 2)

    whole = places(1, 0, 16, 1)
    np.testing.assert_array_equal(whole[:, 5:11], places(1, 5, 6, 1))
    assert len(np.unique(whole[:, 0], axis=0)) == 40
    for other in (places(2, 0, 16, 1), places(1, 0, 16, 0)):
        assert (whole != other).mean() > 0.99
    # neither pair tells of the other: correlations of 640 places, five standard errors of 1/√640
    both = np.concatenate([places(1, 0, 16, 0), whole], axis=2).reshape(-1, 4)
    assert np.abs(np.corrcoef(both.T)[:2, 2:]).max() < 5 / np.sqrt(640)


def test_places_of_a_table_are_turned_or_mirrored_alike_for_all_samples_of_a_pixel():
    m, n, table = np.arange(400) % 20, np.arange(400) // 20, fixed_places(9)

    def places(seed, first, count):
        out = np.empty((400 * count, 2))
        sample_kernels.places(seed, m, n, 20, first, count, 0, table, NO_LENS, out)
        return out.reshape(400, count, 2)

    whole = places(1, 0, 9)
    np.testing.assert_array_equal(whole[:, 2:7], places(1, 2, 5))
    squares = [table, 1 - table, table * [-1, 1] + [1, 0], table * [1, -1] + [0, 1]]
    variants = np.array([*squares, *(square[:, ::-1] for square in squares)])
    far = np.abs(whole[:, None] - variants).max(axis=(2, 3))
    assert far.min(axis=1).max() < 1e-15
    # each an eighth of 400 pixels: 50 with a standard deviation of 6.6
    assert np.abs(np.bincount(far.argmin(axis=1), minlength=8) - 50).max() < 30
    assert (far.argmin(axis=1) != np.abs(places(2, 0, 9)[:, None] - variants).max(axis=(2, 3)).argmin(axis=1)).any()


@pytest.mark.parametrize("samples", first_fast(range(1, MOST + 1), 4))
def test_places_of_few_samples_miss_less_of_an_edge_than_the_sequence(samples):
    """Of edges of all angles 10 to 35 % less, root mean square; along rows and columns as well."""
    found = measured(samples, 200)
    assert (np.array(found["own"]) < np.multiply([0.9, 0.95], found["sequence"])).all()
    if samples in (4, 8, 16):
        assert (np.array(found["doubling"]) < np.multiply([0.95, 1.0], found["sequence"])).all()


@pytest.mark.slow
def test_error_of_an_edge_is_that_of_random_lines():
    """18 000 lines that meet the pixel: the mean of squares has a standard error of 1 %."""
    random, table = np.random.default_rng(0), fixed_places(4)
    angle, offset = random.uniform(0, np.pi, 20_000), random.uniform(-0.71, 0.71, 20_000)
    normal = np.stack([np.cos(angle), np.sin(angle)])
    fine = (np.stack(np.meshgrid(*[(np.arange(40) + 0.5) / 40] * 2), -1).reshape(-1, 2) - 0.5) @ normal < offset
    area, share = fine.mean(axis=0), ((table - 0.5) @ normal < offset).mean(axis=0)
    met = np.abs(offset) < np.abs(normal).sum(axis=0) / 2
    assert np.mean((share - area)[met] ** 2) == pytest.approx(squares(table)[0], rel=0.03)


def test_few_samples_lie_evenly_in_quarters_and_sixteenths_of_the_pixel():
    """So the packets of `near_together` are full."""
    for samples, parts in ((4, 2), (8, 2), (16, 4)):
        cells = (fixed_places(samples) * parts).astype(int) @ [1, parts]
        assert (np.bincount(cells, minlength=parts**2) == samples // parts**2).all()
    for four in doubling_places(MOST).reshape(4, 4, 2):
        assert sorted((four >= 0.5) @ [1, 2]) == [0, 1, 2, 3]
    assert len(fixed_places(MOST + 1)) == len(doubling_places(2 * MOST)) == 0


def test_edges_of_a_picture_have_less_error_than_by_the_sequence(monkeypatch):
    scene, truth = half_plane(), {"support": (), "dtype": "float32"}
    exact = render(scene, ONE_LENS, samples=1024, **truth).picture.pixels

    def error(samples, **wanted):
        pixels = render(scene, ONE_LENS, samples=samples, **wanted, **truth).picture.pixels
        return np.sqrt(np.mean((pixels - exact) ** 2))

    table = error(16), error((4, 16), error=0.1)
    for name in ("fixed_places", "doubling_places"):
        monkeypatch.setattr(f"raytrace_ii.sampling.samples.{name}", lambda samples: NO_TABLE)
    assert table[0] < 0.9 * error(16)
    assert table[1] < error((4, 16), error=0.1)


def test_sums_of_samples_are_those_in_their_order_to_the_bit():
    radiance = np.random.default_rng(3).random((60, 3), np.float32)
    total = np.ones((12, 3), np.float32)
    sample_kernels.sum_samples(radiance, 5, total)
    one_by_one = np.cumsum(radiance.reshape(12, 5, 3), axis=1, dtype=np.float32)[:, -1]
    np.testing.assert_array_equal(total, 1 + one_by_one)


@pytest.mark.parametrize(("count", "parts", "pixels"), [(16, 2, 4), (16, 4, 16), (4, 2, 16), (9, 2, 4), (1, 8, 3)])
def test_samples_of_a_part_stand_together_for_so_many_pixels(count, parts, pixels):
    many = 37  # the last group has fewer pixels
    places = np.random.default_rng(5).random((many, count, 2))
    places[0, 0] = 0.0, np.nextafter(1, 0)
    m, n = np.arange(2 * many, dtype=np.int32).reshape(2, many)
    order, columns, rows = np.empty((3, many * count), np.int32)
    sample_kernels.near_together(
        m, n, places, parts, pixels, order, columns, rows, within := np.empty(2 * many * count)
    )
    x, y = (places.reshape(-1, 2) * parts).astype(int).T
    group = np.arange(many * count) // count // pixels
    np.testing.assert_array_equal(order, np.lexsort((x, y, group)))
    np.testing.assert_array_equal([columns, rows], [m[order // count], n[order // count]])
    np.testing.assert_array_equal(within.reshape(-1, 2), places.reshape(-1, 2)[order])


def test_under_lenses_of_whole_pixels_columns_and_rows_mirror_the_places():
    """So the places of a sample under all lenses are one plane."""
    n, m = np.mgrid[:12, :20].astype(np.int32).reshape(2, -1)
    table, out = fixed_places(5), np.empty((240 * 5, 2))
    sample_kernels.places(3, m, n, 20, 0, 5, 0, table, (10, 6), out)
    found = out.reshape(2, 6, 2, 10, 5, 2)
    np.testing.assert_array_equal(found, np.broadcast_to(found[:1, :, :1], found.shape))
    for axis, of in ((0, found[0, 0, 0]), (1, found[0, :, 0, 0])):
        mirrored = [np.allclose(one[:, axis], 1 - table[:, axis], atol=1e-15) for one in of]
        assert all(m or np.array_equal(one[:, axis], table[:, axis]) for m, one in zip(mirrored, of, strict=True))
        assert 0 < sum(mirrored) < len(mirrored)


@pytest.mark.parametrize("start_mm", [0.0, 3.0])
def test_rays_by_columns_rows_and_places_are_those_of_the_camera(start_mm):
    camera = IICamera(pixels=(60, 40), lenses=(15, 10), pixel_pitch_mm=0.1, gap_mm=2.0, start_mm=start_mm)
    pose, random = np.eye(4), np.random.default_rng(1)
    pose[:3, :3] = [[0.96, 0, 0.28], [0, 1, 0], [-0.28, 0, 0.96]]
    pose[:3, 3] = 1.5, -0.7, -2
    even = EvenRays.of(camera, start_tables(camera.separable_rays(), pose), pose)
    m, n = (random.integers(0, size, 50, dtype=np.int32) for size in camera.pixels)
    within, (origins, directions) = random.random((50, 2)), np.empty((2, 50, 3), np.float32)
    start_separable_rays(camera_rays(even, m, n, within), work(), origins, directions)
    L, D, _ = camera.weighted_rays_at(m, n, within)
    np.testing.assert_allclose(origins, L @ pose[:3, :3].T + pose[:3, 3], rtol=3e-7, atol=1e-6)
    unit = D / np.linalg.norm(D, axis=1, keepdims=True)
    np.testing.assert_allclose(directions, unit @ pose[:3, :3].T, rtol=3e-7, atol=1e-7)


def test_a_flat_scene_stays_at_the_least():
    shot = adaptive(Scene(bodies=[body(wall(20, 100), colour=(0.3, 0.6, 0.9))], ambient=WHITE), SMALL)
    assert shot.stats.samples == {4: 128 * 64} and shot.stats.mean_samples == 4
    assert shot.stats.rays["primary"] == 4 * 128 * 64
    np.testing.assert_allclose(shot.picture.pixels[0, 0], (0.3, 0.6, 0.9), rtol=1e-6)


def test_an_edge_gets_the_most_and_its_surroundings_the_least():
    shot = adaptive(half_plane(), ONE_LENS, error=1.0)
    share = shot.picture.pixels[..., 0]
    edge = (share > 0.02) & (share < 0.98)
    assert edge.sum() > 10
    assert (shot.samples[edge] == 64).all()
    near = np.zeros_like(edge)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            near |= np.roll(edge, (i, j), (0, 1))
    assert (shot.samples[~near] == 4).mean() > 0.95, "away from the edge nothing is added"
    beside = near & ~edge
    assert (shot.samples[beside] > 4).mean() > 0.5, "next to it a second round looks for it"


def test_neighbours_under_another_lens_do_not_count():
    """Every elementary image is of one colour, the next of another: nothing differs under any one lens."""
    pitch = SMALL.lens_pitch_mm[0]
    board = wall(SMALL.gap_mm + 1e-3, 100)
    tiles = body(
        board, coordinates=board.vertices, colour=WHITE, texture=Checker((WHITE, BLACK), (pitch, pitch, 1000))
    )
    shot = adaptive(Scene(bodies=[tiles], ambient=WHITE), SMALL)
    assert len(np.unique(shot.picture.pixels)) == 2, "lenses alternate"
    assert shot.stats.samples == {4: 128 * 64}


@pytest.mark.slow
@pytest.mark.parametrize("which", ["hall", "noise"])
def test_pixels_that_stopped_are_within_the_target(which):
    """Against 400 samples, whose own error is about a tenth of a step."""
    scene, camera = hall(), IICamera(pixels=(64, 32), lenses=(8, 4), pixel_pitch_mm=0.78, gap_mm=11.7)
    if which == "noise":
        board = wall(30, 100)
        cloud = Noise(((0.2, 0.1, 0.05), (0.8, 0.9, 1.0)), (3, 3, 3), octaves=3)
        scene = Scene(bodies=[body(board, coordinates=board.vertices, colour=WHITE, texture=cloud)], ambient=WHITE)
    truth = codes(render(scene, camera, samples=400, seed=9, dtype="float32", support=()).picture.pixels)
    for error in (2.0, 4.0):
        shot = adaptive(scene, camera, most=256, error=error, seed=1)
        off = np.abs(codes(shot.picture.pixels) - truth).max(axis=-1)
        done = shot.samples < 256
        assert done.mean() > 0.5
        assert off[done].mean() < error and np.sqrt((off[done] ** 2).mean()) < 1.2 * error
        if which == "noise":  # its pixels are all alike: a fixed number of the same sequence does as well
            continue
        # and a fixed number that leaves as much error takes more samples
        fixed = render(scene, camera, samples=int(shot.stats.mean_samples), seed=1, dtype="float32", support=())
        rms = [np.sqrt(((codes(p) - truth) ** 2).mean()) for p in (shot.picture.pixels, fixed.picture.pixels)]
        assert rms[0] < rms[1]


def test_details_between_all_samples_are_missed():
    """The limit that the module states: a speck between all samples of a pixel and its neighbours."""
    speck = body(sphere(0.002, 24), at=(0.05, 0.05, 20), colour=BLACK)
    scene = Scene(bodies=[speck, body(wall(30, 500), colour=WHITE)], ambient=WHITE)
    assert set(adaptive(scene, ONE_LENS).stats.samples) == {4}


def test_aperture_and_pixel_are_sampled_together():
    """Out of focus an edge blurs over many pixels, which get more samples than with a pinhole."""
    lens = optics.Lenslet(focal_mm=1.2, aperture_mm=1.0)
    soft = IICamera(pixels=(24, 16), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=2.0, optics=(lens,))
    sharp_count = (adaptive(half_plane(), ONE_LENS).samples > 4).sum()
    shot = adaptive(half_plane(), soft)
    assert (shot.samples > 4).sum() > 1.5 * sharp_count
    truth = render(half_plane(), soft, samples=1024, seed=9, dtype="float32", support=()).picture.pixels
    off = np.abs(codes(shot.picture.pixels) - codes(truth)).max(axis=-1)
    # one pixel in a hundred stops too soon, where black and white fall alike into all four quarters
    assert off[shot.samples < 64].mean() < 0.5


HEXAGONAL = IICamera(pixels=(100, 61), lenses=(8, 5), pixel_pitch_mm=0.4, gap_mm=11.7, lattice="hexagonal")


@pytest.mark.parametrize("camera", first_fast([SMALL, HEXAGONAL, ONE_LENS]), ids=["regular", "hexagonal", "2d"])
def test_same_bits_for_any_workers_and_tiles(camera, monkeypatch):
    scene = hall()
    options = {"samples": (4, 16), "error": 2.0, "seed": 3, "support": ("samples", "depth", "ray_length")}
    whole = render(scene, camera, workers=1, **options)
    assert {4, 8, 16} == set(whole.stats.samples)
    for tile in (None, 300, 5000):
        if tile:
            monkeypatch.setattr(job, "TILE_RAYS", tile)
        other = render(scene, camera, workers=3, **options)
        np.testing.assert_array_equal(whole.picture.pixels, other.picture.pixels)
        for name in options["support"]:
            np.testing.assert_array_equal(getattr(whole, name), getattr(other, name))
        assert whole.stats.samples == other.stats.samples


def test_support_images_are_those_of_the_first_sample():
    scene = hall()
    shot = adaptive(scene, SMALL, seed=5, support=("depth", "normal", "object_id", "ray_length"))
    m, n = np.meshgrid(np.arange(128), np.arange(64))
    place = np.empty((128 * 64, 2))
    sample_kernels.places(5, m.ravel(), n.ravel(), 128, 0, 1, 0, NO_TABLE, NO_LENS, place)
    seen = trace(scene, *SMALL.rays(sample=place.reshape(64, 128, 2)))
    for name in ("depth", "normal", "object_id", "ray_length"):
        np.testing.assert_array_equal(getattr(shot, name).reshape(getattr(seen, name).shape), getattr(seen, name))


@pytest.mark.slow
def test_edges_with_an_aperture_are_adaptive_samples():
    soft = IICamera(
        pixels=(24, 16), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=2.0, optics=(optics.Lenslet(focal_mm=2.0),)
    )
    options = {"error": 2.0, "support": (), "seed": 5}
    shots = [render(half_plane(), soft, samples=samples, **options) for samples in ("edges", (4, 64))]
    np.testing.assert_array_equal(*(shot.picture.pixels for shot in shots))


@pytest.mark.parametrize(
    ("samples", "error", "says"),
    [
        ((4, 2), 0.5, r"samples is \(4, 2\): two powers of 2 are needed"),
        ((2, 16), 0.5, "at least 4"),
        ((4, 48), 0.5, "two powers of 2"),
        ((4, 8, 16), 0.5, "two powers of 2"),
        ((4, 16.0), 0.5, "samples is 16.0: a whole number"),
        ((4, 1 << 20), 0.5, "from 1 to 65536"),
        ((4, 16), 0.0, "error is 0.0: a positive number of 8-bit steps"),
        ((4, 16), float("nan"), "error is nan"),
        ("edges", 0.0, "error is 0.0: a positive number of 8-bit steps"),
        (4, 0.5, "error is 0.5, but the number of samples is fixed"),
        ("corners", 1.0, "samples is 'corners': a whole number, a pair of them or 'edges' is needed"),
    ],
)
def test_invalid_parameters_are_refused(samples, error, says):
    with pytest.raises(ValueError, match=says):
        render(Scene(bodies=[body(wall(5))], background=UNIFORM), ONE_LENS, samples=samples, error=error)


def test_an_error_alone_means_edges():
    alone, edges, one = (
        render(half_plane(), ONE_LENS, **how) for how in ({"error": 2}, {"samples": "edges", "error": 2}, {})
    )
    np.testing.assert_array_equal(alone.picture.pixels, edges.picture.pixels)
    assert alone.stats.mean_samples > one.stats.mean_samples == 1


def test_stored_maps_have_their_own_number(tmp_path):
    from ii_core import read_maps, write_maps

    write_maps([ONE_LENS], tmp_path, format="exr")
    with pytest.raises(ValueError, match=r"samples is \(4, 16\): the maps hold 1"):
        render(Scene(bodies=[body(wall(5))]), read_maps(tmp_path)[0], samples=(4, 16))
