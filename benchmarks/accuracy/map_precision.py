"""Cameras stored as pictures: errors of L, D and the rendered picture against bytes.

    python -m benchmarks run map_precision [--scale 4]

For each format the largest and the root mean square angle between stored and true direction (µrad), the same for
locations (µm), and the PSNR of *Apples* and *Cuboid* rendered from the maps against float maps. Numbers and chart go
to ``benchmarks/results/map_precision.jsonl`` and ``docs/images/map_precision.png``.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.records import Records, number
from ii_core import IICamera, preset, read_maps, write_maps
from ii_core.camera.maps import FORMATS
from metrics import q_global
from raytrace_ii import load_scene, render

RECORDS = Records("map_precision", ("benchmarks.accuracy.map_precision",))
SCALE = 4  # scale on the pages
SCENES = ("apples", "cuboid")
CAMERAS = ("setup1", "setup3", "spherical")


def main() -> None:
    """Measure, print, keep and draw."""
    asked = command_line(__doc__, scale=SCALE, cameras=CAMERAS).parse_args()
    scenes = {name: load_scene(name) for name in SCENES}
    for name in asked.cameras:
        keys = RECORDS.todo(
            ({"scale": asked.scale, "camera": name, "format": format} for format in FORMATS), asked.again
        )
        if not keys:
            continue
        camera = preset(name, scale=asked.scale)
        exact = {
            scene: render(loaded, stored(camera, "exr")[0], support=()).picture for scene, loaded in scenes.items()
        }
        for key in keys:

            def row(format: str = key["format"], camera: IICamera = camera, exact: Any = exact) -> dict[str, Any]:
                maps, size = stored(camera, format)
                psnr = {
                    f"psnr_{scene}": q_global(exact[scene], render(loaded, maps, support=()).picture)
                    for scene, loaded in scenes.items()
                }
                return {"bytes_per_pixel": size / camera.pixels[0] / camera.pixels[1], **errors(camera, maps), **psnr}

            RECORDS.measure(key, row)
    for line in RECORDS.rows(scale=asked.scale):
        print("  ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in line.items()))
    chart(RECORDS.rows(scale=SCALE), IMAGES / "map_precision.png")


def stored(camera: IICamera, format: str) -> tuple[Any, int]:
    """Return the camera loaded from stored maps, and the bytes of the two images."""
    with tempfile.TemporaryDirectory() as folder:
        write_maps([camera], folder, format=format)
        size = sum(path.stat().st_size for path in Path(folder).iterdir() if path.suffix != ".json")
        return read_maps(folder)[0], size


def errors(camera: IICamera, maps: Any) -> dict[str, float]:
    """Angle and location errors over all rays that carry light."""
    L, D, weight = camera.weighted_rays()
    l, d, _ = maps.stored_rays(0)
    on = np.ones(L.shape[:2], bool) if weight is None else weight > 0
    D, d = (x[on] / np.linalg.norm(x[on], axis=-1, keepdims=True) for x in (D, d))
    angle = np.linalg.norm(np.cross(D, d), axis=-1)  # its sine, which is the angle at this size
    place = np.linalg.norm((L - l)[on], axis=-1)
    return {
        "angle_max_urad": float(angle.max() * 1e6),
        "angle_rms_urad": float(np.sqrt((angle**2).mean()) * 1e6),
        "place_max_um": float(place.max() * 1e3),
        "place_rms_um": float(np.sqrt((place**2).mean()) * 1e3),
    }


def chart(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw PSNR over bytes: one marker per format, one colour per camera."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.5), layout="constrained")
    markers = dict(zip(FORMATS, "osD^", strict=True))
    colours = dict(zip(CAMERAS, ("#0072B2", "#D55E00", "#009E73"), strict=True))
    for axes, scene in zip(figure.subplots(1, 2, sharey=True), SCENES, strict=True):
        for row in rows:
            if not np.isfinite(number(row[f"psnr_{scene}"])):
                continue  # the float maps are the reference
            axes.plot(
                row["bytes_per_pixel"], row[f"psnr_{scene}"], markers[row["format"]], color=colours[row["camera"]],
                markersize=8,
            )  # fmt: skip
        axes.set_title(scene)
        axes.set_xlabel("bytes per ray, as stored")
        axes.grid(True, color="0.9")
        axes.set_xscale("log")
    axes = figure.axes[0]
    axes.set_ylabel("PSNR against float maps [dB]")
    for format in FORMATS:
        if format != "exr":
            axes.plot([], [], markers[format], color="0.4", label=format)
    for name in CAMERAS:
        axes.plot([], [], "s", color=colours[name], label=name)
    axes.legend(fontsize="small")
    figure.savefig(path, dpi=120)
    write_picture(path, path)
