"""Progressive decoding of light fields, level by level, and the cost of one view."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ..api import Encoded, blank_picture
from ..checks import check_type, whole_pair
from ..clock import cpu_seconds
from ..coders.lf.coder import LightField
from ..contract import MAX_DECODED_PIXELS, Pixels, find


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A light field decoded up to a level of its pyramid.

    Parameters
    ----------
    level : int
        Level from 0, the view in the middle.
    bytes_read : int
        Bytes of the payload read so far, header and index included.
    seconds : float
        CPU time so far.
    decoded : ndarray of bool, (V, U)
        The decoded views.
    picture : IIPicture
        The decoded views; each other view shows the decoded view nearest to it.
    """

    level: int
    bytes_read: int
    seconds: float
    decoded: NDArray[np.bool_]
    picture: IIPicture


@dataclass(frozen=True, kw_only=True)
class DecodedView:
    """One view, decoded alone, with the bytes read and the CPU time.

    Parameters
    ----------
    pixels : ndarray, (T, S, 3)
    bytes_read : int
        Bytes of the payload read, header and index included.
    payload_bytes : int
        Size of the payload of the whole picture.
    views_decoded : int
        Number of views decoded, the view itself included.
    seconds : float
        CPU time.
    """

    pixels: Pixels
    bytes_read: int
    payload_bytes: int
    views_decoded: int
    seconds: float


def decode_levels(coded: Encoded) -> Iterator[Stage]:
    """Decode a light field level by level: the middle view first, at last the whole picture.

    Parameters
    ----------
    coded : Encoded
        Coded by ``si-lf``.

    Yields
    ------
    Stage
        The last one has the picture of `decode`.

    Raises
    ------
    TypeError
        If ``coded`` is no coded picture; before the first stage.
    ValueError
        If another scheme coded the picture, or it has more than 2²⁷ pixels; before the first stage. If the payload
        is damaged.
    """
    return _stages(coded, *_light_field(coded))


def _stages(coded: Encoded, coder: LightField, blank: IIPicture) -> Iterator[Stage]:
    """Yield the stages of `decode_levels`."""
    started = cpu_seconds()
    (width, height), (cols, rows) = blank.lenses, blank.ei_pixels
    try:
        for level, field, read in coder.decode_levels(coded.payload, blank, coded.options):
            decoded = field.decoded
            pixels = np.empty((height, rows, width, cols, 3), blank.pixels.dtype)
            places = np.argwhere(decoded)
            for row in range(rows):
                for col in range(cols):
                    near = places[np.square(places - (row, col)).sum(axis=1).argmin()]
                    pixels[:, row, :, col] = field.view_pixels(field.number((int(near[0]), int(near[1]))))
            picture = blank.with_pixels(pixels.reshape(blank.pixels.shape))
            yield Stage(
                level=level,
                bytes_read=read,
                seconds=cpu_seconds() - started,
                decoded=decoded.copy(),
                picture=picture,
            )
    except ValueError as error:
        raise ValueError(f"the coded picture is damaged: {error}") from None


def decode_view(coded: Encoded, place: tuple[int, int]) -> DecodedView:
    """Decode one view of a light field alone, and state bytes read and CPU time.

    Parameters
    ----------
    coded : Encoded
        Coded by ``si-lf``.
    place : (int, int)
        (u, v) of the view.

    Raises
    ------
    ValueError
        As `decode_levels`, or if there is no such view.
    """
    coder, blank = _light_field(coded)
    col, row = whole_pair("place", place)
    cols, rows = blank.ei_pixels
    if not (0 <= row < rows and 0 <= col < cols):
        raise ValueError(f"place is {(col, row)}: there are {cols}×{rows} views, from (0, 0)")
    started = cpu_seconds()
    try:
        pixels, read, views = coder.decode_view(coded.payload, blank, coded.options, (row, col))
    except ValueError as error:
        raise ValueError(f"the coded picture is damaged: {error}") from None
    return DecodedView(
        pixels=pixels,
        bytes_read=read,
        payload_bytes=len(coded.payload),
        views_decoded=views,
        seconds=cpu_seconds() - started,
    )


def _light_field(coded: Encoded) -> tuple[LightField, IIPicture]:
    check_type("coded", coded, Encoded, "a coded picture")
    coder = find(coded.scheme)
    if not isinstance(coder, LightField):
        raise ValueError(f"scheme {coded.scheme} codes no levels: only {LightField.name} does")
    blank = blank_picture(coded.structure, coded.dtype)
    width, height = blank.size
    if width * height > MAX_DECODED_PIXELS:
        raise ValueError(f"the picture has {width}×{height} pixels: at most {MAX_DECODED_PIXELS} are decoded")
    return coder, blank
