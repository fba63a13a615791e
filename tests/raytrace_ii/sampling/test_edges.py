"""Samples by edges against closed forms: areas of polygons, lines, discs, checkers and a horizon, and equal bits."""

import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
import OpenImageIO as oiio
import pytest

from ii_core import IICamera, IIPicture, preset, read_maps, write_maps
from ii_core.base.colour import srgb
from raytrace_ii import Light, Scene, load_scene, render
from raytrace_ii.rendering import job
from raytrace_ii.rendering.render import render_to
from raytrace_ii.sampling.edges import SETS
from raytrace_ii.scene.textures import Checker
from raytrace_ii.shapes.primitives import Mesh
from raytrace_ii.tracing.support_images import name_hashes
from tests.support.trace_scenes import BLACK, WHITE, body, hall, wall

pytestmark = pytest.mark.slow  # the kernels compile in half a minute

SMALL = preset("setup1", scale=64)  # 128×64 px, 8×4 lenses
ONE_LENS = IICamera(pixels=(24, 16), lenses=(1, 1), pixel_pitch_mm=0.1, gap_mm=2.0)
HEXAGONAL = IICamera(pixels=(100, 61), lenses=(8, 5), pixel_pitch_mm=0.4, gap_mm=11.7, lattice="hexagonal")


def on_wall(corners, z=22.0, **material):
    """A polygon with corners in pixels of `ONE_LENS`, columns and rows from the left top, as a body at one z."""
    points = np.asarray(corners, float)
    scale = (z - 2) / 20
    vertices = np.column_stack([(12 - points[:, 0]) * scale, (points[:, 1] - 8) * scale, np.full(len(points), z)])
    fan = np.array([[0, k, k + 1] for k in range(1, len(points) - 1)])
    return body(Mesh(vertices, fan, None, None), **material)


def half(degrees, offset, far=60.0):
    """A square whose one side passes at a distance from pixel (12.2, 8.1)."""
    along, across = np.array([[np.cos(a), np.sin(a)] for a in (np.radians(degrees), np.radians(degrees + 90))])
    middle = np.array([12.2, 8.1]) + offset * across
    return [
        middle - far * along,
        middle + far * along,
        middle + far * (along + across),
        middle + far * (across - along),
    ]


def areas(polygon):
    """Share of each pixel of `ONE_LENS` within a convex polygon, by clipping it (Sutherland and Hodgman 1974)."""
    found = np.zeros((16, 24))
    for n, m in np.ndindex(16, 24):
        points = [np.asarray(p, float) for p in polygon]
        for axis, low, sign in ((0, m, 1), (0, m + 1, -1), (1, n, 1), (1, n + 1, -1)):
            kept = []
            for p, q in zip(points, points[1:] + points[:1], strict=True):
                a, b = sign * (p[axis] - low), sign * (q[axis] - low)
                kept += [p] if a >= 0 else []
                kept += [p + (q - p) * a / (a - b)] if (a >= 0) != (b >= 0) else []
            points = kept
        x, y = np.array([*points, *points[:1]]).T if points else (np.zeros(1), np.zeros(1))
        found[n, m] = abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2
    return found


def by_edges(scene, error=1.0, **more):
    return render(scene, ONE_LENS, samples="edges", error=error, dtype="float32", support=(), **more)


INNER = np.s_[1:-1, 1:-1]  # beyond the border of the picture edges are not known


@pytest.mark.parametrize("degrees", range(0, 180, 15))
def test_edges_of_half_planes_are_exact(degrees):
    for offset in (-0.37, 0.0, 0.21):
        polygon = half(degrees, offset)
        shot = by_edges(Scene(bodies=[on_wall(polygon, colour=WHITE)], ambient=WHITE), error=0.1)
        assert np.abs(shot.picture.pixels[..., 0] - areas(polygon))[INNER].max() < 1 / 512
        assert shot.stats.mean_samples < 4


SQUARE = [(8.3, 5.2), (16.4, 5.9), (15.8, 11.3), (7.9, 10.6)]
EDGE, UPPER = half(70, 0.1), [(-9, -9), (11.7, -9), (11.7, 8.4), (-9, 8.4)]
LOWER = [(11.7, -9), (40, -9), (40, 8.4), (11.7, 8.4)]
GREY = (0.2, 0.2, 0.2)
DISC = [(12.37 + 0.15 * np.cos(a), 8.42 + 0.15 * np.sin(a)) for a in 2 * np.pi * np.arange(24) / 24]


def shadowed(polygon):
    """A wall with the shadow of what stands beside the picture."""
    beside = on_wall(polygon, at=(12, 0, -10))
    return {
        "bodies": [body(wall(22), colour=WHITE), beside],
        "lights": [Light(kind="directional", vector=(-1.2, 0, 1), colour=WHITE)],
    }


@pytest.mark.parametrize(
    ("polygons", "made", "most"),
    [
        ([SQUARE], lambda p: {"bodies": [on_wall(p, emission=WHITE)]}, 0.06),
        (
            [EDGE],
            lambda p: {"bodies": [body(wall(22), mirror=WHITE), on_wall(p, 62, at=(0, 0, -80), emission=WHITE)]},
            0.012,
        ),
        (
            [EDGE],
            lambda p: {"bodies": [on_wall(p, 12, transmission=GREY, ior=1.0), body(wall(22), emission=WHITE)]},
            0.012,
        ),
        ([EDGE], shadowed, 0.012),
        ([UPPER, LOWER], lambda p, q: {"bodies": [on_wall(p, emission=WHITE), on_wall(q, emission=GREY)]}, 0.06),
        ([DISC], lambda p: {"bodies": [on_wall(p, emission=WHITE)]}, 0.4),
    ],
    ids=["corners", "mirror", "glass", "shadow", "junction", "disc of 0.3"],
)
@pytest.mark.filterwarnings("error")  # of a single open pixel, no pilots were left, and the mean of none was nan
def test_other_edges_have_the_light_of_their_areas(polygons, made, most):
    seen = by_edges(Scene(**made(*polygons))).picture.pixels[..., 0].astype(float)
    shares = [areas(polygon) for polygon in polygons]
    out = np.median(seen[sum(shares) == 0]) if (sum(shares) == 0).any() else 0.0
    light = out + sum(share * ((np.median(seen[share == 1]) if (share == 1).any() else 1) - out) for share in shares)
    off = np.abs(seen - light)[INNER] / np.ptp(light)
    assert off.max() < most
    assert np.sqrt(np.mean(off[(light != out)[INNER]] ** 2)) < most / 3


@pytest.mark.parametrize("camera", [SMALL, HEXAGONAL, ONE_LENS], ids=["regular", "hexagonal", "2d"])
def test_edges_are_the_same_bits_for_any_workers_and_kept_in_support(camera):
    scene = hall()
    options = {"samples": "edges", "error": 4.0, "support": ("samples", "depth", "object_id")}
    whole = render(scene, camera, workers=1, **options)
    other = render(scene, camera, workers=3, executor=None, **options)
    one = render(scene, camera, support=("depth", "object_id"))
    np.testing.assert_array_equal(whole.picture.pixels, other.picture.pixels)
    assert 1 < whole.samples.mean() < 40
    assert whole.samples.sum() == sum(n * pixels for n, pixels in whole.stats.samples.items())
    calm = whole.samples == 1
    # some have corners that are known without a ray of their own
    apart = whole.picture.pixels[calm].astype(int) - one.picture.pixels[calm]
    assert (apart == 0).mean() > 0.97 and np.sqrt(np.mean(apart**2)) < 1
    for name in ("depth", "object_id"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(one, name))


def test_tiles_of_fine_structure_have_the_sets_of_fixed_numbers():
    """Two numbers in turn, and in the blocks that told, a ray more and pilots."""
    scene, camera = load_scene("cuboid"), preset("setup1", scale=32)
    shot = render(scene, camera, samples="edges", error=4.0, support=("samples",))
    numbers, times = np.unique(shot.samples, return_counts=True)
    two = np.sort(numbers[np.argsort(times)[-2:]])
    assert two[0] in SETS
    assert two[1] in (SETS[np.searchsorted(SETS, two[0]) + 1], two[0] + 1)
    assert times.max() > 0.4 * shot.samples.size
    for number in set(two.tolist()) & set(SETS.tolist()):
        fixed, those = render(scene, camera, samples=number).picture.pixels, shot.samples == number
        off = np.abs(fixed[those].astype(int) - shot.picture.pixels[those])
        assert off.max() <= 1, "rounding of the mean alone"


@pytest.mark.parametrize("side", [0.05, 0.1, 0.3, 0.7, 2.0])
def test_small_bodies_are_all_found_by_edges(side):
    """Squares of 6·4 places in the pixels: 64 samples a pixel would lose five of six of the smallest."""
    offsets = np.random.default_rng(4).random((24, 2))
    bodies, squares = [], []
    for (row, column), offset in zip(np.ndindex(4, 6), offsets, strict=True):
        low = np.array([2.0 + 3.4 * column, 1.5 + 3.4 * row]) + offset
        squares.append([low + side * np.array(corner) for corner in ((0, 0), (1, 0), (1, 1), (0, 1))])
        bodies.append(on_wall(squares[-1], name=f"{row} {column}", emission=WHITE))
    seen = by_edges(Scene(bodies=bodies), error=2.0).picture.pixels[..., 0]
    assert seen.sum() == pytest.approx(24 * side**2, rel=0.05)
    assert all(seen[areas(square) > 0].sum() > 0 for square in squares)


def codes(linear):
    return 255 * srgb(np.clip(np.asarray(linear, float), 0, 1))


def strip(degrees, offset, width, far=60.0):
    """A line through the picture at a distance from pixel (12.2, 8.1)."""
    low, high = (half(degrees, offset + end) for end in (-width / 2, width / 2))
    return [low[0], low[1], high[1], high[0]]


@pytest.mark.parametrize(
    ("width", "least", "most"), [(0.1, 0.95, 1.05), (0.3, 0.98, 1.02), (0.7, 0.98, 1.02)], ids=["0.1", "0.3", "0.7"]
)
def test_lines_thinner_than_a_pixel_have_their_light(width, least, most):
    """At angles along which a line meets no centre and no corner, too; wider ones are two edges in a pixel."""
    found = area = 0.0
    for degrees in (0, 37, 70, 135):
        for offset in (-0.37, 0.1, 0.21):
            line = strip(degrees, offset, width)
            seen = by_edges(Scene(bodies=[on_wall(line, emission=WHITE)]), error=2.0).picture.pixels[..., 0]
            found, area = found + seen[INNER].sum(), area + areas(line)[INNER].sum()
            assert (seen[areas(line) > 0.6 * width] > 0).mean() > 0.9, "it has no gaps"
    assert least < found / area < most


def test_a_thin_bent_body_is_followed_from_where_it_is_met():
    """No rod is around it. A line of 0.3 pixels, along a circle: 96 pieces, each within 1/200 pixel of the circle."""
    turn = 2 * np.pi * np.arange(96) / 96
    rings = [np.array([12.2, 8.1]) + r * np.stack([np.cos(turn), np.sin(turn)], axis=1) for r in (5.85, 6.15)]
    flat = on_wall(np.concatenate(rings), emission=WHITE)
    i, after = np.arange(96), (np.arange(96) + 1) % 96
    faces = np.concatenate([np.stack([i, after, i + 96], 1), np.stack([after, after + 96, i + 96], 1)])
    seen = by_edges(Scene(bodies=[replace(flat, faces=faces)]), error=2.0).picture.pixels[..., 0]
    assert seen.sum() == pytest.approx(np.pi * (6.15**2 - 5.85**2), rel=0.04)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, 0.2), (0.5, 0.37)], ids=str)
def test_checkers_of_one_texel_a_pixel_are_mixed_by_area(shift):
    board = wall(22, 100)
    place = board.vertices + np.array([400 + shift[0], 400 + shift[1], 0])
    checks = body(board, coordinates=place, colour=WHITE, texture=Checker((WHITE, BLACK), (1, 1, 1000)))
    seen = by_edges(Scene(bodies=[checks], ambient=WHITE), error=2.0).picture.pixels[..., 0].astype(float)
    a, b = shift
    share = (1 - a) * (1 - b) + a * b
    even = np.add.outer(np.arange(16), np.arange(24)) % 2 == 0
    true = np.where(even, share, 1 - share) if abs(seen[0, 0] - share) < 0.1 else np.where(even, 1 - share, share)
    assert np.sqrt(np.mean((codes(seen) - codes(true)) ** 2)) < 2.4


def test_the_horizon_of_a_striped_plane_has_the_mean_of_its_stripes():
    """Slanted stripes, seen from 2 mm above, ever narrower up to row 8; by 32×32 places of each pixel."""
    corners = np.array([[-1e4, -2, 3], [1e4, -2, 3], [1e4, -2, 1e5], [-1e4, -2, 1e5]], float)
    across = corners[:, 2] + 0.3 * corners[:, 0]
    place = np.column_stack([np.full((4, 2), 0.5), across])
    plane = Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]]), None, None)
    stripes = body(plane, coordinates=place, colour=WHITE, texture=Checker((WHITE, GREY), (1, 1, 4)))
    seen = by_edges(Scene(bodies=[stripes], ambient=WHITE), error=2.0).picture.pixels[..., 0].astype(float)
    rows, columns = (np.arange(8 * 32) + 0.5) / 32, (np.arange(24 * 32) + 0.5) / 32
    ahead = 40 / (8 - rows)[:, None]
    stripe = np.floor((2 + ahead + 0.3 * (12 - columns) * ahead / 20) / 4) % 2
    light = np.where(stripe == 0, 1.0, GREY[0]).reshape(8, 32, 24, 32).mean(axis=(1, 3))
    off = (codes(seen[:8]) - codes(light))[:, 1:-1]
    assert np.sqrt(np.mean(off[:5] ** 2)) < 2.2
    assert np.abs(off.mean(axis=1)).max() < 8, "where a pixel has several stripes, corners and centre agree by chance"
    assert seen[8:].max() == 0


def test_a_moving_body_has_the_light_of_its_area_in_every_frame():
    """A triangle that moves by an eighth of a pixel a frame: its light does not flicker."""
    for frame in range(8):
        moved = [np.array(p) + frame * np.array([0.125, 0.07]) for p in ((6.1, 4.3), (17.2, 6.1), (9.4, 12.2))]
        seen = by_edges(Scene(bodies=[on_wall(moved, emission=WHITE)]), error=1.0).picture.pixels[..., 0]
        assert seen.sum() == pytest.approx(areas(moved).sum(), rel=0.006)


def test_edges_beyond_the_border_of_a_lens_are_found():
    """A body whose side lies in the outer half of the border pixels of every lens, but meets no centre."""
    low, high = 0.3, 23.7
    frame = [(low, low), (high, low), (high, 16 - low), (low, 16 - low)]
    seen = by_edges(Scene(bodies=[on_wall(frame, emission=WHITE)])).picture.pixels[..., 0]
    np.testing.assert_allclose(seen, areas(frame), atol=0.03)


def test_a_lens_of_more_pixels_than_a_tile_is_one_tile(monkeypatch):
    options = {"samples": "edges", "error": 4.0, "support": ("coverage",), "workers": 1}
    whole = render(hall(), SMALL, **options)
    monkeypatch.setattr(job, "TILE_RAYS", 200)
    tiled = render(hall(), SMALL, **options)
    np.testing.assert_array_equal(tiled.coverage, whole.coverage)
    off = tiled.picture.pixels.astype(int) - whole.picture.pixels
    assert np.sqrt(np.mean(off**2)) < 4


def test_processes_and_files_have_the_same_bits(tmp_path):
    camera, scene, options = preset("setup1", scale=32), hall(), {"samples": "edges", "error": 4.0}
    whole = render(scene, camera, workers=1, support=(), **options)
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("forkserver")) as pool:
        other = render(scene, camera, executor=pool, support=(), **options)
    np.testing.assert_array_equal(whole.picture.pixels, other.picture.pixels)
    render_to(tmp_path / "p.png", scene, camera, workers=2, **options)
    np.testing.assert_array_equal(whole.picture.pixels, IIPicture.load(tmp_path / "p.png").pixels)


@pytest.mark.parametrize("degrees", [0, 20, 70])
def test_coverage_is_the_area_of_bodies_and_the_sky_has_the_rest(degrees):
    polygon = half(degrees, 0.1)
    bodies = [on_wall(polygon, name="half"), on_wall(UPPER, z=30.0, name="behind")]
    alone = render(Scene(bodies=bodies[:1]), ONE_LENS, support=("coverage",)).coverage
    np.testing.assert_allclose(alone[..., 0], areas(polygon), atol=1 / 512)
    shot = render(Scene(bodies=bodies), ONE_LENS, support=("coverage",))
    near, behind = areas(polygon), areas(UPPER)
    hashes = name_hashes(["half", "behind"]).view(np.float32)
    shares = [np.where(shot.coverage[..., 1::2] == one, shot.coverage[..., 2::2], 0).sum(axis=-1) for one in hashes]
    np.testing.assert_allclose(shares[0], near, atol=0.03)  # with three bodies in a pixel it is sampled
    np.testing.assert_allclose(shares[1][near == 0], behind[near == 0], atol=0.03)
    np.testing.assert_allclose(shot.coverage[..., 0], sum(shares), atol=1e-6)
    assert (np.diff(shot.coverage[..., 2::2], axis=-1) <= 0).all(), "the largest share first"


def test_coverage_in_a_file_is_a_cryptomatte(tmp_path):
    """Hashes of names as in the sample files of the specification or, if a bit is flipped, by mmh3 5.3.1 and Psyop's
    reader; and what OpenImageIO reads."""
    known = {"равнина": "9623511e", 'name containing a "quote"  ': "af8bfa09", "ball_asset": "79b62f5e"}
    known |= {"toroidal_asset": "1539c043", "rect_[_top": "c1fa3f1f", "name, with, comma": "62fa4db8"}
    known |= {"n17": "008738c5", "n132": "80ad7680", "n535": "ff0d97ef", "n752": "7f1513e2"}
    assert [f"{value:08x}" for value in name_hashes([*known])] == [*known.values()]
    scene, path = hall(), tmp_path / "c.exr"
    shot = render(scene, SMALL, support=("coverage",), workers=1)
    render_to(None, scene, SMALL, support={"coverage": path}, workers=3)
    file = oiio.ImageInput.open(str(path))
    spec = file.spec()
    assert spec.channelnames[:5] == ("A", *(f"CryptoObject00.{c}" for c in "RGBA"))
    np.testing.assert_array_equal(file.read_image("float"), shot.coverage)
    (key,) = {a.name.rpartition("/")[0] for a in spec.extra_attribs if a.name.startswith("cryptomatte/")}
    assert (len(key), spec[f"{key}/name"]) == (len("cryptomatte/") + 7, "CryptoObject")
    assert (spec[f"{key}/hash"], spec[f"{key}/conversion"]) == ("MurmurHash3_32", "uint32_to_float32")
    assert np.abs(shot.coverage[..., 2::2].sum(axis=-1) - shot.coverage[..., 0]).max() < 1e-6
    names = {np.uint32(int(v, 16)).view(np.float32): k for k, v in json.loads(spec[f"{key}/manifest"]).items()}
    sure = shot.coverage[..., 2] == 1
    found = [names[value] for value in shot.coverage[sure][:, 1]]
    centres = np.array(shot.object_names)[render(scene, SMALL).object_id[sure]]
    assert (found == centres).mean() > 0.999


def test_any_positive_error_makes_a_picture():
    scene = Scene(bodies=[on_wall(SQUARE, emission=WHITE)])
    coarse, fine = (by_edges(scene, error=error).picture.pixels for error in (1e300, 1e-300))
    np.testing.assert_array_equal(coarse, render(scene, ONE_LENS, dtype="float32").picture.pixels)
    assert np.abs(fine[..., 0] - areas(SQUARE))[INNER].max() < 0.01


def test_coverage_of_stored_maps_is_refused(tmp_path):
    write_maps([ONE_LENS], tmp_path, format="exr")
    with pytest.raises(ValueError, match="coverage: stored maps have no rays between those of pixels"):
        render(Scene(bodies=[body(wall(5))]), read_maps(tmp_path)[0], support=("coverage",))
