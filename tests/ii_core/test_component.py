"""Component images: exact rearrangements."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ii_core import IIPicture, component_images, elementary_images, picture_pixels, ray_space_images
from ii_core import sub_images as sub_images_of
from ii_core.picture import component
from ii_core.picture.component import join_si, split_si, swap_runs
from ii_core.picture.picture import picture_order

KINDS = ("ei", "si", "ri")
side = st.integers(1, 6)


def make(lenses, ei_pixels, dtype="uint16"):
    """Return a picture of distinct values, so that every wrong permutation fails."""
    shape = (lenses[1] * ei_pixels[1], lenses[0] * ei_pixels[0], 3)
    values = np.arange(np.prod(shape)).reshape(shape)
    return IIPicture(values.astype(dtype), lenses, ei_pixels)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=40, deadline=None)  # the first call compiles
@given(k=side, l=side, u=side, v=side, dtype=st.sampled_from(["uint8", "uint16", "float32"]))
def test_rearrangements_are_invertible(kind, k, l, u, v, dtype):
    source = make((k, l), (u, v), dtype)
    stack = component_images(source, kind)
    back = picture_pixels(stack, kind)
    assert back.dtype == stack.dtype == source.pixels.dtype
    np.testing.assert_array_equal(back, source.pixels)
    assert not np.shares_memory(stack, source.pixels)


@pytest.mark.parametrize(("lenses", "ei_pixels"), [((4, 3), (2, 5)), ((1, 3), (4, 1)), ((5, 1), (1, 2))])
def test_definitions_element_by_element(lenses, ei_pixels):
    source = make(lenses, ei_pixels)
    (k_count, l_count), (u_count, v_count) = lenses, ei_pixels
    ei, si, ri = elementary_images(source), sub_images_of(source), ray_space_images(source)
    assert ei.shape == (l_count, k_count, v_count, u_count, 3)
    assert si.shape == (v_count, u_count, l_count, k_count, 3)
    assert ri.shape == (v_count, l_count, k_count, u_count, 3)
    for l in range(l_count):
        for k in range(k_count):
            for v in range(v_count):
                for u in range(u_count):
                    # (2.12), (2.13), (2.14): pixel u, v under lens k, l is picture column k·U + u, row l·V + v
                    pixel = source.pixels[l * v_count + v, k * u_count + u]
                    np.testing.assert_array_equal(ei[l, k, v, u], pixel)
                    np.testing.assert_array_equal(si[v, u, l, k], pixel)
                    np.testing.assert_array_equal(ri[v, l, k, u], pixel)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("cpus", [1, 3, 64])
def test_any_number_of_threads_gives_the_same(kind, cpus, monkeypatch):
    monkeypatch.setattr(component, "SMALL", 0)
    monkeypatch.setattr("ii_core.base.parallel.cores", lambda: cpus)
    source = make((7, 5), (3, 4))
    field = source.pixels.reshape(5, 4, 7, 3, 3)
    axes = {"ei": (0, 2, 1, 3, 4), "si": (1, 3, 0, 2, 4), "ri": (1, 0, 2, 3, 4)}[kind]
    stack = component_images(source, kind)
    np.testing.assert_array_equal(stack, field.transpose(axes))
    np.testing.assert_array_equal(picture_pixels(stack, kind), source.pixels)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_kernels_against_their_python(dtype):
    rng = np.random.default_rng(0)
    field = rng.integers(0, 255, (4, 3, 5, 2, 3)).astype(dtype)
    for kernel, shape in ((split_si, (3, 2, 4, 5, 3)), (swap_runs, (4, 5, 3, 6))):
        source = field if kernel is split_si else field.reshape(4, 3, 5, 6)
        outs = [np.zeros(shape, dtype) for _ in range(2)]
        for out, function in zip(outs, (kernel, kernel.py_func), strict=True):
            function(source, out, 1, 3)  # part of the range: the rest stays untouched
        np.testing.assert_array_equal(*outs)
        assert (outs[0] != 0).any()
    stack = np.ascontiguousarray(field.transpose(1, 3, 0, 2, 4))
    outs = [np.zeros_like(field) for _ in range(2)]
    for out, function in zip(outs, (join_si, join_si.py_func), strict=True):
        function(stack, out, 0, 4)
    np.testing.assert_array_equal(*outs)
    np.testing.assert_array_equal(outs[0], field)


def test_memory_order_does_not_matter():
    source = make((3, 2), (4, 5))
    shuffled = source.with_pixels(np.asfortranarray(source.pixels))
    for kind in KINDS:
        stack = component_images(shuffled, kind)
        np.testing.assert_array_equal(stack, component_images(source, kind))
        np.testing.assert_array_equal(picture_pixels(np.asfortranarray(stack), kind), source.pixels)


def test_axes_of_the_light_field_and_of_the_picture_order():
    """Pixel (v, u) under lens (k, l): row l·V + v, column k·U + u of the picture, whatever the order of axes."""
    picture = make((5, 4), (3, 2))
    field, order = picture.light_field, picture_order(picture.pixels, picture.lenses, picture.ei_pixels)
    assert field.shape == (4, 5, 2, 3, 3) and order.shape == (4, 2, 5, 3, 3)
    for l, k, v, u in np.ndindex(field.shape[:4]):
        pixel = picture.pixels[l * 2 + v, k * 3 + u]
        np.testing.assert_array_equal(field[l, k, v, u], pixel)
        np.testing.assert_array_equal(order[l, v, k, u], pixel)
    assert np.shares_memory(field, picture.pixels)


def test_refusals():
    source = make((3, 2), (4, 5))
    with pytest.raises(ValueError, match="unknown component image 'vi': known are ei, si, ri"):
        component_images(source, "vi")
    with pytest.raises(ValueError, match="unknown component image"):
        picture_pixels(component_images(source, "ei"), "EI")
    for stack in (source.pixels, np.zeros((2, 2, 2, 2, 4))):
        with pytest.raises(ValueError, match="five axes, the last of length 3, are needed"):
            picture_pixels(stack, "ei")
