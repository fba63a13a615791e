"""Frozen streams of `si-lf`, versions 3 and 5: the same bytes decode to the same pixels on every machine.

In ``tests/golden/lf``, ``lossy.ii`` holds 6×6 views of *Apples* of 40×28 pixels at quantiser 34, ``exact.ii`` 6×6
views of 8×6 pixels of 16 bits, lossless; the encoder of f44d50a wrote both. ``skipped.ii``, of version 5, holds 6×6
views of *Apples* at quantiser 26; the first encoder that left out transforms wrote it. ``row.ii`` holds 1×10 views of
*Apples* of 32×16 pixels at quantiser 36, by cdd3aba: its first view is matched to one that no other view is made of.
The decoder has integer arithmetic alone, so that a hash of the pixels is the expectation.
"""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec import Encoded, decode
from codec.coders.lf import stream
from codec.coders.lf.blocks import CODED, EXPLICIT, INTRA, KIND, LOG, SKIPPED, SYNTHESIS
from codec.coders.lf.field import Field

FOLDER = Path(__file__).parents[1] / "golden" / "lf"
PIXELS = {
    "lossy": "defb0393182954c2a0827acfe2c0d408fd37d1c8abcac248e83ca5d02bb8f7ee",
    "skipped": "4bb0232b9f5557feb2f5d26ac1904b48c687300269542c6db1bf73b3e635b603",
    "row": "8779e10e45bc0ef8e8a3921c5f3ed192d0b0dad3092e0d9619ae1a54c87281c0",
    "exact": "be2c46c242ca2aae010544f6e178dd5dfa93b5aec5566384427e4a469a1b2cfd",
}

VERSIONS = {"lossy": stream.VERSION, "exact": stream.VERSION, "skipped": stream.SKIPPING, "row": stream.SKIPPING}


def digest(pixels):
    """SHA-256 of pixels as little-endian numbers."""
    return hashlib.sha256(pixels.astype(pixels.dtype.newbyteorder("<")).tobytes()).hexdigest()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", PIXELS)
def test_frozen_streams_decode_to_the_same_pixels(name, threads):
    coded = Encoded.load(FOLDER / f"{name}.ii")
    assert coded.payload[0] == VERSIONS[name]
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


def test_versions_are_the_numbers_in_the_streams():
    assert (stream.UNCROSSED, stream.VERSION, stream.SKIPPING, stream.SKIPPING_UNCROSSED) == (2, 3, 5, 6)


def test_the_third_stream_has_blocks_without_a_transform(monkeypatch):
    """Of both sizes, among others that have one."""
    found, code = set(), Field.code

    def noting(field, coder, job, work):
        code(field, coder, job, work)
        coded = job.blocks[CODED] == 1
        found.update(zip(job.blocks[LOG][coded].tolist(), job.blocks[SKIPPED][coded].tolist(), strict=True))

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "skipped.ii"))
    assert {(2, 0), (2, 1), (3, 0), (3, 1)} <= found


def test_the_lossy_stream_has_factors_between_planes():
    """Read as version 2, which has none, it gives another picture or ends early."""
    coded = Encoded.load(FOLDER / "lossy.ii")
    try:
        pixels = decode(replace(coded, payload=bytes([stream.UNCROSSED]) + coded.payload[1:])).pixels
    except ValueError:
        return
    assert digest(pixels) != PIXELS["lossy"]
