"""Scalar diffraction against closed forms and the limit of rays."""

import math

import numpy as np
import pytest

from ii_core import IIPicture, preset
from ii_core.waves.wave import (
    angular_spectrum,
    defocus_mm,
    diffraction_limit,
    lens_blurred,
    lens_spread,
    model_spread,
    pixel_kernel,
)
from tests.support.slow import first_fast


def test_a_plane_wave_keeps_its_intensity_and_turns_its_phase():
    field = angular_spectrum(np.ones(64, complex), 0.001, 550e-6, 0.3)
    np.testing.assert_allclose(field, np.exp(2j * np.pi * 0.3 / 550e-6), atol=1e-9)


def test_a_gaussian_beam_widens_as_by_closed_form():
    """w(z) = w₀·√(1 + (zλ/πw₀²)²), in one dimension as in two."""
    waist, wavelength, z = 0.02, 550e-6, 5.0
    x = (np.arange(2048) - 1024) * 0.001
    intensity = np.abs(angular_spectrum(np.exp(-(x**2) / waist**2), 0.001, wavelength, z)) ** 2
    wide = waist * math.hypot(1, z * wavelength / math.pi / waist**2)
    # paraxial: the divergence is 9 mrad, its square what the closed form leaves out
    assert 2 * math.sqrt((intensity * x**2).sum() / intensity.sum()) == pytest.approx(wide, rel=1e-3)


@pytest.mark.parametrize(("dimensions", "zero"), [(1, 1.0), (2, 1.21967)])
def test_in_focus_it_is_airys_pattern(dimensions, zero):
    """Over five rings; the first zero lies at 1.22·λΛ/δL for a round lens, λΛ/δL for a slit."""
    width, gap = 0.1, 1.0
    x, intensity = lens_spread(width, gap, 550.0, dimensions=dimensions)
    line = intensity if dimensions == 1 else intensity[len(x) // 2]
    line = line / line.max()
    near = abs(x) < 5 * 550e-6 * gap / width
    closed = diffraction_limit(x, width, gap, 550.0, dimensions)
    # a rim of samples: a hundred of them across the lens
    np.testing.assert_allclose(line[near], closed[near], atol=4e-3)
    angle = math.asin(zero * 550e-6 / width)
    assert diffraction_limit(np.array([gap * math.tan(angle)]), width, gap, 550.0, dimensions)[0] < 1e-9


def test_far_out_of_focus_it_is_the_box_of_rays():
    """Cumulative energy of a blur of many Fresnel zones, against the geometric limit."""
    width, gap, depth = 0.5, 1.0, 3.0
    blur = abs(defocus_mm(width, gap, depth_mm=depth))
    assert blur == pytest.approx(0.5 / 3)
    x, intensity = lens_spread(width, gap, 550.0, depth_mm=depth)
    within = np.interp(np.linspace(-0.6, 0.6, 61) * blur, x, np.cumsum(intensity))
    box = np.clip(np.linspace(-0.6, 0.6, 61) + 0.5, 0, 1)
    # ideal lens and sphere differ by spherical aberration of the slope squared, 6 %
    np.testing.assert_allclose(within, box, atol=0.03)


def test_the_limit_of_rays_is_reached_as_the_wavelength_falls():
    width, gap, depth = 0.1, 0.5, 4.0
    blur = abs(defocus_mm(width, gap, depth_mm=depth))
    off = []
    for wavelength in (800.0, 200.0, 50.0):
        x, intensity = lens_spread(width, gap, wavelength, depth_mm=depth)
        off.append(intensity[abs(x) > blur / 2].sum())
    assert off[0] > 1.7 * off[1] > 1.7**2 * off[2] and off[2] < 0.06


@pytest.mark.parametrize("depth", [math.inf, 20.0, 5.0])
def test_the_model_is_near_the_wave(depth):
    """On pixels of setup1: each tap of the kernel within 0.02 of the light."""
    camera = preset("setup1")
    width, gap, pixel = camera.lens_pitch_mm[0], camera.gap_mm, camera.pixel_pitch_mm
    x, intensity = lens_spread(width, gap, 550.0, depth_mm=depth)
    wave = pixel_kernel(x, intensity, pixel, 8)
    model = pixel_kernel(x, model_spread(x, width, gap, 550.0, depth_mm=depth), pixel, 8)
    np.testing.assert_allclose(wave, model, atol=0.02)


def test_a_kernel_holds_all_light_and_the_mean_stays():
    camera = preset("setup1", scale=32)
    grey = IIPicture(np.full((*camera.pixels[::-1], 3), 90, np.uint8), camera.lenses, camera.ei_pixels, camera)
    np.testing.assert_array_equal(lens_blurred(grey, preset("setup1")).pixels, 90)
    x, intensity = lens_spread(0.1, 0.2, 550.0)
    assert 0.98 < intensity.sum() < 1 and pixel_kernel(x, intensity, 0.006, 3).sum() == pytest.approx(1)


@pytest.mark.parametrize("dimensions", [1, 2])
@pytest.mark.parametrize("fresnel", first_fast([1.0, 0.1, 0.2, 4.0]))
def test_peaks_in_focus_are_those_of_all_the_lenss_light(fresnel, dimensions):
    """In focus the peak is area/(λΛ)² of the light, a slit's δL/λΛ, for any Fresnel number δL²/4λΛ of slow lenses."""
    width, nm = 0.1, 550.0
    gap = width**2 / (4 * fresnel * nm * 1e-6)
    x, intensity = lens_spread(width, gap, nm, dimensions=dimensions)
    step, limit = x[1] - x[0], nm * 1e-6 * gap
    if dimensions == 1:
        assert intensity.max() / step == pytest.approx(width / limit, rel=2e-3)
    else:
        assert intensity.max() / step**2 == pytest.approx(math.pi / 4 * width**2 / limit**2, rel=4e-3)


@pytest.mark.parametrize("pixels", [0.3, 1.0, 3.0])
def test_pixel_kernels_are_the_integral_of_closed_form(pixels):
    """Airy's slit over triangles of 0.3 to 3 λΛ/δL, by quadrature; the field has few samples a pixel."""
    width, gap, nm = 0.05, 2.0, 550.0
    pixel = pixels * nm * 1e-6 * gap / width
    x, intensity = lens_spread(width, gap, nm)
    got = pixel_kernel(x, intensity, pixel, 2)
    fine = np.linspace(-1, 1, 20001)
    light = [((1 - abs(fine)) * diffraction_limit((k + fine) * pixel, width, gap, nm)).mean() for k in range(-2, 3)]
    np.testing.assert_allclose(got, np.array(light) / sum(light), atol=2e-3)


def test_blur_stays_under_its_lens_and_is_that_of_the_kernel():
    camera, real = preset("setup1", scale=32), preset("setup1")
    pixels = np.zeros((*camera.pixels[::-1], 3), np.float32)
    pixels[24, 40] = 1  # row 8 of lens row 1, column 8 of lens column 2
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    got = lens_blurred(picture, real).pixels
    for c, wavelength in enumerate((610.0, 550.0, 465.0)):
        x, spread = lens_spread(real.lens_pitch_mm[0], real.gap_mm, wavelength)
        kernel = pixel_kernel(x, spread, real.pixel_pitch_mm, 16)
        np.testing.assert_allclose(got[24, 34:47, c], kernel[10:23] * kernel[16], rtol=1e-4)
    assert got[:, :32].max() == 0 and got[:16].max() == 0  # the lenses beside
    assert got[24, 41, 0] > got[24, 41, 2]  # red spreads more than blue


@pytest.mark.parametrize("wavelength", [0.0, -550.0, math.nan])
def test_wavelengths_must_be_positive(wavelength):
    with pytest.raises(ValueError, match="wavelength_nm"):
        lens_spread(0.1, 0.2, wavelength)


def test_invalid_waves_are_refused():
    camera = preset("setup1", scale=32)
    picture = IIPicture(np.zeros((*camera.pixels[::-1], 3), np.uint8), camera.lenses, camera.ei_pixels, camera)
    with pytest.raises(ValueError, match=r"is \d+\.\d pixels wide, an elementary image 16"):
        lens_blurred(picture, preset("setup1"), depth_mm=0.1)
    with pytest.raises(ValueError, match=r"wavelengths_nm are \(610.0, 0.0, 465.0\)"):  # the argument's own name
        lens_blurred(picture, camera, wavelengths_nm=(610, 0, 465))
    with pytest.raises(ValueError, match="the same is needed"):
        lens_blurred(picture, preset("setup3", scale=8))
    with pytest.raises(ValueError, match="depth_mm"):
        lens_spread(0.1, 0.2, 550.0, depth_mm=0.0)
    with pytest.raises(ValueError, match="samples"):
        lens_spread(10.0, 10.0, 550.0, dimensions=2)
    with pytest.raises(ValueError, match="dimensions"):
        angular_spectrum(np.zeros((2, 2, 2)), 0.1, 1e-4, 1.0)
