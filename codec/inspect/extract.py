"""Extraction of the coded stream of an ``.ii`` file into a standard container, without coding again.

=================  ===========================================================================================
schemes            files
=================  ===========================================================================================
``*-h264``         ``.mkv``, ``.mp4``, ``.mov``, ``.h264`` (the payload as it is)
``*-hevc``         ``.mkv``, ``.mp4``, ``.mov``, ``.hevc``
``*-av1``          ``.mkv``, ``.mp4``, ``.ivf``, ``.avif``, ``.obu`` (the payload as it is)
``*-avif``         ``.avif``, ``.mkv``, ``.mp4``, ``.ivf``, ``.obu``
``*-vp9``          ``.mkv``, ``.mp4``, ``.webm``, ``.ivf``
``*-ffv1``         ``.mkv``, ``.avi``
``*-mpeg2``        ``.mkv``, ``.mp4``, ``.m2v`` (the payload as it is)
whole pictures     the payload as it is: ``.j2k``, ``.jpg``, ``.jxl``, ``.jph``; in JP2 boxes: ``.jp2``
=================  ===========================================================================================

Files show the coded frames in the order of the sequence, at an arbitrary 25 frames per second. Some encoders need
frames larger than the component image, or transposed; `extract` reports this. HEVC streams get a conformance
window, so that players show the component image alone. Streams of libaom get the label of their matrix, BT.709.
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.bitstream import BitStreamFilterContext

from ii_core.base.files import atomic_path

from ..api import Encoded
from ..checks import check_type
from ..coders.decoding import open_decoder
from ..coders.ffv1 import Ffv1
from ..coders.groups import DEMUXERS, Sequence
from ..coders.pseudo_video import PseudoVideo
from ..coders.video import open_encoder
from ..contract import find
from .random_access import sequence

RATE = 25
CONTAINERS = {
    "H.264": (".mkv", ".mp4", ".mov"),
    "HEVC": (".mkv", ".mp4", ".mov"),
    "AV1": (".mkv", ".mp4", ".ivf", ".avif"),
    "VP9": (".mkv", ".mp4", ".webm", ".ivf"),
    "FFV1": (".mkv", ".avi"),
    "MPEG-2": (".mkv", ".mp4"),
}
BARE = {"H.264": (".h264", ".264"), "HEVC": (".hevc", ".265"), "AV1": (".obu",), "MPEG-2": (".m2v",)}
HEVC_BLOCK = 8  # smallest block of x265: frames are padded to it and cropped
FOURCC = {"AV1": b"AV01", "VP9": b"VP90"}
# First bytes of payloads of whole pictures, and the suffixes of such files.
STILLS: tuple[tuple[bytes, tuple[str, ...]], ...] = (
    (b"\xff\x4f\xff\x51", (".j2k", ".j2c", ".jp2")),
    (b"\xff\xd8\xff", (".jpg", ".jpeg")),
    (b"\xff\x0a", (".jxl",)),
    (b"\0\0\0\x0cJXL ", (".jxl",)),
    (b"\0\0\0\x0cjP  ", (".jp2", ".jph")),
)
HIGH_THROUGHPUT = b"\xff\x50"  # the extended capabilities of Part 15 stand among the first markers


@dataclass(frozen=True, kw_only=True)
class Extracted:
    """Frames in the file of an extracted stream.

    Parameters
    ----------
    frames : int
        Number of frames; 1 for a whole picture.
    size : (int, int)
        Width and height of a frame as players show it.
    image : (int, int)
        Width and height of the component image, or of the whole picture, within a frame.
    turned : bool
        Whether rows of a frame are columns of the component image.
    """

    frames: int
    size: tuple[int, int]
    image: tuple[int, int]
    turned: bool = False

    def __str__(self) -> str:
        (width, height), (across, down) = self.size, self.image
        said = f"{self.frames} frame{'s' if self.frames > 1 else ''} of {width}×{height} pixels"
        corner = (down, across) if self.turned else (across, down)
        if self.turned:
            said += f", rows are the columns of images of {across}×{down}"
        if corner != self.size:
            said += f", the image is the upper left {corner[0]}×{corner[1]} and the rest is filling"
        return said


def extract(coded: Encoded, path: str | os.PathLike[str]) -> Extracted:
    """Write the stream of a coded picture as a file of a standard type, whole or not at all.

    Parameters
    ----------
    coded : Encoded
    path : path
        Its suffix selects the container; see `suffixes`.

    Returns
    -------
    Extracted
        Number and size of frames, and position of component images in them.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    ValueError
        If the container does not take the scheme's stream, or the stream is damaged.
    OSError
        If it cannot be written.
    """
    check_type("coded", coded, Encoded, "a coded picture")
    check_type("path", path, (str, os.PathLike), "a path")
    path = Path(path)
    suffix, allowed = path.suffix.lower(), suffixes(coded)
    if suffix not in allowed:
        known = ", ".join(allowed) or "none"
        raise ValueError(f"the stream of scheme {coded.scheme} does not go into {path.name}: possible are {known}")
    coder = find(coded.scheme)
    with atomic_path(path) as temporary:
        if not isinstance(coder, PseudoVideo):
            boxed = suffix in (".jp2", ".jph") and coded.payload[:2] == b"\xff\x4f"
            temporary.write_bytes(_jp2(coded) if boxed else coded.payload)
            return Extracted(frames=1, size=coded.size, image=coded.size)
        stream, size = _for_others(sequence(coded))
        if suffix in BARE.get(coder.standard, ()):
            temporary.write_bytes(b"".join(packet.data for packet in stream.packets))
        elif suffix == ".ivf":
            temporary.write_bytes(_ivf(stream))
        else:
            _mux(stream, temporary)
    shape = stream.film.layout
    image = (shape.height, shape.width) if shape.turned else (shape.width, shape.height)
    return Extracted(frames=len(stream.packets), size=size, image=image, turned=shape.turned)


def _for_others(stream: Sequence) -> tuple[Sequence, tuple[int, int]]:
    """Return the sequence with metadata for other programs (colours, HEVC size), and its size."""
    film, coder = stream.film, stream.coder
    filters, size = [coder.relabel] if coder.relabel else [], (film.width, film.height)
    if coder.standard == "HEVC":
        unit = 2 if film.format.chroma == "420" else 1  # cropping counts whole samples of chroma
        size = -(-film.layout.width // unit) * unit, -(-film.layout.height // unit) * unit
        right, bottom = (
            -(-coded // HEVC_BLOCK) * HEVC_BLOCK - shown
            for coded, shown in zip((film.width, film.height), size, strict=True)
        )
        filters.append(f"hevc_metadata=crop_right={right}:crop_bottom={bottom}")
    for name in filters:
        source = _demuxer(stream)
        context = BitStreamFilterContext(name, source.streams.video[0])
        packets = []
        for packet in stream.packets:
            (filtered,) = context.filter(av.Packet(packet.data))
            packets.append(replace(packet, data=bytes(filtered)))
        stream = replace(stream, packets=packets)
    return stream, size


def _demuxer(stream: Sequence) -> Any:
    """Return FFmpeg's demuxer of the stream, whose description filters and containers need."""
    if stream.coder.standard in FOURCC:
        return av.open(io.BytesIO(_ivf(stream)), format="ivf")
    data = b"".join(packet.data for packet in stream.packets)
    return av.open(io.BytesIO(data), format=DEMUXERS[stream.coder.standard])


def suffixes(coded: Encoded) -> tuple[str, ...]:
    """Return the suffixes that `extract` accepts for a coded picture, the usual one first."""
    coder = find(coded.scheme)
    if isinstance(coder, PseudoVideo):
        found = CONTAINERS[coder.standard] + BARE.get(coder.standard, ())
        usual = ".avif" if coder.encoder == "libaom" else found[0]
        return (usual, *(suffix for suffix in found if suffix != usual))
    for magic, names in STILLS:
        if coded.payload.startswith(magic):
            if names[0] == ".j2k" and HIGH_THROUGHPUT in coded.payload[:128]:
                return (".jph", ".j2c")
            return names
    return ()


def _mux(stream: Sequence, path: Path) -> None:
    """Write packets into a container, each with the display time of its frame."""
    shown = _display_order(stream)
    # Largest lead of decoding over display.
    ahead = max(i - shown[i] for i in range(len(shown)))
    # bitexact omits identifiers and dates of Matroska: equal streams make equal files
    with av.open(str(path), "w", options={"fflags": "+bitexact"}) as out:
        target, keep = _stream(stream, out)
        target.time_base = Fraction(1, RATE)
        for i, packet in enumerate(stream.packets):
            moved = av.Packet(packet.data)
            moved.stream, moved.time_base = target, Fraction(1, RATE)
            moved.pts, moved.dts, moved.duration = int(shown[i]), int(i - ahead), 1
            moved.is_keyframe = packet.key
            out.mux(moved)
        del keep


def _stream(stream: Sequence, out: Any) -> tuple[Any, Any]:
    """Return an output stream that describes the packets, and an object that must outlive it."""
    coder = stream.coder
    if isinstance(coder, Ffv1):
        # FFV1 has no bare file to copy the description from: open the encoder again.
        target: Any = out.add_stream(coder.encoder, rate=RATE)
        settings = coder.constant(0, stream.film, stream.options)
        open_encoder(coder, stream.film, settings, target.codec_context)
        out.start_encoding()
        if bytes(target.codec_context.extradata or b"") != stream.first:
            raise ValueError("the coded picture was made by another version of FFV1 than this program writes")
        return target, None
    source = _demuxer(stream)
    # From the demuxer, not from the decoder: dav1d has no description.
    target = out.add_stream_from_template(source.streams.video[0], opaque=True)
    context = target.codec_context
    # MPEG-2 cannot state full range, and old streams lack the matrix: state both in the container.
    context.color_range = av.video.reformatter.ColorRange.JPEG
    context.colorspace = av.video.reformatter.Colorspace.ITU709
    return target, source


def _display_order(stream: Sequence) -> Many[int]:
    """Return the display time of each packet's frame, from the decoder."""
    context = open_decoder(stream.coder, stream.film)
    if stream.first:
        context.extradata = stream.first
    order: list[int] = []
    try:
        for i, packet in enumerate(stream.packets):
            numbered = av.Packet(packet.data)
            numbered.pts = i
            order += [frame.pts for frame in context.decode(numbered)]
        order += [frame.pts for frame in context.decode(None)]
    except av.FFmpegError as error:
        raise ValueError(f"the coded picture is damaged: {error.strerror}") from None
    if sorted(order) != list(range(len(stream.packets))):
        raise ValueError(f"the coded picture is damaged: of {len(stream.packets)} packets {len(order)} decode")
    return np.argsort(order).tolist()


def _ivf(stream: Sequence) -> bytes:
    """Return an IVF file: a header, then size, time and bytes of every packet."""
    film = stream.film
    fourcc = FOURCC[stream.coder.standard]
    size = film.width, film.height
    parts = [struct.pack("<4sHH4sHHIIII", b"DKIF", 0, 32, fourcc, *size, RATE, 1, len(stream.packets), 0)]
    for i, packet in enumerate(stream.packets):
        parts += [struct.pack("<IQ", len(packet.data), i), packet.data]
    return b"".join(parts)


def _jp2(coded: Encoded) -> bytes:
    """Return a codestream in the boxes of a JP2 file: sRGB of 8 or 16 bit (ISO/IEC 15444-1, Annex I)."""
    width, height = coded.size
    bits = 15 if coded.dtype == "uint16" else 7
    high = HIGH_THROUGHPUT in coded.payload[:128]
    brand = b"jph " if high else b"jp2 "
    image = _box(b"ihdr", struct.pack(">IIHBBBB", height, width, 3, bits, 7, 0, 0))
    colour = _box(b"colr", struct.pack(">BBBI", 1, 0, 0, 16))
    return b"".join(
        [
            _box(b"jP  ", b"\r\n\x87\n"),
            _box(b"ftyp", brand + bytes(4) + brand),
            _box(b"jp2h", image + colour),
            _box(b"jp2c", coded.payload),
        ]
    )


def _box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), kind) + content
