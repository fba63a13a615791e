"""View images: geometry, interpolation, refocusing."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ii_core import (
    IICamera,
    IIPicture,
    depth_of_disparity,
    disparity_of_depth,
    five_viewpoints,
    orthoscopic,
    preset,
    refocus,
    view_image,
)
from ii_core.camera.optics import Grin
from ii_core.formats.quilt import quilt_path
from ii_core.picture.assumed import with_assumed_camera
from ii_core.picture.view import lens_array_mm, view_positions

CAMERA = IICamera(pixels=(42, 30), lenses=(7, 5), pixel_pitch_mm=0.25, gap_mm=2.0)  # 6×6 px under each lens
VIEWPOINTS = [
    (0.0, 0.0, -150.0),
    (1.3, -0.7, -20.0),
    (-9.1, 6.3, -33.0),
    (25.0, 11.0, -40.0),  # the side viewing zone, and beyond the picture
    (0.21, 0.17, 1.2),  # before the lenses, within the display
]


def coded(camera=CAMERA, dtype="uint8"):
    """Red is the pixel's column, green its row."""
    width, height = camera.pixels
    pixels = np.zeros((height, width, 3), dtype)
    pixels[..., 0], pixels[..., 1] = np.arange(width), np.arange(height)[:, None]
    pixels[..., 2] = 7
    return IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)


def seen(camera, viewpoint):
    """(m, n) under the line from a viewpoint through each lens where it meets the pixel plane z = 0."""
    (width, height), pitch = camera.size_mm, camera.pixel_pitch_mm
    u, v = camera.ei_pixels
    found = np.empty((*camera.lenses[::-1], 2), int)
    lenses, _ = camera.rays()
    e = np.asarray(viewpoint)
    for l in range(camera.lenses[1]):
        for k in range(camera.lenses[0]):
            lens = lenses[l * v, k * u]
            x, y, z = e + (lens - e) * e[2] / (e[2] - lens[2])
            assert abs(z) < 1e-12
            found[l, k] = math.floor((x + width / 2) / pitch), math.floor((height / 2 - y) / pitch)
    return found


def check_picked(view, valid, found, camera=CAMERA):
    inside = ((found >= 0) & (found < camera.pixels)).all(axis=-1)
    np.testing.assert_array_equal(valid, inside)
    np.testing.assert_array_equal(view[inside, :2], found[inside])
    assert (view[inside, 2] == 7).all() and (view[~inside] == 0).all()


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
def test_nearest_picks_the_pixel_on_the_line(viewpoint):
    view, valid = view_image(coded(), viewpoint, interpolation="nearest")
    assert view.shape == (5, 7, 3) and view.dtype == np.uint8 and valid.dtype == bool
    check_picked(view, valid, seen(CAMERA, viewpoint))


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
def test_picked_pixels_look_along_the_line(viewpoint):
    """By rays: no ray of the lens's own elementary image lies closer to the line, if the lens shows its own image."""
    view, valid = view_image(coded(), viewpoint, interpolation="nearest")
    L, D = CAMERA.rays()
    for l in range(5):
        for k in range(7):
            m, n = int(view[l, k, 0]), int(view[l, k, 1])
            if not valid[l, k] or (m // 6, n // 6) != (k, l):
                continue
            block = slice(6 * l, 6 * l + 6), slice(6 * k, 6 * k + 6)
            wanted = (L[n, m] - viewpoint) / (2.0 - viewpoint[2])
            off = np.hypot(*np.moveaxis((D / D[..., 2:] - wanted)[(*block, slice(2))], -1, 0))
            assert off[n % 6, m % 6] <= off.min() + 1e-12  # straight on, four are equally close


def test_signs_by_hand():
    # The pixels lie between viewer and lenses: from the right and above, a lens shows one to its right and above.
    view, _ = view_image(coded(), (3.0, 3.0, -20.0), interpolation="nearest")
    assert view[2, 3, 0] > 3 * 6 + 2.5 and view[2, 3, 1] < 2 * 6 + 2.5
    # From the front the same holds: a lens on the left has the viewer on its right.
    front, _ = view_image(coded(), (0.0, 0.0, -20.0), interpolation="nearest")
    assert front[2, 0, 0] > 2.5 > front[2, 6, 0] - 36.0
    assert front[0, 3, 1] > 2.5 > front[4, 3, 1] - 24.0


def test_side_viewing_zone_shows_the_neighbours_image():
    # One lens pitch of offset on the sensor: (Lx − Ex)·Λ/(Λ − Ez) = −δL for the middle lens.
    ez = -18.0
    view, valid = view_image(coded(), (1.5 * (2 - ez) / 2 + 0.1, 0.1, ez), interpolation="nearest")
    assert view[2, 3, 0] // 6 == 4 and valid[2, 3]
    assert not valid[:, 6].any()  # the last lens's neighbour is beyond the picture


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
def test_erect_pictures_are_seen_from_the_mirrored_viewpoint(viewpoint):
    # D of an erect image is mirrored in x and y: the line is that from its mirror image in the lens plane.
    picture = IIPicture(coded().pixels, CAMERA.lenses, CAMERA.ei_pixels, CAMERA, erect=True)
    view, valid = view_image(picture, viewpoint, interpolation="nearest")
    x, y, z = viewpoint
    check_picked(view, valid, seen(CAMERA, (x, y, 2 * CAMERA.gap_mm - z)))


@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_turning_every_image_changes_nothing_that_is_seen(interpolation):
    rng = np.random.default_rng(0)
    source = coded().with_pixels(rng.random((30, 42, 3)).astype(np.float32))
    viewpoint = (1.3, -0.7, -150.0)  # every lens shows its own image
    expected, _ = view_image(source, viewpoint, interpolation=interpolation)
    turned, valid = view_image(orthoscopic(source), viewpoint, interpolation=interpolation)
    assert valid.all()
    # The weights of the two pixels trade places: one rounding of float32.
    np.testing.assert_allclose(turned, expected, rtol=1e-6)


def test_orthoscopic_turns_each_image_and_back():
    source = coded()
    turned = orthoscopic(source)
    for l in range(5):
        for k in range(7):
            block = slice(6 * l, 6 * l + 6), slice(6 * k, 6 * k + 6)
            np.testing.assert_array_equal(turned.pixels[block], source.pixels[block][::-1, ::-1])
    assert turned.erect and turned.camera is CAMERA
    back = orthoscopic(turned)
    np.testing.assert_array_equal(back.pixels, source.pixels)
    assert not back.erect


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
def test_linear_reproduces_a_ramp_inside_each_image(viewpoint):
    u, v = np.arange(42) % 6, np.arange(30) % 6
    pixels = np.zeros((30, 42, 3), np.float32)
    pixels[..., 0], pixels[..., 1] = u, v[:, None]
    pixels[..., 2] = np.arange(42) // 6 + 10 * (np.arange(30) // 6)[:, None]  # which image it is
    view, valid = view_image(coded().with_pixels(pixels), viewpoint)
    x, y = view_positions(CAMERA, viewpoint)
    m, n = np.floor(x + 0.5), np.floor(y + 0.5)
    column, row = np.clip(x - m // 6 * 6, 0, 5), np.clip(y - n // 6 * 6, 0, 5)  # never across a border
    expected = np.stack(np.broadcast_arrays(column, row[:, None], m // 6 + 10 * (n // 6)[:, None]), -1)
    assert valid.any()
    # Stored in float32, of values below 100.
    np.testing.assert_allclose(view[valid], expected[valid], atol=1e-5)


def test_linear_rounds_whole_types():
    half = IICamera(pixels=(2, 1), lenses=(1, 1), pixel_pitch_mm=1, gap_mm=1)
    for dtype, peak in (("uint8", 255), ("uint16", 65535)):
        pixels = np.array([[[0, 10, peak], [peak, 13, peak]]], dtype)
        view, _ = view_image(IIPicture(pixels, (1, 1), (2, 1), half), (0, 0, -5))
        assert view.dtype == dtype
        assert view[0, 0].tolist() == [round(peak / 2), 12, peak]  # halves go to the even


def test_ties_go_right_and_down():
    # An even image seen straight on: the line ends on the corner of four pixels.
    camera = IICamera(pixels=(4, 4), lenses=(1, 1), pixel_pitch_mm=1, gap_mm=1)
    for erect in (False, True):
        picture = IIPicture(coded(camera).pixels, (1, 1), (4, 4), camera, erect)
        view, valid = view_image(picture, (0, 0, -7), interpolation="nearest")
        assert view[0, 0, :2].tolist() == [2, 2] and valid.all()
    # On the picture's own left edge the pixel still is one, on its right edge there is none.
    x, _ = view_positions(camera, (-4, 0, -1))
    assert x[0] == -0.5
    assert view_image(coded(camera), (-4, 0, -1), interpolation="nearest")[1].all()
    assert not view_image(coded(camera), (4, 0, -1), interpolation="nearest")[1].any()


@pytest.mark.parametrize(
    ("viewpoint", "message"),
    [
        ((0, 0), "viewpoint_mm is .*: 3 numbers from -1e.15 to 1e.15 mm are needed"),
        ((0, 0, math.nan), "viewpoint_mm is .*nan.*: 3 numbers"),
        ((math.inf, 0, -1), "viewpoint_mm is .*inf.*: 3 numbers"),
        ((0, 0, 2.0), "viewpoint z 2 mm is not before the lens plane at 2 mm"),
        ((0, 0, 5.0), "viewpoint z 5 mm"),
    ],
)
def test_invalid_viewpoints_are_refused(viewpoint, message):
    with pytest.raises(ValueError, match=message):
        view_image(coded(), viewpoint)


def test_refusals():
    with pytest.raises(ValueError, match="unknown interpolation 'cubic': known are linear, nearest"):
        view_image(coded(), (0, 0, -9), interpolation="cubic")
    bare = IIPicture(coded().pixels, CAMERA.lenses, CAMERA.ei_pixels)
    for look in (lambda: view_image(bare, (0, 0, -9)), lambda: refocus(bare, 10)):
        with pytest.raises(ValueError, match="no camera"):
            look()
    with pytest.raises(ValueError, match=r"depth_mm 1\.9 is not beyond the lens plane at 2 mm"):
        refocus(coded(), 1.9)
    for depth in (math.inf, math.nan, -1e10):
        with pytest.raises(ValueError, match=re.escape(f"depth_mm is {depth:g}: a depth from -1e+09 to 1e+09 mm")):
            refocus(coded(), depth)


def check_five(camera):
    views = five_viewpoints(camera)
    assert list(views) == ["front", "up", "down", "left", "right"]
    (u, v), (k, l) = camera.ei_pixels, camera.lenses
    for erect in (False, True):
        for viewpoint in views.values():
            x, y = view_positions(camera, viewpoint, erect=erect)
            # every lens shows its own elementary image; a billionth of a pixel for rounding
            assert (abs(x - (np.arange(k) * u + (u - 1) / 2)) <= u / 2 + 1e-9).all()
            assert (abs(y - (np.arange(l) * v + (v - 1) / 2)) <= v / 2 + 1e-9).all()
    centre = np.array([0, 0, camera.gap_mm])
    distances = [np.linalg.norm(view - centre) for view in views.values()]
    assert distances == pytest.approx([distances[0]] * 5, rel=1e-12)  # all at r: sin² + cos² = 1
    assert views["front"][0] == views["front"][1] == 0 and views["front"][2] < 0
    assert views["left"][0] == -views["right"][0] <= 0 <= views["up"][1] == -views["down"][1]
    return views


@pytest.mark.parametrize(
    "name", ("setup1", "setup2-16", "setup2-32", "setup2-64", "setup2-128", "setup2-256", "setup3", "pinhole2d")
)
@pytest.mark.parametrize("scale", [1, 16])
def test_five_viewpoints_of_the_presets(name, scale):
    views = check_five(preset(name, scale=scale))
    # The side views look from well to the side: more than a third of half the viewing angle, 15°.
    assert -math.degrees(math.atan2(views["left"][0], -views["left"][2])) > 5 or name == "pinhole2d"
    assert views["left"][0] < 0 < views["up"][1]


@settings(max_examples=100, deadline=None)
@given(
    k=st.integers(1, 40),
    l=st.integers(1, 40),
    u=st.integers(1, 12),
    v=st.integers(1, 12),
    gap=st.floats(0.5, 20),  # lens pitches: half viewing angles up to 45°
)
def test_five_viewpoints_of_any_camera(k, l, u, v, gap):
    check_five(IICamera(pixels=(k * u, l * v), lenses=(k, l), pixel_pitch_mm=0.01, gap_mm=gap * max(u, v) * 0.01))


# A textured plane, seen through every ray.
REFOCUS = IICamera(pixels=(150, 110), lenses=(30, 22), pixel_pitch_mm=0.2, gap_mm=1.5)  # 5×5 px, lenses 1 mm apart


def texture(x, y):
    """Periods of 4.4, 6.3 and 5.2 mm: more than four lenses each."""
    waves = np.sin(2 * np.pi * x / 4.4), np.sin(2 * np.pi * y / 6.3), np.cos(2 * np.pi * (0.6 * x + 0.8 * y) / 5.2)
    return 0.5 + 0.4 * np.stack(waves, axis=-1)


def plane(z, camera=REFOCUS):
    L, D = camera.rays()
    hit = L + D * ((z - L[..., 2:]) / D[..., 2:])
    np.testing.assert_allclose(hit[..., 2], z, rtol=1e-12)
    return IIPicture(texture(hit[..., 0], hit[..., 1]).astype(np.float32), camera.lenses, camera.ei_pixels, camera)


def at_lenses(camera=REFOCUS):
    L, _ = camera.rays()
    u, v = camera.ei_pixels
    return texture(L[::v, ::u, 0], L[::v, ::u, 1])


@pytest.mark.parametrize("steps", [0, 1, 2])
@pytest.mark.parametrize("erect", [False, True])
def test_refocus_on_the_plane_is_the_texture(steps, erect):
    # z = Λ + s·Λ·U: sub-images shift by s whole lenses a step, nothing is interpolated.
    z = 1.5 + steps * 1.5 * 5
    picture = plane(z)
    sharp = refocus(orthoscopic(picture) if erect else picture, z)
    assert sharp.shape == (22, 30, 3) and sharp.dtype == np.float32
    # Shifts that are whole up to float64 rounding, pixels stored in float32.
    np.testing.assert_allclose(sharp, at_lenses(), atol=1e-6)


@pytest.mark.parametrize("z", [4.0, 6.5, 11.3])
def test_refocus_between_lenses_is_the_texture_within_interpolation(z):
    # Linear interpolation errs by at most h²/8·max|f''| an axis: 0.4·(2π/4.4)²/8 = 0.10; the mean over shifts less.
    np.testing.assert_allclose(refocus(plane(z), z), at_lenses(), atol=0.10)


def test_refocus_on_another_plane_is_not_the_texture():
    error = {z: np.abs(refocus(plane(9.0), z) - at_lenses())[4:-4, 4:-4].mean() for z in (9.0, 16.5, 24.0)}
    # Five sub-images spread over a whole period average it away: what is missing is the texture, mean |0.4 sin|.
    assert error[9.0] < 1e-6
    assert error[16.5] > 0.1 and error[24.0] > 0.2


def test_refocus_keeps_code_values_and_even_images():
    camera = IICamera(pixels=(40, 24), lenses=(10, 6), pixel_pitch_mm=0.2, gap_mm=1.5)
    for dtype, value in (("uint8", 200), ("uint16", 50000)):
        picture = IIPicture(np.full((24, 40, 3), value, dtype), (10, 6), (4, 4), camera)
        for z in (1.5, 5.0, 12.0):
            np.testing.assert_allclose(refocus(picture, z), value, rtol=1e-6)  # a mean of equals, in float32


def test_a_shifted_array_shows_the_same_to_a_shifted_viewer():
    here = preset("setup1", scale=32)
    origin = (3.0, -2.0, 0.5)
    there = replace(here, origin_mm=origin)
    pixels = np.random.default_rng(5).integers(0, 256, (*here.pixels[::-1], 3), np.uint8)
    a, b = (IIPicture(pixels, c.lenses, c.ei_pixels, c) for c in (here, there))
    for name, viewpoint in five_viewpoints(here).items():
        np.testing.assert_allclose(five_viewpoints(there)[name], viewpoint + origin, rtol=1e-12)  # one sum apart
        for one, other in zip(view_image(a, viewpoint), view_image(b, viewpoint + origin), strict=True):
            assert (one != other).mean() < 0.01  # rounding of the sum may move a value by one code
    with pytest.raises(ValueError, match="not before the lens plane"):
        view_image(b, (0, 0, 0.6 + there.gap_mm))


@pytest.mark.parametrize("viewer", [None, 300.0])
@pytest.mark.parametrize("optics", [(), (Grin(),)])
def test_disparity_and_the_meeting_of_zones_are_those_of_the_rays(optics, viewer):
    camera = replace(CAMERA, optics=optics, viewer_mm=viewer, lens_pitch_mm=None, origin_mm=(1.0, 2.0, 5.0))
    starts, directions = (a[0].reshape(7, 6, 3) for a in camera.rays(rows=slice(15, 16), cols=slice(0, 42)))
    slopes = directions[..., 0] / directions[..., 2]
    middle, lens = slopes[:, 2:4].mean(axis=1), starts[:, 0]
    if viewer is None:
        np.testing.assert_allclose(middle, 0, atol=1e-12)
    else:  # before the lens plane
        np.testing.assert_allclose(lens[:, 0] - viewer * middle, camera.origin_mm[0], atol=1e-9)
    for z in (-20.0, 7.0, 37.0, 500.0):
        x = starts[..., 0] + (z - starts[..., 2]) * slopes
        seen_under = (3.0 - x[0]) / np.diff(x, axis=0).mean(axis=0)  # the lens whose ray of each pixel meets a point
        step = np.diff(seen_under) * (1 if camera.erect else -1)
        np.testing.assert_allclose(disparity_of_depth(camera, z), step, atol=1e-9)
        assert depth_of_disparity(camera, disparity_of_depth(camera, z)) == pytest.approx(z)


def field_of(plane, views, step):
    """A bare picture of (across, down) views of a far plane, which moves by whole pixels from view to view."""
    across, down = views
    stack = [[np.roll(plane, (step * v, step * u), (0, 1)) for u in range(across)] for v in range(down)]
    pixels = np.array(stack).transpose(2, 0, 3, 1, 4)
    (l, v, k, u, _) = pixels.shape
    return IIPicture(pixels.reshape(l * v, k * u, 3), (k, l), (u, v))


@pytest.mark.parametrize("views", [(5, 1), (5, 3), (3, 5)])
def test_an_assumed_camera_shows_square_pixels_as_far_apart_down_as_across(views):
    """A quilt of others, 32×1 views of 512×256 px, was shown 64 times as wide as high and written as `a64`."""
    plane = np.random.default_rng(0).integers(0, 256, (24, 32, 3)).astype(np.uint8)
    picture = with_assumed_camera(field_of(plane, views, 1))
    camera = picture.camera
    width, height = lens_array_mm(camera)
    assert width / height == pytest.approx(32 / 24)
    assert quilt_path("a.png", picture).name.endswith(f"a{32 / 24:.6g}.png")
    depth = float(depth_of_disparity(camera, -1.0))
    middle = np.roll(plane, (views[1] // 2, views[0] // 2), (0, 1))
    np.testing.assert_allclose(refocus(picture, depth)[4:-4, 4:-4], middle[4:-4, 4:-4], atol=1e-3)
    np.testing.assert_array_equal(view_image(picture, (0, 0, -1e9))[0], middle)
    at = five_viewpoints(camera)
    assert all(view_image(picture, place)[1].all() for place in at.values())
    assert (np.ptp(view_positions(camera, at["up"])[1] % views[1]) == 0) == (views[1] == 1)
