"""Mutation of binary containers and of text: changed lengths, counts, types and tokens, with corrected checksums."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

from numpy.random import Generator

from benchmarks.coding.fuzz import damaged

from .trees import pick

INTEGERS = (
    0, 1, 2, 3, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x10000, 0xFFFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF,
    2**63, 2**64 - 1,
)  # fmt: skip
FLOATS = (float("nan"), float("inf"), -float("inf"), 1e38, -1e38, 1e-45, 0.0)
TOKENS = (
    "", "0", "-1", "1", "2", "3", "1.5", "-0", "nan", "inf", "-inf", "1e400", "1e38", "1e-400", "2147483648",
    "4294967296", "99999999999999999999", "9" * 5000, "1/1/1", "1//1", "1/2/3/4", "//", "-1/-1/-1", "0x10", "1_0",
    "١", "é", "\0", "\x1b[31m", "a b", "../../etc/passwd", "/dev/zero", ".", "#", "\\", "%(x)s", "=", "[x]",
)  # fmt: skip
CHUNKS = (b"tRNS", b"PLTE", b"iCCP", b"gAMA", b"acTL", b"eXIf", b"zTXt", b"sBIT")


def bytes_changed(data: bytes, rng: Generator) -> bytes:
    """Return bytes after random damage, or with numbers of one to eight bytes replaced by extreme ones."""
    if rng.random() < 0.5:
        return damaged(data, [data], rng)
    mutant = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        number_put(mutant, int(rng.integers(max(len(mutant), 1))), rng)
    return bytes(mutant)


def number_put(data: bytearray, at: int, rng: Generator) -> None:
    """Write an extreme number over the bytes at a place."""
    order = pick(rng, "<>")
    if rng.random() < 0.3:
        number = struct.pack(order + "f", pick(rng, FLOATS))
    else:
        size = pick(rng, (1, 2, 4, 4, 8))
        value = pick(rng, INTEGERS) + int(rng.integers(-1, 2))
        number = (value % (1 << 8 * size)).to_bytes(size, "little" if order == "<" else "big")
    data[at : at + len(number)] = number[: len(data) - at]


def text_changed(text: str, rng: Generator, lines: Sequence[str] = ()) -> str:
    """Return a text after one to four changes of lines and tokens; ``lines`` are candidates for insertion."""
    rows = text.splitlines()
    for _ in range(int(rng.geometric(0.5))):
        if not rows:
            break
        at = int(rng.integers(len(rows)))
        match int(rng.integers(10)):
            case 0:
                del rows[at]
            case 1:
                rows[at:at] = [rows[at]] * pick(rng, (1, 2, 1000))
            case 2:
                other = int(rng.integers(len(rows)))
                rows[at], rows[other] = rows[other], rows[at]
            case 3:
                rows[at] = rows[at][: int(rng.integers(len(rows[at]) + 1))]
            case 4:
                del rows[at:]
            case 5 if lines:
                rows.insert(at, pick(rng, lines))
            case _:
                words = rows[at].split(" ")
                place = int(rng.integers(len(words)))
                match int(rng.integers(6)):
                    case 0:
                        del words[place]
                    case 1:
                        words[place:place] = [words[place]] * pick(rng, (1, 100))
                    case 2:
                        words[place] = words[place] + pick(rng, TOKENS)
                    case _:
                        words[place] = pick(rng, TOKENS)
                rows[at] = " ".join(words)
    return pick(rng, ("\n", "\n", "\n", "\r\n", "\r")).join(rows) + pick(rng, ("\n", ""))


def text_file(text: str, rng: Generator, lines: Sequence[str] = ()) -> bytes:
    """Return a mutated text as bytes, sometimes with damaged bytes."""
    data = text_changed(text, rng, lines).encode("utf-8", "surrogatepass")
    return damaged(data, [data or b"x"], rng) if rng.random() < 0.1 else data


def png_changed(data: bytes, rng: Generator) -> bytes:
    """Return a PNG with chunks changed, left out, doubled or exchanged; most checksums are right."""
    chunks, at = list[tuple[bytes, bytes]](), 8
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    for _ in range(int(rng.integers(1, 4))):
        i = 0 if rng.random() < 0.4 else int(rng.integers(len(chunks)))
        kind, body = chunks[i]
        match int(rng.integers(8)):
            case 0 if len(chunks) > 1:
                del chunks[i]
            case 1:
                chunks.insert(i, (kind, body))
            case 2:
                chunks.insert(i, (pick(rng, CHUNKS), body[:24]))
            case 3 if kind == b"IDAT":
                try:
                    rows = zlib.decompress(body)
                except zlib.error:  # a chunk changed before
                    rows = body
                chunks[i] = kind, zlib.compress(bytes_changed(rows, rng))
            case 4:
                chunks[i] = kind, bytes_changed(body, rng)
            case _:
                mutant = bytearray(body)
                number_put(mutant, int(rng.integers(max(len(body), 1))) & ~3, rng)
                chunks[i] = kind, bytes(mutant)
    out = data[:8]
    for kind, body in chunks:
        crc = zlib.crc32(kind + body) if rng.random() < 0.97 else 0
        out += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)
    return out


def exr_changed(data: bytes, rng: Generator) -> bytes:
    """Return an EXR whose header's attributes, table of offsets or blocks are changed."""
    attributes, at = list[tuple[bytes, bytes, bytes]](), 8
    while data[at]:
        name, kind, rest = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        length = int.from_bytes(data[at : at + 4], "little")
        attributes.append((name, kind, rest[4 : 4 + length]))
        at += 4 + length
    pixels = bytearray(data[at + 1 :])
    for _ in range(int(rng.integers(1, 4))):
        i = int(rng.integers(len(attributes)))
        name, kind, body = attributes[i]
        match int(rng.integers(8)):
            case 0 if len(attributes) > 1:
                del attributes[i]
            case 1:
                attributes.insert(i, (name, pick(rng, attributes)[1], body))
            case 2:
                attributes[i] = name, kind, bytes_changed(body, rng)
            case 3 | 4:
                number_put(pixels, int(rng.integers(len(pixels))), rng)
            case 5:
                number_put(pixels, 8 * int(rng.integers(2)), rng)
            case _:
                mutant = bytearray(body)
                number_put(mutant, int(rng.integers(max(len(body), 1))) & ~3, rng)
                attributes[i] = name, kind, bytes(mutant)
    header = data[:8]
    for name, kind, body in attributes:
        length = len(body) if rng.random() < 0.98 else pick(rng, INTEGERS[:14])
        header += name + b"\0" + kind + b"\0" + struct.pack("<I", length) + body
    return header + b"\0" + bytes(pixels)


def headed(data: bytes, end: bytes, rng: Generator, lines: Sequence[str] = ()) -> bytes:
    """Return a file of a header of text, which ends with ``end``, and bytes: one of the two is changed."""
    at = data.index(end) + len(end)
    header, body = data[:at], data[at:]
    if rng.random() < 0.6:
        header = text_changed(header.decode("latin-1"), rng, lines).encode("latin-1", "replace")
        return header if header.endswith((b"\n", b"\r")) and rng.random() < 0.5 else header.rstrip() + b"\n" + body
    return header + bytes_changed(body, rng)


def glb(text: bytes, chunk: bytes, rng: Generator) -> bytes:
    """Return a GLB of JSON and bytes, sometimes with wrong lengths and kinds of chunks."""
    text += b" " * (-len(text) % 4)
    numbers = [2, 20 + len(text) + 8 + len(chunk), len(text), 0x4E4F534A, len(chunk), 0x004E4942]
    if rng.random() < 0.25:
        numbers[int(rng.integers(6))] = pick(rng, INTEGERS[:14])
    version, total, first, kind, second, binary = numbers
    head = struct.pack("<4sIIII", b"glTF", version, total, first, kind)
    return head + text + struct.pack("<II", second, binary) + chunk
