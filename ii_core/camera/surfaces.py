"""Lens of spheres, conics and even aspheres between glasses, with stop and rims: exact refraction ray by ray.

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
from .refraction import TOUCH_MM, Refracting, traced

MOST_SURFACES = 200
FAN = 32  # heights of the parallel rays that test whether a lens lets light through
MOST_ASPHERIC = 8  # coefficients, up to that of r¹⁶
MOST_COEFFICIENT = 1e30


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Surface of revolution: a sphere, a conic, an even asphere or a plane.

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
    aspheric : sequence of float
        Coefficients of r², r⁴, … r¹⁶ in the sag, added to that of the conic; that of rⁱ in mm¹⁻ⁱ. The coefficient of
        r² adds to the curvature at the vertex. Zeros at the end are left out.
    diameter_mm : float, optional
        Diameter of the rim; without it, the surface ends where it turns back.
    stop : bool
        Whether its rim is the aperture stop.
    """

    radius_mm: float | None = None
    thickness_mm: float = 0.0
    glass: Glass | None = None
    conic: float = 0.0
    aspheric: tuple[float, ...] = ()
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
        put("aspheric", _coefficients(self.aspheric))
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

    @property
    def vertex_curvature(self) -> float:
        """Curvature at the vertex per mm, with the coefficient of r²."""
        return self.curvature + 2 * self.aspheric[0] if self.aspheric else self.curvature

    def sag(self, height_mm: float) -> float:
        """Return how far the surface lies from its vertex towards the pixels; infinite beyond its edge."""
        c, square = self.curvature, height_mm * height_mm
        under = 1 - (1 + self.conic) * c * c * square
        if under < 0:
            return math.inf
        conic = c * square / (1 + math.sqrt(under))
        return conic + float(_polynomial(self.aspheric, square)) if self.aspheric else conic

    def to_json(self) -> dict[str, Any]:
        """Return plain values; those equal to their default are left out."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) != f.default}
        if self.aspheric:
            values["aspheric"] = list(self.aspheric)
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
            aspheric = tuple(a * times ** (1 - 2 * power) for power, a in enumerate(surface.aspheric, 1))
            return replace(surface, **lengths, aspheric=aspheric)

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
            curvature = self.surfaces[i].vertex_curvature
            bend = np.array([[1.0, 0.0], [(after - index) * curvature / after, index / after]])
            matrix, index, z = bend @ to_here @ matrix, after, self._vertices[i]
        return Paraxial(*(float(x) for x in matrix.ravel()))

    @property
    def focal_mm(self) -> float:
        """Paraxial focal length; infinite without power, negative of a diverging lens."""
        c = self.paraxial().c
        return -1 / c if c else math.inf

    def relay(self) -> NDArray[np.float64]:
        m = self.paraxial()
        back = np.array([[self.end_mm * m.c - m.a, self.end_mm * m.d - m.b], [m.c, m.d]])  # of the way to the vertex
        return back @ np.array([[-1.0, self.z_mm], [0.0, 1.0]])

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
        x, y, z, dx, dy, dz, stopped = self._traced(rays)
        weight = (stopped == 0) * (1.0 if rays.weight is None else rays.weight)
        return Bundle(x, y, z, dx, dy, dz, weight)

    def _traced(self, rays: Bundle) -> tuple[Any, ...]:
        """Return the six coordinates of rays behind the first surface, and the surface, from 1, that stopped each; 0
        of rays that pass."""
        coordinates = np.array(np.broadcast_arrays(*rays[:6]), np.float64)
        stopped = traced(coordinates.reshape(6, -1), self._met)
        return *coordinates, stopped.reshape(coordinates.shape[1:])

    @cached_property
    def _met(self) -> list[Refracting]:
        """Surfaces in the order in which rays meet them."""
        after = (1.0, *self._indices[:-1])
        found = [
            Refracting(
                surface.curvature, surface.conic, surface.aspheric,
                -1.0 if surface.diameter_mm is None else surface.diameter_mm / 2, *lies,
            )
            for surface, *lies in zip(self.surfaces, self._vertices, self._indices, after, strict=True)
        ]  # fmt: skip
        return found[::-1]

    def _check_open(self) -> None:
        """Raise ValueError if no ray parallel to the axis passes, but the axis itself."""
        rims = [s.diameter_mm for s in self.surfaces if s.diameter_mm is not None]
        heights = min(rims) / 2 * (np.arange(FAN) + 1) / FAN
        start = self.z_mm - 1e3 * max(rims)  # behind any sag; the rays are parallel
        zero, one = np.float64(0), np.float64(1)
        *_, stopped = self._traced(Bundle(heights, zero, np.float64(start), zero, zero, one))
        if stopped.all():
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


def _coefficients(given: Any) -> tuple[float, ...]:
    """Return aspheric coefficients without zeros at the end."""
    sequence("aspheric", given)
    if len(given) > MOST_ASPHERIC:
        raise ValueError(f"aspheric has {len(given)} coefficients: at most {MOST_ASPHERIC}, of r² to r¹⁶, are needed")
    checked = [within("aspheric", a, -MOST_COEFFICIENT, MOST_COEFFICIENT) for a in given]
    while checked and not checked[-1]:
        checked.pop()
    return tuple(checked)


def _polynomial(coefficients: Sequence[float], square: Any) -> Any:
    """Return the aspheric terms of the sag at r²."""
    total = 0.0 * square
    for a in reversed(coefficients):
        total = (total + a) * square
    return total


def _check_apart(number: int, near: Surface, far: Surface) -> None:
    """Raise ValueError unless a surface and the next, ``far`` from the scene, are apart up to the smaller rim."""
    if near.glass is not None and not near.thickness_mm:
        raise ValueError(f"surfaces: surface {number} has glass and thickness_mm 0: more than 0 is needed")
    rims = [s.diameter_mm / 2 for s in (near, far) if s.diameter_mm is not None]
    if not rims:
        return
    shares = 32 if near.aspheric or far.aspheric else 4  # aspheres may turn back between
    for share in ((i + 1) / shares for i in range(shares)):
        height = min(rims) * share
        gap = near.thickness_mm + far.sag(height) - near.sag(height)
        if gap < -TOUCH_MM:
            raise ValueError(
                f"surfaces: surfaces {number} and {number + 1} cross: the gap {height:.4g} mm from the axis is "
                f"{gap:.4g} mm"
            )


def surfaces_of(elements: Sequence[Any]) -> tuple[Surfaces, ...]:
    """Return the lenses of surfaces among optical elements."""
    return tuple(element for element in elements if isinstance(element, Surfaces))
