"""Pictures with depth as scenes: from their own place they are the picture, from aside nothing is seen through."""

import numpy as np
import pytest

from ii_core.base.files import read_image, write_image
from raytrace_ii import rgbd_scene, trace
from raytrace_ii.files import rgbd
from raytrace_ii.files.rgbd import NEAREST_MM, thinned

FIELD = 70.0
SLOPE = np.tan(np.radians(FIELD / 2))
SIZE = 24, 32  # rows and columns
FRONT = np.s_[8:16, 10:20]  # of a square before a wall


def picture_and_depth(ratio=2.0):
    pixels, depth = np.full((*SIZE, 3), 0.2, np.float32), np.full(SIZE, 5 * ratio)
    pixels[FRONT], depth[FRONT] = 0.9, 5.0
    return pixels, depth


def rays(near, middle, offset=(0.25, 0.25), aside=0.0):
    """Rays through places in the pixels, from the camera's place or beside it; z of that place, and mm of a unit.

    The lenses of setup1 take 50×28 mm, and see 0.267 mm more to each side a mm farther.
    """
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    right = (2 * (x + offset[1]) / SIZE[1] - 1) * SLOPE
    up = (1 - 2 * (y + offset[0]) / SIZE[0]) * SLOPE * SIZE[0] / SIZE[1]
    directions = np.stack([right, up, np.ones_like(right)], axis=-1).reshape(-1, 3)
    sides = ((25, SLOPE), (14, SLOPE * SIZE[0] / SIZE[1]))
    unit = max((half + 0.267 * NEAREST_MM) / (middle * s - 0.267 * (middle - near)) for half, s in sides)
    back = NEAREST_MM - near * unit
    return np.broadcast_to([aside, 0, back], directions.shape), directions, back, unit


@pytest.mark.parametrize("offset", [(0.25, 0.25), (0.75, 0.25), (0.02, 0.97)])
def test_from_its_own_place_the_scene_is_picture_and_depth(offset):
    """The cut runs along the borders of pixels, all around the square, and no colour bleeds over it."""
    pixels, depth = picture_and_depth()
    origins, directions, back, unit = rays(5.0, 10.0, offset)
    seen = trace(rgbd_scene(pixels, depth, field_deg=FIELD), origins, directions)
    np.testing.assert_allclose(seen.depth.reshape(SIZE), back + unit * depth, rtol=1e-4)
    assert np.abs(seen.radiance.reshape(*SIZE, 3) - pixels).max() < 1e-3


def test_a_slanted_plane_comes_back_exactly():
    """1/z is linear over a picture of a plane, and so over triangles between the centres of its pixels."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    inverse = 0.1 + 0.001 * x + 0.002 * y
    nearest = np.quantile(1 / inverse, rgbd.NEAREST_SHARE, method="higher")
    origins, directions, back, unit = rays(nearest, np.median(1 / inverse), (0.3, 0.8))
    scene = rgbd_scene(np.full((*SIZE, 3), 99, np.uint8), 1 / inverse, field_deg=FIELD)
    expected = 1 / (0.1 + 0.001 * (x + 0.3) + 0.002 * (y - 0.2))
    inside = np.s_[1:-1, 1:-1]  # the outermost half pixel is flat
    found = (seen := trace(scene, origins, directions)).depth.reshape(SIZE)
    np.testing.assert_allclose(found[inside], (back + unit * expected)[inside], rtol=1e-4)
    assert len(scene.bodies) == 1 and np.ptp(seen.radiance) < 1e-6


@pytest.mark.parametrize("aside", [-6.0, 6.0])
def test_beside_the_near_the_wall_goes_on(aside):
    """From aside, rays past the square meet the wall where it was hidden, in its colour and at its depth."""
    pixels, depth = picture_and_depth()
    origins, directions, back, unit = rays(5.0, 10.0, (0.4, 0.6), aside)
    scene = rgbd_scene(pixels, depth, field_deg=FIELD)
    seen = trace(scene, origins, directions)
    z = seen.depth.reshape(SIZE)[:, 8:-8]  # the wall ends with the picture
    assert np.isfinite(z).all()
    near, far = back + 5 * unit, back + 10 * unit
    assert (np.isclose(z, near, rtol=1e-4) | np.isclose(z, far, rtol=1e-4)).all()
    hidden = np.zeros(SIZE, bool)
    hidden[FRONT] = True
    place = aside / (far - back) / SLOPE / 2 * SIZE[1] + np.mgrid[: SIZE[0], : SIZE[1]][1] + 0.6
    behind = np.isclose(seen.depth.reshape(SIZE), far, rtol=1e-4) & hidden[:, np.clip(place.astype(int), 0, 31)[0]]
    assert behind[9:15].any()
    np.testing.assert_allclose(seen.radiance.reshape(*SIZE, 3)[9:15][behind[9:15]], 0.2, atol=1e-3)


def test_what_is_unknown_infinite_or_too_near_gets_a_depth():
    pixels, depth = picture_and_depth()
    depth[0, :3], depth[-1, :3], depth[4, 4] = (0, np.nan, np.inf), 0, 1e-9
    scene = rgbd_scene(pixels, depth, field_deg=FIELD)
    z = np.concatenate([body.vertices[:, 2] for body in scene.bodies])
    _, _, back, unit = rays(5.0, 10.0)
    assert z.min() == pytest.approx(back + 5 * unit, rel=1e-3)
    assert z.max() == pytest.approx(back + rgbd.SKY * 10 * unit, rel=1e-3)


def test_a_map_without_a_scale_is_stretched_between_near_and_far():
    _, depth = picture_and_depth()
    same = rgbd_scene(np.zeros((*SIZE, 3), np.uint8), depth).bodies[0].vertices
    for low, high in ((0, 255), (-3.0, 9.0)):  # 1/z of the wall and of the square
        codes = np.where(depth == 5, high, low)
        found = rgbd_scene(np.zeros((*SIZE, 3), np.uint8), codes, inverse=2.0).bodies[0].vertices
        np.testing.assert_allclose(found, same, rtol=1e-6)


def test_large_maps_are_thinned():
    assert thinned(np.ones((1000, 2000))).shape == (1000, 2000)
    assert thinned(np.ones((3000, 4000))).size <= rgbd.MOST_PLACES


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"picture": np.zeros((4, 6))}, r"picture has the shape \(4, 6\)"),
        ({"depth": np.ones((4, 5))}, "depth has 5×4 pixels, the picture 6×4: not one frame"),
        ({"depth": np.ones(6)}, r"depth has the shape \(6,\)"),
        ({"depth": np.zeros((4, 6))}, "known nowhere"),
        ({"depth": -np.ones((4, 6))}, "negative somewhere"),
        ({"inverse": 2.0}, "depth holds one value: as 1/z, with inverse"),
        ({"inverse": 1.0, "depth": np.eye(4, 6)}, "inverse is 1.0"),
        ({"field_deg": 180.0}, "field_deg is 180"),
        ({"cut": 0.0}, "cut is 0"),
    ],
)
def test_wrong_input_is_named(change, says):
    with pytest.raises(ValueError, match=says):
        rgbd_scene(**{"picture": np.zeros((4, 6, 3), np.uint8), "depth": np.ones((4, 6)), **change})


def test_the_command_renders_it(run, refused, tmp_path):
    pixels, depth = picture_and_depth()
    write_image(tmp_path / "p.png", (pixels * 255).astype(np.uint8))
    write_image(tmp_path / "z.png", (depth * 1000).astype(np.uint16))
    given = ["render", "--rgbd", tmp_path / "p.png", tmp_path / "z.png", "--scale", 64]
    assert run(*given, "-o", tmp_path / "a.png")[0] == 0
    assert len(np.unique(read_image(tmp_path / "a.png"))) > 1
    refused(run(*given, "--rotate", "0,9,0", "-o", tmp_path / "b.png"), "does not use --rotate")
    refused(run("render", "car", "--inverse", 2, "-o", tmp_path / "b.png"), "a scene does not use --inverse")
    write_image(tmp_path / "z.png", np.zeros((3, 9), np.uint16))
    refused(run(*given, "-o", tmp_path / "b.png"), "p.png")
