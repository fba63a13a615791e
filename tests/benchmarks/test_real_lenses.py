"""Disparity errors of real main lenses: the ideal twin has none; the sign is positive beyond the plane in focus."""

import pytest

from benchmarks.accuracy.real_lenses import LENSES, ideal_twin, magnification, real_camera, slope
from ii_core.design.properties import through_front_mm


@pytest.mark.parametrize("name", LENSES)
def test_the_twin_has_the_planes_and_the_magnification_of_the_lens_and_no_error(name):
    camera = real_camera(name)
    twin = ideal_twin(camera)
    # The field lens, 0.2 mm before the array, is not in the twin's closed form: 0.2/75 of a magnification.
    assert magnification(twin) == pytest.approx(magnification(camera), rel=5e-3)
    assert through_front_mm(twin, twin.gap_mm) == pytest.approx(through_front_mm(camera, camera.gap_mm), rel=1e-4)
    for field in (0.0, 6.0, 12.0):
        for axis in (0, 1):
            error, bend, share = slope(twin, field, axis)
            assert abs(error) < 1e-12 and bend < 1e-12 and share > 0.9


def test_disparity_of_planes_off_focus_has_one_sign_on_each_side():
    twin = ideal_twin(real_camera("triplet"))
    focus = through_front_mm(twin, twin.gap_mm)
    near, far = slope(twin, 0.0, 0, focus - 5)[0], slope(twin, 0.0, 0, focus + 5)[0]
    assert near < 0 < far and near == pytest.approx(-far, rel=0.01)
    # Closed form: the 16 views come from the opening, `width` wide, which stands `ahead` of the plane in focus.
    width, pitch = twin.front[1].diameter_mm, twin.lens_pitch_mm[0] * magnification(twin)
    assert far == pytest.approx(5 * width / 16 / (focus - twin.front[1].z_mm) / pitch, rel=0.01)
