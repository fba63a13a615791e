"""Pair of II-pictures to compare: reference and decoded picture of the same structure and type."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IICamera, IIPicture
from ii_core.picture.picture import peak as peak_of

if TYPE_CHECKING:
    from ii_core.depth.focus import FocusDepth


Compared = IIPicture | NDArray[Any]
Structure = IIPicture | IICamera | Mapping[str, Any]


def picture_pair(
    reference: Compared, decoded: Compared, structure: Structure | None = None, **conditions: Any
) -> PicturePair:
    """Return a pair of pictures, or of arrays of pixels with a structure.

    Parameters
    ----------
    reference, decoded : IIPicture or ndarray, (N, M, 3)
    structure : IIPicture, IICamera or dict, optional
        Structure of arrays: that of a picture or a camera, or ``{"lenses": (K, L), "ei_pixels": (U, V)}``.
    **conditions
        Those of `PicturePair`.

    Raises
    ------
    TypeError, ValueError
        As `PicturePair`, or if a structure does not fit the pixels.
    """
    if structure is not None:
        reference, decoded = (_as_picture(pixels, structure) for pixels in (reference, decoded))
    return PicturePair(reference, decoded, **conditions)  # type: ignore[arg-type]


def _as_picture(pixels: Any, structure: Structure) -> Any:
    if not isinstance(pixels, np.ndarray):
        return pixels
    if isinstance(structure, IIPicture):
        return structure.with_pixels(pixels)
    if isinstance(structure, IICamera):
        return IIPicture(pixels, structure.lenses, structure.ei_pixels, structure, structure.erect)
    if not isinstance(structure, Mapping) or set(structure) != {"lenses", "ei_pixels"}:
        raise TypeError(f"structure is {structure!r}: a picture, a camera or lenses and ei_pixels are needed")
    return IIPicture(pixels, structure["lenses"], structure["ei_pixels"])


@dataclass(frozen=True, eq=False)
class PicturePair:
    """Reference and decoded picture, validated, with the conditions of their comparison.

    Parameters
    ----------
    reference, decoded : IIPicture
        Of the same structure and type. The decoded picture gets the reference's camera.
    mask : array_like of bool, (N, M), optional
        Pixels that count; all if not given.
    depth, layers_mm, method
        As for `q_depth`, which checks them.
    codes : ndarray, (N, M, 3), optional
        YCbCr codes of 10 bit of a decoder that returns them: measures of the common test conditions compare these
        instead of the decoded picture's.

    Raises
    ------
    TypeError
        If ``reference`` or ``decoded`` is not an `IIPicture`.
    ValueError
        If the pictures differ in structure or type, or the mask has another shape or type.
    """

    reference: IIPicture
    decoded: IIPicture
    mask: Any = None
    depth: ArrayLike | FocusDepth | None = None
    layers_mm: ArrayLike | None = None
    method: str = "dissertation"
    codes: NDArray[Any] | None = None

    def __post_init__(self) -> None:
        for name in ("reference", "decoded"):
            picture = getattr(self, name)
            if not isinstance(picture, IIPicture):
                raise TypeError(
                    f"{name} is a {type(picture).__name__}: an IIPicture is needed, or an array and structure="
                )
        self.reference.check_same_structure(self.decoded)
        if self.decoded.camera is not self.reference.camera:
            object.__setattr__(self, "decoded", self.reference.with_pixels(self.decoded.pixels))
        if self.codes is not None:
            _check_codes(self.codes, self.reference)
        if self.mask is not None:
            object.__setattr__(self, "mask", _checked_mask(self.mask, self.reference))

    @property
    def pictures(self) -> tuple[IIPicture, IIPicture]:
        """Reference and decoded picture."""
        return self.reference, self.decoded

    @property
    def dtype(self) -> np.dtype[Any]:
        """Pixel type of both pictures."""
        return self.reference.pixels.dtype

    @property
    def peak(self) -> float:
        """The largest code value."""
        return peak_of(self.dtype)

    def check_finite(self) -> None:
        """Raise ValueError with the first pixel in reading order that counts and is not finite."""
        for name, picture in zip(("reference", "decoded"), self.pictures, strict=True):
            for n, row in enumerate(picture.pixels):  # row by row, to save memory
                counts = True if self.mask is None else self.mask[n]
                bad = np.flatnonzero(~np.isfinite(row).all(axis=1) & counts)
                if bad.size:
                    raise ValueError(f"{name} pixel ({bad[0]}, {n}) is {row[bad[0]]}: finite values are needed")


def _check_codes(codes: Any, picture: IIPicture) -> None:
    wanted = picture.pixels.shape
    if not isinstance(codes, np.ndarray) or codes.dtype.kind not in "uif":
        raise TypeError(f"codes is a {type(codes).__name__}: an array of numbers of shape {wanted} is needed")
    if codes.shape != wanted:
        raise ValueError(f"codes are {codes.shape}: {wanted} is needed")


def _checked_mask(mask: Any, picture: IIPicture) -> NDArray[np.bool_]:
    try:
        given = np.asarray(mask)
    except (ValueError, TypeError, OverflowError) as error:
        raise TypeError(f"mask is no array: {error}") from None
    if given.dtype != bool or given.shape != picture.pixels.shape[:2]:
        raise ValueError(
            f"mask is {given.dtype} of shape {given.shape}: bool of shape {picture.pixels.shape[:2]} is needed"
        )
    return given
