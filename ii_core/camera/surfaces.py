"""Lens of spherical and conic surfaces between glasses, with stop and rims: exact refraction ray by ray.

Surfaces are listed as prescriptions list them, from the scene to the pixels; a radius is positive if the centre of
curvature lies on the pixels' side of the surface. Rays are traced the other way, from the pixels into the scene.
Losses by reflection at surfaces and by absorption are not included.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.checks import MOST_MM, flag, length, number, sequence, within
from .elements import Bundle, FrontElement
from .glass import LINE_D_NM, Glass, glass

MOST_SURFACES = 200
FAN = 32  # heights of the parallel rays that test whether a lens lets light through
# Surfaces that touch at the rim, as computed: published lengths have seven digits.
TOUCH_MM = 1e-5
Mask = NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Surface of revolution: a sphere, a conic or a plane.

    Parameters
    ----------
    radius_mm : float, optional
        R, radius of curvature at the vertex; without it, a plane.
    thickness_mm : float
        Distance along the axis to the next surface towards the pixels; 0 for the last surface.
    glass : Glass, name or mapping, optional
        What follows the surface towards the pixels; without it, air. See `glass.glass`.
    conic : float
        κ of the sag r²/R / (1 + √(1 − (1 + κ)r²/R²)): 0 is a sphere, −1 a paraboloid, −e² an ellipsoid or hyperboloid
        of eccentricity e about the axis.
    diameter_mm : float, optional
        Diameter of the rim; without it, the surface ends where it turns back.
    stop : bool
        Whether its rim is the aperture stop.
    """

    radius_mm: float | None = None
    thickness_mm: float = 0.0
    glass: Glass | None = None
    conic: float = 0.0
    diameter_mm: float | None = None
    stop: bool = False

    def __post_init__(self) -> None:
        def put(field: str, value: Any) -> None:
            object.__setattr__(self, field, value)

        if self.radius_mm is not None:
            radius = number("radius_mm", self.radius_mm)
            if math.isinf(radius):
                raise ValueError(f"radius_mm is {radius:g}: a plane has none")
            length("the size of radius_mm", abs(radius))
            put("radius_mm", radius)
        put("thickness_mm", within("thickness_mm", self.thickness_mm, 0, MOST_MM, "distance", " mm"))
        put("glass", glass(self.glass))
        put("conic", within("conic", self.conic, -1e6, 1e6))
        if self.diameter_mm is not None:
            put("diameter_mm", length("diameter_mm", self.diameter_mm))
            if not math.isfinite(self.sag(self.diameter_mm / 2)):
                raise ValueError(
                    f"diameter_mm is {self.diameter_mm:g}: a surface of radius_mm {self.radius_mm:g} and conic "
                    f"{self.conic:g} is at most {2 * abs(self.radius_mm or 0) / math.sqrt(1 + self.conic):g} wide"
                )
        flag("stop", self.stop)
        put("stop", bool(self.stop))
        if self.stop and self.diameter_mm is None:
            raise ValueError("the stop has no diameter_mm")

    @property
    def curvature(self) -> float:
        """1/R per mm; 0 of a plane."""
        return 0.0 if self.radius_mm is None else 1 / self.radius_mm

    def sag(self, height_mm: float) -> float:
        """Return how far the surface lies from its vertex towards the pixels; infinite beyond its edge."""
        c, square = self.curvature, height_mm * height_mm
        under = 1 - (1 + self.conic) * c * c * square
        return c * square / (1 + math.sqrt(under)) if under >= 0 else math.inf

    def to_json(self) -> dict[str, Any]:
        """Return plain values; those equal to their default are left out."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}
        return {**values, "glass": self.glass.to_json()} if self.glass else values


class Paraxial(NamedTuple):
    """Paraxial matrix from the vertex plane nearest the pixels to another: height A·y + B·u, slope C·y + D·u."""

    a: float
    b: float
    c: float
    d: float


@dataclass(frozen=True, kw_only=True)
class Surfaces(FrontElement):
    """Lens of refracting surfaces: a main lens as it is built.

    Parameters
    ----------
    z_mm : float
        Vertex of the last surface, the one nearest the pixels.
    surfaces : sequence of Surface or their values
        From the scene to the pixels. One is the stop. Both ends stand in air.
    wavelength_nm : float
        Of the light, in vacuum; from 200 to 2500.
    wavelengths_nm : (red, green, blue), optional
        Of the three channels of a rendered picture, which then has the lens's colour aberrations. Maps of rays,
        support images and paraxial values are those of green: ``wavelength_nm`` is left out.

    Raises
    ------
    ValueError
        If a surface is wrong (named by its number from 1), no or several surfaces are the stop, surfaces cross within
        their rims, glass is behind the last one, or no ray but the axis passes.

    References
    ----------
    Welford, Aberrations of Optical Systems, 1986, ch. 4.
    """

    kind: ClassVar[str] = "surfaces"
    z_mm: float
    surfaces: tuple[Surface, ...]
    wavelength_nm: float = LINE_D_NM
    wavelengths_nm: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        within("surfaces: z_mm", self.z_mm, -MOST_MM, MOST_MM, unit=" mm")
        sequence("surfaces", self.surfaces)
        if not 1 <= len(self.surfaces) <= MOST_SURFACES:
            raise ValueError(f"surfaces: there are {len(self.surfaces)}: 1 to {MOST_SURFACES} are needed")
        built = tuple(_surface(i, value) for i, value in enumerate(self.surfaces, 1))
        object.__setattr__(self, "surfaces", built)
        stops = [i for i, surface in enumerate(built, 1) if surface.stop]
        if len(stops) != 1:
            named = f"surfaces {', '.join(map(str, stops))} are" if stops else "no surface is"
            raise ValueError(f'surfaces: {named} the stop: one surface with "stop": true is needed')
        if built[-1].glass is not None:
            raise ValueError(f"surfaces: surface {len(built)}, the last, has glass behind it: it must end in air")
        if built[-1].thickness_mm:
            raise ValueError(
                f"surfaces: surface {len(built)}, the last, has thickness_mm {built[-1].thickness_mm:g}: "
                "none is needed, z_mm says where it stands"
            )
        for i, (near, far) in enumerate(pairwise(built), 1):
            _check_apart(i, near, far)
        if self.wavelengths_nm is not None:
            self._check_channels(self.wavelengths_nm)
        _ = self._indices  # raises ValueError for a wavelength that a glass does not have
        self._check_open()

    def _check_channels(self, given: Any) -> None:
        """Take three wavelengths, and that of green as the lens's own."""
        sequence("surfaces: wavelengths_nm", given)
        if len(given) != 3:
            raise ValueError(f"surfaces: wavelengths_nm is {given!r}: three, of red, green and blue, are needed")
        for name, wavelength in zip(("red", "green", "blue"), given, strict=True):
            number(f"surfaces: wavelengths_nm of {name}", wavelength)
            for surface in self.surfaces:
                _ = 1.0 if surface.glass is None else surface.glass.index(wavelength)
        red, green, blue = map(float, given)
        if number("surfaces: wavelength_nm", self.wavelength_nm) not in (LINE_D_NM, green):
            raise ValueError(
                f"surfaces: wavelength_nm is {self.wavelength_nm:g} beside wavelengths_nm: one of them is needed"
            )
        object.__setattr__(self, "wavelength_nm", green)
        object.__setattr__(self, "wavelengths_nm", (red, green, blue))

    def of_channel(self, channel: int) -> Surfaces:
        if self.wavelengths_nm is None:
            return self
        return replace(self, wavelength_nm=self.wavelengths_nm[channel], wavelengths_nm=None)

    def to_json(self) -> dict[str, Any]:
        data = {"kind": self.kind, "z_mm": self.z_mm, "surfaces": [surface.to_json() for surface in self.surfaces]}
        if self.wavelengths_nm is not None:
            return {**data, "wavelengths_nm": list(self.wavelengths_nm)}
        return data if self.wavelength_nm == LINE_D_NM else {**data, "wavelength_nm": self.wavelength_nm}

    @cached_property
    def _indices(self) -> tuple[float, ...]:
        """Index of what follows each surface towards the pixels."""
        return tuple(1.0 if s.glass is None else s.glass.index(self.wavelength_nm) for s in self.surfaces)

    @cached_property
    def _vertices(self) -> tuple[float, ...]:
        """z of each surface."""
        behind = np.cumsum([0.0, *(s.thickness_mm for s in reversed(self.surfaces[:-1]))])
        return tuple(float(self.z_mm + z) for z in reversed(behind))

    @property
    def end_mm(self) -> float:
        return self._vertices[0]

    def moved(self, by_mm: float) -> Surfaces:
        return replace(self, z_mm=self.z_mm + number("by_mm", by_mm))

    def enlarged(self, factor: float) -> Surfaces:
        """Return the lens with all its lengths times ``factor``; ``z_mm`` does not change."""
        times = length("factor", factor)

        def grown(surface: Surface) -> Surface:
            given = {name: getattr(surface, name) for name in ("radius_mm", "thickness_mm", "diameter_mm")}
            lengths: dict[str, Any] = {name: x * times for name, x in given.items() if x is not None}
            return replace(surface, **lengths)

        return replace(self, surfaces=tuple(map(grown, self.surfaces)))

    # -- paraxial

    def paraxial(self, count: int | None = None) -> Paraxial:
        """Return the matrix from the last surface through ``count`` surfaces from there on, by default through all.

        It ends in the vertex plane of the last surface counted, on its scene side.
        """
        matrix, index, z = np.eye(2), 1.0, self.z_mm
        total = len(self.surfaces)
        for i in reversed(range(0 if count is None else total - count, total)):
            after = 1.0 if i == 0 else self._indices[i - 1]
            to_here = np.array([[1.0, self._vertices[i] - z], [0.0, 1.0]])
            bend = np.array([[1.0, 0.0], [(after - index) * self.surfaces[i].curvature / after, index / after]])
            matrix, index, z = bend @ to_here @ matrix, after, self._vertices[i]
        return Paraxial(*(float(x) for x in matrix.ravel()))

    @property
    def focal_mm(self) -> float:
        """Paraxial focal length; infinite without power, negative of a diverging lens."""
        c = self.paraxial().c
        return -1 / c if c else math.inf

    def image_mm(self, z_mm: float) -> float:
        m = self.paraxial()
        from_vertex = self.z_mm - number("z_mm", z_mm)
        height, slope = (m.a, m.c) if math.isinf(from_vertex) else (m.a * from_vertex + m.b, m.c * from_vertex + m.d)
        return self.end_mm - height / slope if slope else math.inf

    def pupil(self) -> tuple[float, float] | None:
        """Return z and diameter of the stop's paraxial image towards the pixels; None if it is at infinity."""
        number = next(i for i, surface in enumerate(self.surfaces) if surface.stop)
        behind = len(self.surfaces) - 1 - number
        m = self.paraxial(behind)
        # Up to the plane of the stop, in the medium on its pixel side.
        ahead = self._vertices[number] - (self._vertices[number + 1] if behind else self.z_mm)
        a, b = m.a + ahead * m.c, m.b + ahead * m.d
        diameter = self.surfaces[number].diameter_mm
        assert diameter is not None
        return (self.z_mm + b / a, diameter / abs(a)) if a else None

    # -- rays

    def pass_on(self, rays: Bundle) -> Bundle:
        x, y, z, dx, dy, dz, passes, _ = self._traced(rays)
        given = 1.0 if rays.weight is None else rays.weight
        weight = np.asarray(passes * given, np.float64)
        return Bundle(x, y, z, dx, dy, dz, weight)

    def _traced(self, rays: Bundle) -> tuple[Any, ...]:
        """Return the six coordinates of rays behind the first surface, whether they pass, and the surface, from 1,
        that stopped each; 0 of rays that pass."""
        x, y, z, dx, dy, dz = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in rays[:6]))
        passes = dz > 0
        size = np.sqrt(dx * dx + dy * dy + dz * dz)
        size = np.where(passes, size, 1.0)
        dx, dy, dz = (
            np.where(passes, dx / size, 0.0),
            np.where(passes, dy / size, 0.0),
            np.where(passes, dz / size, 1.0),
        )
        stopped = np.where(passes, 0, len(self.surfaces)).astype(np.int16)
        index = 1.0
        for i in reversed(range(len(self.surfaces))):
            after = 1.0 if i == 0 else self._indices[i - 1]
            x, y, z, dx, dy, dz, through = _refracted(
                (x, y, z, dx, dy, dz), self.surfaces[i], self._vertices[i], index, after
            )
            stopped = np.where(passes & ~through, i + 1, stopped)
            passes = passes & through
            index = after
        return x, y, z, dx, dy, dz, passes, stopped

    def _check_open(self) -> None:
        """Raise ValueError if no ray parallel to the axis passes, but the axis itself."""
        rims = [s.diameter_mm for s in self.surfaces if s.diameter_mm is not None]
        heights = min(rims) / 2 * (np.arange(FAN) + 1) / FAN
        start = self.z_mm - 1e3 * max(rims)  # behind any sag; the rays are parallel
        zero, one = np.float64(0), np.float64(1)
        *_, passes, stopped = self._traced(Bundle(heights, zero, np.float64(start), zero, zero, one))
        if not passes.any():
            raise ValueError(
                f"surfaces: no ray beside the axis passes: surface {stopped[0]} stops it, by its rim or "
                "by total reflection"
            )


def _surface(number: int, value: Any) -> Surface:
    """Return a surface from its values; errors name its number."""
    if isinstance(value, Surface):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f'surfaces: surface {number} is {value!r}: an object is needed, as in {{"radius_mm": 50}}')
    known = [field.name for field in fields(Surface)]
    if unknown := set(value) - set(known):
        raise ValueError(
            f"surfaces: surface {number} has no {', '.join(sorted(map(str, unknown)))}: known are {', '.join(known)}"
        )
    try:
        return Surface(**value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"surfaces: surface {number}: {error}") from None


def _check_apart(number: int, near: Surface, far: Surface) -> None:
    """Raise ValueError unless a surface and the next, ``far`` from the scene, are apart up to the smaller rim."""
    if near.glass is not None and not near.thickness_mm:
        raise ValueError(f"surfaces: surface {number} has glass and thickness_mm 0: more than 0 is needed")
    rims = [s.diameter_mm / 2 for s in (near, far) if s.diameter_mm is not None]
    if not rims:
        return
    for share in (0.25, 0.5, 0.75, 1.0):
        height = min(rims) * share
        gap = near.thickness_mm + far.sag(height) - near.sag(height)
        if gap < -TOUCH_MM:
            raise ValueError(
                f"surfaces: surfaces {number} and {number + 1} cross: the gap {height:.4g} mm from the axis is "
                f"{gap:.4g} mm"
            )


def _refracted(ray: tuple[Any, ...], surface: Surface, vertex: float, index: float, after: float) -> tuple[Any, ...]:
    """Return the rays behind a surface and whether they pass; directions are unit vectors and stay so.

    The surface lies at z = vertex − sag. With c = −1/R, a point at distance t past the vertex plane fulfils
    A·t² − 2B·t + C = 0. C/(B + √(B² − AC)) is the root next to the vertex, exact for planes too.
    """
    x, y, z, dx, dy, dz = ray
    c, k = -surface.curvature, 1 + surface.conic
    to_plane = (vertex - z) / dz
    x0, y0 = x + dx * to_plane, y + dy * to_plane
    if c:
        square = c * (x0 * x0 + y0 * y0)
        b = dz - c * (x0 * dx + y0 * dy)
        under = b * b - c * (1 + surface.conic * dz * dz) * square
        below = b + np.sqrt(np.maximum(under, 0))
        through = (under >= 0) & (below > 0)
        t = square / np.where(below > 0, below, 1.0)
        x, y, depth = x0 + dx * t, y0 + dy * t, dz * t
        steep = 1 - k * c * depth  # z component of the normal before it is a unit vector
        through = through & (steep > 0)
        size = np.sqrt(c * c * (x * x + y * y) + steep * steep)
        size = np.where(size > 0, size, 1.0)
        nx, ny, nz = -c * x / size, -c * y / size, steep / size
        z = vertex + depth
        through = through & (to_plane + t >= -TOUCH_MM)
    else:
        x, y, z = x0, y0, np.full_like(x0, vertex)
        nx, ny, nz = (np.float64(axis) for axis in (0, 0, 1))
        through = to_plane >= -TOUCH_MM
    if surface.diameter_mm is not None:
        through = through & (x * x + y * y <= (surface.diameter_mm / 2) ** 2)
    if index == after:
        return x, y, z, dx, dy, dz, through
    cosine = dx * nx + dy * ny + dz * nz
    ratio = index / after
    rest = 1 - ratio * ratio * (1 - cosine * cosine)
    through = through & (rest > 0) & (cosine > 0)
    bend = np.sqrt(np.maximum(rest, 0)) - ratio * cosine
    dx, dy, dz = ratio * dx + bend * nx, ratio * dy + bend * ny, ratio * dz + bend * nz
    forward = dz > 0
    dx, dy, dz = (np.where(forward, d, safe) for d, safe in ((dx, 0.0), (dy, 0.0), (dz, 1.0)))
    return x, y, z, dx, dy, dz, through & forward


def surfaces_of(elements: Sequence[Any]) -> tuple[Surfaces, ...]:
    """Return the lenses of surfaces among optical elements."""
    return tuple(element for element in elements if isinstance(element, Surfaces))
