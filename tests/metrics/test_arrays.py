"""Measures of plain arrays, whose structure is given beside them."""

import numpy as np
import pytest

from ii_core import IICamera, IIPicture
from metrics import mean_q_angle, q_angle, q_angle_ssim, q_angle_ycbcr, q_depth, q_global, q_view, report

CAMERA = IICamera(pixels=(64, 48), lenses=(16, 12), pixel_pitch_mm=0.25, gap_mm=2.0)
A, B = (np.random.default_rng(seed).integers(0, 256, (48, 64, 3), np.uint8) for seed in (1, 2))
PICTURES = [IIPicture(pixels, CAMERA.lenses, CAMERA.ei_pixels, CAMERA) for pixels in (A, B)]
DEPTH = np.full((48, 64), 30.0)


@pytest.mark.parametrize("structure", [CAMERA, PICTURES[0], {"lenses": (16, 12), "ei_pixels": (4, 4)}])
def test_arrays_measure_as_the_pictures_that_they_are(structure):
    """On b1dc540 arrays were a TypeError, whatever structure was known."""
    for measure in (q_global, mean_q_angle, lambda *a, **o: q_angle_ycbcr(*a, **o).mean):
        assert measure(A, B, structure=structure) == measure(*PICTURES)
    np.testing.assert_array_equal(q_angle(A, B, structure=structure).values, q_angle(*PICTURES).values)
    assert q_angle_ssim(A, B, structure=structure).mean == q_angle_ssim(*PICTURES).mean
    if not isinstance(structure, dict):  # without a camera there are no views
        assert q_view(A, B, structure=structure).values == q_view(*PICTURES).values
        assert q_depth(A, B, depth=DEPTH, structure=structure).mean == q_depth(*PICTURES, depth=DEPTH).mean
        assert report(A, B, structure=structure).numbers == report(*PICTURES).numbers


def test_an_array_beside_a_picture():
    assert q_global(PICTURES[0], B, structure=PICTURES[0]) == q_global(*PICTURES)


@pytest.mark.parametrize(
    ("structure", "said"),
    [
        (None, "reference is a ndarray: an IIPicture is needed, or an array and structure="),
        ({"lenses": (16, 12)}, "a picture, a camera or lenses and ei_pixels are needed"),
        (4, "structure is 4"),
        ({"lenses": (16, 12), "ei_pixels": (5, 4)}, "elementary image 5×4 px does not divide"),
    ],
)
def test_arrays_without_a_structure_that_fits_are_refused(structure, said):
    with pytest.raises((TypeError, ValueError), match=said):
        q_global(A, B, structure=structure)
