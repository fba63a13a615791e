"""Rays and the contract of optical elements; `optics` has the elements.

Rays run from the pixel into the scene, against the light. Lengths are in millimetres, in the frame of `camera`. The
arrays of a bundle broadcast against each other.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.checks import length, number
from .lattice import Axes

Array = NDArray[np.float64] | np.float64


class Bundle(NamedTuple):
    """Rays: location, direction of any length, and weight, the transmitted share of light (0 if blocked)."""

    lx: Array
    ly: Array
    lz: Array
    dx: Array
    dy: Array
    dz: Array
    weight: Array | None = None


class Under(NamedTuple):
    """Input of a lens model: points of pixels, centres and numbers of their lenses, positions on the aperture.

    ``ax`` and ``ay`` lie on the unit disk; 0 is the centre. ``cell`` is the lens pitch across and down. The cell of a
    lens in a hexagonal array is the set of points nearer to its centre than to any other centre.
    """

    px: Array
    py: Array
    cx: Array
    cy: Array
    k: NDArray[np.int64]
    l: NDArray[np.int64]
    ax: Array
    ay: Array
    gap: float
    cell: tuple[float, float]
    hexagonal: bool = False
    axes: Axes | None = None

    def owns(self, x: NDArray[Any], y: NDArray[Any]) -> NDArray[np.bool_]:
        """Return whether a position relative to the lens centre lies in the lens's cell, border included."""
        across, down = self.cell
        if self.axes is not None:  # of a turned grid, whose y runs down
            xx, xy, yx, yy = self.axes
            x, y = yy * x + xy * y, xx * y + yx * x
        if not self.hexagonal:
            return (abs(x) <= across / 2) & (abs(y) <= down / 2)
        # bisectors to the lens beside, to the lens two rows away, and to the nearest lens of the next row
        slanting = abs(x) * across / 2 + abs(y) * down <= (across * across / 4 + down * down) / 2
        return (abs(x) <= across / 2) & (abs(y) <= down) & slanting


class Scaling(NamedTuple):
    """Change of a lens array by `presets.scaled`.

    Attributes
    ----------
    factor : float
        Growth of gap and lens pitch.
    gap_mm, cell_mm : float, (float, float)
        Gap and lens pitch before the change.
    forward_mm : float
        d, the shift of the lens plane towards the scene.
    front_mm : float, optional
        a, distance from the lens plane to the first lens in front of the array before the change; None without one.
    """

    factor: float
    gap_mm: float
    cell_mm: tuple[float, float]
    forward_mm: float
    front_mm: float | None

    def refocused(self, vergence: Array) -> NDArray[np.float64]:
        """Return the vergence 1/b, per mm, that keeps the imaged scene plane of a vergence; 0 is infinity.

        Raises
        ------
        ValueError
            If the lens plane reaches the scene plane.
        """
        w, d = np.asarray(vergence, np.float64), self.forward_mm
        if self.front_mm is not None:
            a = self.front_mm
            return (a * a * w - d) / (a - d) ** 2
        if (d * w >= 1).any():
            raise ValueError(
                f"lens plane moves by {d:g} mm, lenslets focus {1 / w.max():g} mm before it: "
                "a smaller scale is needed"
            )
        return w / (1 - d * w)


@dataclass(frozen=True, kw_only=True)
class Element:
    """Optical element; its parameters are plain values."""

    kind: ClassVar[str]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if (value is None and field.default is None) or field.name in ("focal_mm", "z_mm", "ior"):
                continue
            name = f"{self.kind}: {field.name}"
            if field.name == "aperture_mm" and number(name, value) == 0:  # a pinhole
                continue
            length(name, value)

    def to_json(self) -> dict[str, Any]:
        return {"kind": self.kind, **{k: v for k, v in asdict(self).items() if v is not None}}

    def of_channel(self, channel: int) -> Element:
        """Return the element for the light of one channel: 0 is red, 1 green, 2 blue."""
        return self


class LensModel(Element):
    """Model of the lenslets."""

    erect: ClassVar[bool] = False
    samples_aperture: ClassVar[bool] = False
    vertical_parallax: ClassVar[bool] = True

    def leave(self, under: Under) -> Bundle:
        """Return the rays that leave the lens plane."""
        raise NotImplementedError

    def scaled(self, scaling: Scaling) -> LensModel:
        """Return the model of larger lenslets that image the same scene planes; see `presets.scaled`."""
        return self


class FrontElement(Element):
    """Element between the lens array and the scene, at ``z_mm`` on the side of the pixels."""

    z_mm: float

    @property
    def end_mm(self) -> float:
        """z of its last vertex, on the side of the scene."""
        return self.z_mm

    def moved(self, by_mm: float) -> FrontElement:
        """Return the element further away from the pixels."""
        raise NotImplementedError

    def relay(self) -> NDArray[np.float64]:
        """Return the matrix ((a, b), (c, d)) of the paraxial image (a·z + b)/(c·z + d) of a plane z; mm."""
        raise NotImplementedError

    def image_mm(self, z_mm: float) -> float:
        """Return the paraxial image of a plane: where rays meet that met, or would meet, at ``z_mm``; both z, mm."""
        z = number("z_mm", z_mm)
        image, scale = (float(x) for x in self.relay() @ ((1.0, 0.0) if math.isinf(z) else (z, 1.0)))
        return image / scale if scale else math.inf

    def pupil(self) -> tuple[float, float] | None:
        """Return z and diameter of the opening as seen from the pixels; None if it is unbounded or at infinity."""
        raise NotImplementedError

    def pass_on(self, rays: Bundle) -> Bundle:
        """Return the rays on the scene side of rays on the pixel side."""
        raise NotImplementedError
