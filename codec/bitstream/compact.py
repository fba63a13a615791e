"""Compact values: a canonical binary form of JSON values for headers of a few dozen bytes.

=============  ====================================================================================
first byte     value
=============  ====================================================================================
``00``–``5F``  the integers 0–95
``60`` ``61``  null, false
``62``         true
``63`` ``64``  integer n from 96 on as n − 96, or below 0 as −1 − n, in LEB128
``65``         decimal number: exponent + 128 in a byte, then the integer mantissa as a value
``66``         any other finite number: 8 bytes, IEEE 754, little endian
``67``         text: number of bytes in LEB128, UTF-8
``68`` ``69``  list, object: number of entries in LEB128; an object's are a text and a value each
``70``–``77``  the word ``256·(b − 112) + next byte + 128`` of `WORDS`
``80``–``FF``  the words 0–127 of `WORDS`
=============  ====================================================================================

LEB128 has seven bits a byte, least first, and the highest bit set in all but the last. A value has one form only:
`read_values` refuses all others. Objects keep the order of their entries.
"""

from __future__ import annotations

import math
import struct
from decimal import Decimal
from typing import Any

# Texts that take one byte (the first 128) or two. The numbers are part of the file format: append, never reorder.
_WORDS = """
    ei-av1 ei-ffv1 ei-h264 ei-hevc ei-jp3d ei-mpeg2 ei-vp9 ri-av1 ri-ffv1 ri-h264 ri-hevc ri-jp3d ri-vp9
    si-av1 si-avif si-ffv1 si-h264 si-hevc si-jp3d si-jpeg2000 si-mpeg2 si-sperr si-vp9
    htj2k jpeg jpeg2000 jpegxl uint8 uint16 bpp qp quality
    order by gop bframes merange rate pyramid pbratio preset chroma depth threads speed context effort lossless
    wavelet levels
    row column parallel zigzag spiral rows columns cbr cq crf 2pass 444 420 8 10 97 53
    ultrafast superfast veryfast faster fast medium slow slower veryslow placebo
    name pixel_pitch_mm gap_mm lens_pitch_mm lattice lens_offset_mm origin_mm optics
    kind pinhole grin lenticular lenslet spherical-lenslet lens focal_mm aperture_mm radius_mm ior z_mm diameter_mm
    setup1 setup3 setup2-16 setup2-32 setup2-64 setup2-128 setup2-256
    pixels lenses rectangular hexagonal
    plenoptic plenoptic1 plenoptic2 hdtv hpo multi-focus multi-view moving-lenslets stacked-sensors depth-control
    depth-priority resolution-priority grin-hexagonal-depth-control spherical pinhole2d
    si-lf stride sources
    start_mm viewer_mm
"""
WORDS = tuple(_WORDS.split())
_NUMBER = {word: number for number, word in enumerate(WORDS)}
SMALL, SHORT_WORDS = 96, 128
NULL, FALSE, TRUE, POSITIVE, NEGATIVE, DECIMAL, BINARY, TEXT, LIST, OBJECT = range(0x60, 0x6A)
LONG_WORD, SHORT_WORD = 0x70, 0x80
MAX_DEPTH = 16
_DOUBLE = struct.Struct("<d")


def leb128(number: int) -> bytes:
    """Return an integer of at least 0, seven bits a byte, least first."""
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    out.append(number)
    return bytes(out)


def read_leb128(data: bytes, at: int) -> tuple[int, int]:
    """Return an integer below 2⁶³ and the position after it.

    Raises
    ------
    ValueError
        If it ends too early or is too large.
    """
    number = shift = 0
    while at < len(data) and shift < 63:
        byte = data[at]
        at += 1
        number |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return number, at
    raise ValueError("a number in it is cut short or too large")


def write_values(values: list[Any]) -> bytes:
    """Return JSON values one after the other; the same values give the same bytes.

    Raises
    ------
    ValueError
        If something is no JSON value, a number is not finite, or values are nested deeper than `MAX_DEPTH`.
    """
    return b"".join(_written(value, 0) for value in values)


def read_values(data: bytes) -> list[Any]:
    """Return the values that `write_values` wrote.

    Raises
    ------
    ValueError
        If the bytes are anything else.
    """
    values, at = [], 0
    while at < len(data):
        value, at = _read(data, at, 0)
        values.append(value)
    if write_values(values) != data:
        raise ValueError("its values are not in their one form")
    return values


def _written(value: Any, depth: int) -> bytes:
    if depth > MAX_DEPTH:
        raise ValueError(f"values are nested deeper than {MAX_DEPTH}")
    if value is None or isinstance(value, bool):
        return bytes([{None: NULL, False: FALSE, True: TRUE}[value]])
    if isinstance(value, int):
        if not -(1 << 63) < value < 1 << 63:
            raise ValueError(f"the integer {value} has more than 63 bits")
        if 0 <= value < SMALL:
            return bytes([value])
        return bytes([POSITIVE]) + leb128(value - SMALL) if value > 0 else bytes([NEGATIVE]) + leb128(-1 - value)
    if isinstance(value, float):
        return _number(value, depth)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list | tuple):
        return bytes([LIST]) + leb128(len(value)) + b"".join(_written(item, depth + 1) for item in value)
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        items = (_text(key) + _written(item, depth + 1) for key, item in value.items())
        return bytes([OBJECT]) + leb128(len(value)) + b"".join(items)
    raise ValueError(f"{value!r} is no JSON value")


def _number(value: float, depth: int) -> bytes:
    """The shortest decimal that means this number, or its 8 bytes where that is shorter."""
    if not math.isfinite(value):
        raise ValueError(f"the number {value} is not finite")
    binary = bytes([BINARY]) + _DOUBLE.pack(value)
    if math.copysign(1, value) < 0 and value == 0:  # a decimal has no negative zero
        return binary
    sign, digits, exponent = Decimal(repr(value)).normalize().as_tuple()
    mantissa = int("".join(map(str, digits))) * (-1 if sign else 1)
    if not isinstance(exponent, int) or not -128 <= exponent < 128:
        return binary
    decimal = bytes([DECIMAL, exponent + 128]) + _written(mantissa, depth)
    return min(decimal, binary, key=len)


def _text(value: str) -> bytes:
    number = _NUMBER.get(value)
    if number is not None:
        if number < SHORT_WORDS:
            return bytes([SHORT_WORD + number])
        return bytes([LONG_WORD + (number - SHORT_WORDS) // 256, (number - SHORT_WORDS) % 256])
    data = value.encode()
    return bytes([TEXT]) + leb128(len(data)) + data


def _read(data: bytes, at: int, depth: int) -> tuple[Any, int]:
    if at >= len(data) or depth > MAX_DEPTH:
        raise ValueError("its values are cut short or nested too deep")
    first = data[at]
    at += 1
    if first < SMALL:
        return first, at
    if first >= LONG_WORD:
        return _word(data, first, at)
    if first in _CONSTANTS:
        return _CONSTANTS[first], at
    if first in (POSITIVE, NEGATIVE):
        number, at = read_leb128(data, at)
        return number + SMALL if first == POSITIVE else -1 - number, at
    if first == DECIMAL:
        exponent = data[at] - 128 if at < len(data) else 0
        mantissa, at = _read(data, at + 1, depth)
        if isinstance(mantissa, bool) or not isinstance(mantissa, int):
            raise ValueError(f"a decimal number in it has the mantissa {mantissa!r}")
        return float(f"{mantissa}e{exponent}"), at
    if first == BINARY:
        if at + 8 > len(data):
            raise ValueError("a number in it is cut short")
        return _DOUBLE.unpack_from(data, at)[0], at + 8
    return _read_long(data, first, at, depth)


_CONSTANTS = {NULL: None, FALSE: False, TRUE: True}


def _word(data: bytes, first: int, at: int) -> tuple[str, int]:
    if first >= SHORT_WORD:
        number = first - SHORT_WORD
    elif first < LONG_WORD + 8 and at < len(data):
        number = 256 * (first - LONG_WORD) + data[at] + SHORT_WORDS
        at += 1
    else:
        raise ValueError(f"a value in it starts with the byte {first:02X}")
    if number >= len(WORDS):
        raise ValueError(f"it uses word {number}: {len(WORDS)} are known, a newer version of this program wrote it")
    return WORDS[number], at


def _read_long(data: bytes, first: int, at: int, depth: int) -> tuple[Any, int]:
    """A text, a list or an object; every entry takes at least a byte, so that counts are bounded by the data."""
    if first not in (TEXT, LIST, OBJECT):
        raise ValueError(f"a value in it starts with the byte {first:02X}")
    count, at = read_leb128(data, at)
    if count > len(data) - at:
        raise ValueError(f"a value in it has {count} entries, {len(data) - at} bytes are left")
    if first == TEXT:
        return data[at : at + count].decode(), at + count
    if first == LIST:
        values = []
        for _ in range(count):
            value, at = _read(data, at, depth + 1)
            values.append(value)
        return values, at
    entries: dict[str, Any] = {}
    for _ in range(count):
        key, at = _read(data, at, depth + 1)
        if not isinstance(key, str) or key in entries:
            raise ValueError(f"an object in it has {key!r} for a key, or twice")
        entries[key], at = _read(data, at, depth + 1)
    return entries, at
