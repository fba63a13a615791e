"""Anchors of the benchmark: order of views, search of the quantiser, streams of FFmpeg, measures without a detour."""

import itertools
import pickle
import runpy
from pathlib import Path

import numpy as np
import pytest

from ii_core import IIPicture
from metrics import q_ctc_psnr
from metrics.benchmark.anchor_coder import AnchorCoder, largest, reduced, resized
from metrics.benchmark.anchors import ANCHORS, hierarchy, level_of, serpentine
from metrics.measures.batch import measuring
from metrics.measures.ctc import codes
from metrics.measures.pair import PicturePair


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 3), (9, 9), (7, 16)])
def test_orders_have_every_view_once(rows, columns):
    every = set(np.ndindex(rows, columns))
    path = serpentine(rows, columns)
    assert set(path) == every and len(path) == rows * columns
    assert all(abs(a - c) + abs(b - d) == 1 for (a, b), (c, d) in itertools.pairwise(path))
    order = hierarchy(rows, columns)
    assert set(order) == every and len(order) == rows * columns
    levels = [level_of(place, rows, columns) for place in order]
    assert levels == sorted(levels)
    # A view of a further level lies between views of the levels before it: within a step of half the coarser grid.
    step = 2 ** (max(rows, columns, 2).bit_length() - 1)
    for place, level in zip(order, levels, strict=True):
        assert all(number % (step >> level) == 0 for number in place)


def test_the_largest_file_within_a_limit_is_found():
    rng = np.random.default_rng(3)
    for _ in range(200):
        sizes = np.cumsum(rng.integers(0, 50, rng.integers(1, 60))) + 5
        limit, asked = float(rng.integers(1, sizes[-1] + 20)), []

        def size(index, sizes=sizes, asked=asked):
            asked.append(index)
            return int(sizes[index])

        found = largest(size, limit, len(sizes) - 1)
        fitting = np.flatnonzero(sizes <= limit)
        assert found == (fitting[-1] if len(fitting) else 0) and len(asked) == len(set(asked)) <= len(sizes)


def test_reduced_chroma_comes_back():
    x, y = np.arange(64), np.arange(32)[:, None]
    plane = 512 + 200 * np.cos(2 * np.pi * x / 16) * np.cos(2 * np.pi * y / 16)  # far below the limit of 4:2:0
    off = np.abs(resized(reduced(plane), (64, 32)) - plane)
    assert off[8:-8, 8:-8].max() < 1  # borders have no neighbours


@pytest.fixture(scope="module")
def picture():
    """2×2 views of 71×66 pixels, neither even nor a whole number of blocks; each view has a mark of its own."""
    smooth = np.add.outer(np.arange(66), np.arange(71)) * 1.5
    pixels = np.empty((132, 142, 3), np.uint8)
    for number, (row, column) in enumerate(np.ndindex(2, 2)):
        view = np.stack([smooth, smooth[::-1], np.full_like(smooth, 90)], -1)
        view[:20, :20] = 60 * number
        pixels[row::2, column::2] = view
    return IIPicture(pixels, (71, 66), (2, 2))


SLOW = ("vvenc", "libaom", "libaom-chroma", "svtav1", "x265", "x265-420", "jpegxl")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in ANCHORS]
)
def test_views_pass_through_an_anchor(picture, name):
    pytest.importorskip("imageio_ffmpeg")
    coder = pickle.loads(pickle.dumps(AnchorCoder(name)))
    coded = coder.encode(picture, name, bpp=0.6)
    assert coded.reached and coded.bpp == 8 * coded.nbytes / (132 * 142) <= 0.6 * 1.02
    decoded = coder.decode(coded)
    # Views in the wrong place have the marks of others: errors of 60 codes and more.
    error = decoded.picture.pixels.astype(float) - picture.pixels
    assert np.sqrt((error**2).mean()) < 6 and np.abs(error[:30:2, :30:2].mean()) < 4
    assert (decoded.codes is None) == (name == "jpegxl")
    if decoded.codes is not None:
        off = decoded.codes.astype(float) - codes(picture.pixels / 255)
        assert np.sqrt((off**2).mean()) < 16
    if name not in SLOW:  # each search of a rate takes them half a minute
        again = coder.encode(picture, name, bpp=0.2)
        assert again.nbytes < coded.nbytes and AnchorCoder(name).encode(picture, name, bpp=0.2).data == again.data


def test_what_an_anchor_cannot_take_is_refused(picture):
    pytest.importorskip("imageio_ffmpeg")
    with pytest.raises(ValueError, match="unknown anchor 'h264': known are vvenc"):
        AnchorCoder("h264")
    floats = IIPicture(picture.pixels.astype(np.float32), picture.lenses, picture.ei_pixels)
    with pytest.raises(ValueError, match="x265 codes pictures of 8 or 16 bit"):
        AnchorCoder("x265").encode(floats, "x265", bpp=1.0)


@pytest.mark.parametrize("name", ["x265", "jpegxl"])
def test_sixteen_bits_are_coded_as_eight_with_more_between(picture, name):
    """Pixels 257 times as large make the same file, and come back 257 times as large, between steps of 8 bit, too."""
    pytest.importorskip("imageio_ffmpeg")
    deep = IIPicture(picture.pixels.astype(np.uint16) * 257, picture.lenses, picture.ei_pixels)
    quantiser = ANCHORS[name].quantiser(3)
    one, other = (AnchorCoder(name).encode_at(subject, quantiser) for subject in (picture, deep))
    assert one.data == other.data
    eight, sixteen = (AnchorCoder(name).decode(coded).picture.pixels for coded in (one, other))
    assert sixteen.dtype == np.uint16 and np.abs(sixteen / 257 - eight).max() <= 0.502
    assert (sixteen % 257 != 0).any()


def test_settings_name_their_quantiser():
    for name, anchor in ANCHORS.items():
        words = anchor.command((64, 64), anchor.quantiser(0))
        assert f"{anchor.coarsest:g}" in " ".join(words) and "{q}" not in " ".join(words), name


def test_codes_of_a_decoder_are_measured_without_a_detour(picture):
    """Codes that differ by one in luma alone: PSNR of an error of 1 of 1023, and 120 dB of both chroma channels."""
    given = codes(picture.pixels / 255)
    measure = measuring(picture, ["q_ctc_psnr", "q_ctc_min", "q_ctc_step", "q_ctc_ssim"])
    assert measure(picture, codes=given)["q_ctc_psnr"] == np.inf
    off = given + np.array([1, 0, 0])
    found = measure(picture, codes=off)
    wanted = (6 * 20 * np.log10(1023) + 240) / 8
    assert found["q_ctc_psnr"] == pytest.approx(wanted) == found["q_ctc_min"] and found["q_ctc_step"] == 0
    off[0::2, 0::2, 0] += 1  # one view has an error of 2: along the path, one step down
    found = measure(picture, codes=off)
    worse = wanted - 6 * 20 * np.log10(2) / 8
    assert found["q_ctc_min"] == pytest.approx(worse)
    assert found["q_ctc_step"] == pytest.approx((wanted - worse) / np.sqrt(3))
    assert q_ctc_psnr(picture, picture).step == 0
    with pytest.raises(ValueError, match="codes are"):
        measure(picture, codes=off[1:])


def test_vmaf_of_the_example_falls_with_noise(picture, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    monkeypatch.setattr("metrics.register_measure", lambda measure: measure)
    vmaf = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "vmaf.py"))["vmaf"]
    error = np.random.default_rng(0).standard_normal(picture.pixels.shape)
    noisy = [
        picture.with_pixels(np.clip(picture.pixels + deviation * error, 0, 255).astype(np.uint8))
        for deviation in (4, 20)
    ]
    same, better, worse = (vmaf(PicturePair(picture, other)) for other in (picture, *noisy))
    assert 95 < same <= 100 and same > better + 1 > worse + 10
