"""Packets of a JPEG 2000 tile, and a codestream of some of its components (ISO/IEC 15444-1, Annex B).

One tile, one layer, components of one size, code blocks of 64×64, packets resolution by resolution: the codestreams
that `codec.bitstream.jpeg2000` writes. The reader takes the lengths from packet headers and decodes no coefficient.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass

BLOCK = 64
SOT_BYTES, SOD = 12, b"\xff\x93"
MAX_BITS = 40  # of the length of a code block; longer ones are damage


@dataclass(frozen=True, kw_only=True)
class Tile:
    """Components of one size in one tile.

    Parameters
    ----------
    components, height, width : int
    levels : int
        Of the wavelet.
    precinct : int
        Side in pixels of a resolution, a power of two.
    by_component : bool
        Whether all precincts of a component follow one another (LRCP), else all components of a precinct (RPCL).
    """

    components: int
    height: int
    width: int
    levels: int
    precinct: int
    by_component: bool

    def packet_count(self) -> int:
        """Return the number of packets, which is also their least size in bytes: an empty packet has one."""
        sides = [
            (_halved(self.height, self.levels - r), _halved(self.width, self.levels - r))
            for r in range(self.levels + 1)
        ]
        return self.components * sum(-(-h // self.precinct) * -(-w // self.precinct) for h, w in sides)

    def packets(self) -> Iterator[tuple[int, list[tuple[int, int]]]]:
        """Yield, in stream order, a packet's component and the code blocks (rows, columns) of its subbands."""
        for resolution in range(self.levels + 1):
            precincts = list(self._precincts(resolution))
            if self.by_component:
                for component in range(self.components):
                    yield from ((component, bands) for bands in precincts)
            else:
                for bands in precincts:
                    yield from ((component, bands) for component in range(self.components))

    def _precincts(self, resolution: int) -> Iterator[list[tuple[int, int]]]:
        halvings = self.levels - resolution
        height, width = (_halved(side, halvings) for side in (self.height, self.width))
        if resolution == 0:
            side, bands = self.precinct, [(height, width)]
        else:
            # Lengths of the low and the high half, of rows and of columns.
            above = [
                (_halved(full, halvings + 1), part) for full, part in ((self.height, height), (self.width, width))
            ]
            (low_rows, rows), (low_cols, cols) = above
            side = self.precinct // 2
            bands = [(low_rows, cols - low_cols), (rows - low_rows, low_cols), (rows - low_rows, cols - low_cols)]
        for y in range(-(-height // self.precinct)):
            for x in range(-(-width // self.precinct)):
                yield [(_blocks(rows, y, side), _blocks(cols, x, side)) for rows, cols in bands]


def _halved(side: int, times: int) -> int:
    return -(-side // (1 << times))


def _blocks(length: int, index: int, side: int) -> int:
    """Return the number of code blocks along one axis of a precinct in a subband."""
    return -(-max(0, min(length - index * side, side)) // BLOCK)


def packets_of(body: bytes, tile: Tile, components: Collection[int]) -> bytes:
    """Return the packets of some components, in stream order.

    Raises
    ------
    ValueError
        If the packets do not fill the bytes.
    """
    parts, at = [], 0
    for component, bands in tile.packets():
        end = _packet_end(body, at, bands)
        if component in components:
            parts.append(body[at:end])
        at = end
    if at != len(body):
        raise ValueError(f"its JPEG 2000 packets have {at} bytes, {len(body)} are there")
    return b"".join(parts)


def tile_part(main_and_tile: bytes, at: int) -> bytes:
    """Return the packets of the only tile-part, whose SOT marker is at a position, up to the EOC marker."""
    start = at + SOT_BYTES
    if main_and_tile[start : start + 2] != SOD:
        raise ValueError("its JPEG 2000 stream has more than a tile header before its packets")
    return main_and_tile[start + 2 : -2]


def new_tile_part(packets: bytes) -> bytes:
    """Return a tile-part, from its SOT marker on, and the EOC marker."""
    head = struct.pack(">HHHIBB", 0xFF90, 10, 0, SOT_BYTES + 2 + len(packets), 0, 1)
    return head + SOD + packets + b"\xff\xd9"


def _packet_end(body: bytes, at: int, bands: list[tuple[int, int]]) -> int:
    bits = _Bits(body, at)
    length = 0
    if bits.one():
        for rows, cols in bands:
            if rows and cols:
                length += _band_bytes(bits, rows, cols)
    end = bits.end() + length
    if end > len(body):
        raise ValueError("its JPEG 2000 packets are cut short")
    return end


def _band_bytes(bits: _Bits, rows: int, cols: int) -> int:
    included, zeros = _TagTree(rows, cols), _TagTree(rows, cols)
    total = 0
    for row in range(rows):
        for col in range(cols):
            if not included.below(bits, row, col, 1):
                continue
            threshold = 1
            while not zeros.below(bits, row, col, threshold):
                threshold += 1
                if threshold > MAX_BITS:
                    raise ValueError("its JPEG 2000 packets are damaged")
            passes, size = _passes(bits), 3
            while bits.one():
                size += 1
                if size > MAX_BITS:
                    raise ValueError("its JPEG 2000 packets are damaged")
            total += bits.take(size + passes.bit_length() - 1)
    return total


def _passes(bits: _Bits) -> int:
    """Number of coding passes (Table B.4)."""
    if not bits.one():
        return 1
    if not bits.one():
        return 2
    if (number := bits.take(2)) < 3:
        return 3 + number
    if (number := bits.take(5)) < 31:
        return 6 + number
    return 37 + bits.take(7)


class _Bits:
    """Bits of a packet header: a byte after FF has seven (B.10.1)."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data, self.at, self.left, self.byte = data, at, 0, 0

    def one(self) -> int:
        if self.left == 0:
            self.left = 7 if self.byte == 0xFF else 8
            if self.at >= len(self.data):
                raise ValueError("its JPEG 2000 packets are cut short")
            self.byte = self.data[self.at]
            self.at += 1
        self.left -= 1
        return self.byte >> self.left & 1

    def take(self, count: int) -> int:
        number = 0
        for _ in range(count):
            number = number << 1 | self.one()
        return number

    def end(self) -> int:
        """Position after the header; a last byte of FF is followed by one of stuffing."""
        return self.at + (self.byte == 0xFF)


@dataclass
class _Node:
    low: int = 0
    known: bool = False


class _TagTree:
    """Tag tree (B.10.2): values of a grid; a parent holds the minimum of its 2×2 children."""

    def __init__(self, rows: int, cols: int) -> None:
        self.nodes: list[dict[tuple[int, int], _Node]] = []
        while True:
            self.nodes.append({(y, x): _Node() for y in range(rows) for x in range(cols)})
            if rows * cols <= 1:
                break
            rows, cols = -(-rows // 2), -(-cols // 2)

    def below(self, bits: _Bits, row: int, col: int, threshold: int) -> bool:
        """Return whether a leaf's value is below a threshold, reading as few bits as that takes."""
        low = 0
        for level in reversed(range(len(self.nodes))):
            node = self.nodes[level][row >> level, col >> level]
            node.low = max(node.low, low)
            while not node.known and node.low < threshold:
                if bits.one():
                    node.known = True
                else:
                    node.low += 1
            low = node.low
            if not node.known:
                return False
        return low < threshold
