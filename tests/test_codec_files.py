import hashlib
import json
import struct
import time

import numpy as np
import pytest

from codec import Encoded, container, decode, encode
from codec.container import MAGIC
from ii_core import IIPicture


@pytest.fixture(scope="module")
def coded():
    pixels = np.random.default_rng(0).integers(0, 256, (16, 24, 3), np.uint8)
    return encode(IIPicture(pixels, (6, 4), (4, 4)), "si-h264:gop=4", qp=30)


@pytest.fixture
def whole(coded, tmp_path):
    path = tmp_path / "whole.ii"
    coded.save(path)
    return path.read_bytes()


def forged(header, payload=b"\x00\x00\x00\x01"):
    """A file with a right checksum over anything."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    fixed = struct.pack("<8sHIQ", MAGIC, 1, len(text), len(payload))
    return fixed + hashlib.sha256(fixed + text + payload).digest() + text + payload


def refused(path, data, match):
    path.write_bytes(data)
    with pytest.raises(ValueError, match=match) as caught:
        decode(path)
    assert path.name in str(caught.value)


def test_everything_survives_the_file(coded, tmp_path):
    path = tmp_path / "coded.ii"
    coded.save(path)
    back = Encoded.load(path)
    for name in ("scheme", "options", "payload", "structure", "target_bpp", "qp", "reached", "versions", "bpp"):
        assert getattr(back, name) == getattr(coded, name)
    assert back.encode_seconds is None
    again = tmp_path / "again.ii"
    back.save(again)
    assert again.read_bytes() == path.read_bytes()


def test_truncated_anywhere(whole, tmp_path):
    path = tmp_path / "cut.ii"
    for length in [*range(0, 120), *range(120, len(whole), 37)]:
        refused(path, whole[:length], "no coded II-picture" if length == 0 else "is truncated")


def test_longer_than_it_says(whole, tmp_path):
    refused(tmp_path / "long.ii", whole + b"\0", "is damaged")


def test_foreign(tmp_path):
    path = tmp_path / "foreign.ii"
    for data in (b"\x89PNG\r\n\x1a\n" + bytes(100), b"hello", bytes(1000), MAGIC.replace(b"\r\n", b"\n") + bytes(99)):
        refused(path, data, "is no coded II-picture")


def test_another_version(whole, tmp_path):
    refused(
        tmp_path / "new.ii", whole[:8] + b"\x02\x00" + whole[10:], "is of version 2: this program reads version 1"
    )


def test_hundreds_of_mutations_are_found_fast(whole, tmp_path):
    path, rng = tmp_path / "mutant.ii", np.random.default_rng(7)
    started = time.perf_counter()
    for _ in range(400):
        data = bytearray(whole)
        for position in rng.integers(len(data), size=rng.integers(1, 4)):
            data[position] ^= 1 << rng.integers(8)
        if data != whole:
            refused(path, bytes(data), "mutant.ii is ")
    assert time.perf_counter() - started < 10


def test_lengths_are_not_believed(whole, tmp_path):
    path = tmp_path / "bomb.ii"
    for header_length, payload_length, message in (
        (2**32 - 1, 4, "a header of 4294967295 bytes"),
        (10, 2**63, "is truncated"),
        (0, 2**64 - 1, "is truncated"),
    ):
        fixed = struct.pack("<8sHIQ", MAGIC, 1, header_length, payload_length)
        refused(path, fixed + whole[len(fixed) :], message)


def header_of(coded, **changes):
    names = ("scheme", "options", "structure", "target_bpp", "qp", "reached", "runs", "versions")
    return {name: getattr(coded, name) for name in names} | changes


def structure(**changes):
    return {
        "format": "ii-picture",
        "version": 1,
        "lenses": [6, 4],
        "ei_pixels": [4, 4],
        "erect": False,
        "camera": None,
    } | changes


@pytest.mark.parametrize(
    "change",
    [
        {"scheme": "si-h999"},
        {"scheme": ["si-h264"]},
        {"options": {"order": "diagonal"}},
        {"options": {"speed": 3}},
        {"options": []},
        {"structure": None},
        {"structure": {}},
        {"structure": structure(lenses=[10**9, 10**9])},
        {"structure": structure(lenses=[1e300, 1])},
        {"structure": structure(lenses="64")},
        {"structure": structure(lenses=[2**16, 2**14], ei_pixels=[1, 1])},
        {"structure": structure(lenses=[1, 1], ei_pixels=[2**14, 2**14])},
        {"structure": structure(lenses=[6, 5])},
        {"structure": structure(camera={"kind": "pinhole"})},
        {"structure": structure(version=2)},
        {"unheard": 1},
    ],
)
def test_headers_with_a_right_checksum_are_not_believed(coded, tmp_path, change):
    refused(tmp_path / "forged.ii", forged(header_of(coded, **change), coded.payload), "forged.ii is damaged")


@pytest.mark.parametrize("text", [b"", b"[1]", b"{", b"\xff", b"[" * 100_000, b'{"scheme": "si-h264"}', b"null"])
def test_headers_that_are_none(tmp_path, text):
    refused(tmp_path / "forged.ii", forged(text), "forged.ii is damaged")


def test_a_header_must_be_plain(tmp_path):
    with pytest.raises(ValueError, match="at most 1048576 are allowed"):
        container.write(tmp_path / "x.ii", {"long": "x" * (1 << 20)}, b"")
    assert list(tmp_path.iterdir()) == []


def test_file_system_problems_are_os_errors(coded, tmp_path):
    with pytest.raises(FileNotFoundError):
        decode(tmp_path / "missing.ii")
    with pytest.raises(OSError, match="nowhere"):
        coded.save(tmp_path / "nowhere" / "x.ii")
