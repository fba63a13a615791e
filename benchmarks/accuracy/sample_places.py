"""Places of a pixel's samples: the sets of `raytrace_ii.sampling.sample_places`, and what they miss of an edge.

    python -m benchmarks run sample_places [--find]

An edge divides a pixel; the error is the share of the samples on one side less that of the pixel. Its mean square
over all straight edges that meet the pixel is a quarter of the energy distance of samples and pixel (Székely and
Rizzo 2013, by Crofton's formula); over edges along rows and columns it is the same in one dimension. The least of
both together is searched from many starts. ``--find`` prints the sets anew, in five minutes; else their errors are
measured beside those of the (0, 2)-sequence and recorded.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from raytrace_ii.sampling.sample_kernels import places
from raytrace_ii.sampling.sample_places import MOST, doubling_places, fixed_places

RECORDS = Records("sample_places", ("benchmarks.accuracy.sample_places",))
PAGE = "docs/speed_accuracy.md"
SHOWN = (2, 4, 8, 9, 16)
PIXELS = 4096  # of the sequence, each scrambled otherwise
ALONG = 0.4  # weight of edges along rows and columns
EVEN = 0.39  # by which their energies weigh as much as those of all angles
STARTS = 60

Floats = NDArray[np.float64]
_QUADRATURE = np.stack(np.meshgrid(*[(np.arange(40) + 0.5) / 40] * 2), -1).reshape(-1, 2)
_MEAN_DISTANCE = 0.5214054331647  # of two places in the unit square


def main() -> None:
    """Find the sets, or measure and record their errors."""
    parser = command_line(__doc__)
    parser.add_argument("--find", action="store_true", help="print the sets that are least, found anew")
    asked = parser.parse_args()
    if asked.find:
        found = {samples: spread(samples) for samples in range(2, MOST + 1)}
        for samples, some in {**found, "doubling": doubling()}.items():
            print(samples, np.rint(some * 1000).astype(int).tolist(), flush=True)
        return
    RECORDS.run([{"samples": samples} for samples in SHOWN], measured, asked.again)
    publish(tables())


def measured(samples: int, many: int = PIXELS) -> dict[str, Any]:
    """Return the root mean square errors of an edge by set: [all angles, along rows and columns]."""
    own = np.empty((many, samples, 2))
    pixels = np.arange(many)
    places(0, pixels, pixels, many, 0, samples, 0, np.empty((0, 2)), (0, 0), own.reshape(-1, 2))
    sets = {"sequence": own, "own": fixed_places(samples)[None]}
    if samples & (samples - 1) == 0 and samples >= 4:
        sets["doubling"] = doubling_places(MOST)[None, :samples]
    return {name: np.sqrt(np.mean([squares(one) for one in some], axis=0)).tolist() for name, some in sets.items()}


def squares(places: Floats) -> tuple[float, float]:
    """Return the mean squares of the error of an edge: of all angles, and along rows and columns."""
    (angles, _), (along, _) = _energy(places), _energy_along(places)
    return angles / 4, along / 4


def _energy(places: Floats) -> tuple[float, Floats]:
    """Return the energy distance of places (n, 2) to the unit square, and its gradient."""
    n = len(places)
    to = places[:, None] - _QUADRATURE
    far = np.sqrt((to**2).sum(-1)) + 1e-9
    between = places[:, None] - places
    apart = np.sqrt((between**2).sum(-1) + 1e-12)
    energy = 2 * far.mean() - apart.mean() - _MEAN_DISTANCE
    return energy, 2 / n * ((to / far[..., None]).mean(1) - (between / apart[..., None]).mean(1))


def _energy_along(places: Floats) -> tuple[float, Floats]:
    """Return the sum of the energy distances of both coordinates to the unit interval, and its gradient."""
    n = len(places)
    between = places[:, None] - places
    apart = np.sqrt(between**2 + 1e-7)
    energy = (places**2 + (1 - places) ** 2).sum() / n - apart.mean(axis=(0, 1)).sum() - 2 / 3
    return energy, 2 / n * (2 * places - 1 - (between / apart).mean(1))


def _weighted(places: Floats) -> tuple[float, Floats]:
    (a, slope_a), (b, slope_b) = _energy(places), _energy_along(places)
    return (1 - ALONG) * a + ALONG * EVEN * b, (1 - ALONG) * slope_a + ALONG * EVEN * slope_b


def spread(samples: int) -> Floats:
    """Return the set of least energy, the place nearest to the centre first."""
    found = min(candidates(samples), key=lambda some: _weighted(some)[0])
    return found[np.argsort(((found - 0.5) ** 2).sum(1), kind="stable")]


def candidates(samples: int) -> list[Floats]:
    """Return sets of locally least energy; of 4, 8 and 16 samples as many lie in each quarter or sixteenth."""
    cells = {4: 2, 8: 2, 16: 4}.get(samples, 1)
    corner = np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), -1).reshape(-1, 2)
    low = np.tile(corner, (samples // cells**2, 1)) / cells
    bounds = [(x + 1e-3, x + 1 / cells - 1e-3) for x in low.ravel()]
    random = np.random.default_rng(samples)

    def target(x: Floats) -> tuple[float, Floats]:
        energy, slope = _weighted(x.reshape(-1, 2))
        return energy, slope.ravel()

    return [
        minimize(target, (low + random.random(low.shape) / cells).ravel(), jac=True, bounds=bounds).x.reshape(-1, 2)
        for _ in range(STARTS)
    ]


def doubling() -> Floats:
    """Return a set of 16 in an order in which the first 4 and 8 have little energy, each four one in each quarter."""
    best, found = np.inf, np.empty((0, 2))
    for some in sorted(candidates(MOST), key=lambda some: _weighted(some)[0])[:10]:
        quarters = [np.flatnonzero((some >= 0.5) @ [1, 2] == quarter).tolist() for quarter in range(4)]
        fours = sorted((_weighted(some[list(four)])[0], four) for four in product(*quarters))[:40]
        for energy, four in fours:
            for next_four in product(*_without(quarters, four)):
                eight = _weighted(some[[*four, *next_four]])[0]
                # as they grow with the number, to the power of −3/2
                total = 64 * _weighted(some)[0] + 0.45 * 8**1.5 * eight + 0.5 * 8 * energy
                if total < best:
                    last = _without(quarters, (*four, *next_four))
                    best, found = (
                        total,
                        some[[*four, *next_four, *(row[0] for row in last), *(row[1] for row in last)]],
                    )
    return found


def _without(quarters: list[list[int]], taken: tuple[int, ...]) -> list[list[int]]:
    return [[i for i in quarter if i not in taken] for quarter in quarters]


def tables() -> Tables:
    """Return the table of the page."""
    rows, lines = RECORDS.by("samples", SHOWN), []
    for samples, row in rows.items():
        sets = [row.get(name) for name in ("sequence", "own", "doubling")]
        lines.append([samples, *(f"{one[axis] * 100:.1f} %" if one else "" for axis in (0, 1) for one in sets)])
    heads = (
        "samples | edges of all angles, sequence | own places | doubling | along rows and columns, sequence | own "
        "places | doubling"
    )
    return {(PAGE, "sample-places"): [*table(heads, lines), "", origin(rows.values())]}
