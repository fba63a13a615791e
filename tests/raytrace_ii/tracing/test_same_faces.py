"""Faces with the same corners: found in any order of corners, by the first of them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from raytrace_ii.tracing.same_faces import first_of_same


def by_loops(corners):
    """The first face with the same set of corners, by comparing all pairs."""
    sets = [sorted(map(tuple, face.tolist())) for face in corners]
    return [sets.index(face) for face in sets]


@given(data=st.lists(st.lists(st.sampled_from([0.0, -0.0, 1.0, 1e-38, -2.5]), min_size=9, max_size=9), max_size=30))
def test_as_by_comparison_of_all_pairs(data):
    corners = np.array(data, np.float32).reshape(-1, 3, 3)
    found, expected = first_of_same(corners), by_loops(corners)
    if found is None:
        assert expected == list(range(len(corners)))
    else:
        np.testing.assert_array_equal(found, expected)


def test_one_copy_in_many_blocks_is_found():
    corners = np.random.default_rng(0).random((600_000, 3, 3), dtype=np.float32)
    assert first_of_same(corners) is None
    corners[599_999] = corners[7][[2, 0, 1]]
    found = first_of_same(corners)
    assert found[599_999] == 7 and (np.delete(found, 599_999) == np.arange(599_999)).all()
