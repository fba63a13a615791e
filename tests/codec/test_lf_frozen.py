"""Frozen streams of `si-lf`, version 3: the same bytes decode to the same pixels on every machine.

``tests/golden/lf/lossy.ii`` holds 6×6 views of *Apples* of 40×28 pixels at quantiser 34, ``exact.ii`` 6×6 views of
8×6 pixels of 16 bits, lossless; the encoder of f44d50a wrote both. The decoder has integer arithmetic alone, so that
a hash of the pixels is the expectation.
"""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec import Encoded, decode
from codec.coders.lf import stream
from codec.coders.lf.blocks import EXPLICIT, INTRA, KIND, SYNTHESIS
from codec.coders.lf.field import Field

FOLDER = Path(__file__).parents[1] / "golden" / "lf"
PIXELS = {
    "lossy": "defb0393182954c2a0827acfe2c0d408fd37d1c8abcac248e83ca5d02bb8f7ee",
    "exact": "be2c46c242ca2aae010544f6e178dd5dfa93b5aec5566384427e4a469a1b2cfd",
}


def digest(pixels):
    """SHA-256 of pixels as little-endian numbers."""
    return hashlib.sha256(pixels.astype(pixels.dtype.newbyteorder("<")).tobytes()).hexdigest()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", PIXELS)
def test_frozen_streams_decode_to_the_same_pixels(name, threads):
    coded = Encoded.load(FOLDER / f"{name}.ii")
    assert coded.payload[0] == stream.VERSION == 3
    coded = replace(coded, options={**coded.options, "threads": threads})
    assert digest(decode(coded).pixels) == PIXELS[name]


def test_the_lossy_stream_has_all_kinds_of_blocks(monkeypatch):
    """Each kind of prediction, and views with and without synthesis."""
    kinds, synthesised, code = set(), set(), Field.code

    def noting(field, coder, job, work):
        code(field, coder, job, work)
        kinds.update(np.unique(job.blocks[KIND]).tolist())
        synthesised.add(int(job.synthesised))

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "lossy.ii"))
    assert kinds == {INTRA, EXPLICIT, SYNTHESIS}
    assert synthesised == {0, 1}


def test_the_lossy_stream_has_factors_between_planes():
    """Read as version 2, which has none, it gives another picture or ends early."""
    coded = Encoded.load(FOLDER / "lossy.ii")
    try:
        pixels = decode(replace(coded, payload=bytes([stream.UNCROSSED]) + coded.payload[1:])).pixels
    except ValueError:
        return
    assert digest(pixels) != PIXELS["lossy"]
