"""Random access to component images: one component image or frame of a coded picture, decoded without the others."""

from __future__ import annotations

import numpy as np

from ..api import Encoded, blank_picture
from ..checks import check_type, whole_pair
from ..clock import cpu_seconds
from ..coders import groups
from ..coders.lf.coder import LightField
from ..coders.pseudo_video import PseudoVideo
from ..contract import Coder, Pixels, find
from ..frames import Layout, layout


def decode_component(coded: Encoded, place: tuple[int, int]) -> Pixels:
    """Decode one component image of a coded picture.

    Parameters
    ----------
    coded : Encoded
        A pseudo video sequence is decoded from the start of the group of pictures that holds the component image:
        with ``gop=1`` one frame, with the default ``gop=0`` all frames before it, too.
    place : (int, int)
        (u, v) of a sub-image, (k, l) of an elementary image, (v, l) of a ray-space image.

    Returns
    -------
    ndarray, (T, S, 3)
        Equal to the component image of the whole decoded picture.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    ValueError
        If there is no such component image, the scheme decodes none alone, or the stream is damaged.
    """
    coder, grid = _grid(coded)
    col, row = whole_pair("place", place)
    if not (0 <= row < grid.rows and 0 <= col < grid.cols):
        raise ValueError(f"component image {place} does not exist: there are {grid.cols}×{grid.rows}, from (0, 0)")
    return _decoded(coder, coded, row * grid.cols + col)


def decode_frame(coded: Encoded, index: int) -> Pixels:
    """Decode one frame of a pseudo video sequence, as `decode_component` does.

    Parameters
    ----------
    coded : Encoded
    index : int
        Frame number j, in the order of the sequence. Other schemes count the grid of component images row by row.

    Returns
    -------
    ndarray, (T, S, 3)
        The component image PVS_j.

    Raises
    ------
    TypeError
        If an argument is of the wrong type.
    ValueError
        If there is no such frame, the scheme decodes no frame alone, or the stream is damaged.
    """
    check_type("index", index, (int, np.integer), "a whole number")
    coder, grid = _grid(coded)
    if isinstance(index, bool) or not 0 <= index < grid.frames:
        raise ValueError(f"the frame of index {index} does not exist: there are {grid.frames}, from 0")
    return _decoded(coder, coded, int(coder.frame_order(grid.rows, grid.cols, coded.options)[index]))


def access_cost(coded: Encoded, place: tuple[int, int]) -> tuple[int, float] | None:
    """Return the bytes that decoding of one component image reads, and its CPU seconds.

    Of a pseudo video sequence the bytes are those of the group of pictures; of `si-lf` those of the levels above the
    view, and of its own. None for schemes that decode none alone, or whose bytes are not counted.

    Raises
    ------
    TypeError, ValueError
        As `decode_component`.
    """
    check_type("coded", coded, Encoded, "a coded picture")
    col, row = whole_pair("place", place)
    coder = find(coded.scheme)
    if isinstance(coder, PseudoVideo):
        grid = layout(coded.structure["lenses"], coded.structure["ei_pixels"], coder.kind)
        order = coder.frame_order(grid.rows, grid.cols, coded.options)
        stream = sequence(coded)
        started = cpu_seconds()
        decode_component(coded, place)  # raises ValueError if there is none
        seconds = cpu_seconds() - started
        start, stop = stream.group(int(np.flatnonzero(order == row * grid.cols + col)[0]))
        nbytes = len(stream.first) + sum(len(packet.data) for packet in stream.packets[start:stop])
        return nbytes, seconds
    if isinstance(coder, LightField):
        started = cpu_seconds()
        blank = blank_picture(coded.structure, coded.dtype)
        _, nbytes, _ = coder.decode_view(coded.payload, blank, coded.options, (row, col))
        return nbytes, cpu_seconds() - started
    return None


def sequence(coded: Encoded) -> groups.Sequence:
    """Return the packets of a coded pseudo video sequence.

    Raises
    ------
    ValueError
        If the scheme codes no pseudo video sequence, or the stream does not hold one packet per frame.
    """
    check_type("coded", coded, Encoded, "a coded picture")
    coder = find(coded.scheme)
    if not isinstance(coder, PseudoVideo):
        raise ValueError(f"scheme {coded.scheme} codes no pseudo video sequence")
    film = coder.film(blank_picture(coded.structure, coded.dtype), coded.options)
    try:
        return groups.sequence(coder, coded.payload, film, coded.options)
    except ValueError as error:
        raise ValueError(f"the coded picture is damaged: {error}") from None


def _grid(coded: Encoded) -> tuple[Coder, Layout]:
    """Return the coder of a coded picture and its grid of component images."""
    check_type("coded", coded, Encoded, "a coded picture")
    coder = find(coded.scheme)
    if not coder.components_alone:
        raise ValueError(f"scheme {coded.scheme} codes the picture as a whole: no component image decodes alone")
    return coder, layout(coded.structure["lenses"], coded.structure["ei_pixels"], coder.kind)


def _decoded(coder: Coder, coded: Encoded, index: int) -> Pixels:
    blank = blank_picture(coded.structure, coded.dtype)
    try:
        return coder.decode_component(coded.payload, blank, coded.options, index)
    except ValueError as error:
        raise ValueError(f"the coded picture is damaged: {error}") from None
