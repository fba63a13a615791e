"""Pair of II-pictures to compare: reference and decoded picture of the same structure and type."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IIPicture
from ii_core.picture import peak as peak_of

if TYPE_CHECKING:
    from .depth.focus import FocusDepth


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

    def __post_init__(self) -> None:
        for name in ("reference", "decoded"):
            picture = getattr(self, name)
            if not isinstance(picture, IIPicture):
                raise TypeError(f"{name} is a {type(picture).__name__}: an IIPicture is needed")
        self.reference.check_same_structure(self.decoded)
        if self.decoded.camera is not self.reference.camera:
            object.__setattr__(self, "decoded", self.reference.with_pixels(self.decoded.pixels))
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
