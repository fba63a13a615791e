"""Frames of pseudo video sequences: layout, colour conversion, exact inverses."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec import colour
from codec.colour import RGB8, RGB16, ycbcr
from codec.frames import Film, layout
from codec.order import BY, ORDERS, inverse, selection_order
from ii_core import IIPicture, component_images

KINDS = ("ei", "si", "ri")
counts = st.integers(1, 6)


PLAIN = ycbcr("444", 8)
FORMATS = [ycbcr("444", 8), ycbcr("444", 10), ycbcr("420", 8), ycbcr("420", 10), RGB8, RGB16]


def film_of(picture, kind, form=PLAIN, order="parallel", by="rows", more=(0, 0)):
    """The frames of a picture, ``more`` columns and rows larger than they need be."""
    shape = layout(picture.lenses, picture.ei_pixels, kind)
    even = 2 if form.chroma == "420" else 1
    width, height = (-(-side // even) * even for side in (shape.width + more[0], shape.height + more[1]))
    return Film(layout=shape, order=order, by=by, format=form, width=width, height=height)


def to_planes(pixels, film, extra=0):
    """All frames, a list of (J, rows, samples), collected batch by batch from rows ``extra`` samples too long."""
    widths = [samples for _, samples in film.format.planes(film.width, film.height)]
    planes = film.batch([width + extra for width in widths])
    batches = [
        [plane[:count, :, :width].copy() for plane, width in zip(planes, widths, strict=True)]
        for count in film.gathered(pixels, planes)
    ]
    return [np.concatenate(parts) for parts in zip(*batches, strict=True)]


def convert(colours, form=PLAIN):
    """YCbCr of (n, 3) colours, and RGB from that again."""
    colours = np.ascontiguousarray(colours, np.uint8)
    picture = IIPicture(colours[None], (len(colours), 1), (1, 1))
    film = film_of(picture, "si", form)
    planes, back = to_planes(picture.pixels, film), np.empty_like(picture.pixels)
    film.scatter(planes, film.origins(), back)
    return np.stack([plane[0, 0] for plane in planes], axis=1), back[0]


@given(
    k=counts, l=counts, u=counts, v=counts,
    kind=st.sampled_from(KINDS), order=st.sampled_from(list(ORDERS)), by=st.sampled_from(BY),
)  # fmt: skip
@settings(max_examples=200, deadline=None)
def test_frames_are_the_component_images_in_order(k, l, u, v, kind, order, by):
    # Greys survive the conversion exactly, so that the luma plane is the picture's value.
    grey = np.random.default_rng(k + 7 * l + 49 * u + 343 * v).integers(0, 256, (l * v, k * u, 1), np.uint8)
    picture = IIPicture(np.repeat(grey, 3, axis=2), (k, l), (u, v))
    film = film_of(picture, kind, order=order, by=by)
    luma, cb, cr = to_planes(picture.pixels, film, extra=3)

    stack = component_images(picture, kind)[..., 0]
    if kind == "ri":  # the stack is [v, l], the grid has v across
        stack = stack.swapaxes(0, 1)
    images = stack.reshape(-1, *stack.shape[2:])
    assert (film.layout.rows, film.layout.cols) == stack.shape[:2]
    np.testing.assert_array_equal(luma, images[selection_order(order, *stack.shape[:2], by)])
    assert (cb == 128).all() and (cr == 128).all()

    back = np.zeros_like(picture.pixels)
    film.scatter([luma, cb, cr], film.origins(), back)
    np.testing.assert_array_equal(back, picture.pixels)


def test_ray_space_images_in_row_order_are_the_rows_of_the_picture_from_top_to_bottom():
    """By (2.11) and (2.14). The test above took the grid from the stack [v, l], and missed a transposed one."""
    k, l, u, v = 3, 4, 2, 5
    grey = np.arange(l * v, dtype=np.uint8)[:, None, None] * np.ones((1, k * u, 3), np.uint8)  # row n has value n
    film = film_of(IIPicture(grey, (k, l), (u, v)), "ri", order="row")
    luma, _, _ = to_planes(grey, film)
    assert luma[:, 0, 0].tolist() == list(range(l * v))
    assert (luma == luma[:, :1, :1]).all()


def test_frames_on_their_side():
    pixels = np.random.default_rng(0).integers(0, 256, (12, 15, 3), np.uint8)
    film = film_of(IIPicture(pixels, (3, 4), (5, 3)), "ei", RGB8)
    side = replace(film, layout=film.layout.transposed(), width=film.height, height=film.width)
    (upright,), (lying,) = to_planes(pixels, film), to_planes(pixels, side)
    upright, lying = (p.reshape(*p.shape[:2], -1, 4) for p in (upright, lying))
    np.testing.assert_array_equal(lying, upright.transpose(0, 2, 1, 3))


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
@pytest.mark.parametrize("more", [(0, 0), (1, 1), (5, 3)])
@pytest.mark.parametrize("ei_pixels", [(5, 3), (1, 1), (4, 2)])
def test_padded_frames_repeat_their_edge_and_round_trip(form, more, ei_pixels):
    """Values that 4:2:0 keeps: a grey ramp."""
    u, v = ei_pixels
    top = 65535 if form == RGB16 else 255
    grey = np.random.default_rng(1).integers(0, top + 1, (4 * v, 3 * u, 1), np.uint16 if form == RGB16 else np.uint8)
    pixels = np.repeat(grey, 3, axis=2)
    if form.chroma not in ("420",):
        pixels = np.random.default_rng(2).integers(0, top + 1, pixels.shape, pixels.dtype)
    picture = IIPicture(pixels, (3, 4), ei_pixels)
    film = film_of(picture, "ei", form, more=more)
    planes = to_planes(pixels, film, extra=2)
    for plane, (rows, samples) in zip(planes, form.planes(film.width, film.height), strict=True):
        assert plane.shape == (12, rows, samples)
    if form.chroma != "bgr0":
        for plane in planes[:1]:
            np.testing.assert_array_equal(
                plane, np.pad(plane[:, :v, :u], ((0, 0), (0, film.height - v), (0, film.width - u)), "edge")
            )
    back = np.zeros_like(pixels)
    film.scatter(planes, film.origins(), back)
    exact = form.chroma in ("bgr0", "gbr", "420") or form.depth == 10
    assert np.abs(back.astype(int) - pixels).max() <= (0 if exact else 1)


def test_many_batches_join_up(monkeypatch):
    monkeypatch.setattr("codec.frames.BATCH_FRAMES", 7)
    pixels = np.random.default_rng(0).integers(0, 256, (40, 60, 3), np.uint8)
    film = film_of(IIPicture(pixels, (12, 8), (5, 5)), "ei", order="spiral")
    frames = to_planes(pixels, film)
    assert len(frames[0]) == 96
    back = np.zeros_like(pixels)
    for first in range(0, 96, 7):
        film.scatter([plane[first : first + 7] for plane in frames], film.origins()[first : first + 7], back)
    assert np.abs(back.astype(int) - pixels).max() <= 1


@pytest.mark.parametrize(
    ("rgb", "expected"),
    [
        ((0, 0, 0), (0, 128, 128)),
        ((255, 255, 255), (255, 128, 128)),
        ((255, 0, 0), (54, 99, 255)),  # 0.2126·255 = 54.2; −54.2/1.8556 + 128 = 98.8; 127.5 + 128 rounds to 256
        ((0, 255, 0), (182, 30, 12)),  # 182.4; 29.7; 12.2
        ((0, 0, 255), (18, 255, 116)),  # 18.4; 255.5; 116.3
        ((100, 100, 100), (100, 128, 128)),
    ],
)
def test_bt709_by_hand(rgb, expected):
    there, _ = convert([rgb])
    assert there[0].tolist() == list(expected)


def test_every_colour_comes_back_within_one():
    grid = np.arange(256, dtype=np.uint8)
    for red in range(0, 256, 3):
        colours = np.stack(np.broadcast_arrays(np.uint8(red), grid[:, None], grid[None, :]), axis=-1).reshape(-1, 3)
        _, back = convert(colours)
        assert np.abs(back.astype(np.int16) - colours).max() <= 1


def test_every_colour_comes_back_exactly_at_ten_bits():
    grid = np.arange(256, dtype=np.uint8)
    for red in range(0, 256, 3):
        colours = np.stack(np.broadcast_arrays(np.uint8(red), grid[:, None], grid[None, :]), axis=-1).reshape(-1, 3)
        _, back = convert(colours, ycbcr("444", 10))
        np.testing.assert_array_equal(back, colours)


def test_chroma_of_two_by_two_pixels_is_that_of_their_mean():
    pixels = np.random.default_rng(4).integers(0, 256, (4, 6, 3), np.uint8)
    film = film_of(IIPicture(pixels, (1, 1), (6, 4)), "ei", ycbcr("420", 8))
    _, cb, cr = to_planes(pixels, film)
    r, g, b = pixels.reshape(2, 2, 3, 2, 3).mean(axis=(1, 3)).transpose(2, 0, 1)
    y = 0.2126 * r + 0.7152 * g + 0.0722 * b
    assert np.abs(cb[0] - ((b - y) / 1.8556 + 128)).max() < 0.501
    assert np.abs(cr[0] - ((r - y) / 1.5748 + 128)).max() < 0.501


def test_chroma_is_interpolated_between_the_middles():
    film = film_of(IIPicture(np.zeros((4, 4, 3), np.uint8), (1, 1), (4, 4)), "ei", ycbcr("420", 8))
    cr = np.array([[0, 64], [128, 192]], np.uint8) // 2 + 100
    planes = [np.full((1, 4, 4), 128, np.uint8), np.full((1, 2, 2), 128, np.uint8), cr[None]]
    out = np.zeros((4, 4, 3), np.uint8)
    film.scatter(planes, film.origins(), out)
    at = np.array([0, 0.25, 0.75, 1])
    expected = 100 + 32 * at[None, :] + 64 * at[:, None]
    assert np.abs(out[..., 0] - (128 + 1.5748 * (expected - 128))).max() < 0.6


def test_conversion_is_rounded_to_nearest():
    rgb = np.random.default_rng(1).integers(0, 256, (4000, 3), np.uint8)
    there, back = convert(rgb)
    r, g, b = rgb.T.astype(float)
    y = 0.2126 * r + 0.7152 * g + 0.0722 * b
    exact = np.stack([y, (b - y) / 1.8556 + 128, (r - y) / 1.5748 + 128], axis=1)
    assert np.abs(there - np.minimum(exact, 255)).max() < 0.501
    y, cb, cr = there.T.astype(float) - np.array([[0], [128], [128]])
    exact = np.stack([y + 1.5748 * cr, y - 0.187324 * cb - 0.468124 * cr, y + 1.8556 * cb], axis=1)
    assert np.abs(back - exact.clip(0, 255)).max() < 0.501


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_kernels_equal_their_python(form, monkeypatch):
    dtype = np.uint16 if form == RGB16 else np.uint8
    pixels = np.random.default_rng(2).integers(0, np.iinfo(dtype).max + 1, (6, 10, 3), dtype)
    film = film_of(IIPicture(pixels, (2, 2), (5, 3)), "ei", form, more=(1, 2))
    compiled, there = to_planes(pixels, film, extra=1), np.zeros_like(pixels)
    film.scatter(compiled, film.origins(), there)
    for name in ("444", "420", "bgr0", "channel"):
        for way in ("gather", "scatter"):
            monkeypatch.setattr(colour, f"{way}_{name}", getattr(colour, f"{way}_{name}").py_func)
    plain, back = to_planes(pixels, film, extra=1), np.zeros_like(pixels)
    film.scatter(plain, film.origins(), back)
    for a, b in zip(compiled, plain, strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(there, back)


def test_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="unknown component image 'vi': known are ei, si, ri"):
        layout((1, 1), (1, 1), "vi")


# -- orders of component images


sides = st.integers(1, 40)


@pytest.mark.parametrize("order", ORDERS)
@given(rows=sides, cols=sides)
def test_every_order_lists_every_image_once_and_inverts(order, rows, cols):
    permutation = selection_order(order, rows, cols)
    every = np.arange(rows * cols)
    np.testing.assert_array_equal(np.sort(permutation), every)
    np.testing.assert_array_equal(inverse(permutation)[permutation], every)
    np.testing.assert_array_equal(permutation[inverse(permutation)], every)


@pytest.mark.parametrize("order", ["parallel", "spiral"])
@given(rows=sides, cols=sides)
def test_consecutive_images_are_neighbours_in_the_grid(order, rows, cols):
    row, col = np.divmod(selection_order(order, rows, cols), cols)
    assert (np.abs(np.diff(row)) + np.abs(np.diff(col)) == 1).all()


@given(rows=sides, cols=sides)
def test_zigzag_walks_diagonal_by_diagonal(rows, cols):
    row, col = np.divmod(selection_order("zigzag", rows, cols), cols)
    assert np.isin(np.diff(row + col), (0, 1)).all()


@pytest.mark.parametrize(
    ("order", "by_hand"),
    [
        ("row", [0, 1, 2, 3, 4, 5]),
        ("column", [0, 3, 1, 4, 2, 5]),
        ("parallel", [0, 1, 2, 5, 4, 3]),
        ("zigzag", [0, 1, 3, 4, 2, 5]),
        ("spiral", [3, 4, 5, 2, 1, 0]),
    ],
)
def test_two_by_three_by_hand(order, by_hand):
    assert selection_order(order, 2, 3).tolist() == by_hand


def test_zigzag_of_a_square_is_that_of_jpeg():
    assert selection_order("zigzag", 4, 4).tolist() == [0, 1, 4, 8, 5, 2, 3, 6, 9, 12, 13, 10, 7, 11, 14, 15]


@pytest.mark.parametrize(("rows", "cols", "centre"), [(5, 5, 12), (7, 3, 10), (3, 5, 7)])
def test_spiral_starts_in_the_middle_row_and_ends_in_the_corner(rows, cols, centre):
    spiral = selection_order("spiral", rows, cols)
    distance = np.abs(np.array(np.divmod(spiral[0], cols)) - np.array(np.divmod(centre, cols)))
    assert distance.max() <= abs(rows - cols) // 2
    assert spiral[-1] == 0


def test_unknown_order_and_empty_grid_are_refused():
    with pytest.raises(ValueError, match="unknown order 'diagonal': known are row, column"):
        selection_order("diagonal", 2, 2)
    with pytest.raises(ValueError, match="0×3"):
        selection_order("row", 0, 3)
