"""Samples by edges: the error wanted against the real one, by what pixels see, and a picture of the cells.

    python -m benchmarks run edges [--scenes apples,car]

The reference has 576 samples a pixel. Pixels that got more than one ray count; their errors are root mean squares of
the three channels in 8-bit codes. What a pixel sees is told by nine rays: two bodies (outline), normals that differ
(crease), a mirror, glass or a highlight (glossy), a light that some of the places see (shadow), a texture.
"""

from __future__ import annotations

from typing import Any, ClassVar
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import write_chart
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import IICamera, preset
from ii_core.base.colour import srgb
from ii_core.display.figure import new_figure
from raytrace_ii import Scene, load_scene, render, trace
from raytrace_ii.sampling import edges
from raytrace_ii.sampling.cell_kernels import CUT, DONE, OPEN

RECORDS, PAGE = Records("edges", ("benchmarks.accuracy.edges",)), "docs/speed_accuracy.md"
SCENES = ("apples", "twins", "car", "cuboid", "objects", "dolphin", "hairdo", "mountains")
SCALE, ERRORS = 32, (2.0, 4.0)
TRUE: dict[str, Any] = {"samples": 576, "seed": 1}
CLASSES = ("outline", "crease", "glossy", "shadow", "texture", "smooth")
PLACES = [(x, y) for x in (0.02, 0.5, 0.98) for y in (0.02, 0.5, 0.98)]
ONE_SURFACE = 0.94  # least cosine
LENS, ENLARGED = (8, 4), 24  # of the picture of cells

Floats = NDArray[np.float64]


def main() -> None:
    """Measure, record, fill the page and draw."""
    asked = command_line(__doc__, scenes=SCENES).parse_args()
    RECORDS.run([{"scene": scene} for scene in asked.scenes], measured, asked.again)
    publish(tables())
    write_chart(picture(), "edges.png", dpi=100)


def measured(scene: str) -> dict[str, Any]:
    """Return the error of the pixels that got more than a ray, and their share, by error wanted and class."""
    camera, loaded = preset("setup1", scale=SCALE), load_scene(scene)
    options: dict[str, Any] = {"dtype": "float32", "workers": 1}
    true = _codes(render(loaded, camera, support=(), **TRUE, **options).picture.pixels)
    kinds = classes(loaded, camera)
    found = {}
    for error in ERRORS:
        shot = render(loaded, camera, samples="edges", error=error, support=("samples",), **options)
        assert shot.samples is not None
        off, more = np.mean((_codes(shot.picture.pixels) - true) ** 2, axis=-1), shot.samples > 1
        of_class = {name: more & (kinds == i) for i, name in enumerate(CLASSES)}
        found[f"{error:g}"] = {
            "all": [_rms(off[more]), float(more.mean())],
            **{name: [_rms(off[some]), float(some.mean())] for name, some in of_class.items()},
            "rays": shot.stats.mean_samples, "one ray": _rms(off[~more]),
        }  # fmt: skip
    return found


def classes(scene: Scene, camera: IICamera) -> NDArray[np.int64]:
    """Return what each pixel sees, as places of `CLASSES`."""
    seen, lit = [], []
    for place in PLACES:
        L, D = camera.rays(sample=place)
        seen.append(one := trace(scene, L, D))
        at = L.reshape(-1, 3) + D.reshape(-1, 3) * (one.ray_length / np.linalg.norm(D, axis=-1).ravel())[:, None]
        lit.append(_lights_seen(scene, at + 1e-3 * one.normal, one.object_id))
    body, normal = np.array([one.object_id for one in seen]), np.array([one.shading_normal for one in seen])
    materials = [one.material for one in scene.bodies]
    glossy = [m.specular > 0 or max(*m.mirror, *m.transmission, m.metallic) > 0 for m in materials]
    textured = [m.texture is not None or m.normal_map is not None for m in materials]
    along = np.einsum("pni,ni->pn", normal, normal[0]).min(axis=0)
    kinds = [
        (body != body[0]).any(axis=0), (along < ONE_SURFACE) & (body[0] >= 0), np.array([*glossy, False])[body[0]],
        (np.array(lit) != lit[0]).any(axis=(0, 2)), np.array([*textured, False])[body[0]],
        np.ones(len(along), np.bool_),
    ]  # fmt: skip
    return np.argmax(kinds, axis=0).reshape(camera.pixels[::-1])


def _lights_seen(scene: Scene, points: Floats, body: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return which lights points on bodies see, (n, lights); all where there is no body."""
    found = np.ones((len(points), len(scene.lights)), np.bool_)
    on = np.flatnonzero(body >= 0)
    for i, light in enumerate(scene.lights):
        vector = np.asarray(light.vector, np.float64)
        to = vector - points[on] if light.kind == "point" else np.broadcast_to(-vector, (len(on), 3))
        reach = trace(scene, points[on], to).ray_length
        far = np.linalg.norm(to, axis=1) if light.kind == "point" else np.inf
        found[on, i] = ~(reach < far)
    return found


def _codes(light: NDArray[np.float32]) -> Floats:
    return 255 * srgb(np.clip(light.astype(np.float64), 0, 1))


def _rms(squares: Floats) -> float:
    return float(np.sqrt(squares.mean())) if squares.size else float("nan")


def tables() -> Tables:
    """Return the table of the page."""
    rows, lines = RECORDS.by("scene", SCENES), []
    for scene, row in rows.items():
        cells = [scene, f"{row['4']['all'][0]:.1f}", f"**{row['2']['all'][0]:.1f}**"]
        for name in CLASSES:
            off, share = row["2"][name]
            cells.append(f"{off:.1f}" if off is not None and share >= 0.005 else "–")
        lines.append(cells)
    heads = " | ".join(["scene", "error 4", "error 2", *CLASSES])
    return {(PAGE, "edge-errors"): [*table(heads, lines), "", origin(rows.values())]}


class _Watched(edges.Cells):
    """Cells that can be looked at afterwards."""

    seen: ClassVar[list[edges.Cells]] = []

    def refine(self, *arguments: Any) -> NDArray[np.bool_]:
        self.seen.append(self)
        return super().refine(*arguments)


def picture() -> Any:
    """Draw the cells of an elementary image of Apples over the same image with more pixels."""
    camera, scene = preset("setup1", scale=SCALE), load_scene("apples")
    with patch.object(edges, "Cells", _Watched):
        shot = render(scene, camera, samples="edges", error=ERRORS[0], support=("samples",), workers=1)
    (cells,) = _Watched.seen
    assert shot.samples is not None
    side = camera.ei_pixels[0]
    left, top = LENS[0] * side, LENS[1] * side
    places = (np.arange(ENLARGED) + 0.5) / ENLARGED
    fine = np.empty((side * ENLARGED, side * ENLARGED, 3))
    for i, j in np.ndindex(ENLARGED, ENLARGED):
        L, D = camera.rays(slice(top, top + side), slice(left, left + side), sample=(places[j], places[i]))
        fine[i::ENLARGED, j::ENLARGED] = trace(scene, L, D).radiance.reshape(side, side, 3)
    figure = new_figure(7.5, 7.9)
    axes = figure.subplots()
    axes.imshow(srgb(np.clip(fine, 0, 1)), extent=(0, side, side, 0))
    looks = {DONE: ("tab:green", "mean of corners and centre"), CUT: ("tab:blue", "cut by an edge")}
    looks |= {OPEN: ("tab:red", "set of samples, number of rays")}
    for row in np.flatnonzero(cells.own & (cells.verdicts >= 0)):
        x, y, verdict = int(cells.m[row]) - left, int(cells.n[row]) - top, int(cells.verdicts[row])
        if 0 <= x < side and 0 <= y < side:
            axes.plot([x, x + 1, x + 1, x, x], [y, y, y + 1, y + 1, y], color=looks[verdict][0], linewidth=1.5)
            rays = shot.samples[top + y, left + x]
            axes.text(x + 0.5, y + 0.5, rays, ha="center", va="center", fontsize=7, color="white")
    for color, label in looks.values():
        axes.plot([], [], color=color, linewidth=1.5, label=label)
    axes.set_axis_off()
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


if __name__ == "__main__":
    main()
