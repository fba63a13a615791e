"""Header portion H of a stream (5.11)–(5.15), and bits of a stream by purpose.

The stream is the payload of the ``.ii`` file. The file's header of about 50 bytes is not part of H.

`floor` measures H by a black picture at the coarsest quantiser. `parts` counts the bits of parameter sets and, for
H.264, of slice headers. `si_below_ei` and `si_below_ri` compare kinds of component images by their number of frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ii_core import IIPicture
from ii_core.camera.camera import whole_pair

from ..api import Encoded, encode
from ..bitstream.framing import units
from ..checks import check_type
from ..contract import MAX_PIXELS, find

Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Bits of a stream by purpose.

    Parameters
    ----------
    framing : int
        Start codes, unit headers, length fields, delimiters and padding.
    parameters : int
        Parameter sets, sequence headers.
    messages : int
        Messages that no decoder needs.
    headers : int or None
        Slice headers; None if they are not parsed and count as data.
    data : int
        The rest, macroblock headers and motion included.
    units : int
        Slices, or frames.
    """

    framing: int = 0
    parameters: int = 0
    messages: int = 0
    headers: int | None = None
    data: int = 0
    units: int = 0

    @property
    def total(self) -> int:
        """All bits."""
        return self.framing + self.parameters + self.messages + (self.headers or 0) + self.data


def parts(coded: Encoded) -> Parts:
    """Return the bits of a coded picture's stream by purpose; they add up to the size of its payload.

    Raises
    ------
    ValueError
        If streams of the scheme are not parsed, or the stream is damaged.
    """
    check_type("coded", coded, Encoded, "a coded picture")
    kind = coded.scheme.rpartition("-")[2]
    if kind not in _TAKE_APART:
        known = ", ".join(_TAKE_APART)
        raise ValueError(f"streams of scheme {coded.scheme} are not parsed: known are those of {known}")
    try:
        return _TAKE_APART[kind](coded.payload)
    except (IndexError, KeyError, ValueError) as error:
        raise ValueError(f"the stream of scheme {coded.scheme} is damaged: {error!r}") from None


@dataclass(frozen=True, kw_only=True)
class Floor:
    """Least bits of a scheme for a structure.

    Parameters
    ----------
    scheme : str
    lenses, ei_pixels : (int, int)
    coded : Encoded
        A black picture at the coarsest quantiser.
    """

    scheme: str
    lenses: Pair
    ei_pixels: Pair
    coded: Encoded = field(repr=False)

    @property
    def bits(self) -> int:
        """b̄_h·J, bits of the stream for all J frames, without the header of the ``.ii`` file."""
        return 8 * len(self.coded.payload)

    @property
    def bpp(self) -> float:
        """Least rate of the stream, for which H = 1."""
        width, height = self.coded.size
        return self.bits / (width * height)

    def portion(self, bpp: float) -> float:
        """Return H at a rate (5.13), the share of headers; above 1 the rate cannot be reached."""
        return self.bpp / bpp


def floor(scheme: str, lenses: Pair, ei_pixels: Pair) -> Floor:
    """Measure the header portion of a scheme and structure: a black picture coded at the coarsest quantiser.

    Schemes without a quantiser use their worst quality, else their least rate.

    Raises
    ------
    ValueError
        If the scheme is unknown or cannot take the structure.

    References
    ----------
    Olsson 2008, §5.5.3.
    """
    (k, l), (u, v) = whole_pair("lenses", lenses), whole_pair("ei_pixels", ei_pixels)
    if k * u * l * v > MAX_PIXELS:
        raise ValueError(f"lenses and ei_pixels make {k * u}×{l * v} pixels: at most {MAX_PIXELS} are allowed")
    black = IIPicture(np.zeros((l * v, k * u, 3), np.uint8), lenses, ei_pixels)
    return Floor(scheme=scheme, lenses=black.lenses, ei_pixels=black.ei_pixels, coded=coarsest(black, scheme))


def coarsest(picture: IIPicture, scheme: str) -> Encoded:
    """Code a picture at the coarsest quantiser, else the worst quality, else the least rate."""
    check_type("scheme", scheme, str, "a name")
    coder = find(scheme.partition(":")[0])
    if coder.qp_range is not None:
        return encode(picture, scheme, qp=coder.qp_range[1])
    if coder.quality_range is not None:
        return encode(picture, scheme, quality=coder.quality_range[0])
    return encode(picture, scheme, bpp=1e-6) if coder.rate_control else encode(picture, scheme)


def frames(kind: str, lenses: Pair, ei_pixels: Pair) -> int:
    """Return J, the number of frames: K·L of elementary images, U·V of sub-images, V·L of ray-space images."""
    (k, l), (u, v) = lenses, ei_pixels
    return {"ei": k * l, "si": u * v, "ri": v * l}[kind]


def si_below_ei(lenses: Pair, ei_pixels: Pair) -> bool:
    """Return whether sub-images have the smaller header portion than elementary images: U·V < √(M·N) (5.14)."""
    (k, l), (u, v) = lenses, ei_pixels
    return u * v < math.sqrt(k * u * l * v)


def si_below_ri(lenses: Pair, ei_pixels: Pair) -> bool:
    """Return whether sub-images have the smaller header portion than ray-space images: U < L (5.15).

    By (2.14) a ray-space image has K rows, hence U·K pixels against K·L of a sub-image. For square elementary images
    the condition is U < √N. The dissertation gives ray-space images L rows and has U < √M.
    """
    (_, l), (u, _) = lenses, ei_pixels
    return u < l


def _nal_units(stream: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield (bits of start code and zero bytes, unit) of an Annex B stream."""
    at = stream.find(b"\0\0\1")
    if at < 0:
        raise IndexError("no start code")
    gap = at + 3  # zero bytes before, and the start code
    at += 3
    while True:
        end = stream.find(b"\0\0\1", at)
        unit = stream[at : len(stream) if end < 0 else end]
        body = unit.rstrip(b"\0")  # a trailing zero belongs to the next start code
        yield 8 * gap, body
        if end < 0:
            return
        gap, at = len(unit) - len(body) + 3, end + 3


class _Bits:
    """Bits of a unit without its emulation prevention bytes, read from the front."""

    def __init__(self, unit: bytes) -> None:
        self.data = unit.replace(b"\0\0\3", b"\0\0")
        self.at = 0

    def u(self, count: int) -> int:
        value = 0
        for _ in range(count):
            value = value << 1 | self.data[self.at >> 3] >> (7 - (self.at & 7)) & 1
            self.at += 1
        return value

    def ue(self) -> int:
        zeros = 0
        while not self.u(1):
            zeros += 1
            if zeros > 32:
                raise IndexError("no exp-Golomb code")
        return (1 << zeros) - 1 + self.u(zeros)

    def se(self) -> int:
        code = self.ue()
        return (code + 1) // 2 if code & 1 else -(code // 2)


def _h264(stream: bytes) -> Parts:
    """Count the bits of an H.264 stream: units by type, slice headers field by field (ITU-T H.264, 7.3)."""
    count = dict.fromkeys(("framing", "parameters", "messages", "headers", "data", "units"), 0)
    sequence: dict[str, int] = {}
    picture: dict[str, int] = {}
    for gap, unit in _nal_units(stream):
        count["framing"] += gap + 8
        kind, bits = unit[0] & 31, 8 * (len(unit) - 1)
        if kind in (1, 5):
            reader = _Bits(unit[1:64])  # no header is longer
            _h264_slice_header(reader, kind, unit[0] >> 5 & 3, sequence, picture)
            count["headers"] += reader.at
            count["data"] += bits - reader.at
            count["units"] += 1
        elif kind in (7, 8):
            reader = _Bits(unit[1:])
            if kind == 7:
                sequence = _h264_sequence(reader)
            else:
                picture = _h264_picture(reader)
            count["parameters"] += bits
        elif kind == 6:
            count["messages"] += bits
        else:
            count["framing"] += bits
    return Parts(**count)


def _h264_sequence(r: _Bits) -> dict[str, int]:
    """Return the fields of a sequence parameter set that slice headers depend on (7.3.2.1.1)."""
    profile = r.u(8)
    r.u(16)
    r.ue()
    found = {"separate_planes": 0}
    if profile in (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135):
        chroma = r.ue()
        if chroma == 3:
            found["separate_planes"] = r.u(1)
        r.ue()
        r.ue()
        r.u(1)
        if r.u(1):  # scaling matrices
            for i in range(8 if chroma != 3 else 12):
                if r.u(1):
                    _skip_scaling_list(r, 16 if i < 6 else 64)
    found["frame_num_bits"] = r.ue() + 4
    found["poc_type"] = r.ue()
    if found["poc_type"] == 0:
        found["poc_bits"] = r.ue() + 4
    elif found["poc_type"] == 1:
        found["poc_always_zero"] = r.u(1)
        r.se()
        r.se()
        for _ in range(r.ue()):
            r.se()
    r.ue()
    r.u(1)
    r.ue()
    r.ue()
    found["frames_only"] = r.u(1)
    return found


def _skip_scaling_list(r: _Bits, size: int) -> None:
    last = following = 8
    for _ in range(size):
        if following:
            following = (last + r.se()) % 256
        last = following or last


def _h264_picture(r: _Bits) -> dict[str, int]:
    """Return the fields of a picture parameter set that slice headers depend on (7.3.2.2)."""
    r.ue()
    r.ue()
    found = {"cabac": r.u(1), "poc_of_field": r.u(1)}
    if r.ue():
        raise KeyError("slice groups, which none of our encoders makes")
    found["refs"] = (r.ue() + 1, r.ue() + 1)  # type: ignore[assignment]
    found["weighted"], found["weighted_b"] = r.u(1), r.u(2)
    r.se()
    r.se()
    r.se()
    found["deblocking"] = r.u(1)
    r.u(1)
    found["redundant"] = r.u(1)
    return found


def _h264_slice_header(r: _Bits, kind: int, reference: int, sps: dict[str, int], pps: dict[str, int]) -> None:
    """Read a slice header to its end (7.3.3)."""
    r.ue()
    slice_type = r.ue() % 5
    predicted, both_ways = slice_type in (0, 1, 3), slice_type == 1
    r.ue()
    if sps["separate_planes"]:
        r.u(2)
    _skip_place(r, kind, sps, pps)
    if both_ways:
        r.u(1)
    if predicted:
        refs = _active_references(r, both_ways, pps["refs"])  # type: ignore[arg-type]
        _skip_reordering(r, len(refs))
        if pps["weighted_b"] == 1 if both_ways else pps["weighted"]:
            _skip_weights(r, refs)
    if reference:
        _skip_marking(r, kind)
    if pps["cabac"] and predicted:
        r.ue()
    r.se()
    if pps["deblocking"] and r.ue() != 1:
        r.se()
        r.se()
    if pps["cabac"]:
        r.at += -r.at % 8  # arithmetic coding starts on a byte


def _skip_place(r: _Bits, kind: int, sps: dict[str, int], pps: dict[str, int]) -> None:
    """Skip frame number, field, and picture order count."""
    r.u(sps["frame_num_bits"])
    field_picture = 0 if sps["frames_only"] else r.u(1)
    if field_picture:
        r.u(1)
    if kind == 5:
        r.ue()
    of_field = pps["poc_of_field"] and not field_picture
    if sps["poc_type"] == 0:
        r.u(sps["poc_bits"])
        if of_field:
            r.se()
    elif sps["poc_type"] == 1 and not sps["poc_always_zero"]:
        r.se()
        if of_field:
            r.se()
    if pps["redundant"]:
        r.ue()


def _active_references(r: _Bits, both_ways: bool, usual: tuple[int, int]) -> list[int]:
    """Return the number of references of each list, one list or two."""
    lists = 2 if both_ways else 1
    return [r.ue() + 1 for _ in range(lists)] if r.u(1) else list(usual[:lists])


def _skip_reordering(r: _Bits, lists: int) -> None:
    """Skip the modification of reference lists (7.3.3.1)."""
    for _ in range(lists):
        if r.u(1):
            while r.ue() != 3:
                r.ue()


def _skip_marking(r: _Bits, kind: int) -> None:
    """Skip the marking of decoded references (7.3.3.3)."""
    if kind == 5:
        r.u(2)
    elif r.u(1):
        while operation := r.ue():
            for _ in range({1: 1, 2: 1, 3: 2, 4: 1, 5: 0, 6: 1}[operation]):
                r.ue()


def _skip_weights(r: _Bits, refs: list[int]) -> None:
    """Skip a table of prediction weights with chroma (7.3.3.2)."""
    r.ue()
    r.ue()
    for count in refs:
        for _ in range(count):
            for values in (2, 4):
                if r.u(1):
                    for _ in range(values):
                        r.se()


def _hevc(stream: bytes) -> Parts:
    """Count the bits of an HEVC stream: units by type (ITU-T H.265, 7.3.1)."""
    count = dict.fromkeys(("framing", "parameters", "messages", "data", "units"), 0)
    for gap, unit in _nal_units(stream):
        count["framing"] += gap + 16
        kind, bits = unit[0] >> 1 & 63, 8 * (len(unit) - 2)
        part = "data" if kind < 32 else "parameters" if kind < 35 else "messages" if kind in (39, 40) else "framing"
        count[part] += bits
        count["units"] += kind < 32
    return Parts(**count)


def _av1(stream: bytes) -> Parts:
    """Count the bits of an AV1 stream: units by type (AV1 bitstream specification, 5.3)."""
    count = dict.fromkeys(("framing", "parameters", "messages", "data", "units"), 0)
    for kind, start, body, end in units(stream):
        count["framing"] += 8 * (body - start)
        part = {1: "parameters", 2: "framing", 5: "messages", 15: "framing"}.get(kind, "data")
        count[part] += 8 * (end - body)
        count["units"] += kind in (3, 6)
    return Parts(**count)


_TAKE_APART: dict[str, Callable[[bytes], Parts]] = {"h264": _h264, "hevc": _hevc, "av1": _av1}
