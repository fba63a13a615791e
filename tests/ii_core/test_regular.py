"""Conversion to regular structures."""

import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ii_core import IICamera, IIPicture, component_images, preset, preset_cameras, view_image
from ii_core.picture.regular import from_smallest_rectangle, owners, resampled, smallest_rectangle
from tests.support.slow import first_fast

REGULAR = ("rectangular", (5.0, 5.0), (0.0, 0.0))
KINDS = [
    REGULAR,
    ("rectangular", (4.7, 6.3), (0.0, 0.0)),
    ("rectangular", (5.0, 5.0), (1.3, -0.4)),
    ("hexagonal", (6.0, 6.0 * 0.75**0.5), (0.0, 0.0)),
    ("hexagonal", (7.3, 4.1), (0.6, 0.2)),
    ("hexagonal", (5.0, 9.0), (0.0, 0.0)),
    ("hexagonal", (9.0, 3.0), (0.0, 0.0)),
]


def camera_of(lattice, pitch, offset=(0.0, 0.0), lenses=(7, 6), pixels=None, **more):
    """A camera with pixels of 1 mm, so that pitch and offset are in pixels."""
    size = pixels or tuple(max(1, round(k * p)) for k, p in zip(lenses, pitch, strict=True))
    return IICamera(
        pixels=size, lenses=lenses, pixel_pitch_mm=1.0, gap_mm=10.0, lens_pitch_mm=pitch, lattice=lattice,
        lens_offset_mm=offset, **more,
    )  # fmt: skip


def picture_of(camera, pixels=None, seed=0):
    if pixels is None:
        shape = (camera.pixels[1], camera.pixels[0], 3)
        pixels = np.random.default_rng(seed).integers(1, 65536, shape).astype(np.uint16)
    return IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)


def encoded(camera):
    """Pixels that hold their nearest lens's number and their own offset from its centre, across and down."""
    m, n = np.meshgrid(np.arange(camera.pixels[0]), np.arange(camera.pixels[1]))
    k, l = camera.lens_lattice.nearest(m, n)
    x, y = camera.lens_lattice.centres(k, l)
    return np.stack([l * camera.lenses[0] + k, m + 0.5 - x, n + 0.5 - y], axis=2).astype(np.float32)


@pytest.mark.parametrize(("lattice", "pitch", "offset"), [kind for kind in KINDS if kind != REGULAR])
def test_rectangles_hold_their_own_lens(lattice, pitch, offset):
    """Structures of every kind except the regular one, whose elementary images are rectangles."""
    camera = camera_of(lattice, pitch, offset)
    assert not camera.regular
    regular, owned = smallest_rectangle(picture_of(camera, encoded(camera)))
    (u, v), (k, l) = regular.ei_pixels, camera.lenses
    cells = component_images(regular, "ei")
    owned = owned.reshape(l, v, k, u).transpose(0, 2, 1, 3)
    lens = np.arange(k * l).reshape(l, k, 1, 1)
    assert (cells[..., 0][owned] == np.broadcast_to(lens, owned.shape)[owned]).all()
    # Pixels stand on a grid: the offset grows by one pixel a step from where the centre of the rectangle is, and
    # that is half a pixel from the lens's centre at most, as near as whole pixels come, if the sensor does not cut
    # the cell; a hexagon's corners may pull it a little further. (float32 offsets: 1e-5.)
    across = cells[..., 1] - (np.arange(u) - (u - 1) / 2)
    down = cells[..., 2] - (np.arange(v) - (v - 1) / 2)[:, None]
    inner = np.s_[1:-1, 1:-1]
    for error in (across, down):
        assert abs(error[inner][owned[inner]]).max() < (0.5 if lattice == "rectangular" else 1) + 1e-5
    # Smallest: some lens owns pixels in both outermost columns, and some in both outermost rows.
    assert (owned[..., 0].any(2) & owned[..., -1].any(2)).any()
    assert (owned[..., 0, :].any(2) & owned[..., -1, :].any(2)).any()


@settings(max_examples=80, deadline=None)
@given(
    st.sampled_from(["rectangular", "hexagonal"]),
    st.tuples(*[st.floats(1, 9)] * 2) | st.tuples(*[st.integers(1, 9)] * 2),
    st.tuples(*[st.floats(-20, 20)] * 2) | st.just((0.0, 0.0)),
    st.tuples(*[st.integers(1, 6)] * 2),
    st.tuples(*[st.integers(1, 40)] * 2) | st.none(),
)
@example("rectangular", (1, 1), (0.5, 0.5), (3, 3), (3, 3))
@example("hexagonal", (9, 1.0), (0.0, 0.0), (4, 6), None)
def test_smallest_rectangle_inverts_exactly(lattice, pitch, offset, lenses, pixels):
    camera = camera_of(lattice, tuple(map(float, pitch)), offset, lenses, pixels)
    source = picture_of(camera)
    regular, mask = smallest_rectangle(source)
    assert regular.regular and regular.lenses == lenses and mask.shape == regular.pixels.shape[:2]
    back, owned = from_smallest_rectangle(regular, camera)
    np.testing.assert_array_equal(back.pixels, np.where(owned[..., None], source.pixels, 0))
    assert back.camera == camera and back.ei_pixels == source.ei_pixels
    assert mask.sum() == owned.sum()  # each pixel stands in the rectangle of its one lens


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(
    st.sampled_from(["rectangular", "hexagonal"]),
    st.tuples(*[st.sampled_from([1.0, 2.0, 3.0, 4.5, 6.0, 7.3])] * 2),
    st.tuples(*[st.sampled_from([0.0, 0.5, 3.0, -8.2])] * 2),
)
def test_owners_by_distance(lattice, pitch, offset):
    camera = camera_of(lattice, pitch, offset, (4, 5))
    grid, (k, l) = camera.lens_lattice, camera.lenses
    owner = owners(grid, camera.pixels)
    x, y = np.arange(camera.pixels[0]) + 0.5, np.arange(camera.pixels[1])[:, None] + 0.5
    # All lenses for twenty pitches around, by brute force; a tie may go either way here, but see below.
    i, j = np.meshgrid(np.arange(-24, k + 24), np.arange(-24, l + 24))
    cx, cy = grid.centres(i, j)
    if grid.hexagonal:
        distance = np.hypot(x[..., None, None] - cx, y[..., None, None] - cy)
    else:  # a cell is half a pitch wide each way, whatever the pitches
        distance = np.maximum(abs(x[..., None, None] - cx) / pitch[0], abs(y[..., None, None] - cy) / pitch[1])
    real = (i >= 0) & (i < k) & (j >= 0) & (j < l)
    nearest_real = distance[..., real].min(-1)
    nearest_other = distance[..., ~real].min(-1)
    clear = abs(nearest_real - nearest_other) > 1e-5
    np.testing.assert_array_equal((owner >= 0)[clear], (nearest_real < nearest_other)[clear])
    m, n = np.meshgrid(np.arange(camera.pixels[0]), np.arange(camera.pixels[1]))
    nk, nl = grid.nearest(m, n)
    assert (owner == nl * k + nk)[owner >= 0].all()  # the camera's own choice, ties and all


def test_regular_pictures_are_returned_unchanged():
    camera = camera_of("rectangular", (4.0, 3.0))
    for picture in (picture_of(camera), IIPicture(picture_of(camera).pixels, (7, 6), (4, 3))):
        for regular, mask in (smallest_rectangle(picture), resampled(picture), resampled(picture, (4, 3))):
            assert regular is picture and mask.all() and mask.shape == (18, 28)
    back, mask = from_smallest_rectangle(picture_of(camera), camera)
    np.testing.assert_array_equal(back.pixels, picture_of(camera).pixels)
    assert mask.all()


def smooth(x, y):
    """A light field's value by ray direction: a cosine of 20 px period across, a parabola down."""
    return np.stack([np.cos(2 * np.pi * x / 20), 0.02 * y * y, 0.1 * x * y], axis=-1)


@pytest.mark.parametrize(("lattice", "pitch", "offset"), KINDS)
@pytest.mark.parametrize("size", [None, (9, 3)])
def test_resampled_smooth_light_field(lattice, pitch, offset, size):
    camera = camera_of(lattice, pitch, offset)
    code = encoded(camera)
    picture = picture_of(camera, smooth(code[..., 1], code[..., 2]).astype(np.float32))
    regular, valid = resampled(picture, size)
    (u, v), (k, l) = regular.ei_pixels, camera.lenses
    x = (np.arange(u) - (u - 1) / 2) * pitch[0] / u
    y = (np.arange(v) - (v - 1) / 2) * (pitch[0] / u if size is None else pitch[1] / v)
    expected = smooth(*np.broadcast_arrays(x[None, :], y[:, None]))
    error = abs(component_images(regular, "ei") - expected).max(axis=-1)
    valid = valid.reshape(l, v, k, u).transpose(0, 2, 1, 3)
    # Where the lens owns all four pixels: Δ²/8 of the second derivatives, (2π/20)² and 0.04, and the twist is exact.
    second = (2 * np.pi / 20) ** 2 / 8
    # Else the slope over at most a pixel each way.
    sx, sy = pitch[0] / 2 + 1, pitch[1] / 2 + 1
    first = max(2 * np.pi / 20, 0.04 * sy, 0.1 * (sx + sy))
    assert error[valid].max() < first
    core = valid & (abs(x) <= pitch[0] / 2 - 1)[None, None, None, :]
    core &= (abs(y) <= pitch[1] / 2 - 1)[None, None, :, None]
    if lattice == "hexagonal":  # a pixel's width inside of the slanted sides as well
        n = np.array([pitch[0] / 2, pitch[1]])
        core &= (abs(x) * n[0] + abs(y)[:, None] * n[1] <= n @ n / 2 - 1 * n.sum())[None, None]
    if lattice == "rectangular" or size is None:
        assert core.any()
    core[[0, -1]] = core[:, [0, -1]] = False  # the sensor may cut these
    assert error[core].max(initial=0) < second + 1e-6  # float32
    if lattice == "rectangular" and offset == (0.0, 0.0):
        assert valid.all()


@pytest.mark.parametrize(("lattice", "pitch", "offset"), KINDS)
def test_resampling_never_takes_from_a_neighbour(lattice, pitch, offset):
    camera = camera_of(lattice, pitch, offset)
    regular, valid = resampled(picture_of(camera, encoded(camera)), (8, 5))
    lens = np.arange(42).reshape(6, 1, 7, 1).repeat(5, 1).repeat(8, 3).reshape(valid.shape)
    # A mean of equal numbers below 42 is off by no more than float32's rounding.
    np.testing.assert_allclose(regular.pixels[..., 0][valid], lens[valid], atol=1e-5)


def test_resampled_cell_of_whole_pixels_is_the_cell():
    camera = camera_of("rectangular", (5.0, 5.0), (2.0, -1.0), lenses=(3, 3))
    source = picture_of(camera)
    regular, valid = resampled(source)
    cut, owned = smallest_rectangle(source)
    assert regular.ei_pixels == cut.ei_pixels == (5, 5)
    np.testing.assert_array_equal(valid, owned)
    np.testing.assert_array_equal(regular.pixels[valid], cut.pixels[valid])
    assert regular.camera.origin_mm == (2.0, -1.0, 0.0)


def test_ramp_across_a_hexagonal_array_is_straight_after_deshift():
    camera = camera_of("hexagonal", (6.0, 5.0), lenses=(8, 6))
    code = encoded(camera)
    k, l = code[..., 0] % 8, code[..., 0] // 8
    place = k + 0.5 + 0.5 * (l % 2)  # where the lens stands, in pitches
    picture = picture_of(camera, np.repeat(place[..., None], 3, 2).astype(np.float32))
    for deshift in (False, True):
        regular, valid = resampled(picture, deshift=deshift)
        ei = component_images(regular, "ei")[..., 0]
        mask = valid.reshape(6, 5, 8, 6).transpose(0, 2, 1, 3)
        shift = 0.0 if deshift else 0.5
        expected = np.arange(8)[None, :, None, None] + 0.5 + shift * (np.arange(6) % 2)[:, None, None, None]
        # Means of halves and whole numbers below 9, in float32
        np.testing.assert_allclose(ei[mask], np.broadcast_to(expected, ei.shape)[mask], atol=1e-5)
        assert mask[1, 0].any() != deshift  # the first lens of an odd row has no other to its left
        assert mask[:, 1:, 2, 2].all()


@pytest.mark.parametrize("pitch", [(4.6, 4.6), (13.84, 13.84)])
@pytest.mark.parametrize("way", [smallest_rectangle, resampled])
def test_camera_of_the_regular_picture(pitch, way):
    lens = {"kind": "lenslet", "focal_mm": 9.0, "aperture_mm": 2.0}
    front = {"kind": "lens", "z_mm": 50.0, "focal_mm": 30.0}
    camera = camera_of("rectangular", pitch, (0.7, -0.3), optics=(lens, front), origin_mm=(1.0, 2.0, 3.0))
    regular, _ = way(picture_of(camera))
    u, v = regular.ei_pixels
    made = regular.camera
    assert made.regular and made.ei_pixels == (u, v)
    # Lenses keep their places: without what stands in front, a ray through the lens's middle starts on the axis.
    bare = [IICamera.from_json({**c.to_json(), "optics": [c.optics[0].to_json()]}) for c in (camera, made)]
    grid = camera.lens_lattice
    cx, cy = grid.centres(np.arange(7), np.arange(6))
    width, height = camera.size_mm
    L, D = bare[1].rays(slice(0, None, v), slice(0, None, u))
    np.testing.assert_allclose(L[0, :, 0], cx - width / 2 + 1.0, atol=1e-9)
    np.testing.assert_allclose(L[:, 0, 1], height / 2 - cy + 2.0, atol=1e-9)
    np.testing.assert_allclose(L[..., 2], 13.0, atol=1e-12)
    # A pixel's step turns the ray as in the source: by a pixel over the gap, or, sampled anew, by a pitch / U.
    step = 1.0 if way is smallest_rectangle else pitch[0] / u
    _, D = bare[1].rays(slice(0, v), slice(0, u))
    np.testing.assert_allclose(np.diff(D[0, :, 0] / D[0, :, 2]), -step / 10.0, atol=1e-12)
    # Rays of one pixel meet where they met: the aperture's places bend them alike, and so does the lens in front.
    for a, b in ((bare[0], bare[1]), (camera, made)):
        bend = []
        for c in (a, b):
            m, n = (c.pixels[0] // 2, c.pixels[1] // 2) if c is a else (3 * u + u // 2, 3 * v + v // 2)
            (_, mid), (_, edge) = c.rays_at(m, n), c.rays_at(m, n, place=(1.0, 0.5))
            bend.append((edge - mid)[0] / mid[2])
        assert bend[0] == pytest.approx(bend[1], abs=1e-12)


@pytest.mark.parametrize("kind", [*KINDS, ("rectangular", (13.84, 13.84), (0.0, 0.0))])
@pytest.mark.parametrize("erect", [False, True])
def test_view_of_the_regular_picture_is_the_view_of_the_scene(kind, erect):
    camera = camera_of(*kind, lenses=(8, 7), optics=("grin",) if erect else ())
    # A wall 100 mm off whose colour is x, y and 1: rays of every pixel meet it, and so does the viewer's line.
    L, D = camera.rays()
    hit = L + D * ((100.0 - L[..., 2:]) / D[..., 2:])
    hit[..., 2] = 1
    picture = IIPicture(hit.astype(np.float32), camera.lenses, camera.ei_pixels, camera, erect)
    eye = np.array([1.0, -2.0, -300.0])  # so far off that it sees the middle of elementary images
    cx, cy = camera.lens_lattice.centres(np.arange(8)[None, :], np.arange(7)[:, None])
    for way, blur in ((resampled, 0.0), (smallest_rectangle, 1.0), (lambda p: resampled(p, deshift=True), 0.0)):
        regular, _ = way(picture)
        view, valid = view_image(regular, eye)
        x, y = np.broadcast_arrays(cx - camera.pixels[0] / 2, camera.pixels[1] / 2 - cy)
        rows = slice(1, -1)
        if camera.lens_lattice.hexagonal:
            if way is resampled:
                rows = slice(2, -1, 2)  # where lenses stand as the camera says
            x = np.where(np.arange(7)[:, None] % 2 == 1, x - kind[1][0] / 2, x)
        lens = np.stack([x, y, np.full_like(x, 10.0)], axis=-1)
        wall = eye + (lens - eye) * ((100.0 - eye[2]) / (lens[..., 2:] - eye[2]))
        error = abs(view - wall)[rows, 1:-1, :2].max()
        assert valid.all()
        # An affine scene is resampled without error but float32's, of numbers below 100; a rectangle stands less than
        # a pixel off its lens, which at 90/10 times the distance is 9 mm.
        assert error < 9.0 * blur + 1e-4


def test_erect_and_unknown_focus_survive():
    camera = camera_of("hexagonal", (6.0, 5.0), optics=("grin",))
    picture = IIPicture(picture_of(camera).pixels, camera.lenses, camera.ei_pixels, camera, True)
    for regular, _ in (smallest_rectangle(picture), resampled(picture)):
        assert regular.erect and regular.camera.erect
    sphere = {"kind": "spherical-lenslet", "radius_mm": 4.0, "ior": 1.5}
    for pitch in ((4.6, 4.6), (5.0, 3.0)):
        source = picture_of(camera_of("hexagonal", pitch, optics=(sphere,)))
        for way in (smallest_rectangle, resampled):
            made = way(source)[0].camera
            assert made.optics == source.camera.optics and made.gap_mm == 10 and made.lens_pitch_mm == pitch


@pytest.mark.parametrize("lattice", ["rectangular", "hexagonal"])
@pytest.mark.parametrize(
    ("pitch", "lenses", "pixels"),
    [
        ((1.5, 1.5), (1, 1), (1, 1)),
        ((100.0, 100.0), (1, 1), (8, 5)),  # lens wider than the sensor
        ((100.0, 80.0), (3, 3), (8, 5)),
        ((1.0, 1.0), (8, 5), (9, 5)),  # elementary images of a pixel
        ((0.3, 0.3), (4, 4), (9, 5)),  # and of none
        ((2.5, 2.5), (1, 3), (40, 40)),  # a small array on a large sensor
    ],
)
def test_extremes(lattice, pitch, lenses, pixels):
    camera = camera_of(lattice, pitch, (0.25, 0.0), lenses, pixels)
    source = picture_of(camera)
    regular, _ = smallest_rectangle(source)
    back, mask = from_smallest_rectangle(regular, camera)
    np.testing.assert_array_equal(back.pixels[mask], source.pixels[mask])
    assert regular.ei_pixels[0] <= min(pixels[0], pitch[0] + 1) and regular.ei_pixels[1] <= pixels[1]
    again, valid = resampled(source, (3, 2))
    assert again.pixels.shape == (lenses[1] * 2, lenses[0] * 3, 3)
    assert (again.pixels[valid] > 0).all()  # the source has no black pixel: none is made up


def test_wrong_calls_are_refused():
    camera = camera_of("rectangular", (4.6, 4.6))
    picture = picture_of(camera)
    with pytest.raises(ValueError, match=r"ei_pixels is 0×4"):
        resampled(picture, (0, 4))
    with pytest.raises(ValueError, match=r"ei_pixels is 4\.5×4"):
        resampled(picture, (4.5, 4))
    with pytest.raises(ValueError, match="structure is not regular"):
        from_smallest_rectangle(picture, camera)
    moved = preset_cameras("moving-lenslets", scale=16)[1]
    with pytest.raises(ValueError, match=r"images of 16×16 px that begin at 4, -4 px: run"):
        picture_of(moved).check_regular()
    other = camera_of("rectangular", (5.7, 4.6))
    with pytest.raises(ValueError, match=r"smallest rectangles are 7×6 of 6×5 px, the picture has 7×6 of 5×5"):
        from_smallest_rectangle(smallest_rectangle(picture)[0], other)


def test_nan_stays_in_its_own_pixel():
    camera = camera_of("rectangular", (4.5, 4.5), lenses=(4, 4))
    source = np.ones((18, 18, 3), np.float32)
    source[0, 0] = np.nan
    regular, _ = resampled(picture_of(camera, source), (9, 9))
    bad = np.isnan(regular.pixels[..., 0])
    assert bad[0, 0] and not bad[3:].any() and not bad[:, 3:].any()


@pytest.mark.slow
@pytest.mark.parametrize("name", first_fast(["plenoptic", "hdtv"]))
def test_presets_reach_a_view_image(name):
    camera = preset(name)
    flat = np.full((camera.pixels[1], camera.pixels[0], 3), 77, np.uint8)
    for regular, _ in (smallest_rectangle(picture_of(camera, flat)), resampled(picture_of(camera, flat))):
        view, valid = view_image(regular, (0, 0, -3 * camera.lenses[0] * camera.gap_mm))
        assert valid.all() and (view[1:-1, 1:-1] == 77).all()


def test_large_pictures_in_bounded_time_and_memory():
    camera = preset("plenoptic")
    picture = picture_of(camera, np.zeros((4096, 4096, 3), np.uint8))
    smallest_rectangle(picture_of(camera_of("rectangular", (4.6, 4.6)), None))  # compile
    tracemalloc.start()
    start = time.perf_counter()
    regular, _ = smallest_rectangle(picture)
    seconds = time.perf_counter() - start
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # Result (3 + 1 bytes a pixel) and owners (4 bytes), a quarter more for rectangles larger than cells and blocks.
    assert peak < 1.25 * (4 * regular.pixels.size / 3 + 4 * 4096 * 4096)
    assert seconds < 30  # 0.3 s measured; a plain Python loop would take minutes
