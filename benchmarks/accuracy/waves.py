"""Ray optics against wave optics: error of pictures by rays and by a point-spread model.

    python -m benchmarks run waves

A row of pixels under one slit lens shows a texture of uniform patches with a mean length of 8 pixels. The truth is
the wave's point-spread function, summed over pixels. The ray model does not change the texture, the point-spread
model convolves the geometric blur with sinc². Errors are PSNR of linear light. The last rows blur *Apples* and
*Cuboid* like the lenses of full setup1, and code them.
"""

from __future__ import annotations

import math
import time
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, number, origin
from codec import decode, encode
from ii_core import preset
from ii_core.wave import lens_blurred, lens_spread, model_spread, pixel_kernel
from metrics import q_global, q_view
from metrics.plots.rd_chart import COLOURS, MARKERS, new_figure, save
from raytrace_ii import load_scene, render

RECORDS = Records("waves", ("benchmarks.accuracy.waves",))
PIXELS = 16  # per lens
PITCH, RATIO, WAVELENGTH = 0.0976, 1.8718, 550.0  # of setup1: mm, gap over pitch, nm
WAVELENGTHS = (450.0, 550.0, 650.0)
ENOUGH_DB = 40.0
SCENES, SCALE, RATES = ("apples", "cuboid"), 8, (0.1, 0.2, 0.4, 0.8)
TEXTURE, PATCH = 4096, 8  # lengths in pixels of the texture, and of a patch in the mean
# Sweeps: values, and label of the axis.
SWEEPS: dict[str, tuple[tuple[float, ...], str]] = {
    "pitch": (tuple(float(x) for x in np.geomspace(0.02, 2.0, 13)), "lens pitch [mm], 16 pixels a lens"),
    "gap": (tuple(float(x) for x in np.geomspace(0.8, 12.8, 9)), "gap over lens pitch"),
    "pixels": ((4.0, 8.0, 16.0, 24.0, 32.0, 48.0, 64.0, 96.0), "pixels a lens"),
    "depth": (tuple(float(x) for x in np.geomspace(3, 3000, 13)), "depth of the scene over the gap"),
}


def main() -> None:
    """Measure, record, draw, fill the page."""
    asked = command_line(__doc__).parse_args()
    keys = [{"sweep": name, "wavelength_nm": wavelength} for name in SWEEPS for wavelength in WAVELENGTHS]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda key=key: {"points": sweep(key["sweep"], key["wavelength_nm"])})
    for key in RECORDS.todo(({"scene": name, "scale": SCALE} for name in SCENES), asked.again):
        RECORDS.measure(key, lambda key=key: blurred(key["scene"], key["scale"]))
    path = IMAGES / "waves.png"
    save(draw(), path)
    write_picture(path, path)
    publish(tables())


def sweep(name: str, wavelength_nm: float) -> list[dict[str, float]]:
    """Return errors and cost of both models at each value."""
    points = []
    for value in SWEEPS[name][0]:
        pitch = value if name == "pitch" else PITCH
        gap = pitch * (value if name == "gap" else RATIO)
        pixel = pitch / (value if name == "pixels" else PIXELS)
        depth = value * gap if name == "depth" else math.inf
        started = time.process_time()
        x, intensity = lens_spread(pitch, gap, wavelength_nm, depth_mm=depth)
        between = time.process_time()
        spread = model_spread(x, pitch, gap, wavelength_nm, depth_mm=depth)
        done = time.process_time()
        reach = 2 * PIXELS
        true, model = (pixel_kernel(x, one, pixel, reach) for one in (intensity, spread))
        points.append(
            {
                "value": value,
                "pixel_over_spread": pixel / (wavelength_nm * 1e-6 * gap / pitch),
                "blur_px": pitch * gap / depth / pixel,
                "rays_db": error_db(np.eye(1, 2 * reach + 1, reach)[0], true),
                "model_db": error_db(model, true),
                "wave_seconds": between - started,
                "model_seconds": done - between,
            }
        )
    return points


def error_db(kernel: Any, true: Any) -> float:
    """Return the PSNR of the texture blurred by one kernel against the texture blurred by another."""
    generator = np.random.default_rng(0)
    lengths = generator.geometric(1 / PATCH, TEXTURE)
    texture = np.repeat(generator.random(TEXTURE), lengths)[:TEXTURE]
    off = np.convolve(texture, kernel - true, mode="valid")
    return float(-10 * math.log10(max(float(np.mean(off**2)), 1e-20)))


def blurred(scene: str, scale: int) -> dict[str, Any]:
    """Return the effect of diffraction at full setup1 on a picture: error, views, coding gain of SI-PVS."""
    sharp = render(load_scene(scene), preset("setup1", scale=scale), samples=4, noise=1.0, support=()).picture
    soft = lens_blurred(sharp, preset("setup1"))
    found = {"psnr": q_global(sharp, soft), "q_view": q_view(sharp, soft).mean}
    for name, picture in (("rays", sharp), ("waves", soft)):
        gains = []
        for rate in RATES:
            ours, theirs = (
                q_global(picture, decode(encode(picture, scheme, bpp=rate))) for scheme in ("si-h264", "jpeg2000")
            )
            gains.append(ours - theirs)
        found[f"gain_{name}"] = float(np.mean(gains))
    return found


def draw() -> Any:
    """Draw one panel per sweep: rays as solid lines, the point-spread model as dotted lines."""
    figure = new_figure(8.5, 7.5)
    for axes, (name, (_, label)) in zip(figure.subplots(2, 2).flat, SWEEPS.items(), strict=True):
        for i, wavelength in enumerate(WAVELENGTHS):
            rows = RECORDS.rows(sweep=name, wavelength_nm=wavelength)
            points = rows[0]["points"] if rows else []
            x = [p["value"] for p in points]
            for model, line in (("rays", "-"), ("model", ":")):
                y = [p[f"{model}_db"] for p in points]
                what = "rays" if model == "rays" else "rays and point-spread model"
                axes.plot(
                    x,
                    y,
                    line,
                    marker=MARKERS[i],
                    color=COLOURS[i],
                    markersize=4,
                    label=f"{what}, {wavelength:.0f} nm",
                )
        axes.axhline(ENOUGH_DB, color="0.4", linewidth=1)
        axes.set(xscale="log", xlabel=label, title=name)
        axes.grid(True, color="0.92", linewidth=0.8)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in figure.axes[::2]:
        axes.set_ylabel("PSNR against the wave [dB]")
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False)
    return figure


def tables() -> Tables:
    """Return the tables of the limits of each model at 40 dB, and of the effect on setup1."""
    return {("docs/waves.md", "limits"): limits_table(), ("docs/waves.md", "setup1"): setup1_table()}


def limits_table() -> list[str]:
    """Return the value at which each model crosses `ENOUGH_DB`, by sweep, at 550 nm, and the pixels there."""
    rows = [row for row in RECORDS.rows(wavelength_nm=WAVELENGTH) if "sweep" in row]
    lines = [
        "| varied | rays: 40 dB at | model: 40 dB at | worst of the model | wave | model |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        points = row["points"]
        wave, model = (1e3 * float(np.median([p[f"{k}_seconds"] for p in points])) for k in ("wave", "model"))
        crossed = [crossing(points, f"{k}_db") for k in ("rays", "model")]
        worst = min(p["model_db"] for p in points)
        lines.append(
            f"| {row['sweep']} | {crossed[0]} | {crossed[1]} | {worst:.1f} dB | {wave:.1f} ms | {model:.1f} ms |"
        )
    return [*lines, "", origin(rows)]


def crossing(points: list[dict[str, float]], key: str) -> str:
    """Return the value at which an error crosses `ENOUGH_DB`, by interpolation, with pixel and blur there."""
    for a, b in pairwise(points):
        low, high = number(a[key]), number(b[key])
        if (low - ENOUGH_DB) * (high - ENOUGH_DB) <= 0 and low != high:
            t = (ENOUGH_DB - low) / (high - low)
            value, pixel = (
                math.exp((1 - t) * math.log(a[k]) + t * math.log(b[k])) for k in ("value", "pixel_over_spread")
            )
            return f"{value:.3g} (pixel of {pixel:.1f} λΛ/δL)"
    return "nowhere: always " + ("above" if number(points[0][key]) > ENOUGH_DB else "below")


def setup1_table() -> list[str]:
    """Return a table of the error by diffraction, and of the coding gain with and without it."""
    rows = [row for row in RECORDS.rows(scale=SCALE) if "scene" in row]
    lines = ["| scene | PSNR | Q_view | gain of SI-PVS, rays | gain, waves |", "|---|---|---|---|---|"] + [
        f"| {row['scene']} | {row['psnr']:.1f} dB | {row['q_view']:.4f} | {row['gain_rays']:+.2f} dB | "
        f"{row['gain_waves']:+.2f} dB |"
        for row in rows
    ]
    return [*lines, "", origin(rows)]


if __name__ == "__main__":
    main()
