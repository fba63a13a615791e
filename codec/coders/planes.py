"""Planes as components of one JPEG 2000 codestream, by OpenJPEG through imagecodecs.

One codestream has one rate control: OpenJPEG cuts all code blocks of all components at one rate–distortion slope,
such that the squared error of all planes together is the one allowed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core.base.extras import Lazy

from ..bitstream import jpeg2000

imagecodecs = Lazy("imagecodecs")

MAX_COMPONENTS = 4095  # imagecodecs' limit; the standard's is 16384
FINEST_DB = 140.0


def encode_planes(planes: NDArray[Any], squared_error: float, *, wavelet: str) -> bytes:
    """Code planes: one tile, one quality layer, no colour transform, five levels unless planes are small.

    Parameters
    ----------
    planes : ndarray of int16 or int32, (C, H, W)
        At most `MAX_COMPONENTS` planes; of int32, values of 24 bits.
    squared_error : float
        Allowed mean squared error over all planes. 0 is lossless and needs the 5/3.
    wavelet : {"5/3", "9/7"}
        Within planes: the reversible 5/3, or the 9/7.

    Returns
    -------
    bytes
        The codestream from its coding style (COD marker segment) on.
    """
    if planes.shape[2] == 1:  # imagecodecs misreads planes of one column
        planes = np.repeat(planes, 2, axis=2)
    bits = jpeg2000.BITS[planes.dtype.name]
    peak = 2.0**bits - 1
    level = None if squared_error == 0 else min(max(10 * math.log10(peak**2 / squared_error), 1e-3), FINEST_DB)
    whole = imagecodecs.jpeg2k_encode(
        planes,
        level,
        codecformat="J2K",
        planar=True,
        mct=False,
        bitspersample=bits,
        resolutions=jpeg2000.halvings(planes.shape) + 1,
        reversible=wavelet == "5/3",
        numthreads=1,
    )
    try:
        return jpeg2000.without_head(bytes(whole), planes.shape, planes.dtype.name)
    except ValueError as error:
        raise RuntimeError(f"OpenJPEG {imagecodecs.jpeg2k_version()} writes {error}") from None


def decode_planes(
    stream: bytes, shape: tuple[int, int, int], dtype: str, *, wavelet: str, lossless: bool
) -> NDArray[np.integer]:
    """Decode the planes of a codestream from `encode_planes`.

    Raises
    ------
    ValueError
        If the stream does not hold planes of that shape.
    """
    coded = (*shape[:2], max(2, shape[2]))
    whole = jpeg2000.whole_codestream(stream, coded, dtype, wavelet=wavelet, lossless=lossless)
    try:
        planes = imagecodecs.jpeg2k_decode(whole, planar=True, numthreads=1)
    except (RuntimeError, ValueError) as error:
        raise ValueError(f"its JPEG 2000 stream does not decode ({error})") from None
    if planes.size != math.prod(coded) or planes.dtype.name != dtype:
        raise ValueError(f"its JPEG 2000 stream is {planes.shape} {planes.dtype}, {coded} {dtype} is needed")
    return planes.reshape(coded)[:, :, : shape[2]]


def picked_planes(
    stream: bytes, shape: tuple[int, int, int], dtype: str, picked: Sequence[int], *, wavelet: str, lossless: bool
) -> NDArray[np.integer]:
    """Decode some planes of a codestream from `encode_planes`, in rising order, by their packets alone.

    Raises
    ------
    ValueError
        If the stream does not hold planes of that shape.
    """
    coded = (*shape[:2], max(2, shape[2]))
    jpeg2000.whole_codestream(stream, coded, dtype, wavelet=wavelet, lossless=lossless)  # check the coding style
    some = jpeg2000.some_components(stream, coded, set(picked), lossless)
    return decode_planes(some, (len(picked), *shape[1:]), dtype, wavelet=wavelet, lossless=lossless)
