"""Calibration: cameras estimated from pictures of known cameras."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from benchmarks.accuracy.calibration import (
    SHIFTS,
    behind_glass,
    distorted,
    errors,
    exposed,
    growth,
    micro_image_centres,
    multi_focus_pictures,
    psnr,
    random_camera,
    trial,
    white_image,
)
from ii_core import (
    IICamera,
    IIPicture,
    NoLenses,
    calibrate,
    calibrated_picture,
    centres_picture,
    defective_pixels,
    disparity_of_depth,
    estimate_depth,
    preset,
    resampled,
    sub_images,
)
from ii_core.base.colour import linear, srgb
from ii_core.base.files import write_image
from ii_core.calibration.demosaic import METHODS, MOSAICS, demosaiced, phases
from ii_core.calibration.lens_types import LensTypes
from ii_core.calibration.multi_focus import fused, lens_foci, of_camera, shifts_of, virtual_depths, with_foci
from ii_core.calibration.white import FLOOR, averaged, gain
from ii_core.formats.lytro import RawColour
from ii_core.formats.mosaic import load_mosaic
from raytrace_ii import load_scene, render
from tests.support.slow import first_fast


def shot(seed, hexagonal=False, bad=0.0, size=(330, 300), pitch=13.3):
    """A known camera and its white image."""
    rng = np.random.default_rng(seed)
    camera = random_camera(rng, size, pitch, hexagonal)
    return camera, exposed(white_image(camera), camera, rng, bad)


@pytest.mark.slow
@settings(max_examples=2)
@example(seed=715887, hexagonal=False, bad=0.0)  # a pitch of 10.97 px along pixels: 4.3e-4 of the pitch, 0.039 px
@example(seed=2758, hexagonal=False, bad=0.3)  # 10.07×10.00 px, turned by 0.1°: 0.021°, 0.049 px
@example(seed=2036, hexagonal=True, bad=0.3)  # 11.99×11.00 px, turned by 0.03°
@given(seed=st.integers(0, 10**6), hexagonal=st.booleans(), bad=st.sampled_from((0.0, 0.3)))
@example(seed=23, hexagonal=True, bad=0.3)  # saturated neighbours pulled centres: 1.1e-4 of the pitch
@example(seed=40, hexagonal=True, bad=0.3)  # lenses of 8 px, of which saturated ones hid their neighbours' periods
def test_a_random_camera_is_found(seed, hexagonal, bad):
    """`python -m benchmarks run calibration` has 500 cameras.

    Of 48 000 cameras, the 64 whose micro-images lie most alike in their pixels had up to twice the stated errors.
    """
    found, times = trial(seed, hexagonal, bad), 3 if alike(seed, hexagonal, bad) else 1
    assert found["pitch"] < times * 1e-4
    assert found["turn_deg"] < times * 0.005
    assert found["centres_px"] < times * 0.02


def alike(seed, hexagonal, bad):
    """Whether places of centres in their pixels change by less than 1.5 px over the picture, across or down."""
    rng = np.random.default_rng((seed, hexagonal, round(100 * bad)))  # as in `trial`
    size = int(rng.integers(300, 701)), int(rng.integers(300, 701))
    pitch = rng.uniform(max(6, min(size) / 60), min(24, min(size) / 20))
    camera = random_camera(rng, size, pitch, hexagonal)
    turn = abs(np.sin(np.radians(camera.lens_turn_deg)))
    pairs = list(zip(camera.pixels, camera.lens_lattice.pitch, strict=True))
    return any(
        abs(p - round(p)) * n / p + turn * other < 1.5
        for (n, p), other in zip(pairs, camera.pixels[::-1], strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(0, 36, 3))
def test_seeded_cameras_are_found(seed):
    """The same bounds as above, with cameras that never change."""
    found = trial(seed, seed % 2 == 1, (0.0, 0.3)[seed // 2 % 2])
    assert found["pitch"] < 1e-4 and found["turn_deg"] < 0.005 and found["centres_px"] < 0.02


@pytest.mark.parametrize(
    "kind, border_pitches", first_fast([("perspective", 1.0), ("perspective", 0.2), ("radial", 0.5)])
)
def test_a_distorted_grid_is_followed(kind, border_pitches):
    """Before, the straight grid was judged first, and grids in perspective were refused."""
    found = distorted(kind, border_pitches, 0)
    assert found["centres_px"] < 0.02 and found["straight_px"] > 0.5


@pytest.mark.slow
def test_a_drift_steeper_than_cameras_have_is_named():
    with pytest.raises(NoLenses, match=r"drift by up to \d+\.\d px off a straight grid, which no camera can follow"):
        distorted("radial", 2.0, 0)


def test_signs_of_turn_offset_and_shear():
    """By hand: rows that rise to the right turn anticlockwise; y runs up in the offset; lower rows lean right."""
    camera = IICamera(
        pixels=(300, 300), lenses=(20, 20), pixel_pitch_mm=0.01, gap_mm=0.5, lens_pitch_mm=0.14,
        lens_turn_deg=3.0, lens_shear=0.02, lens_offset_mm=(0.03, 0.05),
    )  # fmt: skip
    (x0, x1), (y0, y1) = camera.lens_lattice.centres(np.array([0, 19]), np.array([10, 10]))
    assert x1 > x0 and y1 < y0  # up is less n
    straight = replace(camera, lens_turn_deg=0.0)
    xs, _ = straight.lens_lattice.centres(np.array([10, 10]), np.array([0, 19]))
    assert xs[1] - xs[0] == pytest.approx(0.02 * 19 * 14)
    assert camera.lens_lattice.middle == pytest.approx((150 + 3, 150 - 5))
    L, _ = camera.rays(slice(145, 146), slice(153, 154))
    assert abs(L[0, 0, 0] - 0.03) < 0.14 and abs(L[0, 0, 1] - 0.05) < 0.14


def test_calibration_gives_back_turn_shear_and_place():
    camera, image = shot(4)
    found = calibrate(image).camera
    assert found.lens_turn_deg == pytest.approx(camera.lens_turn_deg, abs=0.005)
    assert found.lens_shear == pytest.approx(camera.lens_shear, abs=1e-4)
    assert found.lattice == "rectangular" and found.pixels == camera.pixels
    # Same rays but for the main lens: the lens under a pixel stands where the known camera has it.
    m, n = np.array([40, 160, 290]), np.array([30, 200, 260])
    k, l = camera.lens_lattice.nearest(m, n)
    x, y = found.lens_lattice.centres(*found.lens_lattice.nearest(m, n))
    np.testing.assert_allclose(np.stack([x, y], axis=1), micro_image_centres(camera, k, l), atol=0.03)


@pytest.mark.parametrize("hexagonal", [False, True])
def test_the_cameras_lattice_is_the_fitted_grid(hexagonal):
    """Pitch, turn and shear of the camera give back the two fitted vectors: axes have the determinant 1."""
    rng = np.random.default_rng(14)
    camera = replace(random_camera(rng, (330, 300), 13.3, hexagonal), lens_turn_deg=3.0, lens_shear=0.01)
    found = calibrate(exposed(white_image(camera), camera, rng))
    lattice = found.camera.lens_lattice
    k, l = (g.ravel() for g in np.meshgrid(*(np.arange(n) for n in lattice.lenses)))
    centres = np.stack(lattice.centres(k, l), axis=1)
    off = np.abs(centres[:, None] - found.grid.places[None]).max(axis=2).min(axis=1)
    assert off.max() < 1e-6
    at = np.floor(centres).astype(int).T
    np.testing.assert_array_equal(lattice.nearest(*at), (k, l))


@pytest.mark.parametrize("hexagonal", [False, True])
def test_every_lens_of_the_camera_lies_in_the_picture(hexagonal):
    camera = calibrate(shot(8, hexagonal)[1]).camera
    k, l = np.meshgrid(np.arange(camera.lenses[0]), np.arange(camera.lenses[1]))
    places = np.stack(camera.lens_lattice.centres(k, l), axis=-1)
    half = 0.44 * np.array(camera.lens_lattice.pitch)
    assert (places > half).all() and (places < np.array(camera.pixels) - half).all()
    assert camera.lens_lattice.hexagonal == hexagonal
    assert camera.lenses[0] * camera.lenses[1] > 0.75 * 330 * 300 / np.prod(camera.lens_lattice.pitch)


def test_rows_that_run_down_turn_the_picture():
    camera, image = shot(3, hexagonal=True)
    found = calibrate(np.rot90(image, -1).copy())
    assert found.turned
    assert errors(camera, found)["centres_px"] < 0.02
    made = calibrated_picture(found, np.rot90(image, -1).copy())
    assert made.size == camera.pixels


def test_dark_and_saturated_lenses_are_counted_and_left_out():
    found = calibrate(shot(5, bad=0.3, size=(400, 400))[1])
    report = found.report()
    share = report["centres_used"] / report["centres"]
    assert 0.55 < share < 0.8  # 0.7 but for chance
    assert report["dark_lenses"] > 0.08 * report["centres"] < report["saturated_lenses"]


def test_the_picture_itself_serves_in_place_of_a_white_image():
    """Micro-images of a scene with dark borders: the estimate is weaker, and the report warns of it."""
    camera, _ = shot(6, size=(400, 400), pitch=16.0)
    rng = np.random.default_rng(0)
    scene = np.exp(0.2 * ndimage.zoom(rng.normal(size=(80, 80)), 5, order=1))
    image = exposed(white_image(camera) * scene.astype(np.float32) / 2, camera, rng)
    found = calibrate(image)
    assert found.source == "picture itself"
    assert any("a white image is surer" in note for note in found.not_told())
    off = errors(camera, found)
    assert off["centres_px"] < 0.5 and off["pitch"] < 2e-3


@pytest.mark.parametrize(
    "depth", [pytest.param(12, marks=pytest.mark.slow), 40, pytest.param(100, marks=pytest.mark.slow)]
)
def test_micro_images_without_borders_are_refused(depth):
    """Behind pinholes the content repeats at more than the lens pitch, and micro-images have no dark borders."""
    camera = preset("plenoptic", scale=8)
    L, D = camera.rays()
    at = L + (depth - L[..., 2:]) / D[..., 2:] * D
    texture = ndimage.gaussian_filter(np.random.default_rng(5).random((400, 400)), 4, mode="wrap")
    places = [at[..., 1] * 200 / depth, at[..., 0] * 200 / depth]
    with pytest.raises(NoLenses):
        calibrate(ndimage.map_coordinates(texture, places, order=1, mode="grid-wrap"))


NOISE = np.random.default_rng(1).normal(size=(300, 300))


@pytest.mark.parametrize(
    "picture",
    [
        np.ones((200, 200)),
        NOISE,
        ndimage.gaussian_filter(NOISE, 3),
        np.add.outer(np.arange(300.0), np.arange(300.0)),
        np.tile(np.sin(np.arange(300) / 2), (300, 1)) + 0.1 * NOISE,
        np.ones((12, 300)),
    ],
    ids=["even", "noise", "clouds", "ramp", "stripes", "low"],
)
def test_a_picture_without_lenses_is_refused(picture):
    with pytest.raises(NoLenses, match="lenses"):
        calibrate(picture)


def test_frames_of_other_sizes_are_refused():
    with pytest.raises(ValueError, match=r"white is \(10, 10\) and raw \(300, 300\)"):
        calibrate(NOISE, white=NOISE[:10, :10])
    with pytest.raises(ValueError, match="pixel_pitch_mm is 0"):
        calibrate(NOISE, pixel_pitch_mm=0)


def test_values_that_are_not_finite_are_named():
    _, image = shot(4)
    bad = image.astype(np.float32)
    bad[3, 5], bad[7, 7] = np.nan, np.inf
    for frames in ({"raw": bad}, {"raw": image, "white": bad}, {"raw": image, "dark": bad}):
        with pytest.raises(
            ValueError, match="has 1 NaN and 1 infinite of 99000 values, the first at row 3, column 5"
        ):
            calibrate(**frames)
    with pytest.raises(ValueError, match="white has 1 NaN and 1 infinite"):
        calibrated_picture(calibrate(image), image, white=bad)
    bad[3, 5] = 0
    with pytest.raises(ValueError, match="raw has 1 infinite of 99000 values, the first at row 7, column 7"):
        calibrate(bad)


def test_a_saturated_picture_is_named():
    camera, _ = shot(4)
    with pytest.raises(NoLenses, match="a shorter exposure is needed"):
        calibrate(white_image(camera))


def test_vignetting_is_divided_out_without_the_white_images_noise():
    """A scene of even light: what is left of shading and of noise, in the inner half of the micro-images."""
    camera, _ = shot(2, size=(300, 300), pitch=15.0)
    share = white_image(camera)
    rng = np.random.default_rng(9)
    noisy_white, clean_raw = (
        exposed(share, camera, rng),
        share * (1 - 0.2 * np.add.outer(*[np.linspace(-1, 1, 300) ** 2] * 2)),
    )
    found = calibrate(noisy_white)
    factors = gain(averaged(noisy_white - 30.0, found.grid.lattice))
    even = clean_raw * factors
    x, y = found.grid.lattice.centres(*np.meshgrid(*map(np.arange, found.grid.lattice.lenses)))
    middles = even[np.floor(y).astype(int), np.floor(x).astype(int)]
    before = clean_raw[np.floor(y).astype(int), np.floor(x).astype(int)]
    assert before.std() / before.mean() > 0.08  # falls off to the corners
    assert middles.std() / middles.mean() < 0.012  # division by the white pixel itself leaves its noise, 0.023
    assert factors.max() <= (1 + FLOOR**2) / (2 * FLOOR) + 1e-3


def test_averaging_keeps_the_profile_and_a_third_of_the_noise():
    camera, _ = shot(2, size=(300, 300), pitch=15.0)
    share = white_image(camera)
    found = calibrate(exposed(share, camera, np.random.default_rng(0)))
    noise = np.random.default_rng(1).normal(0, 0.02, share.shape).astype(np.float32)
    quiet = averaged(share, found.grid.lattice)
    left = (averaged(share + noise, found.grid.lattice) - quiet)[60:-60, 60:-60]
    assert left.std() < 0.45 * noise.std()
    assert np.abs(quiet - share)[60:-60, 60:-60][share[60:-60, 60:-60] == 1].mean() < 0.02


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mosaic", MOSAICS)
def test_demosaicing_is_exact_on_slopes(mosaic, method):
    """Means and differences of opposite neighbours are exact where every colour is linear."""
    y, x = np.mgrid[:20, :22].astype(np.float32)
    true = np.stack([10 + x, 5 + 2 * y, x + y], axis=-1)
    raw = np.zeros((20, 22), np.float32)
    for channel, places in enumerate(phases(mosaic).values()):
        for row, col in places:
            raw[row::2, col::2] = true[row::2, col::2, channel]
    inner = slice(3, -3), slice(3, -3)
    np.testing.assert_allclose(demosaiced(raw, mosaic, method=method)[inner], true[inner], atol=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_colours_do_not_leak_between_lenses(method):
    raw = np.where(np.arange(16)[None] < 8, 100.0, 0.0).repeat(16, axis=0).astype(np.float32)
    owner = np.where(np.arange(16)[None] < 8, 0, 1).repeat(16, axis=0)
    assert set(np.unique(demosaiced(raw, "rggb", owner, method=method))) == {0.0, 100.0}
    assert len(np.unique(demosaiced(raw, "rggb", method=method))) > 2


def test_detail_of_light_is_demosaiced_better_by_direction():
    """Grey detail finer than the mosaic, behind lenses: the error falls by more than half."""
    y, x = np.mgrid[:90, :96]
    grey = 50 + 40 * np.sin(x / 1.7) * np.cos(y / 2.3)
    owner = (y // 15) * 7 + x // 14
    errors = [demosaiced(grey, "grbg", owner, method=m) - grey[..., None] for m in METHODS]
    assert np.std(errors[0]) < 0.5 * np.std(errors[1])


@pytest.mark.slow
def test_dead_and_hot_pixels_are_found_by_the_white_picture_and_repaired():
    _, white = shot(5, hexagonal=True, pitch=14.3)
    rng = np.random.default_rng(2)
    found = calibrate(white)
    raw = white.astype(np.float32) * 0.5
    bad = np.zeros(raw.shape, bool)
    light = averaged(white - 30.0, found.grid.lattice)
    bright, dim = np.argwhere(light > 900), np.argwhere((light > 300) & (light < 1000))
    chosen = np.concatenate([places[rng.choice(len(places), 20, replace=False)] for places in (bright, dim)])
    bad[tuple(chosen.T)] = True
    spoilt_raw, spoilt = raw.copy(), white.astype(np.float32)
    spoilt[tuple(chosen[:20].T)], spoilt_raw[tuple(chosen[:20].T)] = 30, 15
    spoilt[tuple(chosen[20:].T)], spoilt_raw[tuple(chosen[20:].T)] = 2300, 1150
    seen = defective_pixels(found, spoilt)
    assert (seen & bad).sum() >= 32 and (seen & ~bad).mean() < 1e-3  # those are borders of micro-images
    clean = calibrated_picture(found, raw, white=white, full_scale=1000.0).pixels.astype(int)
    mended = calibrated_picture(found, spoilt_raw, white=spoilt, full_scale=1000.0).pixels.astype(int)
    kept = calibrated_picture(found, spoilt_raw, white=white, full_scale=1000.0).pixels.astype(int)
    assert np.abs(mended - clean)[seen & bad].mean() < 0.2 * np.abs(kept - clean)[seen & bad].mean()


def test_colours_of_the_metadata_are_applied_after_levels_and_before_the_curve():
    """A grey card seen by a sensor of other sensitivities: gains, matrix, sRGB, against the definition."""
    _, white = shot(5, pitch=14.3)
    found = calibrate(white)
    colour = RawColour((1.5, 1.0, 2.0), ((1.6, -0.5, -0.1), (-0.2, 1.5, -0.3), (0.0, -0.4, 1.4)))
    light = np.array([0.2, 0.3, 0.4])  # linear sRGB
    seen = np.linalg.solve(np.array(colour.matrix), light) / colour.gains
    raw = np.broadcast_to(seen * 900, (*white.shape, 3)).astype(np.float32)
    made = calibrated_picture(found, raw, colour=colour, full_scale=900.0, bits=16)
    np.testing.assert_allclose(made.pixels[50, 50] / 65535, srgb(light), atol=2e-5)
    over = np.full((*white.shape, 3), 900, np.float32)  # a saturated sensor is white, whatever the gains
    assert calibrated_picture(found, over, colour=colour, full_scale=900.0).pixels.min() >= 254


@pytest.mark.slow
def test_a_calibrated_picture_shows_the_views_of_a_straight_camera():
    """A rotated hexagonal array, calibrated and converted to a regular structure: the same views as a straight array.

    The scene lies on a plane, so that views are known in closed form: brightness is a wave over the plane.
    """
    rng = np.random.default_rng(11)
    camera = random_camera(rng, (420, 400), 14.2, False)
    grown = growth(camera)  # lenses stand where their micro-images are
    pitch, offset = (tuple(x * grown for x in pair) for pair in (camera.lens_pitch_mm, camera.lens_offset_mm))
    L, D = replace(camera, optics=("pinhole",), lens_pitch_mm=pitch, lens_offset_mm=offset).rays()
    t = (5 - L[..., 2]) / D[..., 2]
    wave = 0.5 + 0.4 * np.sin((L[..., 0] + t * D[..., 0]) * 4) * np.cos((L[..., 1] + t * D[..., 1]) * 5)
    white = exposed(white_image(camera), camera, rng)
    raw = (white - 30.0).clip(0) * wave
    found = calibrate(raw, white=white - 30.0, pixel_pitch_mm=camera.pixel_pitch_mm, gap_mm=camera.gap_mm)
    made = calibrated_picture(found, raw, white=white - 30.0, full_scale=2000.0, bits=16)
    regular, valid = resampled(made)
    assert valid.mean() > 0.99
    from ii_core.base.colour import linear

    (u, v), lattice = regular.ei_pixels, made.camera.lens_lattice
    for place in ((u // 2, v // 2), (u // 2 + 2, v // 2 - 3)):
        si = linear(sub_images(regular)[place[1], place[0], ..., 0] / 65535)
        k, l = np.meshgrid(np.arange(regular.lenses[0]), np.arange(regular.lenses[1]))
        x, y = lattice.centres(k, l)
        off = lattice.offsets(
            (place[0] - (u - 1) / 2) * lattice.pitch[0] / u, (place[1] - (v - 1) / 2) * lattice.pitch[1] / v
        )
        pixel = made.camera.pixel_pitch_mm
        lx, ly = (x - 210) * pixel, (200 - y) * pixel
        reach = (5 - camera.gap_mm) / camera.gap_mm
        expected = 0.5 + 0.4 * np.sin((lx - off[0] * pixel * reach) * 4) * np.cos((ly + off[1] * pixel * reach) * 5)
        assert np.corrcoef(si.ravel(), expected.ravel())[0, 1] > 0.99
        assert np.abs(si - expected).mean() < 0.03  # of noise and interpolation


DRIFT = (  # mm; up to 2 px at the corners of 320×280 px of 5 µm
    (0.0010, -0.0008, 0.0006, -0.0030, 0.0004, -0.0026, -0.0006),
    (-0.0004, 0.0010, 0.0008, 0.0005, -0.0028, 0.0007, -0.0030),
)


def off_the_middle(regular):
    """Return how far the light of each elementary image lies from its middle, (L·K, 2) pixels."""
    (k, l), (u, v) = regular.lenses, regular.ei_pixels
    light = regular.pixels[..., 0].astype(float).reshape(l, v, k, u)
    light = np.maximum(light - 0.3 * light.max(), 0)  # borders hold noise of neighbours
    across, down = light.sum(axis=1), light.sum(axis=3).transpose(0, 2, 1)
    middles = ((np.arange(n) - (n - 1) / 2) for n in (u, v))
    return np.stack([(a @ m / a.sum(axis=-1)).ravel() for a, m in zip((across, down), middles, strict=True)], axis=1)


@pytest.mark.parametrize("hexagonal", [False, True])
def test_a_drift_is_found_and_undone(hexagonal):
    """Before, a drift was reported and left in the picture."""
    rng = np.random.default_rng(21)
    camera = replace(random_camera(rng, (320, 280), 12.4, hexagonal), lens_drift_mm=DRIFT)
    share = white_image(camera)
    found = calibrate(exposed(share, camera, rng), pixel_pitch_mm=camera.pixel_pitch_mm)
    assert 1.0 < found.report()["drift_px"] < 2.5 and "the camera follows" in found.describe()
    assert found.report()["straight_grid_rms_px"] > 0.1
    assert errors(camera, found)["centres_px"] < 0.02
    # The image of a drift by the main lens is as much larger as that of the pitch. A factor's error is ten times
    # that of a centre's place, 0.02 px, as terms of the third degree are alike.
    true, seen = growth(camera) * np.array(DRIFT), np.array(found.camera.lens_drift_mm)
    np.testing.assert_allclose(seen, true, atol=0.2 * camera.pixel_pitch_mm)
    made = calibrated_picture(found, 2000 * share, bits=16, full_scale=2000.0)
    regular, _ = resampled(made)
    straight, _ = resampled(replace_camera(made, lens_drift_mm=None))
    undone, left = (np.sqrt((off_the_middle(p) ** 2).sum(axis=1).mean()) for p in (regular, straight))
    # Borders of cells cut the discs of light: without any drift in the camera, the measure is 0.12 and 0.07 px.
    assert undone < 0.13 and 3 * undone < left


def replace_camera(picture, **values):
    camera = replace(picture.camera, **values)
    return IIPicture(picture.pixels, camera.lenses, camera.ei_pixels, camera)


@pytest.mark.slow
def test_the_drift_of_a_real_main_lens_is_followed():
    """A double Gauss: its pupil moves with the field, and micro-images with it. Truth is the light without noise."""
    found = behind_glass(scale=16)
    assert found["followed_px"] < 0.015 < 0.025 < found["straight_px"]  # no straight grid is nearer than the last


def test_without_drift_none_is_fitted():
    assert all(calibrate(shot(seed)[1]).camera.lens_drift_mm is None for seed in (4, 9))


def test_marks_stand_on_centres(tmp_path):
    _, image = shot(7)
    found = calibrate(image)
    made = calibrated_picture(found, image)
    marks = centres_picture(found, made)
    assert marks.shape == (600, 660, 3)
    place = np.floor(2 * found.grid.places[100]).astype(int)
    assert tuple(marks[place[1], place[0]]) == (0, 255, 0)
    made.save(tmp_path / "p.png")
    back = IIPicture.load(tmp_path / "p.png")
    assert back.camera == found.camera and not back.regular


@pytest.mark.slow
def test_alternating_lens_types_are_reported():
    """A 2×2 pattern of sharp and blurred lenses, as of multi-focus arrays."""
    camera, _ = shot(12, size=(500, 500), pitch=16.0)
    rng = np.random.default_rng(3)
    texture = rng.random((500, 500)).astype(np.float32)
    k, l = camera.lens_lattice.nearest(np.arange(500)[None], np.arange(500)[:, None])
    sharp = (k + l) % 2 == 0
    scene = np.where(sharp, ndimage.gaussian_filter(texture, 0.7), ndimage.gaussian_filter(texture, 2.5))
    image = exposed(white_image(camera) * (0.3 + 0.5 * scene), camera, rng)
    white = exposed(white_image(camera), camera, rng)
    assert calibrate(image, white=white).types.pattern == "2×2"
    even = exposed(white_image(camera) * (0.3 + 0.5 * ndimage.gaussian_filter(texture, 1)), camera, rng)
    assert calibrate(even, white=white).types.pattern == "one"


def test_a_mosaic_that_does_not_divide_is_cut_with_a_warning(tmp_path):
    """Pictures are never cropped silently: the report counts the pixels outside."""
    _, image = shot(1)
    outside = calibrate(image).report()["pixels_outside"]
    assert set(outside) == {"left", "right", "top", "bottom"} and max(outside.values()) > 0
    from ii_core.base.files import write_image

    write_image(tmp_path / "m.png", image)
    with pytest.warns(UserWarning, match="cut off"):
        load_mosaic(tmp_path / "m.png", (13, 13))


@pytest.fixture(scope="module")
def multi_focus():
    return multi_focus_pictures(20, (14, 12), 36)


@pytest.mark.slow
def test_lens_types_and_their_foci_are_found(multi_focus):
    """At every depth another type is sharp, so that types are alike over the whole picture."""
    raw, white = multi_focus.raw, multi_focus.white
    rng = np.random.default_rng(3)
    light = linear(raw.pixels / 255) * white[..., None]
    frames = [rng.poisson(3000 * a + 10).astype(np.uint16) for a in (light, white)]
    found = calibrate(frames[0], white=frames[1], gap_mm=0.4, pixel_pitch_mm=0.006)
    assert found.types.pattern == "3" and found.report()["lens_type_rows"] == [[0, 1, 2], [2, 0, 1]]
    picture = calibrated_picture(found, *frames[:1], white=frames[1])
    foci = lens_foci(picture, found.types)
    np.testing.assert_allclose(foci.shifts, SHIFTS, atol=0.03)
    camera = with_foci(found.camera, foci)
    assert of_camera(camera).shifts == pytest.approx(sorted(foci.shifts, reverse=True))
    given = lens_foci(picture, found.types, depths=(5, 1 / 0.3, 10))
    assert given.shifts == pytest.approx(SHIFTS)
    with pytest.raises(ValueError, match="2 virtual depths are given, and the array has 3"):
        lens_foci(picture, found.types, depths=(2.0, 3.0))
    even = calibrate(frames[1], white=frames[1]).types
    assert even.pattern == "one" and lens_foci(picture, even) is None


@pytest.mark.slow
def test_pixels_come_from_lenses_in_focus(multi_focus):
    """The truth is rendered through pinholes."""
    raw, sharp, _, true, inner = multi_focus
    shifts = shifts_of(raw)
    assert np.nanmedian(abs(shifts - true)[inner]) < 0.005 and (abs(shifts - true)[inner] < 0.03).mean() > 0.9
    made, taken = fused(raw, shifts=shifts)
    assert psnr(made, sharp, inner) > psnr(raw, sharp, inner) + 4
    assert 0.4 < taken[inner].mean() < 0.8 and (made.pixels[~taken] == raw.pixels[~taken]).all()
    assert of_camera(made.camera) is None
    near = inner & (abs(true - 0.3) < 0.01)
    of_each = [psnr(fused(raw, only=t, shifts=shifts)[0], sharp, near) for t in range(3)]
    assert of_each[0] > of_each[1] + 3 > of_each[2] + 6  # type 0 of the camera has the shortest focal length
    with pytest.raises(ValueError, match="lens type is 3: the array has types 0 to 2"):
        fused(raw, only=3)
    with pytest.raises(ValueError, match="only one focus"):
        fused(made)


@pytest.mark.slow
def test_a_depth_that_one_lens_alone_shows_is_left():
    """Matching needs two other lenses that show the point; without detail nothing changes."""
    camera = preset("multi-focus", scale=64)
    flat = IIPicture(np.full((*camera.pixels[::-1], 3), 90, np.uint8), camera.lenses, camera.ei_pixels, camera)
    assert (fused(flat)[0].pixels == 90).all()
    assert len(of_camera(camera).shifts) == 4 and lens_foci(flat, LensTypes("2×2", 1.0, (0.0,) * 4)) is None


def test_virtual_depths_of_a_raytrix_file(tmp_path):
    """The form is that of samliu0631/Light-Field-Simulation and shabiouyang/Raytrix-Light-Field-Video."""
    each = (
        "<lens_type id='{}'><depth_range units='virtual_depth'><min>{}</min><max>{}</max></depth_range></lens_type>"
    )
    body = "".join(each.format(i, low, high) for i, low, high in ((1, 2, 6), (0, 1, 3), (2, 3, 6)))
    file = tmp_path / "calibration.xml"
    file.write_text(f"<RayCalibData version='1.0'>{body}</RayCalibData>")
    assert virtual_depths(file) == pytest.approx((1.5, 3.0, 4.0))
    for text, said in (
        (f"<!DOCTYPE a [<!ENTITY b 'c'>]><RayCalibData>{body}</RayCalibData>", "without declarations"),
        ("<RayCalibData/>", "of 0 lens_type: <RayCalibData> of 2 to 4 is needed"),
        (f"<Other>{body}</Other>", "<Other>"),
        (f"<RayCalibData>{body.replace('6', 'nan')}</RayCalibData>", "min < max"),
        ("none", "no calibration of a Raytrix camera"),
    ):
        file.write_text(text)
        with pytest.raises(ValueError, match=said):
            virtual_depths(file)


@pytest.mark.slow
def test_import_of_a_multi_focus_picture(run, refused, multi_focus, tmp_path):
    """Types are kept, fused, or one is taken; foci are found or given."""
    rng = np.random.default_rng(3)
    light = linear(multi_focus.raw.pixels / 255) * multi_focus.white[..., None]
    for name, values in (("raw", light), ("white", multi_focus.white)):
        write_image(tmp_path / f"{name}.png", rng.poisson(20000 * values + 10).astype(np.uint16))
    command = "import", tmp_path / "raw.png", "--whites", tmp_path / "white.png", "-o", tmp_path / "f.png", "--force"
    code, out, _ = run(*command, "--foci", "3.33,10,5")
    assert code == 0 and "type 0: +0.100, type 1: +0.200, type 2: +0.300" in out
    kept = IIPicture.load(tmp_path / "f.png")
    assert of_camera(kept.camera).matrix == ((2, 1, 0), (0, 2, 1))  # by focal length
    code, out, _ = run(*command, "--lens-types", "fuse")
    made = IIPicture.load(tmp_path / "f.png")
    assert code == 0 and "in better focus" in out and of_camera(made.camera) is None
    assert made.lenses == kept.lenses
    refused(run(*command, "--lens-types", "sharp"), "keep, fuse or the number of a type")
    refused(run(*command, "--foci", "3,x"), "2 to 4 virtual depths beyond 1")
    refused(
        run("import", tmp_path / "f.png", "--ei-pixels", "2x2", "-o", tmp_path / "g.png", "--foci", "2,3"), "--whites"
    )


@pytest.mark.slow
def test_depth_of_a_raw_picture_whose_points_are_all_before_the_plane_in_focus():
    """Rendered through a double Gauss. The camera is not told of it: its exit pupil's distance scales disparities."""
    camera = preset("plenoptic1-double-gauss", scale=4)
    shot = render(load_scene("cuboid"), camera, samples=4, support=("depth",))
    places = [(x, y) for x in (0.2, 0.5, 0.8) for y in (0.2, 0.5, 0.8)]
    share = np.mean([camera.weighted_rays(sample=place)[2] for place in places], axis=0)[..., None]
    noise = np.random.default_rng(0).normal(0, 3, share.shape)
    white = np.repeat((215 * share + noise).clip(0, 255), 3, 2).astype(np.uint8)
    found = calibrate(shot.picture.pixels, white=white)
    field = resampled(calibrated_picture(found, shot.picture.pixels, white=white, curve="srgb"))[0]
    (u, v), estimate = camera.ei_pixels, estimate_depth(field).disparity
    truth = disparity_of_depth(camera, shot.depth[v // 2 :: v, u // 2 :: u])
    assert np.nanmin(truth) > 0.3 and (estimate > 0).mean() > 0.98
    assert 0.93 < np.nanmedian(estimate / truth) < 1.03
