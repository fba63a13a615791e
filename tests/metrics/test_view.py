"""Q_view and error maps."""

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from ii_core import IICamera, IIPicture, five_viewpoints, view_image
from metrics import q_view

PEAKS = {"uint8": 255, "uint16": 65535, "float32": 1.0}


def picture(dtype="uint8", lenses=(16, 12), seed=0):
    camera = IICamera(pixels=(lenses[0] * 6, lenses[1] * 6), lenses=lenses, pixel_pitch_mm=0.1, gap_mm=1.2)
    values = np.random.default_rng(seed).random((lenses[1] * 6, lenses[0] * 6, 3)) * PEAKS[dtype]
    return IIPicture(values.astype(dtype), lenses, (6, 6), camera)


def noisy(source, seed=1):
    rng = np.random.default_rng(seed)
    peak = PEAKS[source.pixels.dtype.name]
    return source.with_pixels(
        np.clip(source.pixels + rng.normal(0, 0.1 * peak, source.pixels.shape), 0, peak).astype(source.pixels.dtype)
    )


def test_identical_is_one_in_every_view():
    q = q_view(picture(), picture())
    assert q.values == dict.fromkeys(("front", "up", "down", "left", "right"), 1.0)
    assert q.mean == 1


def test_against_ssim_written_out():
    a, b = picture(), noisy(picture())
    view = five_viewpoints(a.camera)["left"]
    x, y = (view_image(p, view)[0] @ [0.2989, 0.587, 0.114] for p in (a, b))

    # Wang 2004, (13), by hand at every place the window fits into.
    offset = np.arange(11) - 5
    window = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * 1.5**2))
    window /= window.sum()
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    values = []
    for i in range(x.shape[0] - 10):
        for j in range(x.shape[1] - 10):
            p, q = x[i : i + 11, j : j + 11], y[i : i + 11, j : j + 11]
            mp, mq = (window * p).sum(), (window * q).sum()
            vp, vq = (window * (p - mp) ** 2).sum(), (window * (q - mq) ** 2).sum()
            cov = (window * (p - mp) * (q - mq)).sum()
            values.append((2 * mp * mq + c1) * (2 * cov + c2) / ((mp**2 + mq**2 + c1) * (vp + vq + c2)))
    # Same window in two passes against one: float64 rounding, amplified by variances from differences of squares.
    assert q_view(a, b).values["left"] == pytest.approx(np.mean(values), abs=1e-9)


@pytest.mark.parametrize("dtype", ["uint16", "float32"])
def test_other_types_mean_the_same(dtype):
    a, b = picture(), noisy(picture())
    scale = PEAKS[dtype] / 255
    other = (p.with_pixels((p.pixels * scale).astype(dtype)) for p in (a, b))
    # View images of 8-bit pictures are rounded to code values, others finer: ±½ of 255 moves SSIM by about 1e-3.
    assert q_view(*other).mean == pytest.approx(q_view(a, b).mean, abs=3e-3)


def test_mean_is_that_of_the_views_and_noise_costs():
    q = q_view(picture(), noisy(picture()))
    assert q.mean == pytest.approx(np.mean(list(q.values.values())), rel=1e-14)
    assert all(0 < value < 0.99 for value in q.values.values())


def test_only_pixels_in_view_count():
    a = picture()
    pixels = a.pixels.copy().reshape(12, 6, 16, 6, 3)
    pixels[:, 0, :, 0] ^= 255  # a corner direction: none of the five views goes there
    q = q_view(a, a.with_pixels(pixels.reshape(a.pixels.shape)))
    assert q.values["front"] == 1


def test_decoded_needs_no_camera_but_reference_does():
    a = picture()
    bare = IIPicture(a.pixels, a.lenses, a.ei_pixels)
    assert q_view(a, bare).mean == 1
    with pytest.raises(ValueError, match="no camera"):
        q_view(bare, a)


def test_refusals():
    small = picture(lenses=(16, 10))
    with pytest.raises(ValueError, match=r"16×10 lenses .* at least 11×11"):
        q_view(small, small)
    with pytest.raises(ValueError, match="different type"):
        q_view(picture(), picture("uint16"))
    a = picture("float32")
    pixels = a.pixels.copy()
    pixels[30:42, 40:52] = np.nan
    with pytest.raises(ValueError, match=r"decoded pixel \(40, 30\)"):
        q_view(a, a.with_pixels(pixels))


def test_smallest_picture_has_one_window():
    a = picture(lenses=(11, 11))
    b = noisy(a)
    x, y = (view_image(p, five_viewpoints(a.camera)["front"])[0] @ [0.2989, 0.587, 0.114] for p in (a, b))
    _, full = structural_similarity(
        x, y, data_range=255, gaussian_weights=True, use_sample_covariance=False, full=True
    )
    assert q_view(a, b).values["front"] == pytest.approx(full[5, 5], rel=1e-12)  # the same number, averaged alone


def test_psnr_of_the_views_pooled_and_averaged():
    a, b = picture(), noisy(picture())
    q = q_view(a, b)
    squares = {}
    for name, viewpoint in five_viewpoints(a.camera).items():
        x, y = (view_image(p, viewpoint)[0].astype(float) for p in (a, b))
        squares[name] = np.square(x - y).mean()
        assert q.psnr[name] == pytest.approx(10 * np.log10(255**2 / squares[name]), rel=1e-12)
    assert q.pooled_psnr == pytest.approx(10 * np.log10(255**2 / np.mean(list(squares.values()))), rel=1e-12)
    assert q.mean_psnr == pytest.approx(np.mean(list(q.psnr.values())), rel=1e-12) and q.mean_psnr >= q.pooled_psnr
    assert q.worst == min(q.values.values()) == q.values[q.worst_view]
    same = q_view(a, a)
    assert same.psnr == dict.fromkeys(q.psnr, np.inf) and same.pooled_psnr == np.inf


def test_pixels_past_the_picture_do_not_count():
    a, b = picture(lenses=(32, 14)), noisy(picture(lenses=(32, 14)))
    front = five_viewpoints(a.camera)["front"]
    aside = front + np.array([2 * abs(front[2]), 0, 0])  # some lenses look past the picture
    q = q_view(a, b, viewpoints={"aside": aside})
    (x, valid), (y, _) = (view_image(p, aside) for p in (a, b))
    assert 11 <= valid.all(axis=0).sum() < 32
    columns = np.flatnonzero(valid.all(axis=0))
    x, y = (image[:, columns[0] : columns[-1] + 1] for image in (x, y))
    gray = [image @ [0.2989, 0.587, 0.114] for image in (x, y)]
    alone = structural_similarity(*gray, data_range=255, gaussian_weights=True, use_sample_covariance=False)
    assert q.values["aside"] == pytest.approx(alone, abs=1e-12)
    assert q.psnr["aside"] == pytest.approx(10 * np.log10(255**2 / np.square(x.astype(float) - y).mean()), rel=1e-12)
    past = q_view(a, b, viewpoints={"past": (50 * abs(front[2]), 0, front[2]), "front": front})
    assert np.isnan(past.values["past"]) and np.isnan(past.psnr["past"])
    assert past.mean == past.worst == past.values["front"] and past.worst_view == "front"


def test_a_mask_takes_out_what_is_interpolated_from_it():
    a = picture(lenses=(24, 14))
    mask = np.ones(a.pixels.shape[:2], bool)
    mask[:, :36] = False  # six lenses
    b = noisy(a).pixels.copy()
    other = a.with_pixels(np.where(mask[..., None], b, 255 - a.pixels))
    q = q_view(a, other, mask=mask)
    assert q.values == q_view(a, a.with_pixels(b), mask=mask).values
    assert np.isnan(q_view(a, other, mask=np.zeros_like(mask)).mean)
    assert q_view(a, other, mask=np.ones_like(mask)).values == q_view(a, other).values


def test_a_view_pixel_with_a_masked_neighbour_does_not_count():
    """Views lie between pixels: of a masked pixel even a small weight takes the view pixel out."""
    a = picture(lenses=(24, 14))
    viewpoint = five_viewpoints(a.camera)["left"] * [0.7, 1, 1]
    mask = np.ones(a.pixels.shape[:2], bool)
    mask.reshape(14, 6, 24, 6)[:, :, 3:6, 1::2] = False  # every other column under three columns of lenses
    counted, _ = view_image(a.with_pixels(np.repeat(mask[..., None], 3, 2).astype(np.float32)), viewpoint)
    assert 0 < counted.min() < 1  # interpolated between masked and unmasked pixels
    wrong = a.with_pixels(np.where(mask[..., None], a.pixels, 255 - a.pixels))
    q = q_view(a, wrong, viewpoints={"aside": viewpoint}, mask=mask)
    assert q.values["aside"] == 1 and q.psnr["aside"] == np.inf


@pytest.mark.parametrize("z", [1.2, 5.0])
def test_invalid_viewpoints_are_refused(z):
    a = picture()
    with pytest.raises(ValueError, match=r"viewpoint z .* is not before the lens plane at 1.2 mm"):
        q_view(a, a, viewpoints={"inside": (0, 0, z)})
    with pytest.raises(ValueError, match="no viewpoints"):
        q_view(a, a, viewpoints={})
