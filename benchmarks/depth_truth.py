"""How well depth from focus finds the depth that the renderer knows, and what its errors do to Q_depth.

    python -m benchmarks.depth_truth [--full]

Errors are counted in depth layers over the view pixels that hit something within the 250 layers. They are also told
apart by what is seen: ``edge``, one view pixel or less from a step in depth of more than a fifth; else ``flat``,
without texture to go by (within a pixel of the elementary image luma changes by less than 3 steps of 8 bits); else
``textured``. Scenes are taken at scale 8, with noise, and at scale 2, where ±14 lenses are a quarter as wide.
``--full`` times both methods on a picture of full setup1 size. Numbers go to ``benchmarks/results/depth_truth.json``,
the chart drawn from them beside it.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from codec import decode, encode
from ii_core import IICamera, IIPicture, add_sensor_noise, preset
from ii_core.files import atomic_path, write_json
from metrics import DepthQuality, depth_from_focus, provenance, q_depth
from metrics.chart import COLOURS
from metrics.depth import virtual_camera_pixels
from metrics.focus import METHODS
from raytrace_ii import Background, Body, Light, Material, Scene, load_scene, render
from raytrace_ii.shapes import Plane, Sphere
from raytrace_ii.texture import Image

RESULTS = Path(__file__).parent / "results"
SCALES = (8, 2)
REFERENCE_SCENES = ("apples", "cuboid")
KINDS = ("textured", "flat", "edge")
FEW = 10  # pixels: the PSNR of a layer of fewer is left to chance
BINS = np.geomspace(2.5, 250.5, 25)  # edges, in layers: what the chart pools
BPP = 0.35  # of JPEG 2000, the distortion that Q_depth is asked about


def main() -> None:
    """Print a table, keep it, draw it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true")
    arguments = parser.parse_args()
    at_full_size = full() if arguments.full else None  # first, before anything else has had the memory
    rows, curves = [], []
    for scale in SCALES:
        camera = preset("setup1", scale=scale)
        for name, scene in scenes(camera).items():
            reference = name in REFERENCE_SCENES
            if not reference and scale != SCALES[0]:
                continue
            shot = render(scene, camera, support=("depth",))
            assert shot.depth is not None
            for sigma in (0, 2, 8) if reference and scale == SCALES[0] else (0,):
                picture = add_sensor_noise(shot.picture, sigma, seed=1)
                for method in METHODS:
                    row = {"scene": name, "scale": scale, "noise": sigma, **errors(picture, shot.depth, method)}
                    rows.append(row)
                    print("  ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()))
            if reference:
                curves.append({"scene": name, "scale": scale, **quality(shot.picture, shot.depth)})
    result = {**provenance(), "rows": rows, "q_depth": curves}
    path = RESULTS / "depth_truth.json"
    if at_full_size:
        result["full"] = at_full_size
    elif path.is_file() and "full" in (old := json.loads(path.read_text())):
        result["full"] = old["full"]
    write_json(path, result)
    draw(path, path.with_suffix(".png"))


def scenes(camera: IICamera) -> dict[str, Scene]:
    """Reference scenes, and some made to be easy or impossible."""
    z, white = 20 * camera.gap_mm, (1.0, 1.0, 1.0)
    texels = np.random.default_rng(0).random((100, 100, 3)).astype(np.float32)
    even = Background(horizon=white, zenith=white, nadir=white)

    def wall(texture: Image | None) -> Scene:
        mesh = Plane(shape="plane", size_mm=(200, 200)).mesh()
        vertices = mesh.vertices[:, [0, 2, 1]] + [0, 0, z]
        assert mesh.uv is not None
        uv = np.column_stack([mesh.uv, np.zeros(4)])
        paint = Material(colour=white, texture=texture)
        body = Body(name="wall", vertices=vertices, faces=mesh.faces, material=paint, texture_coordinates=uv)
        return Scene(bodies=(body,), background=even, ambient=(0.9, 0.9, 0.9))

    mesh = Sphere(shape="sphere", radius_mm=12).mesh()
    shiny = Material(colour=(0.1, 0.1, 0.1), mirror=(0.8, 0.8, 0.8), specular=0.5)
    at = mesh.vertices + np.array([0, 0, 30])
    ball = Body(name="ball", vertices=at, faces=mesh.faces, material=shiny, normals=mesh.normals)
    behind = wall(Image(texels))
    sun = Light(kind="directional", vector=(0.5, -0.8, 1.0), colour=(0.8, 0.8, 0.8))
    return {
        "apples": load_scene("apples"),
        "cuboid": load_scene("cuboid"),
        "textured wall": behind,
        "even wall": wall(None),
        "mirror ball": Scene(
            bodies=(ball, *_moved(behind, 60 - z).bodies),
            lights=(sun,),
            background=load_scene("apples").background,
            ambient=(0.4, 0.4, 0.4),
        ),
    }


def _moved(scene: Scene, by: float) -> Scene:
    (body,) = scene.bodies
    moved = replace(body, vertices=np.asarray(body.vertices) + np.array([0, 0, by]))
    return replace(scene, bodies=(moved,))


def errors(picture: IIPicture, depth: NDArray[np.float32], method: str) -> dict[str, Any]:
    """Errors of the estimate in layers."""
    camera = picture.camera
    assert camera is not None
    index = virtual_camera_pixels(camera)
    z = depth[index] / np.float64(camera.gap_mm)
    started = time.perf_counter()
    found = depth_from_focus(picture, method=method)
    seconds = time.perf_counter() - started
    with np.errstate(invalid="ignore"):
        counted = (z >= 0.5) & (z < found.layers_mm.size + 0.5)
    error = np.where(found.layer < 0, np.inf, np.abs(found.layer + 1 - np.floor(z + 0.5)))
    row: dict[str, Any] = {
        "method": method,
        "median_layers": float(np.median(error[counted])),
        "p90_layers": float(np.quantile(error[counted], 0.9, method="higher")),
        "within_one_layer": float((error[counted] <= 1).mean()),
        "without_depth": float((found.layer < 0)[counted].mean()),
        "sure": float((found.confidence[counted] > 0.5).mean()),
        "within_one_layer_where_sure": _share(error[counted & (found.confidence > 0.5)] <= 1),
    }
    kinds = tell_apart(picture.pixels, index, z)
    for i, kind in enumerate(KINDS):
        here = counted & (kinds == i)
        row[f"share_{kind}"] = float(here.sum() / counted.sum())
        row[f"within_one_layer_{kind}"] = _share(error[here] <= 1)
    return {**row, "seconds": seconds}


def _share(right: NDArray[np.bool_]) -> float:
    return float(right.mean()) if right.size else float("nan")


def tell_apart(pixels: NDArray[Any], index: Any, z: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which of KINDS each view pixel is."""
    far = np.where(np.isnan(z), 1e6, z)
    edge = maximum_filter(far, 3) > 1.2 * minimum_filter(far, 3)
    luma = pixels.astype(np.float32) @ np.float32([0.299, 0.587, 0.114])
    flat = (maximum_filter(luma, 3) - minimum_filter(luma, 3))[index] < 3
    return np.where(edge, 2, np.where(flat, 1, 0))


def quality(picture: IIPicture, depth: NDArray[np.float32]) -> dict[str, Any]:
    """Q_depth of a coded picture with true and with estimated depth."""
    decoded = decode(encode(picture, "jpeg2000", bpp=BPP))
    true = q_depth(picture, decoded, depth=depth)
    row: dict[str, Any] = {"layer": [round(float(x), 2) for x in np.sqrt(BINS[1:] * BINS[:-1])], "true": pooled(true)}
    for method in METHODS:
        found = q_depth(picture, decoded, method=method)
        both = (true.counts >= FEW) & (found.counts >= FEW)
        row[method] = pooled(found)
        row[f"{method}_mean_difference_db"] = float(np.abs(true.values - found.values)[both].mean())
        row[f"{method}_layers_compared"] = int(both.sum())
        print(f"Q_depth {method}: {row[f'{method}_mean_difference_db']:.2f} dB off in {both.sum()} layers")
    return row


def pooled(quality: DepthQuality) -> list[float | None]:
    """Q_depth of the layers within each of BINS together, None of fewer than FEW pixels."""
    d = np.arange(1, quality.values.size + 1)
    error = np.where(quality.counts > 0, quality.counts / 10 ** (quality.values / 10), 0.0)
    counts, errors = (np.histogram(d, BINS, weights=w)[0] for w in (quality.counts, error))
    return [
        round(float(10 * np.log10(c / e)), 2) if c >= FEW and e > 0 else None
        for c, e in zip(counts, errors, strict=True)
    ]


def full() -> dict[str, Any]:
    """Time and memory of 250 layers on a picture of full setup1 size, of noise."""
    camera = preset("setup1")
    block = np.random.default_rng(0).integers(0, 256, (256, 512, 3), dtype=np.uint8)
    picture = IIPicture(np.tile(block, (16, 16, 1)), camera.lenses, camera.ei_pixels, camera)
    seconds = {}
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for method in METHODS:
        started = time.perf_counter()
        depth_from_focus(picture, method=method)
        seconds[method] = time.perf_counter() - started
    more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 2**20
    print(f"full setup1, 250 layers: {seconds} s, {more:.2f} GiB more than before")
    return {"seconds": seconds, "gib_more": more}


def draw(source: Path, target: Path) -> None:
    """The chart of what `main` wrote."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    data = json.loads(source.read_text(encoding="utf-8"))
    figure = Figure(figsize=(11, 7), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 2)
    gap = preset("setup1", scale=SCALES[-1]).gap_mm
    styles = {"true": ("0.15", "o"), "dissertation": (COLOURS[1], "s"), "robust": (COLOURS[0], "^")}
    curves = [curve for curve in data["q_depth"] if curve["scale"] == SCALES[-1]]
    for axes, curve in zip(panels[0], curves, strict=True):
        for name, (colour, marker) in styles.items():
            label = "true depth" if name == "true" else f"estimated, {name}"
            values = np.array([np.nan if v is None else v for v in curve[name]], float)
            here = np.isfinite(values)  # a line goes on over bins that hold nothing
            layer = np.array(curve["layer"])[here]
            axes.plot(layer, values[here], marker=marker, color=colour, markersize=5, linewidth=1.4, label=label)
        axes.set_xscale("log")
        axes.set_xticks([5, 10, 20, 50, 100, 200], ["5", "10", "20", "50", "100", "200"])
        axes.minorticks_off()
        axes.set_xlabel(f"depth layer d, at z = d · {gap:.2f} mm, in 24 bins")
        axes.set_ylabel(r"$Q_\mathrm{depth}$ [dB]")
        axes.set_title(f"{curve['scene']}: JPEG 2000 at {BPP} bit/pixel, scale {SCALES[-1]}", loc="left")
        axes.legend(frameon=False, fontsize=9)
    _bars(panels[1, 0], [row for row in data["rows"] if row["scale"] == SCALES[-1]])
    _all(panels[1, 1], [row for row in data["rows"] if row["scale"] == SCALES[0]])
    for axes in panels.flat:
        axes.grid(True, axis="y", color="0.9", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    with atomic_path(target) as temporary:
        figure.savefig(temporary, dpi=130, format=target.suffix[1:])


def _bars(axes: Any, rows: list[dict[str, Any]]) -> None:
    """Where it fails: by what is seen."""
    groups = [(scene, kind) for scene in REFERENCE_SCENES for kind in KINDS]
    labels = []
    for x, (scene, kind) in enumerate(groups):
        for i, method in enumerate(METHODS):
            (row,) = [row for row in rows if row["scene"] == scene and row["method"] == method]
            value = row[f"within_one_layer_{kind}"]
            _bar(axes, x + 0.4 * i - 0.2, value, method, x == 0)
        labels.append(f"{scene}\n{kind}\n{100 * row[f'share_{kind}']:.0f} %")
    axes.set_xticks(range(len(groups)), labels, fontsize=8)
    _finish(axes, f"where it fails, scale {SCALES[-1]} (and how much of the view that is)")


def _all(axes: Any, rows: list[dict[str, Any]]) -> None:
    """Scene by scene, noise by noise."""
    groups = list(dict.fromkeys((row["scene"], row["noise"]) for row in rows))
    for row in rows:
        x = groups.index((row["scene"], row["noise"]))
        _bar(axes, x + 0.4 * METHODS.index(row["method"]) - 0.2, row["within_one_layer"], row["method"], x == 0)
    names = [scene.replace(" ", "\n") + (f"\nσ = {noise}" if noise else "") for scene, noise in groups]
    axes.set_xticks(range(len(groups)), names, fontsize=8)
    _finish(axes, f"all pixels, scale {SCALES[0]}: sensor noise σ, walls, a mirror")


def _bar(axes: Any, x: float, value: float | None, method: str, named: bool) -> None:
    colour = {"dissertation": COLOURS[1], "robust": COLOURS[0]}[method]
    share = 0.0 if value is None else 100 * value
    axes.bar(x, share, 0.38, color=colour, label=method if named else None)
    axes.annotate(f"{share:.0f}", (x, share), ha="center", va="bottom", fontsize=8)


def _finish(axes: Any, title: str) -> None:
    axes.set_ylim(0, 110)
    axes.set_yticks(range(0, 101, 20))
    axes.set_ylabel("right within one layer [%]")
    axes.set_title(title, loc="left")
    axes.legend(frameon=False, fontsize=9)


if __name__ == "__main__":
    main()
