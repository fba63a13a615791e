"""Frozen streams of `si-lf`, versions 3, 5 and 7 to 15: the same bytes decode to the same pixels on every machine.

In ``tests/golden/lf.zip``, ``lossy.ii`` holds 6×6 views of *Apples* of 40×28 pixels at quantiser 34, ``exact.ii`` 6×6
views of 8×6 pixels of 16 bits, lossless; the encoder of f44d50a wrote both. ``skipped.ii``, of version 5, holds 6×6
views of *Apples* at quantiser 26; the first encoder that left out transforms wrote it. ``row.ii`` holds 1×10 views of
*Apples* of 32×16 pixels at quantiser 36, by cdd3aba: its first view is matched to one that no other view is made of.
``tuned.ii`` and ``rotated.ii``, of version 7, hold 7×6 views of 58×38 pixels and 7×2 of them of the benchmark's 9×9
views of *Apples*, at quantiser 36, tuned by ctc and rgb; 046fc0d wrote them. ``dependent.ii``, of
version 8, ``directed.ii``, of version 9, and ``parted.ii``, of version 10, hold 5×4 of those views of 46×35 pixels at
quantiser 32. ``rigged.ii``, of version 11, holds `moved_planes` of `test_lf_tuning`, 3×4 views of 72×64 pixels at
quantiser 36; ``refined.ii``, of version 12, such views with noise, at quantiser 30; ``limited.ii``, of version 13,
3×4 views of 88×72 pixels with bars, at quantiser 32; ``guided.ii``, of version 14, 2×3 views of 80×72 pixels with
coloured bars, at quantiser 29 by `best`; ``learnt.ii``, of version 15, 2×3 such views with discs and noise, at
quantiser 44. The decoder has integer arithmetic alone, so that a hash of the pixels is the expectation.
"""

import contextlib
import hashlib
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec import Encoded, decode
from codec.coders.lf import stream
from codec.coders.lf.field import Field
from codec.coders.lf.intra import ALL_MODES, MODES
from codec.coders.lf.loop_filter import COMMON, OWN
from codec.coders.lf.pyramid import ALIKE, NEAREST, _spread, pyramid
from codec.coders.lf.state import (
    CODED,
    DIRECTION,
    EXPLICIT,
    FOLLOWS,
    INTRA,
    KIND,
    LOG,
    PARTS,
    SKIPPED,
    SYNTHESIS,
    TALL,
    WIDE,
)
from ii_core.base.jit import lean_kernel, part_kernel
from tests.support.pictures import unpacked

FOLDER = unpacked("lf.zip")
PIXELS = {
    "lossy": "defb0393182954c2a0827acfe2c0d408fd37d1c8abcac248e83ca5d02bb8f7ee",
    "skipped": "4bb0232b9f5557feb2f5d26ac1904b48c687300269542c6db1bf73b3e635b603",
    "tuned": "d9d30a671b25efd3a58ad8856f476928dc720daa03306e3642c3d62d8d79c0de",
    "rotated": "1c1d667939667f5b19d172dd13ee2637d5e29ae8e9c7d0f11a44a72bcd47be85",
    "dependent": "acb8e241356f7e43f530b611839fbefbbac435bae303635eafc0b8c355efe3cf",
    "directed": "f3d2f5aaf76a3db69ab2b2cb58612ba11f7fbc5b101a8a96d99cedcffffb3b84",
    "parted": "4fed4243261259d830d4fb3764e1c4d2ab4062f7e87ff84fe47535170d7c80a9",
    "rigged": "b9bd647343a6ee5bd856526e9af14e8691de67989ee53125ff71c11f53b8391f",
    "refined": "f50066bc34f045614162d0f107263d80257350780e91125f6845f0af951d54ab",
    "limited": "714a575b532c883f21933a0725f6bdcab75465cb8b3cd53b5f7c71e8c3dac885",
    "guided": "1904031a5cfc9f0194580012dbadeb3ffea45ee85a97ca62c41086af495944fb",
    "learnt": "bd19d64ead82f23cf1d5fb8ca5e3355344babb42144a9799077a209b5d596189",
    "row": "8779e10e45bc0ef8e8a3921c5f3ed192d0b0dad3092e0d9619ae1a54c87281c0",
    "exact": "be2c46c242ca2aae010544f6e178dd5dfa93b5aec5566384427e4a469a1b2cfd",
}

VERSIONS = {
    "lossy": stream.VERSION,
    "exact": stream.VERSION,
    "skipped": stream.SKIPPING,
    "row": stream.SKIPPING,
    "tuned": stream.TUNED,
    "rotated": stream.TUNED,
    "dependent": stream.DEPENDENT,
    "directed": stream.DIRECTED,
    "parted": stream.PARTED,
    "rigged": stream.RIGGED,
    "refined": stream.REFINED,
    "limited": stream.LIMITED,
    "guided": stream.GUIDED,
    "learnt": stream.LEARNT,
}


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

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        kinds.update(np.unique(job.blocks[KIND]).tolist())
        synthesised.add(int(job.synthesised))

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "lossy.ii"))
    assert kinds == {INTRA, EXPLICIT, SYNTHESIS}
    assert synthesised == {0, 1}


def test_versions_are_the_numbers_in_the_streams():
    numbers = stream.UNCROSSED, stream.VERSION, stream.SKIPPING, stream.SKIPPING_UNCROSSED
    assert (*numbers, *stream.FLAGGED) == (2, 3, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)


def test_the_third_stream_has_blocks_without_a_transform(monkeypatch):
    """Of both sizes, among others that have one."""
    found, code = set(), Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        coded = job.blocks[CODED] == 1
        found.update(zip(job.blocks[LOG][coded].tolist(), job.blocks[SKIPPED][coded].tolist(), strict=True))

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "skipped.ii"))
    assert {(2, 0), (2, 1), (3, 0), (3, 1)} <= found


def test_the_directed_stream_has_each_kind_of_transform_and_of_modes(monkeypatch):
    """Intra blocks of all sizes above 4×4 that are flat, smooth, straight and oblique."""
    kinds, modes, code = set(), set(), Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        intra = job.blocks[KIND] == INTRA
        kinds.update(job.blocks[SKIPPED][intra & (job.blocks[CODED] == 1)].tolist())
        modes.update(job.blocks[DIRECTION][intra].tolist())

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "directed.ii"))
    assert {0, 2, 4, 6} <= kinds
    assert {0, 1, 10, 27} <= modes and len(modes) > 20


def test_the_parted_stream_has_blocks_of_unequal_sides(monkeypatch):
    """Wide and tall ones, halved once and twice, of each kind of prediction and with sines."""
    found, transforms, code = set(), set(), Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        fields = job.blocks[[KIND, TALL, WIDE]].reshape(3, -1).tolist()
        found.update(zip(*fields, strict=True))
        unequal = (job.blocks[TALL] != job.blocks[WIDE]) & (job.blocks[CODED] == 1)
        transforms.update(job.blocks[SKIPPED][unequal].tolist())

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "parted.ii"))
    assert {np.sign(tall - wide) for kind, tall, wide in found if kind == INTRA} == {-1, 0, 1}
    assert {kind for kind, tall, wide in found if tall != wide} >= {INTRA, EXPLICIT}
    assert max(abs(tall - wide) for _, tall, wide in found) == 2
    assert {0, 2, 4, 6} <= transforms


def test_the_refined_stream_has_departures_and_modes_of_all_classes(monkeypatch):
    """Flat, smooth, straight and oblique intra blocks with each kind of transform and without one."""
    kinds, modes, code = set(), set(), Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        assert field.header.rig
        intra = job.blocks[KIND] == INTRA
        kinds.update(job.blocks[SKIPPED][job.blocks[CODED] == 1].tolist())
        modes.update(job.blocks[DIRECTION][intra].tolist())

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "refined.ii"))
    assert {0, 1, 2, 4, 6} == kinds
    assert {0, 1, 10, 34} <= modes


def test_the_tuned_stream_has_filters_of_several_kinds(monkeypatch):
    """New ones of one class and of four, those coded last, and none; planes are those of BT.709."""
    found, code = [], Field.code

    def noting(field, coder, job, work, *same):
        latest = field.filters.latest.copy()
        code(field, coder, job, work, *same)
        again = (field.filters.modes[job.at] > 0) & (field.filters.latest == latest)
        found.extend(zip(field.filters.modes[job.at].tolist(), again.tolist(), strict=True))
        assert field.header.scales == (34, 28)

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "tuned.ii"))
    assert {(0, False), (1, False), (2, False), (2, True)} <= set(found)


def test_the_limited_stream_has_limited_differences(monkeypatch):
    """Filters of one class and of several with such taps: read as version 12, another picture or none."""
    modes, code = set(), Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        if field.filters.taps[job.at, 0, :, OWN:].any():
            modes.add(int(field.filters.modes[job.at, 0]))

    coded = Encoded.load(FOLDER / "limited.ii")
    monkeypatch.setattr(Field, "code", noting)
    decode(coded)
    assert modes == {1, 2}
    with contextlib.suppress(ValueError):
        older = decode(replace(coded, payload=bytes([stream.REFINED]) + coded.payload[1:])).pixels
        assert digest(older) != PIXELS["limited"]


def test_the_guided_stream_has_directions_between_and_colours_that_follow(monkeypatch):
    """And a square that is halved three times."""
    found, code = [], Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        found.append(job.blocks[[KIND, DIRECTION, FOLLOWS, PARTS]].reshape(4, -1))

    monkeypatch.setattr(Field, "code", noting)
    decode(Encoded.load(FOLDER / "guided.ii"))
    kinds, modes, follows, parts = np.concatenate(found, axis=1)
    assert len(set(modes[kinds == INTRA]) & set(range(MODES, ALL_MODES))) > 10
    assert set(follows[kinds == INTRA]) == {0, 1} and not follows[kinds != INTRA].any()
    assert parts.max() >= 16


def test_the_learnt_stream_has_guesses_in_the_first_levels(monkeypatch):
    """Read as version 14, it gives another picture or none."""
    with_guess, code = [], Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        with_guess.append(bool(field.filters.taps[job.at, 0, :, COMMON].any()))

    coded = Encoded.load(FOLDER / "learnt.ii")
    monkeypatch.setattr(Field, "code", noting)
    decode(coded)
    assert sum(with_guess) >= 3
    with contextlib.suppress(ValueError):
        older = decode(replace(coded, payload=bytes([stream.GUIDED]) + coded.payload[1:])).pixels
        assert digest(older) != PIXELS["learnt"]


def test_the_lossy_stream_has_factors_between_planes():
    """Read as version 2, which has none, it gives another picture or ends early."""
    coded = Encoded.load(FOLDER / "lossy.ii")
    try:
        pixels = decode(replace(coded, payload=bytes([stream.UNCROSSED]) + coded.payload[1:])).pixels
    except ValueError:
        return
    assert digest(pixels) != PIXELS["lossy"]


def decode_with_checks():
    """Decode the frozen streams, and ten damaged ones of each; a kernel that leaves an array raises IndexError."""
    with pytest.raises(IndexError):
        lean_kernel(_through)(np.zeros(3), np.int64(4))  # checks are on, in parts of kernels, too
    rng = np.random.default_rng(0)
    for name in PIXELS:
        coded = Encoded.load(FOLDER / f"{name}.ii")
        assert digest(decode(coded).pixels) == PIXELS[name]
        for _ in range(10):
            payload = bytearray(coded.payload)
            payload[rng.integers(40, len(payload))] ^= 1 << rng.integers(8)
            with contextlib.suppress(ValueError):
                decode(replace(coded, payload=bytes(payload)))


@part_kernel
def _beyond(values, at):
    return values[at]


def _through(values, at):
    return _beyond(values, at)


@pytest.mark.slow
def test_no_kernel_leaves_its_arrays(tmp_path):
    """In a process of its own, whose kernels are compiled with checks of bounds."""
    run = "from tests.codec.test_lf_frozen import decode_with_checks; decode_with_checks()"
    variables = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", run], env=variables, cwd=Path(__file__).parents[2], check=True)


def nodes_by_sorting(rows, cols, log_stride, references, sources):
    """The order of coding by its definition: all decoded views sorted for each view."""
    nodes, done = [], []
    for level in pyramid(rows, cols, log_stride, references, sources):
        phases = {}
        for node in level:
            phases.setdefault(node.phase, []).append(node)
        for phase in phases.values():
            for node in phase:
                place, reach = (node.row, node.col), 1 << (log_stride + 2 - node.level)
                near = [each for each in done if max(abs(each[0] - node.row), abs(each[1] - node.col)) <= reach]
                found = near if len(near) >= 8 else done
                key = [((r - node.row) ** 2 + (c - node.col) ** 2, (r, c)) for r, c in found]
                nearest = [each for _, each in sorted(key)][:NEAREST]
                spread = [_spread(nearest, place, n, a) for n, a in zip((references, sources), ALIKE, strict=True)]
                nodes.append((node, tuple(spread)))
            done += [(node.row, node.col) for node in phase]
    return nodes


@pytest.mark.parametrize("grid", [(1, 1), (1, 40), (33, 1), (2, 30), (9, 9), (13, 6)], ids=str)
@pytest.mark.parametrize("log_stride", [0, 2, 6])
def test_references_are_the_nearest_views_by_definition(grid, log_stride):
    for node, expected in nodes_by_sorting(*grid, log_stride, 4, 5):
        assert (node.references, node.sources) == expected


@pytest.mark.slow
@pytest.mark.parametrize("grid", [(1, 1 << 14), (128, 128)], ids=str)
def test_the_order_of_many_views_is_quick(grid):
    """A row of 16 384 views took 67 s."""
    started = time.process_time()
    pyramid.__wrapped__(*grid, 3, 4, 4)
    assert time.process_time() - started < 10
