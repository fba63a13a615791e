"""Depth from focus against the depth of the renderer, and the effect of its errors on Q_depth.

    python -m benchmarks run depth_truth [--scale 2] [--scenes apples,cuboid]

Errors are counted in depth layers, over the view pixels whose hit lies within the 250 layers. Pixels are also
classified; the first class that applies counts: ``clear``, a transmitting body; ``mirror``, a reflecting one;
``edge``, within one view pixel of a step in depth of more than a fifth, where nearby lenses do not see the same
point; ``flat``, without texture (luma changes by less than 3 8-bit steps within a pixel of the elementary image);
else ``textured``. Sensor noise is measured at scale 8, with arrays of 64 lenses across. Numbers go to
``benchmarks/results/depth_truth.jsonl``, the chart drawn from them to ``docs/images/depth_truth.png``.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import tidy, write_chart
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from codec import decode, encode
from ii_core import IIPicture, add_sensor_noise, preset
from ii_core.depth.focus import METHODS
from ii_core.depth.layers import virtual_camera_pixels
from ii_core.display.figure import COLOURS, new_figure
from ii_core.picture.view import camera_of
from metrics import DepthQuality, FocusDepth, depth_from_focus, linear_layers, q_depth
from raytrace_ii import Scene, Shot, load_scene, render

RECORDS = Records("depth_truth", ("benchmarks.accuracy.depth_truth",))
SCALE = 2  # scale on the page
SCENES = ("apples", "twins", "car", "cuboid", "objects", "dolphin", "hairdo", "mountains")
KINDS = ("textured", "flat", "edge", "mirror", "clear")
NOISES = (0, 1, 2, 4, 8)
NOISE_SCALE = 8
SURE = 0.5  # least confidence of a sure estimate
FEW = 10  # pixels: the PSNR of a layer with fewer is random
BINS = np.geomspace(2.5, 250.5, 25)  # edges in layers of the bins that the chart pools
BPP = 0.35  # rate of JPEG 2000, whose distortion Q_depth measures
SHADES = {"dissertation": COLOURS[1], "robust": COLOURS[0], "true": "0.15"}


def main() -> None:
    """Measure, record, print and draw."""
    asked = command_line(__doc__, scale=SCALE, scenes=SCENES).parse_args()
    keys = [
        {"scene": name, "scale": scale, "bpp": BPP} for name in asked.scenes for scale in (NOISE_SCALE, asked.scale)
    ]
    RECORDS.run(keys, lambda scene, scale, bpp: study(scene, scale), asked.again)
    write_chart(draw(data()), "depth_truth.png")
    publish(tables())


def study(name: str, scale: int) -> dict[str, Any]:
    """Return errors of both methods on one picture: for all noises at the scale for noise, else with Q_depth."""
    scene = load_scene(name)
    shot = render(scene, preset("setup1", scale=scale), support=("depth", "object_id"))
    kinds, rows = tell_apart(scene, shot), []
    for noise in NOISES if scale == NOISE_SCALE else (0,):
        found = estimates(add_sensor_noise(shot.picture, noise, seed=1))
        for method, (depth, seconds) in found.items():
            rows.append({"noise": noise, "method": method, **errors(depth, shot, kinds), "cpu_seconds": seconds})
    return {"errors": rows, "q_depth": None if scale == NOISE_SCALE else quality(shot, found)}


def data() -> dict[str, list[dict[str, Any]]]:
    """Return the newest rows of errors and curves of Q_depth, of the scales on the page."""
    kept = [row for row in RECORDS.rows(bpp=BPP) if row["scale"] in (NOISE_SCALE, SCALE)]
    known = ("scene", "scale", "commit")
    return {
        "rows": [{**{k: row[k] for k in known}, **one} for row in kept for one in row["errors"]],
        "q_depth": [{**{k: row[k] for k in known}, **row["q_depth"]} for row in kept if row["q_depth"]],
    }


def tables() -> Tables:
    """Return the table of the records."""
    return {("docs/metrics.md", "depth-truth"): truth_table(data())}


def truth_table(data: dict[str, Any]) -> list[str]:
    """Return a table of both methods without noise: median and range over the scenes at each scale."""
    lines = []
    formats = {"median_layers": ".0f", "within_one_layer": ".0%", "within_10_%": ".0%"}
    for scale in (SCALE, NOISE_SCALE):
        cells = []
        for key, form in formats.items():
            each = [
                [row[key] for row in _only(data["rows"], scale=scale, noise=0, method=method)] for method in METHODS
            ]
            cells.append(" → ".join(f"{np.median(x):{form}} ({min(x):{form}}–{max(x):{form}})" for x in each))
        lines.append([scale, *(cell.replace("%", "") for cell in cells)])
    heads = "scale | median error, layers | within 1 layer, % | within 10 % of the depth, %"
    scenes = len({row["scene"] for row in data["rows"]})
    told = f"Median (range) of {scenes} scenes through `setup1`, the dissertation's method → the robust one."
    return [*table(heads, lines), "", f"{told} {origin(data['rows'])}"]


def estimates(picture: IIPicture) -> dict[str, tuple[FocusDepth, float]]:
    """Depth by each method, and the CPU seconds it took."""
    found = {}
    for method in METHODS:
        started = time.process_time()
        depth = depth_from_focus(picture, method=method, layers_mm=linear_layers(camera_of(picture)))
        found[method] = depth, time.process_time() - started
    return found


def errors(found: FocusDepth, shot: Shot, kinds: NDArray[np.int64]) -> dict[str, Any]:
    """Return errors of the estimate in layers: over all pixels, by kind, and over sure pixels."""
    camera = shot.picture.camera
    assert camera is not None and shot.depth is not None
    z = shot.depth[virtual_camera_pixels(camera)] / np.float64(camera.gap_mm)
    with np.errstate(invalid="ignore"):
        counted = (z >= 0.5) & (z < found.layers_mm.size + 0.5)
    error = np.where(found.layer < 0, np.inf, np.abs(found.layer + 1 - np.floor(z + 0.5)))
    near = np.abs(found.depth_mm / camera.gap_mm - z) < 0.1 * z
    sure = counted & (found.confidence > SURE)
    row: dict[str, Any] = {
        "median_layers": float(np.median(error[counted])),
        "p90_layers": float(np.quantile(error[counted], 0.9, method="higher")),
        "within_one_layer": _share(error[counted] <= 1),
        "within_10_%": _share(near[counted]),
        "too_near": _share((found.layer + 2 < np.floor(z + 0.5))[counted]),
        "without_depth": _share((found.layer < 0)[counted]),
        "sure": float(sure.sum() / counted.sum()),
        "within_10_%_where_sure": _share(near[sure]),
    }
    for i, kind in enumerate(KINDS):
        here = counted & (kinds == i)
        row[f"pixels_{kind}"] = int(here.sum())
        row[f"within_one_layer_{kind}"] = _share(error[here] <= 1)
        row[f"within_10_%_{kind}"] = _share(near[here])
    return row


def _share(right: NDArray[np.bool_]) -> float:
    return float(right.mean()) if right.size else float("nan")


def tell_apart(scene: Scene, shot: Shot) -> NDArray[np.int64]:
    """Return the kind, an index into KINDS, of each view pixel."""
    assert shot.picture.camera is not None and shot.depth is not None and shot.object_id is not None
    index = virtual_camera_pixels(shot.picture.camera)
    z = shot.depth[index]
    far = np.where(np.isnan(z), 1e6, z)
    edge = maximum_filter(far, 3) > 1.2 * minimum_filter(far, 3)
    luma = shot.picture.pixels.astype(np.float32) @ np.float32([0.299, 0.587, 0.114])
    flat = (maximum_filter(luma, 3) - minimum_filter(luma, 3))[index] < 3
    mirror, clear = (part[index] for part in mirrors_and_glass(scene, shot))
    return np.select([clear, mirror, edge, flat], [4, 3, 2, 1], 0)


def mirrors_and_glass(scene: Scene, shot: Shot) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which pixels see a reflecting and a transmitting body."""
    body = {body.name: body.material for body in scene.bodies}
    materials = [body[name] for name in shot.object_names]
    mirror = np.array([max(m.mirror) > 0 for m in materials] + [False])  # the last entry: no hit
    clear = np.array([max(m.transmission) > 0 for m in materials] + [False])
    return mirror[shot.object_id], clear[shot.object_id]


def quality(shot: Shot, found: dict[str, tuple[FocusDepth, float]]) -> dict[str, Any]:
    """Q_depth of a coded picture with true and with estimated depth."""
    picture: IIPicture = shot.picture
    decoded = decode(encode(picture, "jpeg2000", bpp=BPP))
    true = q_depth(picture, decoded, depth=shot.depth, layers_mm=linear_layers(camera_of(picture)))
    at = [round(float(x), 2) for x in np.sqrt(BINS[1:] * BINS[:-1])]
    row: dict[str, Any] = {"layer": at, "true": pooled(true)}
    for method, (depth, _) in found.items():
        row[method] = pooled(q_depth(picture, decoded, depth=depth))
        pairs = [(a, b) for a, b in zip(row["true"], row[method], strict=True) if a is not None and b is not None]
        row[f"{method}_off_db"] = float(np.mean([abs(a - b) for a, b in pairs]))
        row[f"{method}_bins_made_up"] = sum(b is not None for b in row[method]) - len(pairs)
    return row


def pooled(quality: DepthQuality) -> list[float | None]:
    """Return Q_depth pooled over the layers of each of BINS; None for fewer than FEW pixels."""
    d = np.arange(1, quality.values.size + 1)
    error = np.where(quality.counts > 0, quality.counts / 10 ** (quality.values / 10), 0.0)
    counts, errors = (np.histogram(d, BINS, weights=w)[0] for w in (quality.counts, error))
    return [
        round(float(10 * np.log10(c / e)), 2) if c >= FEW and e > 0 else None
        for c, e in zip(counts, errors, strict=True)
    ]


def draw(data: dict[str, Any]) -> Any:
    """Draw Q_depth with true and estimated depth by scene; below, accuracy of depth by kind and noise."""
    figure = new_figure(15, 11)
    upper, lower = figure.subfigures(2, 1, height_ratios=[3, 2])
    panels = upper.subplots(2, 4)
    for axes, curve in zip(panels.flat, data["q_depth"], strict=False):
        for name, marker in (("true", "o"), ("dissertation", "s"), ("robust", "^")):
            values = np.array([np.nan if v is None else v for v in curve[name]], float)
            here = np.isfinite(values)  # the line skips empty bins
            label = "true depth" if name == "true" else f"from focus, {name}"
            layer = np.array(curve["layer"])[here]
            axes.plot(
                layer, values[here], marker=marker, color=SHADES[name], markersize=4, linewidth=1.3, label=label
            )
        axes.set_xscale("log")
        axes.set_xticks([5, 10, 20, 50, 100, 200], ["5", "10", "20", "50", "100", "200"])
        axes.minorticks_off()
        off = ", ".join(f"{curve[f'{method}_off_db']:.1f}" for method in METHODS)
        axes.set_title(f"{curve['scene']}: {off} dB off", loc="left", fontsize=10)
    for axes in panels[:, 0]:
        axes.set_ylabel(r"$Q_\mathrm{depth}$ [dB]")
    for axes in panels[-1]:
        axes.set_xlabel("depth layer d, pooled in 24 bins")
    upper.suptitle(f"JPEG 2000 at {BPP} bit/pixel, scale {data['q_depth'][0]['scale']}", fontsize=11)
    handles, names = panels[0, 0].get_legend_handles_labels()
    upper.legend(handles, names, loc="outside lower right", ncols=3, frameon=False)

    rows = data["rows"]
    fine = [row for row in rows if row["scale"] != NOISE_SCALE] or rows
    by_scene, by_kind, by_noise = lower.subplots(1, 3, width_ratios=[8, 5, 5])
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    _bars(by_scene, scenes, lambda name, method: _only(fine, scene=name, method=method)[0]["p90_layers"])
    by_scene.set_yscale("log")
    by_scene.set_ylabel("90 % of the errors are below [layers]")
    kinds = {f"{kind}\n{_part(fine, kind):.0f} %": kind for kind in KINDS}
    _bars(by_kind, list(kinds), lambda name, method: _pooled(_only(fine, method=method), kinds[name]))
    by_kind.set_ylabel("depth right within 10 % [%]")
    by_kind.set_title("all scenes, by what is seen (share of the views)", loc="left", fontsize=10)
    coarse = [row for row in rows if row["scale"] == NOISE_SCALE]
    _bars(by_noise, list(NOISES), lambda noise, method: 100 * np.mean(
        [row["within_10_%"] for row in _only(coarse, noise=noise, method=method)]))  # fmt: skip
    by_noise.set_xlabel("sensor noise σ [steps of 8 bits]")
    by_noise.set_ylabel("depth right within 10 % [%]")
    by_noise.set_title(f"all scenes, scale {NOISE_SCALE}", loc="left", fontsize=10)
    tidy(*panels.flat, by_scene, by_kind, by_noise, axis="y")
    return figure


def _bars(axes: Any, groups: list[Any], value: Any) -> None:
    for i, method in enumerate(METHODS):
        heights = [value(group, method) for group in groups]
        bars = axes.bar(np.arange(len(groups)) + 0.4 * i - 0.2, heights, 0.38, color=SHADES[method], label=method)
        axes.bar_label(bars, [f"{height:.0f}" for height in heights], fontsize=8)
    axes.set_xticks(range(len(groups)), groups, fontsize=9)


def _only(rows: list[dict[str, Any]], **wanted: Any) -> list[dict[str, Any]]:
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def _part(rows: list[dict[str, Any]], kind: str) -> float:
    """Percent of all view pixels that are of a kind."""
    return 100 * sum(row[f"pixels_{kind}"] for row in rows) / sum(row[f"pixels_{k}"] for row in rows for k in KINDS)


def _pooled(rows: list[dict[str, Any]], kind: str) -> float:
    """Percent right of all pixels of a kind."""
    held = [row for row in rows if row[f"pixels_{kind}"]]
    right = sum(row[f"pixels_{kind}"] * row[f"within_10_%_{kind}"] for row in held)
    return 100 * right / max(sum(row[f"pixels_{kind}"] for row in held), 1)
