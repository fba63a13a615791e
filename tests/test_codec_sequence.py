import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.order import ORDERS, selection_order
from codec.sequence import gather_ycbcr, gathered, layout, scatter, scatter_rgb
from ii_core import IIPicture, component_images

KINDS = ("ei", "si", "ri")
counts = st.integers(1, 6)


def to_planes(pixels, shape, order, stride):
    """All frames, (J, 3, height, width), collected batch by batch."""
    planes = shape.batch(stride)
    return np.concatenate([planes[:n, ..., : shape.width].copy() for n in gathered(pixels, shape, order, planes)])


def convert(colours):
    """YCbCr of (n, 3) colours, and RGB from that again."""
    colours = np.ascontiguousarray(colours, np.uint8)
    planes, back = np.empty((1, 3, 1, len(colours)), np.uint8), np.empty_like(colours)
    gather_ycbcr(colours, np.zeros(1, np.int64), 0, 1, len(colours), planes)
    scatter_rgb(planes, np.zeros(1, np.int64), 0, 1, len(colours), back)
    return planes[0, :, 0].T, back


@given(k=counts, l=counts, u=counts, v=counts, kind=st.sampled_from(KINDS), order=st.sampled_from(list(ORDERS)))
@settings(max_examples=200, deadline=None)
def test_frames_are_the_component_images_in_order(k, l, u, v, kind, order):
    # Greys survive the conversion exactly, so that the luma plane is the picture's value.
    grey = np.random.default_rng(k + 7 * l + 49 * u + 343 * v).integers(0, 256, (l * v, k * u, 1), np.uint8)
    picture = IIPicture(np.repeat(grey, 3, axis=2), (k, l), (u, v))
    shape = layout(picture.lenses, picture.ei_pixels, kind)
    frames = to_planes(picture.pixels, shape, order, stride=shape.width + 3)

    stack = component_images(picture, kind)[..., 0]
    images = stack.reshape(-1, *stack.shape[2:])
    assert (shape.rows, shape.cols) == stack.shape[:2]
    np.testing.assert_array_equal(frames[:, 0], images[selection_order(order, shape.rows, shape.cols)])
    assert (frames[:, 1:] == 128).all()

    back = np.zeros_like(picture.pixels)
    scatter(frames, shape.origins(order), shape, back)
    np.testing.assert_array_equal(back, picture.pixels)


def test_many_batches_join_up(monkeypatch):
    monkeypatch.setattr("codec.sequence.BATCH_FRAMES", 7)
    pixels = np.random.default_rng(0).integers(0, 256, (40, 60, 3), np.uint8)
    shape = layout((12, 8), (5, 5), "ei")
    frames = to_planes(pixels, shape, "spiral", stride=5)
    assert len(frames) == 96
    back = np.zeros_like(pixels)
    for first in range(0, 96, 7):
        scatter(frames[first : first + 7], shape.origins("spiral")[first : first + 7], shape, back)
    assert np.abs(back.astype(int) - pixels).max() <= 1


@pytest.mark.parametrize(
    ("rgb", "ycbcr"),
    [
        ((0, 0, 0), (0, 128, 128)),
        ((255, 255, 255), (255, 128, 128)),
        ((255, 0, 0), (54, 99, 255)),  # 0.2126·255 = 54.2; −54.2/1.8556 + 128 = 98.8; 127.5 + 128 rounds to 256
        ((0, 255, 0), (182, 30, 12)),  # 182.4; 29.7; 12.2
        ((0, 0, 255), (18, 255, 116)),  # 18.4; 255.5; 116.3
        ((100, 100, 100), (100, 128, 128)),
    ],
)
def test_bt709_by_hand(rgb, ycbcr):
    there, _ = convert([rgb])
    assert there[0].tolist() == list(ycbcr)


def test_every_colour_comes_back_within_one():
    grid = np.arange(256, dtype=np.uint8)
    for red in range(0, 256, 3):
        colours = np.stack(np.broadcast_arrays(np.uint8(red), grid[:, None], grid[None, :]), axis=-1).reshape(-1, 3)
        _, back = convert(colours)
        assert np.abs(back.astype(np.int16) - colours).max() <= 1


def test_conversion_rounds_like_real_numbers():
    rgb = np.random.default_rng(1).integers(0, 256, (4000, 3), np.uint8)
    there, back = convert(rgb)
    r, g, b = rgb.T.astype(float)
    y = 0.2126 * r + 0.7152 * g + 0.0722 * b
    exact = np.stack([y, (b - y) / 1.8556 + 128, (r - y) / 1.5748 + 128], axis=1)
    assert np.abs(there - np.minimum(exact, 255)).max() < 0.501
    y, cb, cr = there.T.astype(float) - np.array([[0], [128], [128]])
    exact = np.stack([y + 1.5748 * cr, y - 0.187324 * cb - 0.468124 * cr, y + 1.8556 * cb], axis=1)
    assert np.abs(back - exact.clip(0, 255)).max() < 0.501


def test_kernels_equal_their_python():
    pixels = np.random.default_rng(2).integers(0, 256, (4 * 6, 3), np.uint8)
    origins = np.array([0, 6, 3])
    compiled, plain = np.zeros((2, 3, 3, 2, 4), np.uint8)
    gather_ycbcr(pixels, origins, 12, 1, 3, compiled)
    gather_ycbcr.py_func(pixels, origins, 12, 1, 3, plain)
    np.testing.assert_array_equal(compiled, plain)
    there, back = np.zeros_like(pixels), np.zeros_like(pixels)
    scatter_rgb(compiled, origins, 12, 1, 3, there)
    scatter_rgb.py_func(compiled, origins, 12, 1, 3, back)
    np.testing.assert_array_equal(there, back)


def test_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="unknown component image 'vi': known are ei, si, ri"):
        layout((1, 1), (1, 1), "vi")
