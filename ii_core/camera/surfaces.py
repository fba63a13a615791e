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

MOST_SURFACES = 200
FAN = 32  # heights of the parallel rays that test whether a lens lets light through
# Surfaces that touch at the rim, as computed: published lengths have seven digits.
TOUCH_MM = 1e-5
MOST_ASPHERIC = 8  # coefficients, up to that of r¹⁶
MOST_COEFFICIENT = 1e30
MOST_STEPS = 100  # of Newton's method with bisection; most rays take four to six
ROUNDING = 64 * float(np.finfo(np.float64).eps)  # of a sag, against the sum of its terms
Mask = NDArray[np.bool_]


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


def _refracted(ray: tuple[Any, ...], surface: Surface, vertex: float, index: float, after: float) -> tuple[Any, ...]:
    """Return the rays behind a surface and whether they pass; directions are unit vectors and stay so.

    The surface lies at z = vertex − sag.
    """
    x, y, z, dx, dy, dz = ray
    c, k = -surface.curvature, 1 + surface.conic
    to_plane = (vertex - z) / dz
    x0, y0 = x + dx * to_plane, y + dy * to_plane
    if surface.aspheric:
        t, through = _to_asphere((x0, y0, dx, dy, dz), surface)
        x, y, depth = x0 + dx * t, y0 + dy * t, dz * t
        with np.errstate(over="ignore", invalid="ignore"):
            steep = _slope(np.where(through, x * x + y * y, 0.0), surface)
            tilt: Any = np.sqrt(4 * steep * steep * (x * x + y * y) + 1)
        through = through & np.isfinite(tilt)
        steep, tilt = np.where(through, steep, 0.0), np.where(through, tilt, 1.0)
        nx, ny, nz = 2 * steep * x / tilt, 2 * steep * y / tilt, 1 / tilt
        z = vertex + depth
        through = through & (dx * nx + dy * ny + dz * nz > 0) & (to_plane + t >= -TOUCH_MM)
    elif c:
        t, through = _to_conic((x0, y0, dx, dy, dz), c, surface.conic)
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


def _to_conic(ray: tuple[Any, ...], c: float, conic: float) -> tuple[Any, Mask]:
    """Return the distance past the vertex plane at which rays from there meet a conic, and whether they do.

    With c = −1/R, the distance t fulfils A·t² − 2B·t + C = 0. C/(B + √(B² − AC)) is the root next to the vertex,
    exact for planes too.
    """
    x0, y0, dx, dy, dz = ray
    square = c * (x0 * x0 + y0 * y0)
    b = dz - c * (x0 * dx + y0 * dy)
    under = b * b - c * (1 + conic * dz * dz) * square
    below = b + np.sqrt(np.maximum(under, 0))
    return square / np.where(below > 0, below, 1.0), (under >= 0) & (below > 0)


def _slope(square: Any, surface: Surface) -> Any:
    """Return the derivative of the sag after r², inside the edge of the conic."""
    c = surface.curvature
    total = 0.0 * square
    for power in reversed(range(len(surface.aspheric))):
        total = total * square + (power + 1) * surface.aspheric[power]
    return total + c / (2 * np.sqrt(1 - (1 + surface.conic) * c * c * square))


def _to_asphere(ray: tuple[Any, ...], surface: Surface) -> tuple[Any, Mask]:
    """Return the distance past the vertex plane at which rays from there meet an even asphere, and whether they do.

    Newton's method from the point on the conic, or from the vertex plane if a ray misses the conic. The residual is
    the height over the surface. A ray that enters the rim below the surface and leaves it above brackets a root: a
    step out of the bracket, or one that does not halve the residual, gives way to bisection. For other rays, a step
    that does not lessen the residual is halved. A ray meets the surface if its residual falls to its rounding.
    """
    rays = tuple(np.ravel(a) for a in ray)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        start, on_conic = _to_conic(rays, -surface.curvature, surface.conic)
        low, high = _bracket(rays, surface)
        found = np.where(on_conic, start, 0.0)
        closed = np.isfinite(low)
        found = np.where(closed & ~((low < found) & (found < high)), (low + high) / 2, found)
        met = np.zeros(found.shape, bool)
        left, t = np.arange(found.size), found.copy()
        residual, slope, rounding = _residual(rays, t, surface)
        step = -residual / slope
        for _ in range(MOST_STEPS):
            done = np.isfinite(residual) & (np.abs(residual) <= rounding)
            found[left[done]], met[left[done]] = t[done], True
            on = ~done & np.isfinite(step)
            if not on.any():
                break
            left, t, residual, step = left[on], t[on], residual[on], step[on]
            low, high, closed = low[on], high[on], closed[on]
            trial = t + step
            trial = np.where(closed & ~((low < trial) & (trial < high)), (low + high) / 2, trial)
            after, slope, rounding = _residual(tuple(a[left] for a in rays), trial, surface)
            low, high = np.where(closed & (after < 0), trial, low), np.where(closed & (after > 0), trial, high)
            better = np.abs(after) < np.abs(residual)
            newton = -after / slope
            halved = np.abs(after) <= 0.5 * np.abs(residual)
            bisection = (low + high) / 2 - trial
            step = np.where(closed, np.where(halved, newton, bisection), np.where(better, newton, step / 2))
            taken = closed | better
            t, residual = np.where(taken, trial, t), np.where(taken, after, residual)
            rounding = np.where(taken, rounding, 0.0)
    shape = np.shape(ray[0])
    return np.where(met, found, 0.0).reshape(shape), met.reshape(shape)


def _bracket(ray: tuple[Any, ...], surface: Surface) -> tuple[Any, Any]:
    """Return the distances at which rays enter the rim below a surface and leave it above it, or infinities."""
    x0, y0, dx, dy, _ = ray
    reach = math.inf if surface.diameter_mm is None else surface.diameter_mm / 2
    bend = (1 + surface.conic) * surface.curvature**2
    if bend > 0:
        reach = min(reach, (1 - 1e-9) / math.sqrt(bend))
    across = dx * dx + dy * dy
    along = x0 * dx + y0 * dy
    under = along * along - across * (x0 * x0 + y0 * y0 - reach * reach)
    root = np.sqrt(np.where(under > 0, under, 0.0))
    slanted = np.where(across > 0, across, 1.0)
    low, high = (-along - root) / slanted, (-along + root) / slanted
    crosses = (across > 0) & (under > 0) & np.isfinite(low) & np.isfinite(high)
    low, high = np.where(crosses, low, 0.0), np.where(crosses, high, 0.0)
    crosses = crosses & (_residual(ray, low, surface)[0] < 0) & (_residual(ray, high, surface)[0] > 0)
    return np.where(crosses, low, -np.inf), np.where(crosses, high, np.inf)


def _residual(ray: tuple[Any, ...], t: Any, surface: Surface) -> tuple[Any, Any, Any]:
    """Return the height of rays over an asphere, its derivative along the ray, and its rounding.

    The height is infinite beyond the edge of the conic.
    """
    x0, y0, dx, dy, dz = ray
    x, y = x0 + dx * t, y0 + dy * t
    square = x * x + y * y
    c = surface.curvature
    under = 1 - (1 + surface.conic) * c * c * square
    inside = under > 0
    conic = c * square / (1 + np.sqrt(np.where(inside, under, 1.0)))
    height = np.where(inside, dz * t + conic + _polynomial(surface.aspheric, square), np.inf)
    slope = dz + 2 * _slope(np.where(inside, square, 0.0), surface) * (x * dx + y * dy)
    terms = np.abs(conic) + _polynomial([abs(a) for a in surface.aspheric], square)
    rounding = ROUNDING * (terms + np.abs(x0) + np.abs(y0) + np.abs(t))
    return height, np.where(slope != 0, slope, 1.0), rounding


def surfaces_of(elements: Sequence[Any]) -> tuple[Surfaces, ...]:
    """Return the lenses of surfaces among optical elements."""
    return tuple(element for element in elements if isinstance(element, Surfaces))
