"""Optics of a camera as a chain of elements: pinholes, lenslets, GRIN lenses, main lenses, apertures.

The first element is the lens model of every lenslet. It maps a point of a pixel and a position on the aperture to a
ray that leaves the lens plane. Further elements stand between the array and the scene and map rays to rays. Rays run
from the pixel into the scene, against the light. `elements` has their contract, `surfaces` the lens of real glass.

Lengths are in millimetres, in the frame of `camera`. The arrays of a bundle broadcast against each other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..base.checks import MOST_MM, length, number, within
from .elements import Array, Bundle, Element, FrontElement, LensModel, Scaling, Under
from .surfaces import Surfaces

MOST_IOR = 1000.0  # a material of 4.5 is a rarity
Focal = float | tuple[tuple[float, ...], ...]


@dataclass(frozen=True, kw_only=True)
class Pinhole(LensModel):
    """Pinhole: the ray from the pixel through the lens centre (3.15), (3.20)."""

    kind: ClassVar[str] = "pinhole"

    def leave(self, u: Under) -> Bundle:
        return Bundle(u.cx, u.cy, _like(u.gap), u.cx - u.px, u.cy - u.py, _like(u.gap))


@dataclass(frozen=True, kw_only=True)
class Grin(LensModel):
    """Gradient-index rod: its elementary image is erect, so the ray is mirrored about the lens axis."""

    kind: ClassVar[str] = "grin"
    erect: ClassVar[bool] = True

    def leave(self, u: Under) -> Bundle:
        return Bundle(u.cx, u.cy, _like(u.gap), u.px - u.cx, u.py - u.cy, _like(u.gap))


@dataclass(frozen=True, kw_only=True)
class Lenticular(LensModel):
    """Vertical cylinder lens over a column of pixels: horizontal parallax only; rays of a row are horizontal."""

    kind: ClassVar[str] = "lenticular"
    vertical_parallax: ClassVar[bool] = False

    def leave(self, u: Under) -> Bundle:
        return Bundle(u.cx, u.py, _like(u.gap), u.cx - u.px, _like(0.0), _like(u.gap))


@dataclass(frozen=True, kw_only=True)
class Lenslet(LensModel):
    """Ideal thin lens with an aperture. The rays of a pixel meet at its image, z − Λ = fΛ/(Λ − f) (2.3).

    Λ = f is depth priority: the rays of a pixel are parallel. Λ ≠ f is resolution priority. The slope form
    x' = (a − p)/Λ − (a − c)/f has no singularity at Λ = f.

    Parameters
    ----------
    focal_mm : float or rows of floats
        f. A matrix of focal lengths repeats over the array.
    aperture_mm : float, optional
        Diameter of the round aperture; without it, rays pass the lens centre.
    """

    kind: ClassVar[str] = "lenslet"
    samples_aperture: ClassVar[bool] = True
    focal_mm: Focal
    aperture_mm: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        focal: Any = self.focal_mm
        rows = focal if isinstance(focal, list | tuple) else [[focal]]
        if not all(isinstance(row, list | tuple) and row and len(row) == len(rows[0]) for row in rows) or not rows:
            raise ValueError(f"lenslet: focal_mm is {focal!r}: one length, or rows of equally many, are needed")
        for f in (f for row in rows for f in row):
            length("lenslet: focal_mm", f)
        if rows is focal:
            object.__setattr__(self, "focal_mm", tuple(tuple(float(f) for f in row) for row in rows))

    def leave(self, u: Under) -> Bundle:
        focal = np.atleast_2d(np.asarray(self.focal_mm, np.float64))
        f = focal[u.l % focal.shape[0], u.k % focal.shape[1]] if focal.size > 1 else focal[0, 0]
        radius = (self.aperture_mm or 0.0) / 2
        ax, ay = radius * u.ax, radius * u.ay
        dx = (u.cx + ax - u.px) - ax * (u.gap / f)
        dy = (u.cy + ay - u.py) - ay * (u.gap / f)
        return Bundle(u.cx + ax, u.cy + ay, _like(u.gap), dx, dy, _like(u.gap))

    def scaled(self, scaling: Scaling) -> Lenslet:
        f = np.atleast_2d(np.asarray(self.focal_mm, np.float64))
        power = 1 / (scaling.gap_mm * scaling.factor) + scaling.refocused(1 / f - 1 / scaling.gap_mm)
        if not (power > 0).all():
            raise ValueError("lenslet: its focal length would be negative: a smaller scale is needed")
        rows = tuple(tuple(float(x) for x in row) for row in 1 / power)
        focal = rows if isinstance(self.focal_mm, tuple) else rows[0][0]
        return replace(self, focal_mm=focal, aperture_mm=_times(self.aperture_mm, scaling.factor))


@dataclass(frozen=True, kw_only=True)
class SphericalLenslet(LensModel):
    """Plano-convex lens with its flat face towards the pixels at z = Λ; Snell's law holds at both faces.

    Rays start on the sphere. Rays are blocked if they enter outside the lens's cell, leave the cell inside the glass,
    or are totally reflected. A thin lens has f = R/(n − 1).

    Parameters
    ----------
    radius_mm : float
        R, radius of the sphere; at least half the diagonal of the lens's cell.
    ior : float
        n, from 1 to 1000.
    aperture_mm : float, optional
        Diameter of the aperture on the flat face; without it, rays pass its centre.
    """

    kind: ClassVar[str] = "spherical-lenslet"
    samples_aperture: ClassVar[bool] = True
    radius_mm: float
    ior: float
    aperture_mm: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        within("spherical-lenslet: ior", self.ior, 1, MOST_IOR)

    def thickness(self, cell: tuple[float, float]) -> float:
        """Return the thickness of the glass on the axis, mm; the sphere meets the flat face at the cell's corners."""
        half = math.hypot(*cell) / 2
        if half > self.radius_mm:
            raise ValueError(
                f"spherical-lenslet: radius_mm is {self.radius_mm:g}: at least half the cell's diagonal, "
                f"{half:g}, is needed"
            )
        return self.radius_mm - math.sqrt(self.radius_mm**2 - half**2)

    def leave(self, u: Under) -> Bundle:
        n, radius = self.ior, self.radius_mm
        spread = (self.aperture_mm or 0.0) / 2
        ax, ay = np.broadcast_arrays(spread * u.ax + 0 * u.px, spread * u.ay + 0 * u.py)  # from the lens's axis
        tx, ty, tz = u.cx + ax - u.px, u.cy + ay - u.py, u.gap
        length = np.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty = tx / length / n, ty / length / n  # Snell at the flat face
        tz = np.sqrt(1 - tx * tx - ty * ty)
        # Height of the sphere's centre above the flat face. The ray leaves at the far intersection.
        centre = self.thickness(u.cell) - radius
        along = ax * tx + ay * ty - centre * tz
        beside = ax * ax + ay * ay + centre * centre - radius * radius  # positive if it enters beside the sphere
        s = -along + np.sqrt(np.maximum(0, along * along - beside))
        ex, ey, ez = ax + s * tx, ay + s * ty, s * tz
        nx, ny, nz = ex / radius, ey / radius, (ez - centre) / radius
        cosine = tx * nx + ty * ny + tz * nz
        sine2 = n * n * (1 - cosine * cosine)
        through = u.owns(ax, ay) & u.owns(ex, ey) & (ez >= 0) & (sine2 < 1)
        bend = n * cosine - np.sqrt(np.maximum(0, 1 - sine2))
        dx, dy, dz = n * tx - bend * nx, n * ty - bend * ny, n * tz - bend * nz
        return Bundle(u.cx + ex, u.cy + ey, u.gap + ez, dx, dy, dz, through.astype(np.float64))

    def vergence(self, gap_mm: float, cell: tuple[float, float]) -> float:
        """Return the paraxial vergence 1/b, per mm; b is the distance from the lens plane to the imaged plane.

        Glass of thickness t adds t/n to the gap. The sphere, of power (n − 1)/R, stands t in front of the lens plane.
        """
        t = self.thickness(cell)
        at_sphere = (self.ior - 1) / self.radius_mm - 1 / (gap_mm + t / self.ior)
        return at_sphere / (1 + t * at_sphere)

    def scaled(self, scaling: Scaling) -> SphericalLenslet:
        grown = replace(
            self,
            radius_mm=self.radius_mm * scaling.factor,
            aperture_mm=_times(self.aperture_mm, scaling.factor),
        )
        if self.ior == 1:  # bends nothing
            return grown
        gap, cell = scaling.gap_mm * scaling.factor, tuple(x * scaling.factor for x in scaling.cell_mm)
        wanted = float(scaling.refocused(np.float64(self.vergence(scaling.gap_mm, scaling.cell_mm))))
        return replace(grown, radius_mm=_radius(grown, gap, cell, wanted))


@dataclass(frozen=True, kw_only=True)
class Lens(FrontElement):
    """Ideal thin lens about the z axis: a depth-control lens, or the main lens of a plenoptic camera.

    It changes the slope of a ray at height h by −h/f. Rays outside the rim, and rays that do not reach the lens, are
    blocked.

    Parameters
    ----------
    z_mm : float
        Position of the lens.
    focal_mm : float
        Negative for a diverging lens.
    diameter_mm : float, optional
        Diameter of the rim; without it the lens is unbounded.
    """

    kind: ClassVar[str] = "lens"
    z_mm: float
    focal_mm: float
    diameter_mm: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        within("lens: z_mm", self.z_mm, -MOST_MM, MOST_MM, unit=" mm")
        length("lens: the size of focal_mm", abs(number("lens: focal_mm", self.focal_mm)))

    def moved(self, by_mm: float) -> Lens:
        return replace(self, z_mm=self.z_mm + number("by_mm", by_mm))

    def relay(self) -> NDArray[np.float64]:
        z, f = self.z_mm, self.focal_mm  # 1/b = 1/f + 1/a of the distances a and b from the lens
        return np.array([[z + f, -z * z], [1.0, f - z]])

    def pupil(self) -> tuple[float, float] | None:
        return None if self.diameter_mm is None else (self.z_mm, self.diameter_mm)

    def pass_on(self, rays: Bundle) -> Bundle:
        lx, ly, lz, dx, dy, dz, weight = rays
        reaches = (dz > 0) & (lz <= self.z_mm)
        safe = np.where(dz > 0, dz, 1.0)
        x, y = lx + dx / safe * (self.z_mm - lz), ly + dy / safe * (self.z_mm - lz)
        passes = reaches & True
        if self.diameter_mm is not None:
            passes = passes & (x * x + y * y <= (self.diameter_mm / 2) ** 2)
        if not np.all(passes):
            weight = np.asarray(passes * (1.0 if weight is None else weight), np.float64)
        return Bundle(
            x, y, _like(self.z_mm), dx - safe * x / self.focal_mm, dy - safe * y / self.focal_mm, dz, weight
        )


KINDS: dict[str, type[Element]] = {
    cls.kind: cls for cls in (Pinhole, Grin, Lenticular, Lenslet, SphericalLenslet, Lens, Surfaces)
}


def element(data: Any) -> Element:
    """Return an element from its name or from the values of `Element.to_json`.

    Raises
    ------
    ValueError
        If the kind or a parameter is unknown, missing or out of range.
    """
    data = {"kind": data} if isinstance(data, str) else data
    kind = data.get("kind") if isinstance(data, Mapping) else data
    if not isinstance(data, Mapping) or not isinstance(kind, str) or kind not in KINDS:
        raise ValueError(f"unknown optical element {kind!r}: known are {', '.join(KINDS)}")
    cls = KINDS[kind]
    known = {field.name for field in fields(cls)}
    parameters = {key: value for key, value in data.items() if key != "kind"}
    if unknown := set(parameters) - known:
        raise ValueError(
            f"{cls.kind} has no {', '.join(sorted(unknown))}: known are {', '.join(sorted(known)) or 'none'}"
        )
    try:
        return cls(**parameters)
    except TypeError as error:
        named = str(error).startswith(f"{cls.kind}: ")
        raise ValueError(str(error) if named else f"{cls.kind}: {error}") from None


def chain(elements: Sequence[Any]) -> tuple[LensModel, tuple[FrontElement, ...]]:
    """Return the lens model, by default a pinhole, and the elements in front of the array.

    Raises
    ------
    ValueError
        If a lens model is not the first element.
    """
    built = [e if isinstance(e, Element) else element(e) for e in elements]
    if not built or not isinstance(built[0], LensModel):
        built.insert(0, Pinhole())
    model, front = built[0], built[1:]
    assert isinstance(model, LensModel)
    for e in front:
        if not isinstance(e, FrontElement):
            raise ValueError(f"{e.kind} is a lens model: it must be the first element, and the only one")
    return model, tuple(e for e in front if isinstance(e, FrontElement))


def scaled_chain(elements: Sequence[Element], scaling: Scaling, *, nearer_mm: float = 0.0) -> tuple[Element, ...]:
    """Return the elements of a scaled camera; see `presets.scaled`. The pixel array moves forward by ``nearer_mm``.

    Raises
    ------
    ValueError
        If the lens plane reaches a lens in front, or no positive focal length keeps an imaged plane.
    """
    model, *front = elements
    placed: list[Any] = [e.moved(-nearer_mm) for e in front]  # type: ignore[attr-defined]
    if placed and isinstance(front[0], Lens):
        a, d = front[0].z_mm - scaling.gap_mm, scaling.forward_mm
        if not a > d:
            raise ValueError(
                f"lens at z_mm {front[0].z_mm:g}: the lens plane moves by {d:g} mm and is {a:g} mm away: "
                "a smaller scale is needed"
            )
        power = 1 / front[0].focal_mm + d / (a * (a - d))
        if power == 0:
            raise ValueError(
                f"lens at z_mm {front[0].z_mm:g}: its focal length would be infinite: another scale is needed"
            )
        placed[0] = replace(placed[0], focal_mm=1 / power)
    return (model.scaled(scaling), *placed)  # type: ignore[attr-defined]


def _radius(lens: SphericalLenslet, gap: float, cell: tuple[float, ...], vergence: float) -> float:
    """Return the radius of a spherical lenslet of a given vergence."""
    from scipy.optimize import brentq

    least = math.hypot(*cell) / 2

    def excess(radius: float) -> float:
        return replace(lens, radius_mm=radius).vergence(gap, cell) - vergence  # type: ignore[arg-type]

    # Bracket: twice the power of a thin lens is too strong, half of it too weak.
    thin = (lens.ior - 1) / (1 / gap + vergence)
    low, high = max(least, thin / 2), max(2 * thin, 2 * least)
    if not excess(low) >= 0 >= excess(high):
        raise ValueError(
            f"spherical-lenslet: no radius_mm of at least half the cell's diagonal, {least:g}, focuses where it did: "
            "a smaller scale is needed"
        )
    return float(brentq(excess, low, high, xtol=1e-15 * high, rtol=1e-14))


def _times(length: float | None, factor: float) -> float | None:
    return None if length is None else length * factor


def unit_disk(place: NDArray[np.float64]) -> tuple[Array, Array]:
    """Map the unit square (…, 2) to the unit disk, equal areas, (½, ½) to its centre (Shirley and Chiu 1997)."""
    a, b = 2 * place[..., 0] - 1, 2 * place[..., 1] - 1
    wide = abs(a) > abs(b)
    radius = np.where(wide, a, b)
    safe = np.where(radius == 0, 1.0, radius)
    angle = np.where(wide, (np.pi / 4) * (b / safe), np.pi / 2 - (np.pi / 4) * (a / safe))
    return radius * np.cos(angle), radius * np.sin(angle)


def _like(value: float) -> Array:
    return np.float64(value)
