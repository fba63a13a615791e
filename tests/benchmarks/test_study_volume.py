"""Files exchanged with the verification model of JPEG 2000 Part 10."""

import math
import os

import numpy as np
import pytest

from benchmarks.study import claims, volume_model
from codec import encode
from ii_core import IIPicture
from metrics import q_global

PIXELS = np.random.default_rng(7).integers(0, 256, (8 * 4, 12 * 4, 3), np.uint8)
PICTURE = IIPicture(PIXELS, (12, 8), (4, 4))


@pytest.fixture
def programs(tmp_path, monkeypatch):
    """Create programs of those names from shell code."""

    def write(encode, decode):
        for name, text in ((volume_model.ENCODER, encode), (volume_model.DECODER, decode)):
            (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
            (tmp_path / name).chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")

    return write


def test_voxels_round_trip_to_pixels(programs):
    """Programs that only copy: the sizes written are those of the volume, each colour's bytes are counted once."""
    programs("grep -q 'Dimensions.12.8.16' volume.img && cp volume.bin volume.jp3d", "cp volume.jp3d decoded.bin")
    pixels, size, seconds = volume_model.by_model(PICTURE, 1.0)
    assert (pixels == PICTURE.pixels).all() and size == PICTURE.pixels.size and seconds >= 0


def test_slices_are_sub_images_in_parallel_order(programs, tmp_path):
    """Rows alternate in direction: the last sub-image of the first row is followed by the one below it."""
    programs(f"cp volume.bin {tmp_path}/kept.bin; cp volume.bin volume.jp3d", "cp volume.jp3d decoded.bin")
    volume_model.by_model(PICTURE, 1.0)
    slices = np.fromfile(tmp_path / "kept.bin", np.uint8).reshape(16, 8, 12)  # of the last colour
    for number, (v, u) in {0: (0, 0), 3: (0, 3), 4: (1, 3), 7: (1, 0)}.items():
        assert (slices[number] == PIXELS[v::4, u::4, 2]).all()


@pytest.mark.parametrize(
    ("encode", "decode", "said"),
    [
        ("echo no memory; exit 3", "", "compress ended with 3: no memory"),
        ("touch volume.jp3d", "touch decoded.bin", "left 0 voxels: 1536"),
    ],
)
def test_programs_that_fail_are_named(programs, encode, decode, said):
    programs(encode, decode)
    with pytest.raises(OSError, match=said):
        volume_model.by_model(PICTURE, 1.0)


def test_colours_coded_alone_by_ours():
    """Sizes are those of the three streams: their file headers do not count, though `bpp` includes them.

    With more than enough bits each colour comes back to its place.
    """
    pixels, size, _ = volume_model.by_ours(PICTURE, 3.0)
    greys = (np.repeat(PIXELS[..., c : c + 1], 3, axis=2) for c in range(3))
    coded = [encode(PICTURE.with_pixels(grey), volume_model.VOLUME, bpp=3.0) for grey in greys]
    assert size == sum(len(one.payload) for one in coded)
    assert 8 * sum(one.nbytes for one in coded) == pytest.approx(3 * 3.0 * pixels[..., 0].size, rel=0.02)
    assert q_global(PICTURE, IIPicture(pixels, PICTURE.lenses, PICTURE.ei_pixels)) > 15  # grey has 10.8 dB
    assert (volume_model.by_ours(PICTURE, 30.0)[0] == PIXELS).all()


def test_a_lead_is_measured_at_the_rates_of_the_other_scheme():
    """A line of 3 dB per octave is 6 dB above another at all rates of that; rates beyond its ends do not count."""
    mine = [{"scheme": "a", "bpp": rate, "q_global": 30 + 3 * math.log2(rate)} for rate in (0.1, 0.4, 1.6)]
    its = [{"scheme": "b", "bpp": rate, "q_global": 24 + 3 * math.log2(rate)} for rate in (0.15, 0.7, 1.3)]
    beyond = [{"scheme": "b", "bpp": rate, "q_global": -99} for rate in (0.09, 1.7)]
    assert claims.lead(mine, "a", [*its, *beyond], "b") == pytest.approx(6)
    assert claims.lead(mine, "a", beyond, "b") is None
