"""Ray optics against wave optics: error of pictures by rays and by point-spread models.

    python -m benchmarks run waves [--again all]

A row of pixels under one lens shows a texture of even stripes, 8 pixels wide in the mean. The truth is the wave's
point-spread function, summed over pixels: of a round lens by its angular spectrum, or Airy's closed form where the
field would be too large. The model by rays leaves the texture as it is. The point-spread maps of
`ii_core.waves.spread` are the model of round lenses, the box of rays folded with sinc² that of slits. Errors are PSNR
of linear light.
"""

from __future__ import annotations

import math
import time
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import tidy, write_chart
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, number, origin, table
from ii_core import IICamera, IIPicture
from ii_core.camera.optics import Lenslet
from ii_core.waves.spread import spread_maps, spread_picture
from ii_core.waves.wave import diffraction_limit, lens_spread, model_spread, pixel_kernel
from metrics.plots.rd_chart import COLOURS, MARKERS, new_figure

RECORDS = Records("waves", ("benchmarks.accuracy.waves",))
PIXELS = 16  # under a lens
REACH = 2 * PIXELS  # of a kernel
PITCH, RATIO, WAVELENGTH = 0.0976, 1.8718, 550.0  # of setup1: mm, gap over pitch, nm
WAVELENGTHS = (450.0, 550.0, 650.0)
ENOUGH_DB = 40.0
TEXTURE, PATCH = 4096, 8  # pixels of the texture, and of a stripe in the mean
SHAPES = ("round", "slit")
# Sweeps: values, and label of the axis.
SWEEPS: dict[str, tuple[tuple[float, ...], str]] = {
    "pitch": (tuple(float(x) for x in np.geomspace(0.02, 2.0, 13)), "lens pitch [mm], 16 pixels a lens"),
    "gap": (tuple(float(x) for x in np.geomspace(0.8, 12.8, 9)), "gap over lens pitch"),
    "pixels": ((4.0, 8.0, 16.0, 24.0, 32.0, 48.0, 64.0, 96.0), "pixels a lens"),
    "depth": (tuple(float(x) for x in np.geomspace(3, 3000, 13)), "depth of the scene over the gap"),
}


def main() -> None:
    """Measure, keep, draw, fill the page."""
    asked = command_line(__doc__).parse_args()
    keys = [{"sweep": n, "wavelength_nm": w, "lens": s} for s in SHAPES for n in SWEEPS for w in WAVELENGTHS]
    RECORDS.run(keys, swept, asked.again)
    write_chart(draw(), "waves.png")
    publish(tables())


def swept(sweep: str, wavelength_nm: float, lens: str) -> dict[str, Any]:
    """Return the result of a sweep by its key."""
    return {"points": sweep_points(sweep, wavelength_nm, lens)}


def sweep_points(name: str, wavelength_nm: float, shape: str) -> list[dict[str, float]]:
    """Errors of both models and their cost at each value."""
    points = []
    kernels = round_kernels if shape == "round" else slit_kernels
    for value in SWEEPS[name][0]:
        pitch = value if name == "pitch" else PITCH
        gap = pitch * (value if name == "gap" else RATIO)
        pixel = pitch / (value if name == "pixels" else PIXELS)
        depth = value * gap if name == "depth" else math.inf
        true, model, *seconds = kernels(pitch, gap, pixel, wavelength_nm, depth)
        points.append(
            {
                "value": value, "pixel_over_spread": pixel / (wavelength_nm * 1e-6 * gap / pitch),
                "blur_px": pitch * gap / depth / pixel,
                "rays_db": error_db(np.eye(1, 2 * REACH + 1, REACH)[0], true), "model_db": error_db(model, true),
                "wave_seconds": seconds[0], "model_seconds": seconds[1],
            }
        )  # fmt: skip
    return points


def slit_kernels(pitch: float, gap: float, pixel: float, nm: float, depth: float) -> tuple[Any, Any, float, float]:
    """Light on pixels by the wave and by the model, and the CPU seconds of both, under a slit."""
    started = time.process_time()
    x, intensity = lens_spread(pitch, gap, nm, depth_mm=depth)
    between = time.process_time()
    spread = model_spread(x, pitch, gap, nm, depth_mm=depth)
    done = time.process_time()
    true, model = (pixel_kernel(x, one, pixel, REACH) for one in (intensity, spread))
    return true, model, between - started, done - between


def round_kernels(pitch: float, gap: float, pixel: float, nm: float, depth: float) -> tuple[Any, Any, float, float]:
    """Light on columns of pixels by the wave and by point-spread maps, and the CPU seconds of both; round lenses.

    The seconds of the model are those of one colour of a picture of one lens, maps and kernels included.
    """
    started = time.process_time()
    x, columns = round_wave(pitch, gap, nm, depth, pixel)
    between = time.process_time()
    side = 2 * REACH + 1
    lens = Lenslet(focal_mm=gap, aperture_mm=pitch)
    camera = IICamera(pixels=(side, side), lenses=(1, 1), pixel_pitch_mm=pixel, gap_mm=gap, optics=(lens,))
    light = np.zeros((side, side, 3), np.float32)
    light[REACH, REACH] = 1
    maps = spread_maps(camera, depth + gap, wavelengths_nm=(nm, nm, nm))
    got = spread_picture(IIPicture(light, (1, 1), (side, side), camera), maps).pixels[..., 1].sum(axis=0)
    done = time.process_time()
    return pixel_kernel(x, columns, pixel, REACH), got, between - started, (done - between) / 3


def round_wave(
    pitch: float, gap: float, nm: float, depth: float, pixel: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places, and light summed over columns, of a round lens; of Airy's pattern where a field would be too large."""
    from scipy.signal import resample

    try:
        x, field = lens_spread(pitch, gap, nm, depth_mm=depth, dimensions=2)
    except ValueError:
        if math.isfinite(depth):
            raise
        # rings are far narrower than pixels: a window of 200 of them holds all but 1/300 of the light
        x = np.linspace(-100, 100, 2001) * nm * 1e-6 * gap / pitch
        return x, diffraction_limit(np.hypot(x, x[:, None]), pitch, gap, nm, 2).sum(axis=0)
    rows, places = resample(field.sum(axis=0), 8 * len(x), x)  # it is coarse beside a pixel
    return np.asarray(places), np.asarray(rows)


def error_db(kernel: Any, true: Any) -> float:
    """Return the PSNR of the texture blurred by one kernel against the texture blurred by another."""
    generator = np.random.default_rng(0)
    lengths = generator.geometric(1 / PATCH, TEXTURE)
    texture = np.repeat(generator.random(TEXTURE), lengths)[:TEXTURE]
    off = np.convolve(texture, kernel - true, mode="valid")
    return float(-10 * math.log10(max(float(np.mean(off**2)), 1e-20)))


def draw() -> Any:
    """Draw one panel per sweep: rays as solid lines, the point-spread model as dotted lines."""
    figure = new_figure(8.5, 7.5)
    for axes, (name, (_, across)) in zip(figure.subplots(2, 2).flat, SWEEPS.items(), strict=True):
        for i, wavelength in enumerate(WAVELENGTHS):
            rows = RECORDS.rows(sweep=name, wavelength_nm=wavelength, lens="round")
            points = rows[0]["points"] if rows else []
            x = [p["value"] for p in points]
            for model, line in (("rays", "-"), ("model", ":")):
                y = [p[f"{model}_db"] for p in points]
                what = "rays" if model == "rays" else "point-spread maps"
                label = f"{what}, {wavelength:.0f} nm"
                axes.plot(x, y, line, marker=MARKERS[i], color=COLOURS[i], markersize=4, label=label)
        axes.axhline(ENOUGH_DB, color="0.4", linewidth=1)
        axes.set(xscale="log", xlabel=across, title=name)
        tidy(axes)
    for axes in figure.axes[::2]:
        axes.set_ylabel("PSNR against the wave [dB]")
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False)
    return figure


def tables() -> Tables:
    """Return where each model leaves 40 dB."""
    return {("docs/waves.md", "limits"): limits_table()}


def limits_table() -> list[str]:
    """Return the value at which each model crosses `ENOUGH_DB`, by sweep, at 550 nm, and the pixels there."""
    rows, lines = RECORDS.rows(wavelength_nm=WAVELENGTH, lens="round"), []
    slits = RECORDS.by("sweep", SWEEPS, wavelength_nm=WAVELENGTH, lens="slit")
    for row in rows:
        points, slit = row["points"], slits[row["sweep"]]["points"]
        wave, model = (1e3 * float(np.median([p[f"{k}_seconds"] for p in points])) for k in ("wave", "model"))
        crossed = [crossing(points, f"{k}_db") for k in ("rays", "model")]
        worst, narrow = (min(p["model_db"] for p in one) for one in (points, slit))
        lines.append(
            f"{row['sweep']} | {crossed[0]} | {crossed[1]}, {worst:.1f} dB | "
            f"{crossing(slit, 'rays_db')}, {narrow:.1f} dB | {wave:.0f} ms | {model:.1f} ms"
        )
    heads = "varied | rays: 40 dB at (pixel) | maps: 40 dB, worst | slit: rays at, worst of model | wave | maps"
    return [*table(heads, lines), "", origin(rows)]


def crossing(points: list[dict[str, float]], key: str) -> str:
    """Return the value at which an error crosses `ENOUGH_DB`, by interpolation, with pixel and blur there."""
    for a, b in pairwise(points):
        low, high = number(a[key]), number(b[key])
        if (low - ENOUGH_DB) * (high - ENOUGH_DB) <= 0 and low != high:
            t = (ENOUGH_DB - low) / (high - low)
            value, pixel = (
                math.exp((1 - t) * math.log(a[k]) + t * math.log(b[k])) for k in ("value", "pixel_over_spread")
            )
            return f"{value:.3g} ({pixel:.1f} λΛ/δL)"
    return "always " + ("above" if number(points[0][key]) > ENOUGH_DB else "below")
