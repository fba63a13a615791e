"""Errors of disparity maps in closed form."""

import numpy as np
import pytest

from ii_core import IICamera
from metrics import depth_errors, depth_regions
from metrics.measures.depth_errors import angle_errors

CAMERA = IICamera(pixels=(180, 180), lenses=(60, 60), pixel_pitch_mm=0.1, gap_mm=1.0, start_mm=30, viewer_mm=30)


def test_measures_of_known_errors():
    truth = np.zeros((40, 40))
    found = truth.copy()
    found[15:25, 15] = 0.02  # of the inner 10 × 10 pixels: ten at 0.02, ten at 0.05, ten unknown, ten at 1
    found[15:25, 16] = -0.05
    found[15:25, 17] = np.nan
    found[15:25, 18] = 1.0
    found[:15] = 9  # the border does not count
    rows = depth_errors(found, truth)
    assert (rows["badpix_001"], rows["badpix_003"], rows["badpix_007"]) == (40, 30, 20)
    assert rows["unknown"] == 10 and rows["q_25"] == 0
    assert rows["mse_100"] == pytest.approx(100 * (10 * 0.02**2 + 10 * 0.05**2 + 10) / 90)
    truth[15:25, 18] = np.nan  # without truth
    assert depth_errors(found, truth)["badpix_007"] == pytest.approx(100 * 10 / 90)


def test_regions_of_a_bar_before_a_slanted_wall():
    x = np.mgrid[:60, :60].astype(float)[1]
    truth = 0.01 * x
    truth[20:40, 30:33] = 2.0
    view = np.full((60, 60, 3), 90, np.uint8)
    view[:, :20] = np.random.default_rng(0).integers(0, 256, (60, 20, 3))
    regions = depth_regions(truth, view)
    assert regions["thin"].sum() == 60 and regions["thin"][20:40, 30:33].all()
    assert regions["outlines"][20:40, 28:35].all() and not regions["outlines"][:, :20].any()
    assert regions["textureless"][:, 23:].all() and not regions["textureless"][:, :17].any()
    assert regions["planes"][:10, 5:55].all() and not regions["surfaces"][:10, 5:55].any()
    bowl = depth_regions(0.005 * (x - 30) ** 2 / 10, view)
    assert bowl["surfaces"][10:50, 10:50].all()
    found = truth.copy()
    found[20:40, 30:33] -= 0.2
    found[20:40, 33:36] = 2.0
    rows = depth_errors(found, truth, regions=regions, border=0)
    assert rows["fine_thinning"] == 100 and 20 < rows["fine_fattening"] < 60
    assert rows["badpix_007_thin"] == 100 and rows["badpix_007_planes"] == 0


def test_angle_errors_of_planes():
    """In the toolkit's frame: x and y are half the share of the side, times the width of the field."""
    x = np.mgrid[:60, :60].astype(float)[1]
    level, slanted = 0 * x, 0.02 * x
    np.testing.assert_allclose(angle_errors(level + 0.3, level, CAMERA)[5:-5, 5:-5], 0, atol=1e-5)
    found = angle_errors(slanted, level, CAMERA)[30, 30]
    # normals from three points of each plane

    def z(d):  # disparity of depth, solved for the distance from the cameras
        return 1 / (1 / 30 + d * 0.3 / 0.1 / 900)

    points = [np.array([a / 59 / 2 * 18 / 30 * z(0.02 * a), b / 59 / 2 * 18 / 30 * z(0.02 * a), z(0.02 * a)])
              for a, b in ((29.5, 30), (30.5, 30), (30, 30.5))]  # fmt: skip
    normal = np.cross(points[1] - points[0], points[2] - (points[0] + points[1]) / 2)
    flat = np.array([0, 0, 1.0])
    assert found == pytest.approx(np.degrees(np.arccos(abs(normal @ flat) / np.linalg.norm(normal))), abs=1.0)
    with pytest.raises(ValueError, match="parallel"):
        angle_errors(level, level, IICamera(pixels=(60, 60), lenses=(20, 20), pixel_pitch_mm=0.1, gap_mm=1.0))


@pytest.mark.parametrize(
    ("found", "truth", "said"),
    [
        (np.zeros((40, 40)), np.zeros((40, 41)), "two maps of one size"),
        (np.zeros((40, 40)), np.full((40, 40), np.nan), "has a truth"),
        (np.zeros((20, 20)), np.zeros((20, 20)), "15 px from the border"),
    ],
)
def test_refused(found, truth, said):
    with pytest.raises(ValueError, match=said):
        depth_errors(found, truth)
