"""Rate bounds of light fields with and without geometry against `si-lf`: how far is it from the sky?

    python -m benchmarks run light_field_bounds [--scale 8] [--scenes apples,twins,car,cuboid]

Power spectra and coherence between sub-images one and four steps apart are measured on each scene, in blocks of 16×16
samples by classes of detail, as they are; and how well the eight views around a view predict it by the renderer's
disparity. `rate_model` gives the rate of Gaussian views of these statistics. A second measurement displaces views by
a random error, and compares the rate by the coherence then measured with that by the closed form. Numbers go to
``benchmarks/results/light_field_bounds.jsonl``, tables to ``docs/lf_bounds.md``; ``benchmarks run lf_bounds_chart``
draws the chart.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.coding.disparity import disparity
from benchmarks.coding.rate_model import CrossSpectra, fitted, jitter_coherence, rate_at, view_gains
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from codec import decode, encode
from codec.coders.lf.planes import detail_axes
from ii_core import IICamera, IIPicture, preset, sub_images
from metrics import q_global
from raytrace_ii import load_scene, render

RECORDS = Records(
    "light_field_bounds",
    ("benchmarks.coding.light_field_bounds", "benchmarks.coding.rate_model", "benchmarks.coding.disparity"),
)
SCENES = ("apples", "twins", "car", "cuboid")
SCHEME = "si-lf"
BLOCK, CLASSES = 16, 8
FAR = 4  # steps on the grid, beside 1
PAIRS = 24  # of views by direction and distance
DRAWS = 12  # errors of disparity for each pair; the mean of n random phases has a magnitude of about 1/√n
SAME, PHASE = 0.8, 0.08  # disparities that differ less, in samples, are of one surface; see docs/lf.md, Synthesis
QUANTISERS = (22, 30, 38, 44, 50)
AT = 38  # quantiser of the measurement by number of views
SIDES = (1, 2, 4, 8, 16)
ERRORS = (0.0, 0.125, 0.25, 0.5, 1.0)  # standard deviations of disparity, in samples
ERRORS_DB = 36.0


def main() -> None:
    """Measure, print, keep and fill the page."""
    parser = command_line(__doc__, scenes=SCENES, scale=8)
    asked = parser.parse_args()
    keys = [{"scene": name, "scale": asked.scale} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        record = RECORDS.measure(key, partial(measured, key["scene"], key["scale"]))
        print(key, record["result"]["curve"], flush=True)
    publish(tables())


def measured(name: str, scale: int) -> dict[str, Any]:
    """Bounds and measured rates of a scene."""
    camera = preset("setup1", scale=scale)
    shot = render(load_scene(name), camera, support=("depth",))
    assert shot.depth is not None
    field = LightField(shot.picture, shot.depth, camera)
    curve = []
    for qp in QUANTISERS:
        coded, psnr = coded_at(shot.picture, qp)
        curve.append({"qp": qp, "coded": coded, "psnr": psnr, **field.rates(psnr, camera.ei_pixels[::-1])})
    sides = []
    for side in SIDES:
        part = middle_views(shot.picture, side)
        coded, psnr = coded_at(part, AT)
        sides.append({"side": side, "coded": coded, "psnr": psnr, **field.rates(psnr, (side, side))})
    return {"curve": curve, "views": sides, "errors": field.by_error(camera.ei_pixels[::-1])}


def tables() -> Tables:
    """The tables of docs/lf_bounds.md, at scale 8; the page's chart has all points and the errors of disparity."""
    rows = RECORDS.by("scene", SCENES, scale=8)
    marks = ("lf-bounds-rate", "lf-bounds-views")
    if not rows:
        return {("docs/lf_bounds.md", mark): ["Not measured yet."] for mark in marks}
    rate = ["| scene | PSNR | `si-lf` | views apart | no geometry | exact geometry |", "|---|---|---|---|---|---|"]
    views = ["| scene | " + " | ".join(f"{side}×{side}" for side in SIDES) + " |", "|---|" + "---|" * len(SIDES)]
    for name, row in rows.items():
        for point in row["curve"][::2]:
            cells = [f"{point[kind]:.3f}" for kind in ("coded", "apart", "plain", "exact")]
            rate.append(f"| {name} | {point['psnr']:.1f} | " + " | ".join(cells) + " |")
        views.append(f"| {name} | " + " | ".join(f"{r['coded']:.2f} ({r['exact']:.2f})" for r in row["views"]) + " |")
    said = ["", origin(list(rows.values()))]
    return {("docs/lf_bounds.md", mark): lines + said for mark, lines in zip(marks, (rate, views), strict=True)}


def coded_at(picture: IIPicture, qp: int) -> tuple[float, float]:
    """Bits a pixel and PSNR of `si-lf`; header and index of the file are not counted."""
    coded = encode(picture, SCHEME, qp=qp)
    return 8 * len(coded.payload) / (picture.pixels.size / 3), q_global(picture, decode(coded))


def middle_views(picture: IIPicture, side: int) -> IIPicture:
    """Square of neighbouring views in the middle of the grid."""
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    top, left = (v - side) // 2, (u - side) // 2
    cut = picture.light_field[:, :, top : top + side, left : left + side].transpose(0, 2, 1, 3, 4)
    return IIPicture(cut.reshape(l * side, k * side, 3), (k, l), (side, side))


class LightField:
    """Statistics of a rendered light field.

    Parameters
    ----------
    picture : IIPicture
    depth : ndarray, (N, M)
        mm; NaN without a hit.
    camera : IICamera
    """

    def __init__(self, picture: IIPicture, depth: NDArray[np.float32], camera: IICamera) -> None:
        self.tool = CrossSpectra(BLOCK)
        axes = detail_axes(picture.pixels, picture.ei_pixels[::-1]) / 2.0**14
        views = np.einsum("pc,vuyxc->vupyx", axes, sub_images(picture).astype(np.float32))
        self.views = views - views.mean(axis=(0, 1, 3, 4), keepdims=True)
        deep = sub_images(picture.with_pixels(np.repeat(depth[..., None], 3, axis=2)))[..., 0]
        self.moves = np.nan_to_num(disparity(camera, deep))
        rng = np.random.default_rng(0)
        places = rng.permutation([(v, u) for v in range(views.shape[0]) for u in range(views.shape[1])])
        self.places = [(int(v), int(u)) for v, u in places]
        every = np.concatenate([self.tool.blocks(self.views[place]) for place in self.places[:64]])
        self.bounds = np.quantile(_detail(every), np.linspace(0, 1, CLASSES + 1)[1:-1])
        classes = np.digitize(_detail(every), self.bounds)
        self.power = np.stack([(np.abs(every[classes == c]) ** 2).mean(axis=0) for c in range(CLASSES)])
        one = np.ones_like(self.power)
        plain = fitted(*(self.coherence(steps, "plain") for steps in (1, FAR)), FAR)
        self.model = {"plain": plain, "exact": (self.shared(), one)}

    def coherence(self, steps: int, kind: str, sigma: float = 0.0) -> NDArray[np.float64]:
        """Coherence (CLASSES, 3, BLOCK, BLOCK) so many steps apart, mean of both directions.

        ``sigma`` is the standard deviation of an error of each view's disparity, in samples along the direction.
        """
        return np.mean([self.along(direction, steps, kind, sigma) for direction in ((0, 1), (1, 0))], axis=0)

    def along(self, direction: tuple[int, int], steps: int, kind: str, sigma: float) -> NDArray[np.float64]:
        """Coherence along one direction of the grid."""
        rng = np.random.default_rng(steps)
        down, across = (steps * part for part in direction)
        rows, cols = self.views.shape[:2]
        one, other = [], []
        for v, u in [p for p in self.places if p[0] + down < rows and p[1] + across < cols][:PAIRS]:
            there, move = self.views[v + down, u + across], self.moves[v, u]
            errors = rng.normal(0, sigma, DRAWS if sigma > 0 else 1) if kind == "moved" else ()
            shown = [moved(there, *(move * part + e * np.sign(part) for part in (down, across))) for e in errors]
            for view in shown or [there]:
                one.append(self.tool.blocks(self.views[v, u]))
                other.append(self.tool.blocks(view))
        return self.by_class(np.concatenate(one), np.concatenate(other))

    def shared(self) -> NDArray[np.float64]:
        """Part (CLASSES, 3, BLOCK, BLOCK) of the power of a view that the eight around it predict, by exact depth."""
        one, other = [], []
        for place in self.places[:PAIRS]:
            one.append(self.tool.blocks(self.views[place]))
            other.append(self.tool.blocks(self.predicted(place)))
        return self.by_class(np.concatenate(one), np.concatenate(other)) ** 2

    def predicted(self, place: tuple[int, int]) -> NDArray[np.float64]:
        """A view from the eight around it: nearest samples that show the same surface, by their sampling phase."""
        v, u = place
        rows, cols, planes, height, width = self.views.shape
        y, x = np.mgrid[:height, :width]
        total, weights = np.zeros((planes, height, width)), np.full((height, width), 1e-12)
        for row in range(max(v - 1, 0), min(v + 2, rows)):
            for col in range(max(u - 1, 0), min(u + 2, cols)):
                if (row, col) == place:
                    continue
                down, across = (y + self.moves[v, u] * (row - v), x + self.moves[v, u] * (col - u))
                i, j = np.clip(np.rint(down), 0, height - 1), np.clip(np.rint(across), 0, width - 1)
                away = (down - i) ** 2 + (across - j) ** 2
                i, j = i.astype(int), j.astype(int)
                same = np.abs(self.moves[row, col][i, j] - self.moves[v, u]) < SAME
                weight = np.where(same, 1.0, 1e-4) * (np.exp(-away / PHASE) + 1e-8)
                total += weight * self.views[row, col][:, i, j]
                weights += weight
        found: NDArray[np.float64] = total / weights
        return found

    def by_class(self, one: NDArray[np.complex128], other: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Coherence by the class of the first transforms."""
        classes = np.digitize(_detail(one), self.bounds)
        found = np.zeros((CLASSES, *one.shape[1:]))
        for c in np.unique(classes):
            found[c] = self.tool.coherence(one[classes == c], other[classes == c])
        return found

    def rates(self, psnr: float, grid: tuple[int, int]) -> dict[str, float]:
        """Bits a pixel of the model at a PSNR, without and with views in common."""
        found = {"apart": self.rate(psnr, np.zeros_like(self.power), np.ones_like(self.power), (1, 1))}
        return found | {kind: self.rate(psnr, *self.model[kind], grid) for kind in self.model}

    def rate(self, psnr: float, alpha: Any, beta: Any, grid: tuple[int, int]) -> float:
        """Bits a pixel at coherence α·β^distance."""
        spectra = self.power[..., None] * view_gains(alpha, beta, grid)
        return rate_at(spectra, 3 / spectra.size, psnr)

    def by_error(self, grid: tuple[int, int]) -> list[dict[str, float]]:
        """Rates by error of the disparity: by the coherence then measured, and by the closed form."""
        one = np.ones_like(self.power)
        across = self.tool.frequencies()
        found = []
        for sigma in ERRORS:
            measured = self.coherence(1, "moved", sigma)
            falls = jitter_coherence(sigma, across)
            predicted = np.mean(
                [self.along((0, 1), 1, "moved", 0) * falls, self.along((1, 0), 1, "moved", 0) * falls[:, None]],
                axis=0,
            )
            rates = [self.rate(ERRORS_DB, alpha, one, grid) for alpha in (measured, predicted)]
            found.append({"sigma": sigma, "measured": rates[0], "predicted": rates[1]})
        return found


def _detail(blocks: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Energy of the first plane's blocks above the lowest frequencies."""
    power: NDArray[np.float64] = np.abs(blocks[:, 0]) ** 2
    return power.sum(axis=(1, 2)) - power[:, [0, 0, 1, 1, -1, -1, 0, 1, -1], [0, 1, 0, 1, -1, 0, -1, -1, 1]].sum(
        axis=1
    )


def moved(planes: NDArray[Any], down: NDArray[Any], across: NDArray[Any]) -> NDArray[np.float64]:
    """Planes (P, H, W) at positions moved by as much (H, W), by cubic splines; the border repeats."""
    from scipy.ndimage import map_coordinates

    y, x = np.mgrid[: planes.shape[1], : planes.shape[2]]
    return np.stack([map_coordinates(plane, (y + down, x + across), order=3, mode="nearest") for plane in planes])


if __name__ == "__main__":
    main()
