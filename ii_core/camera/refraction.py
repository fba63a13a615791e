"""Kernel of `surfaces`: rays from the pixels through refracting surfaces, each as exactly as numbers allow."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.jit import exact_kernel, exact_stage_kernel

# Surfaces that touch at the rim, as computed: published lengths have seven digits.
TOUCH_MM = 1e-5
MOST_STEPS = 100  # of Newton's method with bisection; most rays take four to six
ROUNDING = 64 * float(np.finfo(np.float64).eps)  # of a sag, against the sum of its terms
_BLOCK = 256  # rays that a surface takes at a time: all they need stays in the first cache
# rows of the work: a ray's place, its direction, and the surface that stopped it, from 1
X, Y, Z, DX, DY, DZ, STOPPED = (row * _BLOCK for row in range(7))


class Refracting(NamedTuple):
    """Surface as rays from the pixels meet it: it lies at z = vertex − sag."""

    curvature: float
    conic: float
    aspheric: tuple[float, ...]
    radius: float  # of the rim; negative without one
    vertex: float
    before: float  # index on the pixels' side
    after: float


def traced(coordinates: NDArray[np.float64], surfaces: list[Refracting]) -> NDArray[np.int16]:
    """Trace rays through surfaces in the order in which they meet them, and return where each is stopped.

    Parameters
    ----------
    coordinates : ndarray of float64, (6, n)
        Places, mm from the axis and in z, and directions of any length; replaced by those behind the last surface,
        unit vectors. Those of stopped rays mean nothing.
    surfaces : list of Refracting

    Returns
    -------
    ndarray of int16, (n,)
        Which surface stops a ray, from 1 for the last one in the list; 0 of rays that pass.

    References
    ----------
    Welford, Aberrations of Optical Systems, 1986, ch. 4.
    """
    most = max(len(surface.aspheric) for surface in surfaces)
    numbers = np.array([(*surface[:2], *surface[3:], len(surface.aspheric)) for surface in surfaces], np.float64)
    terms = np.zeros((len(surfaces), most))
    for row, surface in zip(terms, surfaces, strict=True):
        row[: len(surface.aspheric)] = surface.aspheric
    stopped = np.empty(coordinates.shape[1], np.int16)
    _trace(coordinates, numbers, terms, np.empty(7 * _BLOCK), stopped)
    return stopped


@exact_kernel
def _trace(coordinates: Any, numbers: Any, terms: Any, work: Any, stopped: Any) -> None:
    total, n = len(numbers), len(stopped)
    for first in range(0, n, _BLOCK):
        count = min(_BLOCK, n - first)
        for i in range(count):
            dx, dy, dz = coordinates[3, first + i], coordinates[4, first + i], coordinates[5, first + i]
            forward = dz > 0
            size = math.sqrt(dx * dx + dy * dy + dz * dz) if forward else 1.0
            for row in range(3):
                work[row * _BLOCK + i] = coordinates[row, first + i]
            work[DX + i] = dx / size if forward else 0.0
            work[DY + i] = dy / size if forward else 0.0
            work[DZ + i] = dz / size if forward else 1.0
            work[STOPPED + i] = 0 if forward else total
        for s in range(total):
            if numbers[s, 6]:
                _through_asphere(work, count, numbers[s], terms[s, : int(numbers[s, 6])], total - s)
            else:
                _through_conic(work, count, numbers[s], total - s)
        for i in range(count):
            stopped[first + i] = int(work[STOPPED + i])
            for row in range(6):
                coordinates[row, first + i] = work[row * _BLOCK + i]


@exact_stage_kernel
def _through_conic(work: Any, count: int, numbers: Any, number: int) -> None:
    """Pass rays through a conic, sphere or plane."""
    c, conic, radius, vertex, before, after = (
        -numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]
    )  # fmt: skip
    k = 1 + conic
    for i in range(count):
        dx, dy, dz = work[DX + i], work[DY + i], work[DZ + i]
        to_plane = (vertex - work[Z + i]) / dz
        x0, y0 = work[X + i] + dx * to_plane, work[Y + i] + dy * to_plane
        t, through = _to_conic(x0, y0, dx, dy, dz, c, conic)
        x, y, depth = x0 + dx * t, y0 + dy * t, dz * t
        steep = 1 - k * c * depth  # z component of the normal before it is a unit vector
        through = through & (steep > 0) & (to_plane + t >= -TOUCH_MM)
        size = math.sqrt(c * c * (x * x + y * y) + steep * steep)
        size = size if size > 0 else 1.0
        work[X + i], work[Y + i], work[Z + i] = x, y, vertex + depth
        _bend(work, i, -c * x / size, -c * y / size, steep / size, before, after, radius, through, number)


@exact_stage_kernel
def _through_asphere(work: Any, count: int, numbers: Any, terms: Any, number: int) -> None:
    """Pass rays through an even asphere."""
    c, conic, radius, vertex, before, after = (
        numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]
    )  # fmt: skip
    for i in range(count):
        dx, dy, dz = work[DX + i], work[DY + i], work[DZ + i]
        to_plane = (vertex - work[Z + i]) / dz
        x0, y0 = work[X + i] + dx * to_plane, work[Y + i] + dy * to_plane
        t, through = _to_asphere(x0, y0, dx, dy, dz, c, conic, terms, radius)
        x, y = x0 + dx * t, y0 + dy * t
        square = x * x + y * y
        steep = _slope(square if through else 0.0, c, conic, terms)
        tilt = math.sqrt(4 * steep * steep * square + 1)
        through = through & math.isfinite(tilt)
        steep, tilt = (steep, tilt) if through else (0.0, 1.0)
        nx, ny, nz = 2 * steep * x / tilt, 2 * steep * y / tilt, 1 / tilt
        through = through & (dx * nx + dy * ny + dz * nz > 0) & (to_plane + t >= -TOUCH_MM)
        work[X + i], work[Y + i], work[Z + i] = x, y, vertex + dz * t
        _bend(work, i, nx, ny, nz, before, after, radius, through, number)


@exact_stage_kernel
def _bend(work: Any, i: int, nx: float, ny: float, nz: float, before: float, after: float, radius: float,
          through: bool, number: int) -> None:  # fmt: skip
    """Turn a ray at its place on a surface by Snell's law; note where it is stopped first."""
    x, y, dx, dy, dz = work[X + i], work[Y + i], work[DX + i], work[DY + i], work[DZ + i]
    bends = before != after
    cosine = dx * nx + dy * ny + dz * nz
    ratio = before / after
    rest = 1 - ratio * ratio * (1 - cosine * cosine)
    bend = math.sqrt(rest if rest > 0 else 0.0) - ratio * cosine
    tx, ty, tz = ratio * dx + bend * nx, ratio * dy + bend * ny, ratio * dz + bend * nz
    forward = tz > 0
    through = through & ((radius < 0) | (x * x + y * y <= radius * radius))
    through = through & (not bends or ((rest > 0) & (cosine > 0) & forward))
    work[DX + i] = (tx if forward else 0.0) if bends else dx
    work[DY + i] = (ty if forward else 0.0) if bends else dy
    work[DZ + i] = (tz if forward else 1.0) if bends else dz
    work[STOPPED + i] = number if (work[STOPPED + i] == 0) & (not through) else work[STOPPED + i]


@exact_stage_kernel
def _to_conic(x0: float, y0: float, dx: float, dy: float, dz: float, c: float, conic: float) -> tuple[float, bool]:
    """Return the distance past the vertex plane at which a ray from there meets a conic, and whether it does.

    With c = −1/R, the distance t fulfils A·t² − 2B·t + C = 0. C/(B + √(B² − AC)) is the root next to the vertex,
    exact for planes too.
    """
    square = c * (x0 * x0 + y0 * y0)
    b = dz - c * (x0 * dx + y0 * dy)
    under = b * b - c * (1 + conic * dz * dz) * square
    below = b + math.sqrt(under if under > 0 else 0.0)
    return square / (below if below > 0 else 1.0), (under >= 0) & (below > 0)


@exact_stage_kernel
def _slope(square: float, c: float, conic: float, terms: Any) -> float:
    """Return the derivative of the sag after r², inside the edge of the conic."""
    total = 0.0 * square
    for power in range(len(terms) - 1, -1, -1):
        total = total * square + (power + 1) * terms[power]
    return total + c / (2 * math.sqrt(1 - (1 + conic) * c * c * square))


@exact_stage_kernel
def _to_asphere(x0: float, y0: float, dx: float, dy: float, dz: float, c: float, conic: float, terms: Any,
                radius: float) -> tuple[float, bool]:  # fmt: skip
    """Return the distance past the vertex plane at which a ray from there meets an even asphere, and whether it does.

    Newton's method from the point on the conic, or from the vertex plane if the ray misses the conic. The residual is
    the height over the surface. A ray that enters the rim below the surface and leaves it above brackets a root: a
    step out of the bracket, or one that does not halve the residual, gives way to bisection. For other rays, a step
    that does not lessen the residual is halved. A ray meets the surface if its residual falls to its rounding.
    """
    start, on_conic = _to_conic(x0, y0, dx, dy, dz, -c, conic)
    low, high, closed = _bracket(x0, y0, dx, dy, dz, c, conic, terms, radius)
    t = start if on_conic else 0.0
    if closed and not low < t < high:
        t = (low + high) / 2
    residual, slope, rounding = _height(x0, y0, dx, dy, dz, t, c, conic, terms)
    step = -residual / slope
    for _ in range(MOST_STEPS):
        if math.isfinite(residual) and abs(residual) <= rounding:
            return t, True
        trial = t + step
        if not math.isfinite(trial):
            break
        if closed and not low < trial < high:
            trial = (low + high) / 2
        after, slope, new_rounding = _height(x0, y0, dx, dy, dz, trial, c, conic, terms)
        if not closed and not abs(after) < abs(residual):
            step, rounding = step / 2, 0.0
            continue
        low, high = trial if after < 0 else low, trial if after > 0 else high
        step = -after / slope
        if closed and not abs(after) <= 0.5 * abs(residual):
            step = (low + high) / 2 - trial
        t, residual, rounding = trial, after, new_rounding
    return 0.0, False


@exact_stage_kernel
def _bracket(x0: float, y0: float, dx: float, dy: float, dz: float, c: float, conic: float, terms: Any,
             reach: float) -> tuple[float, float, bool]:  # fmt: skip
    """Return at which distances a ray enters the rim below a surface and leaves it above it, and whether it does."""
    bend = (1 + conic) * c**2
    if bend > 0:
        edge = (1 - 1e-9) / math.sqrt(bend)
        reach = edge if reach < 0 else min(reach, edge)
    across, along = dx * dx + dy * dy, x0 * dx + y0 * dy
    under = along * along - across * (x0 * x0 + y0 * y0 - reach * reach)
    if reach < 0 or not (across > 0 and under > 0):
        return 0.0, 0.0, False
    root = math.sqrt(under)
    low, high = (-along - root) / across, (-along + root) / across
    if not (math.isfinite(low) and math.isfinite(high)):
        return 0.0, 0.0, False
    enters = _height(x0, y0, dx, dy, dz, low, c, conic, terms)[0] < 0
    return low, high, enters and _height(x0, y0, dx, dy, dz, high, c, conic, terms)[0] > 0


@exact_stage_kernel
def _height(x0: float, y0: float, dx: float, dy: float, dz: float, t: float, c: float, conic: float,
            terms: Any) -> tuple[float, float, float]:  # fmt: skip
    """Return the height of a ray over an asphere, its derivative along the ray, and its rounding.

    The height is infinite beyond the edge of the conic.
    """
    x, y = x0 + dx * t, y0 + dy * t
    square = x * x + y * y
    under = 1 - (1 + conic) * c * c * square
    inside = under > 0
    sag = c * square / (1 + math.sqrt(under if inside else 1.0))
    total, sizes = 0.0 * square, 0.0 * square
    for power in range(len(terms) - 1, -1, -1):
        total = (total + terms[power]) * square
        sizes = (sizes + abs(terms[power])) * square
    height = dz * t + sag + total if inside else math.inf
    slope = dz + 2 * _slope(square if inside else 0.0, c, conic, terms) * (x * dx + y * dy)
    rounding = ROUNDING * (abs(sag) + sizes + abs(x0) + abs(y0) + abs(t))
    return height, slope if slope != 0 else 1.0, rounding
