"""Orders of component images."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.order import ORDERS, inverse, selection_order

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
