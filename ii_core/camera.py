"""The II-camera: nothing but where each pixel's ray starts (L) and where it goes (D).

Coordinates: left-handed, x right, y up, z into the scene, millimetres. The pixel array lies in z = 0,
centred on the origin; the lens plane is z = gap. A pixel (m, n) is column m from the left, row n from the top.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .lattice import lens_centres, nearest_lens, pixel_positions

Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class IICamera:
    """A rectangular lenslet array before a pixel array, in the pinhole approximation.

    The same class is the 2D pinhole camera: an array of one lens.

    Parameters
    ----------
    pixels : (M, N)
        Pixels across and down.
    lenses : (K, L)
        Lenslets across and down. They must divide ``pixels``: the structure is regular.
    pixel_pitch_mm : float
        δP, the side of a square pixel.
    gap_mm : float
        Λ, the distance from the pixel array to the lens plane.
    name : str
        What to call it in files and messages.

    Raises
    ------
    ValueError
        If a count is below one, a length is not positive and finite, or the lenses do not divide the pixels.

    References
    ----------
    Olsson 2008, (3.9), (3.15), (3.16), (3.20), with samples on pixel centres instead of corners.
    """

    pixels: Pair
    lenses: Pair
    pixel_pitch_mm: float
    gap_mm: float
    name: str = ""

    def __post_init__(self) -> None:
        for field in ("pixels", "lenses"):
            object.__setattr__(self, field, whole_pair(field, getattr(self, field)))
        for field in ("pixel_pitch_mm", "gap_mm"):
            value = float(getattr(self, field))
            if not 0 < value < math.inf:
                raise ValueError(f"{field} is {value:g}: a positive length in mm is needed")
            object.__setattr__(self, field, value)
        check_structure(self.pixels, self.lenses)

    @property
    def ei_pixels(self) -> Pair:
        """(U, V), pixels across and down in one elementary image."""
        return self.pixels[0] // self.lenses[0], self.pixels[1] // self.lenses[1]

    @property
    def lens_pitch_mm(self) -> tuple[float, float]:
        """δL across and down."""
        u, v = self.ei_pixels
        return u * self.pixel_pitch_mm, v * self.pixel_pitch_mm

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the pixel array."""
        return self.pixels[0] * self.pixel_pitch_mm, self.pixels[1] * self.pixel_pitch_mm

    @property
    def view_angle_deg(self) -> float:
        """α, the full horizontal angle that one lens sees (2.1)."""
        return math.degrees(2 * math.atan(self.lens_pitch_mm[0] / (2 * self.gap_mm)))

    def rays(
        self,
        rows: slice = slice(None),
        cols: slice = slice(None),
        sample: ArrayLike = (0.5, 0.5),
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Location points and direction vectors of a block of pixels.

        Parameters
        ----------
        rows, cols : slice
            The block, numpy rules. Only this block is computed.
        sample : array_like, (2,) or (h, w, 2)
            Where in each pixel the ray starts, right and down from its top left corner, in [0, 1].
            The lens is the one over the pixel's centre, so a sample never strays under a neighbour.

        Returns
        -------
        L, D : ndarray of float64, (h, w, 3)
            Lens centres, mm, and lens centre minus pixel, mm, not normalised.

        References
        ----------
        Olsson 2008, (3.15), (3.19), (3.20).
        """
        m = np.arange(self.pixels[0])[cols]
        n = np.arange(self.pixels[1])[rows]
        return self.rays_at(m[None, :], n[:, None], sample)

    def rays_at(
        self, m: ArrayLike, n: ArrayLike, sample: ArrayLike = (0.5, 0.5)
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rays of any pixels: m and n broadcast against each other; see `rays`.

        Raises
        ------
        ValueError
            If ``sample`` leaves the pixel.
        """
        offset = np.asarray(sample, dtype=np.float64)
        if offset.shape[-1:] != (2,) or not ((offset >= 0) & (offset <= 1)).all():
            raise ValueError("sample must hold (right, down) positions inside the pixel, each in [0, 1]")
        m, n = np.asarray(m), np.asarray(n)
        (width, height), pitch = self.size_mm, self.pixel_pitch_mm
        lens_x = lens_centres(nearest_lens(m, self.pixels[0], self.lenses[0]), self.lens_pitch_mm[0], width)
        lens_y = -lens_centres(nearest_lens(n, self.pixels[1], self.lenses[1]), self.lens_pitch_mm[1], height)
        shape = np.broadcast_shapes(m.shape, n.shape, offset.shape[:-1])
        L, D = np.empty((*shape, 3)), np.empty((*shape, 3))
        L[..., 0], L[..., 1], L[..., 2] = lens_x, lens_y, self.gap_mm
        D[..., 0] = lens_x - pixel_positions(m, offset[..., 0], pitch, width)
        D[..., 1] = lens_y + pixel_positions(n, offset[..., 1], pitch, height)
        D[..., 2] = self.gap_mm
        return L, D

    def to_json(self) -> dict[str, Any]:
        """Plain values that `from_json` takes back."""
        return {
            "kind": "lenslet-array",
            "name": self.name,
            "pixels": list(self.pixels),
            "lenses": list(self.lenses),
            "pixel_pitch_mm": self.pixel_pitch_mm,
            "gap_mm": self.gap_mm,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> IICamera:
        """A camera from `to_json`'s values.

        Raises
        ------
        ValueError
            If a value is missing, unknown or out of range.
        """
        known = {"kind", "name", "pixels", "lenses", "pixel_pitch_mm", "gap_mm"}
        if not isinstance(data, Mapping) or set(data) != known or data["kind"] != "lenslet-array":
            raise ValueError(f"not a lenslet-array camera: needs exactly the keys {', '.join(sorted(known))}")
        try:
            return cls(
                pixels=tuple(data["pixels"]),
                lenses=tuple(data["lenses"]),
                pixel_pitch_mm=data["pixel_pitch_mm"],
                gap_mm=data["gap_mm"],
                name=str(data["name"]),
            )
        except TypeError as error:
            raise ValueError(f"camera has a value of the wrong type: {error}") from None


def whole_pair(name: str, value: Any) -> Pair:
    """A pair of counts ≥ 1, or a ValueError that names it."""
    try:
        a, b = value
        across, down = int(a), int(b)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {value!r}: two whole numbers are needed") from None
    if (across, down) != (a, b) or across < 1 or down < 1:
        raise ValueError(f"{name} is {a}×{b}: two whole numbers of at least 1 are needed")
    return across, down


def check_structure(pixels: Pair, lenses: Pair) -> None:
    """Raise ValueError unless K×L lenses divide M×N pixels."""
    for count, lens_count, side in ((pixels[0], lenses[0], "width"), (pixels[1], lenses[1], "height")):
        if count % lens_count:
            raise ValueError(
                f"{lenses[0]}×{lenses[1]} lenses do not divide picture {side} {count}: "
                "a regular structure needs whole pixels per lens"
            )
