"""Contract of every registered scheme; see `codec.contract.Coder`."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from codec import decode, encode, schemes, timed_decode
from codec.contract import find, parse_scheme
from ii_core import IICamera, IIPicture
from tests.support.slow import first_fast

SCHEMES = sorted(schemes())


def quick_ones(names, *slow):
    """Schemes of a test of coders, not of kinds of images: other kinds than sub-images are slow tests."""
    others = [*slow, *(name for name in names if name[:3] in ("ei-", "ri-") and f"si-{name[3:]}" in names)]
    return [pytest.param(name, marks=pytest.mark.slow) if name in others else name for name in names]


# Largest error of a noise picture at the finest setting of schemes whose only loss is colour conversion.
EXACT = {"jpeg2000": 0} | {f"{kind}-{coder}": 1 for kind in ("ei", "si", "ri") for coder in ("h264", "vp9")}


@cache
def textured(k=32, l=16, u=8, v=8):
    """Return a textured ball before a textured wall, with disparity and sensor noise."""
    rng = np.random.default_rng(5)
    wall, ball = (_texture(l + 4 * v + 8, k + 4 * u + 8, rng) for _ in range(2))
    field = np.empty((l, v, k, u, 3), np.uint8)
    y, x = np.mgrid[:l, :k]
    for row in range(v):
        for col in range(u):
            inside = np.hypot(x - k / 2 + 0.8 * (col - u / 2), y - l / 2 + 0.8 * (row - v / 2)) < l / 3
            value = np.where(
                inside[..., None], _shifted(ball, 0.8 * row, 0.8 * col, l, k), _shifted(wall, 2 * row, 2 * col, l, k)
            )
            field[:, row, :, col] = np.clip(value + rng.standard_normal((l, k, 1)), 0, 255)
    camera = IICamera(pixels=(k * u, l * v), lenses=(k, l), pixel_pitch_mm=0.0061, gap_mm=0.18, name="bench")
    return IIPicture(field.reshape(l * v, k * u, 3), (k, l), (u, v), camera, erect=True)


def _texture(rows, cols, rng):
    """Return nearly grey noise at several scales."""
    total = np.full((rows, cols, 3), 120.0)
    for scale in (2, 4, 8, 16):
        cells = rng.standard_normal((rows // scale + 2, cols // scale + 2, 1)) + 0.3 * rng.standard_normal(3)
        total += 7 * np.sqrt(scale) * np.kron(cells, np.ones((scale, scale, 1)))[:rows, :cols]
    return total


def _shifted(texture, down, right, rows, cols):
    i, j = int(down), int(right)
    a, b = down - i, right - j
    part = texture[i : i + rows + 1, j : j + cols + 1]
    part = part[:-1] * (1 - a) + part[1:] * a
    return part[:, :-1] * (1 - b) + part[:, 1:] * b


@cache
def large():
    """Return a picture with so many frames of every kind that headers are negligible."""
    return textured(64, 32, 16, 16)


@cache
def many():
    """Return a picture with a third of the pixels, whose headers are small beside its frames."""
    return textured(48, 24, 12, 12)


def psnr(a, b, peak=255):
    with np.errstate(divide="ignore"):
        return 10 * np.log10(peak**2 / np.mean((a.pixels.astype(float) - b.pixels) ** 2))


def quick(scheme):
    """Return the scheme at its fastest, unless its default is that of the dissertation."""
    return f"{scheme}:fast" if "fast" in find(scheme).presets and "h264" not in scheme else scheme


def lossless(scheme):
    coder, options = parse_scheme(scheme)
    return coder.lossless(options)


def subsampled(scheme):
    return "av1" in scheme or "mpeg2" in scheme or parse_scheme(scheme)[1].get("chroma") == "420"


def finest(scheme):
    """Return the goal of a scheme's best quality."""
    coder = parse_scheme(scheme)[0]
    if lossless(scheme):
        return {}
    if coder.qp_range is not None:
        return {"qp": coder.qp_range[0]}
    return {"quality": coder.quality_range[1]} if coder.quality_range is not None else {"bpp": 10_000}


def medium(scheme):
    """Return the goal of a moderate rate, with a quality similar over schemes."""
    coder = find(scheme)
    if coder.rate_control or lossless(scheme):
        return {"bpp": 1.5} if not lossless(scheme) else {}
    if coder.qp_range is not None:
        return {"qp": sum(coder.qp_range) // 2}
    low, high = coder.quality_range
    return {"quality": type(low)((low + high) / 2)}


@cache
def fine(scheme):
    """Return the picture coded by a scheme at its best quality."""
    return encode(textured(), quick(scheme), **finest(scheme))


@cache
def moderate(scheme):
    """Return the picture coded by a scheme at a moderate rate."""
    return encode(textured(), quick(scheme), **medium(scheme))


RATED = [scheme for scheme in SCHEMES if find(scheme).rate_control and not lossless(scheme)]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_round_trip(scheme):
    picture, decoded = textured(), decode(fine(scheme))
    assert decoded.pixels.shape == picture.pixels.shape
    assert decoded.pixels.dtype == picture.pixels.dtype
    assert (decoded.lenses, decoded.ei_pixels, decoded.erect) == (picture.lenses, picture.ei_pixels, picture.erect)
    assert decoded.camera == picture.camera
    if lossless(scheme):
        np.testing.assert_array_equal(decoded.pixels, picture.pixels)
    else:  # 4:2:0 halves the resolution of colour, of which the picture has much
        assert psnr(picture, decoded) > (33 if subsampled(scheme) else 38)
    assert decoded.pixels.flags.writeable


SIXTEEN_BITS = [scheme for scheme in SCHEMES if "uint16" in find(scheme).dtypes]


@pytest.mark.parametrize("scheme", SIXTEEN_BITS)
def test_sixteen_bits_come_back(scheme):
    """To the bit where a scheme, or an option of it, is lossless."""
    coder = find(scheme)
    pixels = textured(16, 8, 4, 4).pixels.astype(np.uint16)
    rng = np.random.default_rng(2)
    picture = IIPicture(pixels * 256 + rng.integers(0, 256, pixels.shape, np.uint16), (16, 8), (4, 4))
    if not lossless(scheme) and "lossless" in coder.options:
        scheme += ":lossless=1"
    decoded = decode(encode(picture, scheme, **finest(scheme)))
    assert decoded.pixels.dtype == np.uint16
    if lossless(scheme):
        np.testing.assert_array_equal(decoded.pixels, picture.pixels)
    else:
        assert psnr(picture, decoded, peak=65535) > 38


@pytest.mark.parametrize("scheme", [s for s in SCHEMES if "lossless" in find(s).options])
def test_eight_bits_come_back_to_the_bit(scheme):
    decoded = decode(encode(textured(), f"{scheme}:lossless=1"))
    np.testing.assert_array_equal(decoded.pixels, textured().pixels)


@pytest.mark.parametrize("scheme", quick_ones(RATED, "si-lf", "si-av1"))
def test_target_rates_are_met(scheme):
    picture = large() if scheme == "ei-mpeg2" else many()  # MPEG-2 fills frames of 12×12 px up to 16×16
    coded = encode(picture, quick(scheme), bpp=1.5)
    assert coded.reached
    assert coded.bpp == pytest.approx(1.5, rel=0.02)


@pytest.mark.parametrize("scheme", quick_ones(SCHEMES))
def test_all_bytes_are_accounted_for(scheme, tmp_path):
    picture, coded = textured(), moderate(scheme)
    path = tmp_path / "coded.ii"
    coded.save(path)
    assert path.read_bytes().endswith(coded.payload)
    assert coded.nbytes == path.stat().st_size
    assert coded.overhead == coded.nbytes - len(coded.payload) <= 64
    assert coded.bpp == 8 * coded.nbytes / picture.pixels[..., 0].size


@pytest.mark.parametrize("scheme", quick_ones(SCHEMES, "si-lf"))
def test_coding_is_reproducible_alone_and_in_parallel(scheme):
    picture, asked = textured(), medium(scheme)
    first = moderate(scheme).payload
    with ThreadPoolExecutor(2) as pool:
        others = list(pool.map(lambda _: encode(picture, quick(scheme), **asked).payload, range(2)))
    assert others == [first, first]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_file_decodes_by_itself(scheme, tmp_path):
    coded = fine(scheme)
    path = tmp_path / "coded.ii"
    coded.save(path)
    from_file, from_memory = decode(str(path)), decode(coded)
    np.testing.assert_array_equal(from_file.pixels, from_memory.pixels)
    assert from_file.structure_json() == from_memory.structure_json()


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    ("lenses", "ei_pixels"),
    first_fast([((1, 1), (1, 1)), ((17, 2), (2, 19)), ((5, 3), (1, 1)), ((1, 1), (7, 2)), ((1, 9), (3, 1))]),
)
def test_any_size_down_to_one_pixel(scheme, lenses, ei_pixels):
    rng = np.random.default_rng(3)
    (k, l), (u, v) = lenses, ei_pixels
    pixels = rng.integers(0, 256, (l * v, k * u, 3), np.uint8)
    if subsampled(scheme):
        pixels[:] = pixels[..., :1]
    picture = IIPicture(pixels, lenses, ei_pixels)
    decoded = decode(encode(picture, quick(scheme), **finest(scheme)))
    assert decoded.pixels.shape == picture.pixels.shape
    error = np.abs(decoded.pixels.astype(int) - picture.pixels).max()
    assert error <= (0 if lossless(scheme) else EXACT.get(find(scheme).name, 16))
    if scheme in RATED:
        assert decode(encode(picture, quick(scheme), bpp=1.0)).pixels.shape == picture.pixels.shape


@pytest.mark.parametrize("scheme", quick_ones(RATED))
@pytest.mark.parametrize(("bpp", "side"), [(1e-310, 1), (1e-4, 1), (1000.0, -1), (1e308, -1)])
def test_an_unreachable_rate_gives_the_nearest_and_says_so(scheme, bpp, side):
    coded = encode(textured(16, 8, 4, 4), quick(scheme), bpp=bpp)
    assert not coded.reached
    assert coded.target_bpp == bpp
    assert (coded.bpp - bpp) * side > 0
    decode(coded)


@pytest.mark.parametrize(
    ("scheme", "dtype"), [(s, t) for s in SCHEMES for t in ("uint16", "float32") if t not in find(s).dtypes]
)
def test_pixel_types_it_does_not_take_are_refused(scheme, dtype):
    picture = IIPicture(np.zeros((4, 4, 3), dtype), (2, 2), (2, 2))
    takes = ", ".join(find(scheme).dtypes)
    with pytest.raises(ValueError, match=f"pixels are {dtype}: scheme {scheme} takes {takes}"):
        encode(picture, scheme, **medium(scheme))


@pytest.mark.parametrize("scheme", RATED)
@pytest.mark.parametrize("bpp", [0, -1, np.nan, np.inf, True, "0.1"])
def test_invalid_rates_are_refused(scheme, bpp):
    with pytest.raises(ValueError, match=r"bpp is .*: a positive number is needed"):
        encode(textured(), scheme, bpp=bpp)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_exactly_one_goal_is_allowed(scheme):
    coder = find(scheme)
    bounds = {"qp": coder.qp_range, "quality": coder.quality_range, "bpp": (1, 2) if coder.rate_control else None}
    takes = {} if lossless(scheme) else {name: pair for name, pair in bounds.items() if pair is not None}
    for name in set(bounds) - set(takes):
        with pytest.raises(ValueError, match=f"scheme {scheme} takes no {name} here: (give|it codes lossless)"):
            encode(textured(), scheme, **{name: 1})
    if takes:
        with pytest.raises(ValueError, match="is needed"):
            encode(textured(), scheme)
    if len(takes) > 1:
        with pytest.raises(ValueError, match=r"exactly one of .* is needed"):
            encode(textured(), scheme, **{name: 1 for name in takes})
    for name, (low, high) in takes.items():
        for value in (low - 1, high + 1, True, "1") if name != "bpp" else ():
            with pytest.raises(ValueError, match=f"{name} is .*number from {low:g} to {high} is needed"):
                encode(textured(), scheme, **{name: value})


@pytest.mark.parametrize("scheme", quick_ones(SCHEMES))
def test_costs_are_recorded_apart(scheme):
    coded = moderate(scheme)
    assert 0 < coded.codec_seconds <= coded.encode_seconds
    decoding = timed_decode(coded)
    assert 0 < decoding.codec_seconds <= decoding.seconds


@pytest.mark.parametrize("scheme", quick_ones(SCHEMES))
def test_damaged_payloads_end_in_a_value_error_or_a_picture(scheme):
    """Damage inside the checksum, as by an attacker: no crash and no other error."""
    coded = encode(textured(16, 8, 4, 4), quick(scheme), **medium(scheme))
    rng = np.random.default_rng(11)
    for _ in range(15 if "sperr" in scheme else 60):  # each volume of SPERR is decoded by a process of its own
        payload = bytearray(coded.payload)
        at = rng.integers(len(payload), size=rng.integers(1, 6))
        for position in at:
            payload[position] ^= 1 << rng.integers(8)
        if rng.integers(3) == 0:
            del payload[at[0] :]
        try:
            assert decode(replace(coded, payload=bytes(payload))).pixels.shape == (32, 64, 3)
        except ValueError as error:
            assert "is damaged" in str(error)
