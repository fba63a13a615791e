"""Point-spread functions as maps: against Airy's closed form, the geometric limit and the wave."""

import math

import numpy as np
import pytest
from scipy import integrate, special
from scipy.signal import resample

from ii_core import DisplayModel, Eye, IICamera, IIPicture, eye_image, preset
from ii_core.camera.optics import Lenslet
from ii_core.waves.spread import FIRST_ZERO, _extent, _kernel, _spot, scatter, spread_maps, spread_picture
from ii_core.waves.wave import diffraction_limit, lens_spread
from tests.support.slow import first_fast


def camera(u=15, k=1, pixel=0.001, gap=1.0, width=0.1, focal=None):
    """Lenses of a width of their own, which need not be that of their elementary images."""
    optics = (Lenslet(focal_mm=focal or gap, aperture_mm=width),)
    return IICamera(pixels=(k * u, u), lenses=(k, 1), pixel_pitch_mm=pixel, gap_mm=gap, optics=optics)


def point(camera, at=None, dtype=np.float32):
    """Light in the middle pixel of every elementary image, or at one place."""
    pixels = np.zeros((*camera.pixels[::-1], 3), dtype)
    u, v = camera.ei_pixels
    rows, columns = (slice(v // 2, None, v), slice(u // 2, None, u)) if at is None else at
    pixels[rows, columns] = 1 if dtype == np.float32 else 255
    return IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)


def test_maps_in_closed_form():
    """On the axis 1.22·λΛ/δL, at an angle 1/cos²θ of it; the disk δL·Λ/z of a lens in focus at infinity."""
    made = preset("setup1", scale=32)
    depth = np.full(made.pixels[::-1], 50.0)
    depth[0, 0], depth[0, 1] = np.nan, 1e6
    maps = spread_maps(made, depth, wavelengths_nm=(600, 500, 400))
    width, gap, pixel = made.lens_pitch_mm[0], made.gap_mm, made.pixel_pitch_mm
    assert maps.defocus_mm[0, 0] == 0 and maps.defocus_mm[0, 1] == pytest.approx(width * gap / 1e6, rel=1e-4)
    assert maps.defocus_mm[5, 5] == pytest.approx(width * gap / (50 - made.origin_mm[2] - gap), rel=1e-6)
    ring = FIRST_ZERO * np.array([600, 500, 400]) * 1e-6 * gap / width
    x, y = 7.5 * pixel, 0.5 * pixel  # of the first column, and of a row in the middle, from the lens
    tan2 = (x * x + y * y) / gap**2
    np.testing.assert_allclose(maps.airy_mm[7, 0], ring * (1 + tan2), rtol=1e-6)


@pytest.mark.parametrize("nm", [465.0, 610.0])
def test_in_focus_the_picture_of_a_point_is_airys_pattern(nm):
    """Pixels of a tenth of the first ring: averaging over them changes the pattern by 1 % of its peak."""
    width, gap = 0.1, 1.0
    ring = FIRST_ZERO * nm * 1e-6 * gap / width
    made = camera(u=61, pixel=ring / 10, width=width)
    light = spread_picture(point(made), spread_maps(made, wavelengths_nm=(nm, nm, nm))).pixels[30, :, 1]
    x = (np.arange(61) - 30) * ring / 10
    np.testing.assert_allclose(light / light.max(), diffraction_limit(x, width, gap, nm, 2), atol=0.01)
    assert light[20] < 2e-3 * light[30] and light[16] > 1e-2 * light[30]  # first dark and first bright ring


@pytest.mark.parametrize("depth", [math.inf, 16.0, 8.0, 4.0, 1.0])
def test_it_is_the_wave_in_focus_and_out_of_it(depth):
    """Columns around a point, against the angular spectrum of the same round lens: disks of 0 to 15 rings.

    The product of the transfer functions of disk and rings was off by 0.11 of 0.43 at the depth 8.
    """
    width, gap, nm, pixel = 0.1, 1.0, 550.0, 0.004
    x, wave = lens_spread(width, gap, nm, depth_mm=depth, dimensions=2)
    made = camera(u=31, pixel=pixel, width=width)
    maps = spread_maps(made, depth + gap, wavelengths_nm=(nm, nm, nm))
    got = spread_picture(point(made), maps).pixels[..., 1].sum(axis=0)
    rows, x = resample(wave.sum(axis=0), 8 * len(x), x)  # band-limited, and coarse beside a pixel
    triangles = np.clip(1 - abs(x - (np.arange(31) - 15)[:, None] * pixel) / pixel, 0, None)
    wanted = triangles @ rows / 8
    # widths are rounded by up to 3 %, and the angular spectrum is not paraxial
    np.testing.assert_allclose(got, wanted, atol=0.01)


@pytest.mark.parametrize("ring", first_fast([0.194, 0.03, 0.06, 0.1, 0.4, 0.97, 1.9]))
def test_kernels_in_focus_are_the_integral_of_the_transfer(ring):
    """∫∫ OTF·sinc²·sinc² by Gauss's quadrature in polar coordinates: the light that stays, and that of neighbours.

    A triangle sampled four times a pixel left 11.2 % instead of 17.1 % outside a pixel of setup1's ring, 0.194.
    """
    x, weights = np.polynomial.legendre.leggauss(1200)
    share = (x + 1) / 2  # of the highest frequency
    f = share * FIRST_ZERO / ring
    turn = (np.arange(400) + 0.5) / 400 * math.pi / 2
    across, down = f[:, None] * np.cos(turn), f[:, None] * np.sin(turn)
    passed = (
        (np.arccos(share) - share * np.sqrt(1 - share * share)) * 2 / math.pi * weights * f / 2 * f[-1] / share[-1]
    )
    square = np.sinc(across) ** 2 * np.sinc(down) ** 2
    wanted = [passed @ (square * np.cos(2 * math.pi * k * across)).mean(axis=1) * 2 * math.pi for k in range(4)]
    got = _kernel(0.0, ring, 0.0, 16)[16, 16:20]
    np.testing.assert_allclose(got, wanted, rtol=4e-3, atol=1e-4)


def test_a_picture_leaves_as_much_light_in_its_pixels_as_the_transfer():
    """Full setup1 in focus at 550 nm: 17.1 % leave the pixel, by quadrature; all stay under the lens."""
    made = preset("setup1", scale=32)
    lens = preset("setup1")
    maps = spread_maps(made, wavelengths_nm=(550, 550, 550))._replace(
        airy_mm=np.full(
            (*made.pixels[::-1], 3), FIRST_ZERO * 550e-6 * lens.gap_mm / lens.lens_pitch_mm[0], np.float32
        ),
        pixel_pitch_mm=lens.pixel_pitch_mm,
    )
    light = spread_picture(point(made), maps).pixels[:16, :16, 1]
    assert light[8, 8] == pytest.approx(1 - 0.171, abs=3e-3)
    assert light.sum() == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize(("disk", "aberration"), [(5.0, -3.0), (0.0, 30.0), (40.0, 25.0)])
def test_spots_of_aberrated_lenses_are_their_integral(disk, aberration):
    """By 64 + 8·f·d samples of the midpoint rule the error was up to 4e-4, in three times the time."""

    def light(rho, f):
        return 2 * rho * special.j0(np.pi * f * (disk * rho + aberration * rho**3))

    f = np.array([3.0, 0.0, 0.2, 1.0])
    wanted = [integrate.quad(light, 0, 1, args=(one,), limit=999)[0] for one in f]
    np.testing.assert_allclose(_spot(f, disk, aberration), wanted, atol=1e-9)


def test_no_ray_leaves_the_extent():
    r = np.linspace(0, 1, 100_001)
    for disk, aberration in ((3, 0), (3, 2), (3, -2), (1, -3), (0, 2)):
        assert _extent(disk, aberration) == pytest.approx(abs(disk * r + aberration * r**3).max(), abs=1e-8)


def test_without_wavelength_it_is_the_disk_of_rays():
    """A disk of 6 pixels: each pixel has its share of the disk, smoothed by the pixel of the source."""
    kernel = _kernel(6.0, 1e-6, 0.0, 15)
    fine = (np.arange(31 * 20) + 0.5) / 20 - 15.5
    disk = (np.hypot(fine[:, None], fine) <= 3).astype(float)
    triangles = np.clip(1 - abs(fine - np.arange(-15, 16)[:, None]), 0, None)
    wanted = triangles @ disk @ triangles.T
    np.testing.assert_allclose(kernel, wanted / wanted.sum(), atol=0.02 * kernel.max())
    x = np.arange(-15, 16)
    # a disk has the variance d²/16 along an axis, a triangle of two pixels 1/6
    assert (kernel.sum(axis=0) * x * x).sum() == pytest.approx(36 / 16 + 1 / 6, rel=0.01)


def test_a_disk_of_many_pixels_is_even():
    """150 pixels of a lens of 200."""
    kernel = _kernel(150.0, 1e-3, 0.0, 200)
    np.testing.assert_allclose(kernel[200, 140:261], 4 / math.pi / 150**2, rtol=0.02)
    assert kernel[200, 280:].max() < 1e-7 and kernel.sum() == pytest.approx(1, abs=2e-3)


def test_a_sharp_lens_leaves_the_picture_as_it_is():
    made = camera(k=2, width=0.1)
    rng = np.random.default_rng(0)
    picture = IIPicture(rng.random((15, 30, 3)).astype(np.float32), (2, 1), (15, 15), made)
    got = spread_picture(picture, spread_maps(made, wavelengths_nm=(0.001, 0.001, 0.001)))
    np.testing.assert_allclose(got.pixels, picture.pixels, atol=2e-3)


def test_spreads_wider_than_an_elementary_image_fill_it_and_stay_in_it():
    """Rings of 1.2 mm over images of 15 µm, and disks of 1 mm."""
    for maps in (
        spread_maps(camera(k=3), wavelengths_nm=(1e6, 1e6, 1e6)),
        spread_maps(camera(k=3), focal_mm=0.09),
    ):
        made = camera(k=3)
        got = spread_picture(point(made, (slice(3, 4), slice(18, 19))), maps).pixels[..., 1]
        np.testing.assert_allclose(got[:, 15:30], 1 / 225, rtol=0.12)
        assert got[:, :15].max() == got[:, 30:].max() == 0
        assert got.sum() == pytest.approx(1, rel=1e-6)


def test_light_is_linear_and_colours_spread_by_their_wavelengths():
    made = camera(u=15, pixel=0.003, width=0.1)
    maps = spread_maps(made)
    light = spread_picture(point(made), maps).pixels
    codes = spread_picture(point(made, dtype=np.uint8), maps).pixels
    from ii_core.base.colour import LINEAR

    np.testing.assert_allclose(LINEAR[codes], light, atol=3e-3)  # half a code
    middle = light[7, 7]
    assert middle[0] < middle[1] < middle[2]  # blue light spreads least
    np.testing.assert_allclose(light.sum(axis=(0, 1)), 1, rtol=1e-6)


def test_depth_differs_from_ray_to_ray():
    """In one picture, far parts stay sharper than near ones."""
    made = camera(k=2, pixel=0.01, width=0.15)
    depth = np.where(np.arange(30) < 15, 3.0, 1e6) * np.ones((15, 1))
    light = spread_picture(point(made), spread_maps(made, depth)).pixels
    assert light[7, 7, 1] < 0.05 < 0.5 < light[7, 22, 1]


def test_a_display_is_the_camera_run_backwards():
    """An eye at a finite distance is out of focus of lenses focused at infinity; the disk is δL·Λ/d."""
    made = preset("setup1", scale=32)
    eye = Eye(position_mm=(0.0, 0.0, -40.0))
    maps = spread_maps(made, eye.position_mm[2])
    distance = made.gap_mm + made.origin_mm[2] + 40.0
    assert maps.defocus_mm[0, 0] == pytest.approx(made.lens_pitch_mm[0] * made.gap_mm / distance)
    noise = np.random.default_rng(1).integers(0, 256, (*made.pixels[::-1], 3), np.uint8)
    picture = IIPicture(noise, made.lenses, made.ei_pixels, made)
    seen = [
        eye_image(p, DisplayModel(camera=made), eye).light.std() for p in (picture, spread_picture(picture, maps))
    ]
    assert seen[1] < 0.8 * seen[0]


def test_a_lens_of_its_own_focus_and_aperture():
    made = camera(gap=1.0, width=0.01, focal=0.5)
    maps = spread_maps(made)
    assert maps.defocus_mm[0, 0] == pytest.approx(0.01)  # δL·(Λ/f − 1)
    assert maps.airy_mm[7, 7, 1] == pytest.approx(FIRST_ZERO * 550e-6 / 0.01)
    assert spread_maps(made, 2.0).defocus_mm.max() == pytest.approx(0, abs=1e-9)  # 1/f = 1/Λ + 1/z, z = 1


def test_kernel_without_compilation(monkeypatch):
    made = camera(u=5, k=2, pixel=0.003)
    maps = spread_maps(made, 4.0)
    compiled = spread_picture(point(made), maps).pixels
    monkeypatch.setattr("ii_core.waves.spread.scatter", scatter.py_func)
    np.testing.assert_array_equal(spread_picture(point(made), maps).pixels, compiled)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: spread_maps(camera(), wavelengths_nm=(610, 0, 465)), "wavelengths_nm"),
        (lambda: spread_maps(camera(), wavelengths_nm=(610, math.nan, 465)), "wavelengths_nm"),
        (lambda: spread_maps(camera(), wavelengths_nm=(610, 465)), "3 numbers"),
        (lambda: spread_maps(camera(), 1.0), "lens plane"),
        (lambda: spread_maps(camera(), np.ones((3, 3))), "a map of"),
        (lambda: spread_maps(camera(), focal_mm=0.0), "focal_mm"),
        (lambda: spread_maps(preset("hexagonal", scale=8)), "not regular"),
        (lambda: spread_picture(point(camera(k=2)), spread_maps(camera())), "maps are"),
    ],
)
def test_invalid_spreads_are_refused(call, said):
    with pytest.raises(ValueError, match=said):
        call()
