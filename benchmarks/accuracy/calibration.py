"""Calibration of lenslet pictures of known cameras: errors of pitch, rotation and centres.

    python -m benchmarks run calibration

A white image is the mean weight of every pixel's rays through a camera with a main lens; the rim of the main lens
bounds the micro-images. Light falls off towards the corners, photons and the sensor add noise, and a given share of
the lenses is dark or saturated. Each row holds worst and median errors of one kind of picture. The row of one large
picture also has CPU time and memory of `calibrate`. Discs on grids in perspective or with radial distortion have rows
by the shift at the border. The last row is a camera behind a main lens of glass, whose pupil moves with the field:
distance of the centres from the light without noise, with and without the drift.

A multi-focus array is rendered before noise at three depths: lens types, their foci, and pictures in focus are
compared with the camera and with the same pixels through pinholes.

    python -m benchmarks run calibration --vesicle FOLDER

measures and draws a picture of a light field microscope instead. The folder is ``src/napari_lf/examples/GUVExperim1``
of github.com/PolarizedLightFieldMicroscopy/napari-LF at commit 289a067.

    python -m benchmarks run calibration --letters FOLDER

measures letters in ``examples/data`` of github.com/cicwi/plenoptomos, whose authors fitted the grid, too.
"""

from __future__ import annotations

import contextlib
import math
import tempfile
import textwrap
import time
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, enlarged, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import ALL, Records, origin, table
from ii_core import (
    IICamera,
    NoLenses,
    calibrate,
    calibrated_picture,
    centres_picture,
    preset,
    resampled,
    sub_images,
)
from ii_core.base.colour import linear
from ii_core.calibration import Calibration
from ii_core.calibration.multi_focus import fused, lens_foci, shifts_of
from ii_core.camera.optics import Lens
from ii_core.formats.lfp import read_raw
from ii_core.picture.picture import IIPicture, codes8
from ii_core.picture.regular import owners
from raytrace_ii import load_scene, render

RECORDS = Records("calibration", ("benchmarks.accuracy.calibration",))
CAMERAS = 125  # cameras per row; four rows of small pictures
DISTORTIONS, BORDER_PITCHES, DISTORTED = ("perspective", "radial"), (0.1, 0.2, 0.5, 1.0, 2.0), 5
DISTORTED_SIZE = (480, 420)
PIXEL_MM = 0.005
# Distance of the main lens, in gaps and sides of the picture: its rim's images shift by a sixth of a pixel towards
# the border. In our camera a pixel's rays pass only the lens over it: larger shifts would cut micro-images.
FAR = 3.0
ELECTRONS, READ_NOISE, OFFSET, FULL = 2000.0, 5.0, 30.0, 2300.0


SHIFTS, FOCUS_PIXEL_MM, FOCUS_GAP_MM = (0.1, 0.2, 0.3), 0.006, 0.4  # of the multi-focus array
THEIR_PITCH = 48.2, 48.2273  # px, of the letters: in the comments of examples/example_04_letters.py


def random_camera(rng: np.random.Generator, size: tuple[int, int], pitch_px: float, hexagonal: bool) -> IICamera:
    """Return a camera behind a main lens, with a rotated and shifted lens array that is larger than its sensor."""
    across = pitch_px
    down = across * rng.uniform(0.92, 1.08) * (math.sqrt(3) / 2 if hexagonal else 1)
    reach = 2 * math.hypot(*size) / 2
    lenses = int(reach / across) + 5, int(reach / down) // 2 * 2 + 6
    gap, far = 4 * across * PIXEL_MM, FAR * max(size)
    nearest = min(across, math.hypot(across / 2, down) if hexagonal else down)
    rim = rng.uniform(0.88, 0.98) * nearest * PIXEL_MM * far
    x, y = rng.uniform(-0.5, 0.5, 2) * PIXEL_MM * across
    return IICamera(
        pixels=size,
        lenses=lenses,
        pixel_pitch_mm=PIXEL_MM,
        gap_mm=gap,
        lens_pitch_mm=(across * PIXEL_MM, down * PIXEL_MM),
        lattice="hexagonal" if hexagonal else "rectangular",
        lens_offset_mm=(float(x), float(y)),
        lens_turn_deg=float(rng.uniform(-3, 3)),
        lens_shear=float(rng.uniform(-0.01, 0.01)),
        optics=("pinhole", Lens(z_mm=gap * (1 + far), focal_mm=gap * far, diameter_mm=rim)),  # type: ignore[arg-type]
    )


def white_image(camera: IICamera, samples: int = 3) -> NDArray[np.float32]:
    """Return the share of light of every pixel before a uniform scene, the mean over samples×samples of its rays."""
    width, height = camera.pixels
    out = np.zeros((height, width), np.float32)
    for top in range(0, height, 256):
        rows = slice(top, min(top + 256, height))
        for i in range(samples):
            for j in range(samples):
                weight = camera.weighted_rays(rows, sample=((j + 0.5) / samples, (i + 0.5) / samples))[2]
                out[rows] += 1 if weight is None else weight
    return out / samples**2


def exposed(
    share: NDArray[np.float32], camera: IICamera, rng: np.random.Generator, bad: float = 0.0
) -> NDArray[np.uint16]:
    """Return a white image as recorded: 40 % fall-off to the corners, noise, and a share ``bad`` of spoilt lenses.

    Half of the spoilt lenses are dark, half get four times the light, which saturates the sensor.
    """
    height, width = share.shape
    x, y = np.linspace(-1, 1, width), np.linspace(-1, 1, height)[:, None]
    light = share * (1 - 0.2 * (x * x + y * y))
    k, l = camera.lens_lattice.nearest(np.arange(width)[None], np.arange(height)[:, None])
    state = rng.random(camera.lenses[::-1])
    brightness = np.where(state < bad / 2, 0.02, np.where(state < bad, 4.0, 1.0))
    electrons = rng.poisson(light * brightness[l, k] * ELECTRONS) + rng.normal(OFFSET, READ_NOISE, share.shape)
    return np.rint(electrons).clip(0, FULL).astype(np.uint16)


def micro_image_centres(camera: IICamera, k: NDArray[Any], l: NDArray[Any]) -> NDArray[np.float64]:
    """Return the image of the centre of the main lens through lenses (k, l), pixels (…, 2)."""
    grown = growth(camera)
    places = camera.lens_lattice.centres(k, l)
    return np.stack([(p - n / 2) * grown + n / 2 for p, n in zip(places, camera.pixels, strict=True)], axis=-1)


def growth(camera: IICamera) -> float:
    """Return the pitch of the images of the main lens over the pitch of the lenses."""
    far = camera.front[0].z_mm - camera.gap_mm
    return 1 + camera.gap_mm / far


def errors(camera: IICamera, found: Calibration) -> dict[str, float]:
    """Return relative errors of pitch, the error of rotation in degrees, and the rms error of centres in pixels."""
    true, lattice = camera.lens_lattice, found.grid.lattice
    pitch = [a / (b * growth(camera)) - 1 for a, b in zip(lattice.pitch, true.pitch, strict=True)]
    k, l = np.meshgrid(np.arange(lattice.lenses[0]), np.arange(lattice.lenses[1]))
    centres = np.stack(lattice.centres(k, l), axis=-1)
    at = np.floor(centres).astype(int)
    nearest = true.nearest(at[..., 0], at[..., 1])
    off = centres - micro_image_centres(camera, *nearest)
    return {
        "pitch": max(map(abs, pitch)),
        "turn_deg": abs(found.grid.turn_deg - camera.lens_turn_deg),
        "centres_px": float(np.sqrt((off**2).sum(axis=-1).mean())),
    }


def trial(seed: int, hexagonal: bool, bad: float, size: tuple[int, int] | None = None) -> dict[str, float]:
    """Return the errors of one random camera: 300–700 px a side if no size is given, 20–60 lenses across."""
    rng = np.random.default_rng((seed, hexagonal, round(100 * bad)))
    pixels = size or (int(rng.integers(300, 701)), int(rng.integers(300, 701)))
    pitch = rng.uniform(max(6, min(pixels) / 60), min(24, min(pixels) / 20)) if size is None else rng.uniform(10, 20)
    camera = random_camera(rng, pixels, pitch, hexagonal)
    image = exposed(white_image(camera, 3 if size is None else 2), camera, rng, bad)
    if size is None:
        return errors(camera, calibrate(image))
    before = time.process_time()
    found = calibrate(image)
    used = {"calibrate_cpu_seconds": time.process_time() - before}
    tracemalloc.start()  # it would count as time of the first run
    calibrate(image)
    used["calibrate_peak_bytes"] = float(tracemalloc.get_traced_memory()[1])
    tracemalloc.stop()
    return errors(camera, found) | used


def distorted(kind: str, border_pitches: float, seed: int) -> dict[str, float]:
    """Return errors of centres of a grid in perspective or with radial distortion, in pixels.

    ``border_pitches`` is the shift at the left or right border off the straight grid of the middle. The lenses are
    discs on a rectangular grid turned by up to 3°; ``straight_px`` is their rms distance from the best straight grid.
    """
    rng = np.random.default_rng((seed, kind == "radial", round(100 * border_pitches)))
    pitch, turn = rng.uniform(10, 16), math.radians(rng.uniform(-3, 3))
    middle, half, shift = np.array(DISTORTED_SIZE) / 2, DISTORTED_SIZE[0] / 2, border_pitches * pitch
    rotation = pitch * np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    start = middle + rng.uniform(-0.5, 0.5, 2) * pitch
    steep = shift / (half - shift) / half  # of a perspective, per pixel

    def bent(places: NDArray[np.float64]) -> NDArray[np.float64]:
        p = places - middle
        if kind == "perspective":
            return p / (1 + steep * p[..., :1]) + middle
        return p * (1 - shift * (p**2).sum(axis=-1, keepdims=True) / half**3) + middle

    def unbent(places: NDArray[np.float64]) -> NDArray[np.float64]:
        p = places - middle
        if kind == "perspective":
            return p / (1 - steep * p[..., :1]) + middle
        for _ in range(25):  # each leaves a third of the error
            p = (places - middle) / (1 - shift * (p**2).sum(axis=-1, keepdims=True) / half**3)
        return p + middle

    def nearest(places: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        index = np.rint((unbent(places) - start) @ np.linalg.inv(rotation))
        return index, bent(index @ rotation + start)

    (width, height), samples = DISTORTED_SIZE, 4
    corners = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    centres = nearest(np.asarray(corners + 0.5, np.float64))[1]
    radius = 0.42 * pitch * (1 - 3 * shift / half)  # discs stay apart where the grid is narrowest
    share = np.zeros((height, width), np.float32)
    for i in range(samples):
        for j in range(samples):
            off = corners + (np.array([i, j]) + 0.5) / samples - centres
            share += np.hypot(off[..., 0], off[..., 1]) < radius
    x, y = np.linspace(-1, 1, width), np.linspace(-1, 1, height)[:, None]
    light = share / samples**2 * (1 - 0.2 * (x * x + y * y))
    image = rng.poisson(light * ELECTRONS) + rng.normal(OFFSET, READ_NOISE, share.shape)
    found = calibrate(np.rint(image).clip(0, FULL).astype(np.uint16))
    k, l = np.meshgrid(*(np.arange(n) for n in found.grid.lattice.lenses))
    got = np.stack(found.grid.lattice.centres(k, l), axis=-1).reshape(-1, 2)
    index, true = nearest(got)
    grid = np.column_stack([np.ones(len(index)), index])
    straight = grid @ np.linalg.lstsq(grid, true, rcond=None)[0]
    off_found, off_straight = (np.sqrt(((places - true) ** 2).sum(axis=1)) for places in (got, straight))
    return {
        "centres_px": float(np.sqrt((off_found**2).mean())),
        "greatest_px": float(off_found.max()),
        "straight_px": float(np.sqrt((off_straight**2).mean())),
        "drift_px": found.grid.drift_px,
    }


def behind_glass(scale: int) -> dict[str, float]:
    """Return rms distances of centres from the light of micro-images behind a double Gauss, in pixels.

    ``followed_px`` is that of the calibrated camera, ``straight_px`` that of the best straight grid, ``drift_px`` the
    greatest shift that the camera has. The stop is at 80 %, so that micro-images lie within their cells.
    """
    camera = preset("plenoptic1-double-gauss", scale=scale)
    lens: Any = camera.optics[2]
    stopped = tuple(replace(s, diameter_mm=0.8 * s.diameter_mm) if s.stop else s for s in lens.surfaces)
    camera = replace(camera, optics=(*camera.optics[:2], replace(lens, surfaces=stopped)))
    white, (across, down), (u, v) = white_image(camera), camera.lenses, camera.ei_pixels
    cells = white.astype(np.float64).reshape(down, v, across, u).transpose(0, 2, 1, 3)
    k, l = np.meshgrid(np.arange(across), np.arange(down))
    x = u * k + np.average(np.broadcast_to(np.arange(u) + 0.5, cells.shape), axis=(2, 3), weights=cells)
    y = v * l + np.average(np.broadcast_to(np.arange(v)[:, None] + 0.5, cells.shape), axis=(2, 3), weights=cells)
    true = np.stack([x, y], axis=-1).reshape(-1, 2)
    found = calibrate(exposed(white, camera, np.random.default_rng(0)))
    got = np.stack(found.grid.lattice.centres(k, l), axis=-1).reshape(-1, 2)
    grid = np.stack([np.ones(k.size), k.ravel(), l.ravel()], axis=1)
    straight = grid @ np.linalg.lstsq(grid, true, rcond=None)[0]
    rms = [float(np.sqrt(((places - true) ** 2).sum(axis=1).mean())) for places in (got, straight)]
    return {"followed_px": rms[0], "straight_px": rms[1], "drift_px": found.grid.drift_px}


SMALL = [
    {"lattice": lattice, "bad": bad, "pixels": "300-700", "cameras": CAMERAS}
    for lattice in ("rectangular", "hexagonal")
    for bad in (0.0, 0.3)
]
LARGE = [{"lattice": "hexagonal", "bad": 0.3, "pixels": "7728x5368", "cameras": 1}]
BENT = [
    {"distortion": kind, "border_pitches": pitches, "cameras": DISTORTED}
    for kind in DISTORTIONS
    for pitches in BORDER_PITCHES
]
GLASS = [{"main_lens": "double-gauss", "scale": 8}]
FOCUS = [{"multi_focus_px": 20}]
KEYS: list[dict[str, Any]] = [*BENT, *GLASS, *SMALL, *LARGE, *FOCUS]
LETTERS = {"picture": "letters_ULF_M1 of plenoptomos"}
VESICLE = {"picture": "GUVExperim1 of napari-LF"}
ENLARGED, DETAIL = 3, (32, 123, 125)  # of the microscope's picture: factor; left, top and side in pixels
GUTTER = 6


class MultiFocus(NamedTuple):
    """Pictures of a hexagonal array of three focal lengths before noise at the three depths in focus."""

    raw: IIPicture
    sharp: IIPicture  # through pinholes
    white: NDArray[np.float64]  # vignetting of micro-images, (N, M)
    shifts: NDArray[np.float64]  # gap over distance of each pixel's point
    inner: NDArray[np.bool_]  # pixels away from borders of lenses and of the picture


def multi_focus_pictures(pitch_px: int, lenses: tuple[int, int], samples: int) -> MultiFocus:
    """Render the pictures; the middle strip of the scene stands at the middle depth."""
    pitch, gap = pitch_px * FOCUS_PIXEL_MM, FOCUS_GAP_MM
    rows = [[gap / (1 + SHIFTS[t]) for t in row] for row in ((0, 1, 2), (2, 0, 1))]
    width, height = (lenses[0] + 1) * pitch_px, int((lenses[1] + 1) * pitch_px * math.sqrt(0.75))
    lenslet: Any = {"kind": "lenslet", "focal_mm": rows, "aperture_mm": 0.9 * pitch}
    camera = IICamera(
        pixels=(width, height), lenses=lenses, pixel_pitch_mm=FOCUS_PIXEL_MM, gap_mm=gap, lattice="hexagonal",
        lens_pitch_mm=(pitch, pitch * math.sqrt(0.75)), optics=(lenslet,),
    )  # fmt: skip
    side = width * FOCUS_PIXEL_MM / 6
    parts = ['ambient = 1.0\nbackground = {horizon = "#808080"}']
    for i, (shift, left, right) in enumerate(zip(SHIFTS, (-9, -side, side), (9, side, 9), strict=True)):
        grain = 4 * FOCUS_PIXEL_MM / shift  # four pixels
        parts.append(
            f'[texture.t{i}]\nkind = "noise"\ncolours = ["#101820", "#f8e0c0"]\nsize = [{grain}, {grain}, {grain}]\n'
            f'contrast = 1.0\noctaves = 2\nseed = {i + 1}\n[material.m{i}]\ntexture = "t{i}"\n[[object]]\n'
            f'name = "o{i}"\nshape = "box"\nsize_mm = [{right - left}, 18, 0.01]\n'
            f'position_mm = [{(left + right) / 2}, 0, {gap + gap / shift + 0.005}]\nmaterial = "m{i}"'
        )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "noise.toml"
        file.write_text("\n".join(parts), encoding="utf-8")
        scene = load_scene(file)
    raw = render(scene, camera, samples=samples, seed=0).picture
    sharp = render(scene, replace(camera, optics=()), samples=max(1, samples // 4), seed=1)
    depth: Any = sharp.depth
    x, y = np.broadcast_arrays(
        *camera.lens_lattice.centres(np.arange(lenses[0])[None], np.arange(lenses[1])[:, None])
    )
    owner = owners(camera.lens_lattice, camera.pixels)
    columns, lines = np.arange(width)[None] + 0.5, np.arange(height)[:, None] + 0.5
    away = np.hypot(columns - x.ravel()[owner], lines - y.ravel()[owner])
    white = 1 / (1 + np.exp((away - 0.46 * pitch_px) / 0.5)) * (owner >= 0) + 0.01
    inside = (abs(columns / width - 0.5) < 0.35) & (abs(lines / height - 0.5) < 0.32)
    inner = (away < 0.4 * pitch_px) & (owner >= 0) & inside
    return MultiFocus(raw, sharp.picture, white, gap / (depth - gap), inner)


def psnr(picture: IIPicture, truth: IIPicture, at: NDArray[np.bool_]) -> float:
    """Return the PSNR of some pixels, dB."""
    return float(-10 * np.log10((((picture.pixels[at] - 1.0 * truth.pixels[at]) / 255) ** 2).mean()))


def multi_focus(pitch_px: int) -> dict[str, Any]:
    """Return errors of what is found in pictures with noise, and PSNR of pictures in focus, dB."""
    shot = multi_focus_pictures(pitch_px, (24, 20), 64)
    rng = np.random.default_rng(0)
    light = linear(shot.raw.pixels / 255) * shot.white[..., None]
    frames = [rng.poisson(3000 * a + 10).astype(np.uint16) for a in (light, shot.white)]
    found = calibrate(frames[0], white=frames[1], gap_mm=FOCUS_GAP_MM, pixel_pitch_mm=FOCUS_PIXEL_MM)
    foci = lens_foci(calibrated_picture(found, frames[0], white=frames[1]), found.types)
    started = time.process_time()
    shifts = shifts_of(shot.raw)
    seconds = time.process_time() - started
    error = np.abs(shifts - shot.shifts)[shot.inner]
    return {
        "pattern": found.types.pattern,
        "explained": found.types.explained,
        "foci_error": None if foci is None else float(np.abs(np.array(foci.shifts) - SHIFTS).max()),
        "shift_error_median": float(np.nanmedian(error)),
        "raw_db": psnr(shot.raw, shot.sharp, shot.inner),
        "fused_db": psnr(fused(shot.raw, shifts=shifts)[0], shot.sharp, shot.inner),
        "match_seconds_a_megapixel": seconds / shifts.size * 1e6,
    }


def main() -> None:
    """Measure, record and fill the page."""
    parser = command_line(__doc__)
    parser.add_argument("--vesicle", type=Path, metavar="FOLDER", help="measure and draw this picture alone")
    parser.add_argument("--letters", type=Path, metavar="FOLDER", help="measure this picture alone")
    asked = parser.parse_args()
    if asked.vesicle is not None:
        RECORDS.run([VESICLE], lambda **_: microscope(asked.vesicle), ALL)
    elif asked.letters is not None:
        RECORDS.run([LETTERS], lambda **_: letters(asked.letters), ALL)
    else:
        RECORDS.run(KEYS, measured, asked.again)
    publish(tables())


def measured(**key: Any) -> dict[str, Any]:
    """Return the number of refused cameras of a row, and worst and median errors of the others."""
    if "main_lens" in key:
        return behind_glass(key["scale"])
    if "multi_focus_px" in key:
        return multi_focus(key["multi_focus_px"])
    found = []
    if "distortion" in key:
        for seed in range(key["cameras"]):
            with contextlib.suppress(NoLenses):
                found.append(distorted(key["distortion"], key["border_pitches"], seed))
    else:
        size: Any = None if "-" in key["pixels"] else tuple(map(int, key["pixels"].split("x")))
        found = [trial(i, key["lattice"] == "hexagonal", key["bad"], size) for i in range(key["cameras"])]
    result: dict[str, Any] = {"refused": key["cameras"] - len(found)}
    for name in found[0] if found else ():
        values = np.array([one[name] for one in found])
        result |= {f"{name}_worst": float(values.max()), f"{name}_median": float(np.median(values))}
    return result


def microscope(folder: Path) -> dict[str, Any]:
    """Return the calibration of the microscope's picture, with and without its white image, and draw it."""
    raw, white, dark = (
        read_raw(folder / f"{name}_GUVExperim1.tif").samples for name in ("Lightfield", "Radiometry", "DarkFrame")
    )
    found, alone = calibrate(raw, white=white, dark=dark), calibrate(raw, dark=dark)
    picture = calibrated_picture(found, raw, white=white, dark=dark)
    left, top, side = DETAIL
    detail = slice(top, top + side), slice(left, left + side)
    grey = np.repeat(codes8((raw / raw.max()).astype(np.float32))[..., None], 3, axis=-1)
    marked = centres_picture(found, picture.with_pixels(grey), zoom=ENLARGED)
    marked = marked[tuple(slice(s.start * ENLARGED, s.stop * ENLARGED) for s in detail)]
    views = sub_images(resampled(picture)[0])
    middle, border = views.shape[0] // 2, 2
    shown = [enlarged(views[middle, u], 8) for u in (views.shape[1] // 2, border, views.shape[1] - 1 - border)]
    page = np.full((marked.shape[0] + GUTTER + shown[0].shape[0], 2 * marked.shape[1] + GUTTER, 3), 255, np.uint8)
    page[: marked.shape[0], : marked.shape[1]] = marked
    page[: marked.shape[0], marked.shape[1] + GUTTER :] = enlarged(picture.pixels[detail], ENLARGED)
    for i, view in enumerate(shown):
        left = i * (page.shape[1] - view.shape[1]) // 2
        page[marked.shape[0] + GUTTER :, left : left + view.shape[1]] = view
    write_picture(IMAGES / "calibration" / "vesicle.png", page)
    shift = np.abs(np.subtract(alone.report()["middle_px"], found.report()["middle_px"]))
    pitch = np.abs(np.subtract(alone.grid.lattice.pitch, found.grid.lattice.pitch))
    return {**found.report(), "alone_shift_px": shift.tolist(), "alone_pitch_px": pitch.tolist()}


def letters(folder: Path) -> dict[str, Any]:
    """Measure the letters: the grid of their white picture."""
    raw, white, dark = (read_raw(folder / f"letters_ULF_M1{end}.png").samples for end in ("", "_white", "_dark"))
    found = calibrate(raw, white=white, dark=dark)
    return {key: found.report()[key] for key in ("lens_pitch_px", "turn_deg", "residual_rms_px", "lenses")}


def tables() -> Tables:
    """Return the table of the page of calibration."""
    rows = [row for row in RECORDS.rows() if any(key.items() <= row.items() for key in KEYS)]
    grids = [row for row in rows if "lattice" in row]
    lines = [
        f"{row['lattice']} | {row['bad']:.0%} | {row['pixels'].replace('-', '–').replace('x', '×')} | "
        f"{row['cameras']} | {row['pitch_worst']:.1e} ({row['pitch_median']:.1e}) | "
        f"{row['turn_deg_worst']:.4f}° ({row['turn_deg_median']:.4f}°) | "
        f"{row['centres_px_worst']:.4f} px ({row['centres_px_median']:.4f} px)"
        for row in grids
    ]
    large = [
        f"The picture of {row['pixels'].replace('x', '×')} px took {row['calibrate_cpu_seconds_worst']:.0f} s of CPU "
        f"time and {row['calibrate_peak_bytes_worst'] / 1e9:.1f} GB at the most."
        for row in grids
        if "calibrate_peak_bytes_worst" in row
    ]
    glass = [
        f"Behind a double Gauss (`plenoptic1-double-gauss`, scale {row['scale']}, its stop at 80 %), centres lie "
        f"{row['straight_px']:.3f} px rms off the best straight grid and {row['followed_px']:.3f} px off the "
        "calibrated one; truth is the light of micro-images without noise."
        for row in rows
        if "main_lens" in row
    ]
    focus = [
        f"Multi-focus: three focal lengths, hexagonal, {row['multi_focus_px']} px a lens, before noise at the three "
        f"depths in focus. Pattern {row['pattern']} explains {row['explained']:.0%} of the variation of detail; foci "
        f"are off by {row['foci_error']:.3f} of shift at the most. Against the same pixels "
        f"through pinholes the picture has {row['raw_db']:.1f} dB, fused {row['fused_db']:.1f} dB. "
        f"Matching takes {row['match_seconds_a_megapixel']:.0f} CPU s a megapixel."
        for row in rows
        if "multi_focus_px" in row
    ]
    theirs = [
        f"Letters of cicwi/plenoptomos, {'×'.join(map(str, row['lenses']))} lenses: "
        f"{row['lens_pitch_px'][0]:.3f}×{row['lens_pitch_px'][1]:.3f} px, turned by {row['turn_deg']:.3f}°, centres "
        f"{row['residual_rms_px']:.3f} px rms off; its authors, without a turn: "
        f"{THEIR_PITCH[0]:.3f}×{THEIR_PITCH[1]:.3f} px."
        for row in RECORDS.rows(**LETTERS)
    ]
    told = [
        line
        for text in (*large, *glass, *focus, *theirs)
        for line in ("", *textwrap.wrap(text, 100, break_on_hyphens=False))
    ]
    heads = "lattice | lenses dark or saturated | pixels a side | cameras | pitch, worst (median) | turn | centres"
    return {
        ("docs/calibration.md", "vesicle"): caption(),
        ("docs/calibration.md", "calibration"): [*table(heads, lines), *told, *bent_table(rows), "", origin(rows)],
    }


def caption() -> list[str]:
    """Return the caption of the microscope's picture, and what its white image brings."""
    (row,) = RECORDS.rows(**VESICLE)
    across, down = row["lens_pitch_px"]
    text = (
        "*A vesicle under a light field microscope. Above: part of the raw picture with centres, and without "
        f"vignetting. Below: views from the middle, left and right. {'×'.join(map(str, row['lenses']))} lenses of "
        f"{across:.3f}×{down:.3f} px, turned by {row['turn_deg']:.3f}°; centres lie {row['residual_rms_px']:.3f} px "
        f"rms off the grid, which drifts by up to {row['drift_px']:.2f} px, and {row['straight_grid_rms_px']:.3f} px "
        "off the best straight grid. Without the white image the pitch moves by "
        f"{max(row['alone_pitch_px']):.3f} px, "
        f"the middle by {' and '.join(f'{v:.1f}' for v in row['alone_shift_px'])} px. Picture: "
        "[napari-LF](https://github.com/PolarizedLightFieldMicroscopy/napari-LF), © 2022 Geneva Schlafly, "
        f"[BSD 3-Clause](images/calibration/LICENSE.txt). {origin([row])}*"
    )
    return textwrap.wrap(text, 100, break_on_hyphens=False, break_long_words=False)


def bent_table(rows: list[dict[str, Any]]) -> list[str]:
    """Return errors of centres by distortion, with a caption."""
    size = "×".join(map(str, DISTORTED_SIZE))
    caption = (
        f"Grids that no straight grid fits: discs on {size} px, lenses of 10–16 px, with the same noise. The shift "
        "is that of the left or right border off the straight grid of the middle. Distances are root mean squares, "
        "worst of the cameras. Where a drift would be steeper than cameras support, `calibrate` refuses the picture."
    )
    lines = []
    for row in rows:
        if "distortion" in row:
            found = row["refused"] < row["cameras"]
            off = [f"{row['centres_px_worst']:.4f} px", f"{row['straight_px_worst']:.2f} px"] if found else ["–", "–"]
            refused = f"{row['refused']} of {row['cameras']}"
            lines.append([row["distortion"], f"{row['border_pitches']:g}", refused, *off])
    heads = "distortion | shift at the border, pitches | cameras refused | centres | best straight grid"
    return ["", *textwrap.wrap(caption, 100, break_on_hyphens=False), "", *table(heads, lines)]
