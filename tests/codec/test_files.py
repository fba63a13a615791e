"""Files ``.ii``: round trips, sizes, damage, versions."""

import hashlib
import json
import math
import struct
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec import Encoded, container, decode, encode
from codec.bitstream import compact
from codec.bitstream.compact import WORDS, leb128, read_values, write_values
from codec.container import FIRST_MAGIC, MAGIC
from ii_core import IIPicture, preset


@pytest.fixture(scope="module")
def coded():
    pixels = np.random.default_rng(0).integers(0, 256, (16, 24, 3), np.uint8)
    return encode(IIPicture(pixels, (6, 4), (4, 4)), "si-h264:gop=4", qp=30)


@pytest.fixture
def whole(coded, tmp_path):
    path = tmp_path / "whole.ii"
    coded.save(path)
    return path.read_bytes()


def first_file(header, payload=b"\x00\x00\x00\x01"):
    """Return a file of the first version with any content and a correct checksum."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    fixed = struct.pack("<8sHIQ", FIRST_MAGIC, 1, len(text), len(payload))
    return fixed + hashlib.sha256(fixed + text + payload).digest() + text + payload


def forged(header, payload=b"\x00\x00\x00\x01"):
    """Return a file with any content and a correct checksum."""
    text = header if isinstance(header, bytes) else write_values(header)
    fixed = b"\x89IIC\x02" + leb128(len(text)) + leb128(len(payload))
    return fixed + hashlib.sha256(fixed + text + payload).digest()[:8] + text + payload


def refused(path, data, match):
    path.write_bytes(data)
    with pytest.raises(ValueError, match=match) as caught:
        decode(path)
    assert path.name in str(caught.value)


def test_files_round_trip_all_fields(coded, tmp_path):
    path = tmp_path / "coded.ii"
    coded.save(path)
    back = Encoded.load(path)
    for name in (
        "scheme",
        "options",
        "payload",
        "structure",
        "dtype",
        "target_bpp",
        "qp",
        "quality",
        "reached",
        "bpp",
    ):
        assert getattr(back, name) == getattr(coded, name)
    assert back.encode_seconds is None
    again = tmp_path / "again.ii"
    back.save(again)
    assert again.read_bytes() == path.read_bytes()


@pytest.mark.parametrize("version", [1, 2])
def test_truncated_anywhere(coded, whole, tmp_path, version):
    path = tmp_path / "cut.ii"
    data = whole if version == 2 else first_file(header_of(coded), coded.payload)
    for length in [*range(0, 120), *range(120, len(data), 37)]:
        refused(path, data[:length], "no coded II-picture" if length == 0 else "is truncated")


def test_files_longer_than_stated_are_refused(whole, tmp_path):
    refused(tmp_path / "long.ii", whole + b"\0", "is damaged")


def test_foreign_files_are_refused(tmp_path):
    path = tmp_path / "foreign.ii"
    for data in (
        b"\x89PNG\r\n\x1a\n" + bytes(100),
        b"hello",
        bytes(1000),
        FIRST_MAGIC.replace(b"\r\n", b"\r") + bytes(99),
    ):
        refused(path, data, "is no coded II-picture")


def test_another_version(coded, whole, tmp_path):
    path = tmp_path / "new.ii"
    refused(path, MAGIC + b"\x03" + whole[5:], "is of version 3: this program reads versions 1 and 2")
    first = first_file(header_of(coded), coded.payload)
    refused(path, first[:8] + b"\x02\x00" + first[10:], "is of version 2: this program reads versions 1 and 2")


def test_bytes_of_a_file_by_the_tables_of_the_format(tmp_path):
    """Put together by hand from the tables in container.py, file_header.py and compact.py."""
    camera = preset("setup1", scale=64)  # 8×4 lenses, pitch 0.3904 mm, gap 11.691979456 mm
    coded = Encoded(
        scheme="si-h264",
        options={
            **encode(IIPicture(np.zeros((4, 4, 3), np.uint8), (2, 2), (2, 2)), "si-h264", qp=51).options,
            "gop": 300,
        },
        payload=b"\1\2\3",
        structure=IIPicture(np.zeros((64, 128, 3), np.uint8), (8, 4), (16, 16), camera).structure_json(),
        qp=30,
    )
    coded.save(tmp_path / "x.ii")

    def word(text):
        return bytes([128 + WORDS.index(text)])

    header = bytes([8, 4, 16, 16, 0x61]) + word("uint8") + word("si-h264")
    header += b"\x69\2" + word("qp") + b"\x1e" + word("gop") + b"\x63" + bytes([0xCC, 0x01])  # 300 − 96 = 204
    header += b"\x69\3" + word("name") + word("setup1") + word("pixel_pitch_mm")
    header += bytes([0x65, 128 - 4, 0x63]) + leb128(3904 - 96) + word("gap_mm")
    mantissa = round(camera.gap_mm * 10**9)
    assert camera.gap_mm == mantissa / 10**9 and mantissa % 10
    header += bytes([0x65, 128 - 9, 0x63]) + leb128(mantissa - 96)
    fixed = b"\x89IIC\2" + bytes([len(header), 3])
    digest = hashlib.sha256(fixed + header + b"\1\2\3").digest()[:8]
    assert (tmp_path / "x.ii").read_bytes() == fixed + digest + header + b"\1\2\3"


def test_words_keep_their_numbers():
    """The table is part of the format: words may be appended, and a changed hash then needs a new one here."""
    assert hashlib.sha256(" ".join(WORDS[:124]).encode()).hexdigest()[:16] == "6235f16dcbd7c8c6"
    assert len(set(WORDS)) == len(WORDS)


@pytest.mark.slow
@pytest.mark.parametrize(
    "scheme", ["si-h264:balanced", "ei-hevc:best", "ri-av1:best,by=columns", "jpeg2000", "si-avif:best"]
)
def test_usual_files_have_at_most_64_bytes_beside_the_payload(scheme, tmp_path):
    for name in ("setup1", "setup2-64", "setup3"):
        camera = preset(name, scale=64 if name != "setup2-64" else 16)
        picture = IIPicture(np.zeros((*camera.pixels[::-1], 3), np.uint8), camera.lenses, camera.ei_pixels, camera)
        coded = encode(picture, scheme, bpp=0.125)
        coded.save(tmp_path / "x.ii")
        size = (tmp_path / "x.ii").stat().st_size
        assert size - len(coded.payload) <= 64
        assert coded.nbytes == size and coded.bpp == 8 * size / (camera.pixels[0] * camera.pixels[1])
        assert decode(tmp_path / "x.ii").camera == camera


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


def test_false_lengths_are_refused(whole, tmp_path):
    path = tmp_path / "bomb.ii"
    for header_length, payload_length, message in (
        (2**32 - 1, 4, "a header of 4294967295 bytes"),
        (10, 2**63, "is truncated"),
        (0, 2**64 - 1, "is truncated"),
    ):
        fixed = struct.pack("<8sHIQ", FIRST_MAGIC, 1, header_length, payload_length)
        refused(path, fixed + whole[5:], message)
        lengths = leb128(header_length) + leb128(payload_length)
        refused(path, MAGIC + b"\2" + lengths + whole[7:], f"{message}|too large")


def header_of(coded, **changes):
    names = ("scheme", "options", "structure", "target_bpp", "qp", "reached", "runs", "versions")
    return {name: getattr(coded, name) for name in names} | {"runs": 1} | changes


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
def test_false_headers_with_a_correct_checksum_are_refused(coded, tmp_path, change):
    refused(
        tmp_path / "forged.ii",
        first_file(header_of(coded, **change), coded.payload),
        "forged.ii (is damaged|has .* decoded)",
    )


GOOD = [6, 4, 4, 4, False, "uint8", "si-h264", {"qp": 30, "gop": 4}, None]


def changed(place, value):
    return [*GOOD[:place], value, *GOOD[place + 1 :]]


def test_the_good_header_is_good(coded, tmp_path):
    (tmp_path / "good.ii").write_bytes(forged(GOOD, coded.payload))
    assert Encoded.load(tmp_path / "good.ii").options == coded.options


@pytest.mark.parametrize(
    "header",
    [
        GOOD[:-1],
        [*GOOD, None],
        changed(0, 10**9),
        changed(0, 5),
        changed(0, 0),
        changed(0, -6),
        changed(0, 6.0),
        changed(0, True),
        changed(2, None),
        changed(5, "float32"),
        changed(5, ["uint8"]),
        changed(6, "si-h999"),
        changed(6, 3),
        changed(7, []),
        changed(7, {"gop": -1}),
        changed(7, {"speed": 3}),
        changed(7, {"qp": "30"}),
        changed(7, {"bpp": [1]}),
        changed(8, {}),
        changed(8, {"pixel_pitch_mm": 1.0, "gap_mm": 1.0, "unheard": 2}),
        changed(8, {"pixel_pitch_mm": 1.0, "gap_mm": 1.0, "lenses": [1, 1]}),
        changed(8, "setup1"),
        [2**15, 2**15, 2**15, 2**15, *GOOD[4:]],
        write_values(GOOD)[:-1],
        write_values(GOOD).replace(b"\6", b"\x63\0", 1),  # 96 and more than one way to write a number
        write_values(GOOD) + b"\x6f",
        b"\x68\1" * 100_000,
        b"\x68" + leb128(2**40),
        b"\x67" + leb128(2**40),
        b"\x66\0",
        b"\x65",
        b"\x65\x80\x62",
        b"\x77\xff",
        b"\x67\1\xff",
        b"\x69\1\1\1",
        b"\x63" + b"\xff" * 30,
        b"",
    ],
)
def test_false_compact_headers_with_a_correct_checksum_are_refused(coded, tmp_path, header):
    refused(tmp_path / "forged.ii", forged(header, coded.payload), "forged.ii is damaged")


@pytest.mark.parametrize("text", [b"", b"[1]", b"{", b"\xff", b"[" * 100_000, b'{"scheme": "si-h264"}', b"null"])
def test_headers_of_other_types_are_refused(tmp_path, text):
    refused(tmp_path / "forged.ii", first_file(text), "forged.ii is damaged")


def test_a_header_must_be_plain(tmp_path):
    for header, message in (
        (["x" * (1 << 20)], "at most 1048576 are allowed"),
        ([float("nan")], "not finite"),
        ([object()], "no JSON value"),
        ([{1: 2}], "no JSON value"),
        ([1 << 63], "more than 63 bits"),
    ):
        with pytest.raises(ValueError, match=message):
            container.write(tmp_path / "x.ii", header, b"")
    assert list(tmp_path.iterdir()) == []


def test_file_system_problems_are_os_errors(coded, tmp_path):
    with pytest.raises(FileNotFoundError):
        decode(tmp_path / "missing.ii")
    with pytest.raises(OSError, match="nowhere"):
        coded.save(tmp_path / "nowhere" / "x.ii")


# -- compact values of file headers: exact inverse, unique form


NUMBERS = st.integers(-(2**63) + 1, 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
TEXTS = st.text(max_size=20) | st.sampled_from(WORDS)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=12,
)


@given(st.lists(VALUES, max_size=5))
def test_values_come_back_with_their_types(values):
    back = read_values(write_values(values))
    assert json.dumps(back) == json.dumps(values)  # tells 1, 1.0, true and −0.0 apart


@given(st.binary(max_size=40))
def test_any_bytes_are_refused_or_in_canonical_form(data):
    try:
        values = read_values(data)
    except ValueError:
        return
    assert write_values(values) == data


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_take_at_most_nine_bytes(number):
    assert len(write_values([number])) <= 9


@pytest.mark.parametrize(
    ("value", "length"), [(0, 1), (95, 1), (96, 2), (512, 3), (-1, 2), (0.0061, 3), (1.461497432, 8), (math.pi, 9)]
)
def test_lengths(value, length):
    assert len(write_values([value])) == length


def test_words_beyond_128_take_two_bytes(monkeypatch):
    words = (*WORDS, *(f"later{i}" for i in range(600)))
    monkeypatch.setattr(compact, "WORDS", words)
    monkeypatch.setattr(compact, "_NUMBER", {word: number for number, word in enumerate(words)})
    for number, word in enumerate(words):
        data = write_values([word])
        assert len(data) == 1 + (number >= 128)
        assert read_values(data) == [word]
    monkeypatch.undo()
    with pytest.raises(ValueError, match="a newer version of this program"):
        read_values(data)
