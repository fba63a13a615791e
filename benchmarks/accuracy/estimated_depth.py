"""Disparity from all views, and retargeted fields, against the renderer.

    python -m benchmarks run estimated_depth [--scenes apples,cuboid]

*Fields*: the three of the profile ``jpeg-pleno``, 9×9 views of 512² px, with sensor noise of one code; truth is the
disparity of the rays through the middles of the pixels of the middle view. Pixels count 15 px from the border.
*setup1*: eight scenes through ``setup1`` at scale 4, 256 views of 128×64 px; relative errors of depth where luma
varies, those of mirrors and glass apart. *Retargeted*: those pictures to other cameras, against renders through
them; 16 samples a pixel in both.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.ndimage import convolve1d

from benchmarks.accuracy.depth_truth import mirrors_and_glass
from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import (
    IICamera,
    IIPicture,
    add_sensor_noise,
    camera_pose,
    disparity_of_depth,
    estimate_depth,
    preset,
    retarget,
    sub_images,
)
from ii_core.base.colour import linear, srgb
from ii_core.base.files import read_image
from ii_core.depth.all_views import disparity_of_views
from ii_core.depth.focus import depth_from_focus
from metrics import depth_errors, depth_regions
from metrics.benchmark.profile import profile
from raytrace_ii import load_scene, render

RECORDS = Records("estimated_depth", ("benchmarks.accuracy.estimated_depth",))
FIELDS = ("cuboid", "twins", "apples")
SETUP1 = ("apples", "twins", "car", "cuboid", "objects", "dolphin", "hairdo", "mountains")
MOVED = ("apples", "car", "cuboid")
TARGETS = ("upright", "coarse", "double", "quilt")
QUILT = 48  # views across
METHODS = ("views", "robust")
PLACES = ("outlines", "textureless", "dark")
PARTS = ("seen", "filled", "outside")
SURE, BORDER, DARK = 0.9, 15, 40  # DARK in 8-bit codes
FOCUSED = IMAGES / "depth.webp"


def main() -> None:
    """Measure, keep and print."""
    asked = command_line(__doc__, scenes=tuple(dict.fromkeys((*FIELDS, *SETUP1)))).parse_args()
    keys = [{"study": "field", "scene": s, "method": m} for s in FIELDS for m in METHODS if s in asked.scenes]
    keys += [{"study": "setup1", "scene": s} for s in SETUP1 if s in asked.scenes]
    keys += [{"study": "retarget", "scene": s, "target": t} for s in MOVED for t in TARGETS if s in asked.scenes]
    RECORDS.run(keys, row, asked.again)
    if "apples" in asked.scenes:
        write_focused()
    publish(tables())


def write_focused() -> None:
    """Write the picture of the page: *Apples* focused on two planes and everywhere, by the command."""
    with TemporaryDirectory() as folder:
        field, out = Path(folder, "field.png"), Path(folder, "out.png")
        shot_of("apples", preset("setup1", scale=4))[0].save(field)
        seen = []
        for how in ["--at", "25mm"], ["--at", "60mm"], ["--all-in-focus"]:
            command = [sys.executable, "-m", "raytrace_ii.cli", "focus", field, *how, "-o", out, "--force"]
            subprocess.run(command, check=True)
            seen.append(read_image(out)[..., :3].repeat(2, axis=0).repeat(2, axis=1))  # views are small
        gap = np.full((seen[0].shape[0], 16, 3), 255, np.uint8)
        write_picture(FOCUSED, np.hstack([seen[0], gap, seen[1], gap, seen[2]]))


def row(study: str, scene: str, method: str = "", target: str = "") -> dict[str, Any]:
    """Return the results of a key."""
    if study == "field":
        return field_errors(scene, method)
    return setup1_errors(scene) if study == "setup1" else moved(scene, target)


def field_errors(scene: str, method: str) -> dict[str, Any]:
    """Return the errors of a method on a field of the profile."""
    defined = next(p for p in profile("jpeg-pleno").pictures if p.scene == scene)
    camera, pose = defined.made_camera(), camera_pose(defined.at_mm)
    shot = render(load_scene(scene), camera, samples=defined.samples, pose=pose)
    picture = add_sensor_noise(shot.picture, 1.0, 0)
    true = centres(scene, camera, pose)
    warm_up()
    before = time.process_time()
    if method == "views":
        found = estimate_depth(picture)
        disparity, sure = found.disparity, found.confidence >= SURE
    else:
        focus = depth_from_focus(picture, method=method)
        disparity, sure = disparity_of_depth(camera, focus.depth_mm), focus.confidence >= SURE
    seconds = time.process_time() - before
    u, v = camera.ei_pixels
    view = sub_images(picture)[v // 2, u // 2]
    regions = depth_regions(true, view)
    errors = depth_errors(disparity, true, regions=regions, camera=camera)
    inner = np.isfinite(true) & _inner(true.shape)
    bad = ~(np.abs(disparity - true) <= 0.07)
    places = zip(PLACES, (regions["outlines"], regions["textureless"], view.mean(axis=2) < DARK), strict=True)
    return {
        **errors, "cpu": seconds, "sure": float(sure[inner].mean()),
        **{f"of_bad_{name}": float(place[inner & bad].mean()) for name, place in places},
        "sure_where_textured": float(sure[inner & ~regions["textureless"]].mean()),
        "bad_where_sure": float(bad[inner & sure].mean()) if (inner & sure).any() else None,
    }  # fmt: skip


def warm_up() -> None:
    """Load the kernels of `estimate_depth`."""
    noise = np.random.default_rng(0).integers(0, 256, (144, 144, 3), np.uint8)
    estimate_depth(IIPicture(noise, (16, 16), (9, 9)))


def setup1_errors(scene: str) -> dict[str, Any]:
    """Return the errors of depth through setup1 at scale 4."""
    camera = preset("setup1", scale=4)
    picture, true, odd = shot_of(scene, camera)
    warm_up()
    before = time.process_time()
    found = estimate_depth(picture)
    seconds = time.process_time() - before
    (u, v), at = camera.ei_pixels, found.view
    assert found.depth_mm is not None
    z, odd = (part[at[1] :: v, at[0] :: u] for part in (true, odd))
    hit = np.isfinite(z)
    regions = depth_regions(disparity_of_depth(camera, z), sub_images(picture)[at[1], at[0]])
    varied = hit & ~regions["textureless"]
    textured, odd = varied & ~odd, varied & odd
    relative = np.abs(found.depth_mm / z - 1)
    error = np.abs(found.disparity - disparity_of_depth(camera, z))
    sure = found.confidence >= SURE
    return {
        "median_relative": float(np.median(relative[textured])), "median_px": float(np.median(error[textured])),
        "median_relative_odd": float(np.median(relative[odd])) if odd.any() else None,
        "textured": float(textured.mean()), "odd": float(odd.mean()), "sure": float(sure[textured].mean()),
        "within_5_where_sure": float((relative[textured & sure] < 0.05).mean()) if (textured & sure).any() else None,
        "cpu": seconds,
    }  # fmt: skip


def moved(scene: str, target: str) -> dict[str, Any]:
    """Return PSNR of a retargeted picture against a render through the target, with true and estimated depth."""
    camera = preset("setup1", scale=4)
    picture, true, _ = shot_of(scene, camera)
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    other = replace(camera, optics=({"kind": "grin"},)) if target == "upright" else of_double_pitch(camera, target)
    wanted = render(load_scene(scene), other, samples=16, seed=1).picture
    found = estimate_depth(picture)
    known = {
        "true": disparity_of_depth(camera, true).reshape(l, v, k, u).transpose(1, 3, 0, 2),
        "estimated": disparity_of_views(picture, found.disparity, found.view),
    }
    result: dict[str, Any] = {}
    ways = [("true", False), ("estimated", False)] + (
        [("true", True), ("estimated", True)] if target == "double" else []
    )
    for name, refine in ways:
        made = retarget(picture, other, known[name], refine=refine)
        error, mask = made.picture.pixels - wanted.pixels.astype(float), made.mask
        if target == "quilt":  # the middle row of views
            rows = slice(other.ei_pixels[1] // 2, None, other.ei_pixels[1])
            error, mask = error[rows], mask[rows]
        name += "_refined" if refine else ""
        result |= {f"{name}_psnr": psnr(error[mask == 2])} | {
            f"{name}_{part}": float((mask == code).mean()) for part, code in zip(PARTS, (2, 1, 0), strict=True)
        }
        result[f"{name}_filled_psnr"] = psnr(error[mask == 1]) if (mask == 1).any() else None
    if target == "double":
        result["footprint_psnr"] = psnr(of_twice_the_step(wanted) - wanted.pixels)
    return result


def of_double_pitch(camera: IICamera, target: str) -> IICamera:
    """Return the camera with lenses of twice the pitch and the same viewing angle.

    Under a lens are as many pixels of twice the size (``coarse``), twice as many (``double``), or `QUILT`.
    """
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    under = {"coarse": (u, v), "double": (2 * u, 2 * v), "quilt": (QUILT, QUILT)}[target]
    pitch = 2 * u * camera.pixel_pitch_mm / under[0]
    return IICamera(
        pixels=(k // 2 * under[0], l // 2 * under[1]), lenses=(k // 2, l // 2), pixel_pitch_mm=pitch,
        gap_mm=2 * camera.gap_mm,
    )  # fmt: skip


def of_twice_the_step(picture: IIPicture) -> np.ndarray:
    """Return a picture as if each of its pixels took in light of two steps of directions: what the source has."""
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    light = linear(picture.pixels / 255).reshape(l, v, k, u, 3)
    for axis in (1, 3):
        light = convolve1d(light, [0.25, 0.5, 0.25], axis=axis, mode="nearest")
    return 255 * srgb(light.reshape(picture.pixels.shape))


def psnr(error: np.ndarray) -> float:
    """Return dB of an error in codes of 8 bit: infinite without one, NaN of no pixels."""
    with np.errstate(divide="ignore"):
        return float(10 * np.log10(255**2 / np.mean(error**2))) if error.size else np.nan


@lru_cache(maxsize=1)
def shot_of(scene: str, camera: IICamera) -> tuple[IIPicture, np.ndarray, np.ndarray]:
    """Return a render of 16 samples a pixel; of rays through the middles, z and which meet mirrors or glass."""
    made = load_scene(scene)
    centre = render(made, camera, samples=1, support=("depth", "object_id"))
    assert centre.depth is not None
    return render(made, camera, samples=16).picture, centre.depth, np.logical_or(*mirrors_and_glass(made, centre))


def centres(scene: str, camera: IICamera, pose: Any) -> np.ndarray:
    """Return the disparity of the middles of the middle view's pixels.

    A render of several samples a pixel keeps the depth of one of them, somewhere in the pixel and its view: by it,
    12 % of the pixels of cuboid and 17 % of apples are more than 0.07 px from those of the middles.
    """
    depth = render(load_scene(scene), camera, samples=1, pose=pose, support=("depth",)).depth
    assert depth is not None
    u, v = camera.ei_pixels
    return disparity_of_depth(camera, depth[v // 2 :: v, u // 2 :: u])


def _inner(shape: tuple[int, int]) -> np.ndarray:
    inner = np.zeros(shape, bool)
    inner[BORDER:-BORDER, BORDER:-BORDER] = True
    return inner


def tables() -> Tables:
    """Return the tables of the page of depth."""
    page, rows = "docs/depth.md", RECORDS.rows()
    if not rows:
        return {(page, mark): ["No record yet."] for mark in ("fields", "setup1", "retargeted")}
    fields = [r for r in rows if r["study"] == "field"]
    lines = [
        [
            r["scene"], "all views" if r["method"] == "views" else "focus, robust",
            *(f"{r[f'badpix_{t}']:.1f}" for t in ("007", "003", "001")), f"{r['mse_100']:.3g}", f"{r['q_25']:.2f}",
            *(f"{r[f'badpix_007_{p}']:.0f}" for p in ("outlines", "textureless")),
            *(f"{100 * r[f'of_bad_{p}']:.0f}" if f"of_bad_{p}" in r else "–" for p in PLACES),
            f"{100 * r['sure_where_textured']:.0f}" if "sure_where_textured" in r else "–",
            "–" if r["bad_where_sure"] is None else f"{100 * r['bad_where_sure']:.1f}", f"{r['cpu']:.0f}",
        ]
        for r in fields
    ]  # fmt: skip
    heads = (
        "field | method | > 0.07 px, % | > 0.03 | > 0.01 | MSE×100 | Q25 | outlines, % | textureless, % | "
        "of the bad: outlines | textureless | dark | sure where textured, % | bad where sure, % | CPU s"
    )
    small = [r for r in rows if r["study"] == "setup1"]
    places = [
        [
            r["scene"], f"{100 * r['median_relative']:.1f}", f"{r['median_px']:.3f}", f"{100 * r['textured']:.0f}",
            f"{100 * r['sure']:.0f}",
            "–" if r["within_5_where_sure"] is None else f"{100 * r['within_5_where_sure']:.0f}",
            "–" if r["median_relative_odd"] is None else f"{100 * r['median_relative_odd']:.1f}",
            f"{100 * r['odd']:.0f}", f"{r['cpu']:.1f}",
        ]
        for r in small
    ]  # fmt: skip
    turned = [r for r in rows if r["study"] == "retarget"]

    def cell(row: dict[str, Any], name: str) -> str:
        return "–" if row.get(name) is None else f"{row[name]:.1f}"

    pictures = [
        [
            r["scene"], r["target"],
            *(cell(r, f"{n}_psnr") for n in ("true", "true_refined", "footprint", "estimated", "estimated_refined")),
            f"{100 * r['true_filled']:.1f}", cell(r, "true_filled_psnr"), f"{100 * r['estimated_outside']:.1f}",
        ]
        for r in turned
    ]  # fmt: skip
    median = statistics.median(100 * r["median_relative"] for r in small) if small else float("nan")
    return {
        (page, "fields"): [*table(heads, lines), "", *_wrapped(f"Noise of one code. {origin(fields)}")],
        (page, "setup1"): [
            *table(
                "scene | median error of z, % | px | textured, % | sure, % | of these within 5 %, % | "
                "mirrors and glass: error, % | textured, % | CPU s",
                places,
            ),
            "",
            *_wrapped(f"Median of the scenes {median:.1f} %. {origin(small)}"),
        ],
        (page, "retargeted"): [
            *table(
                "scene | target | PSNR with true depth, dB | refined | footprint | estimated | refined | filled, % | "
                "PSNR there | outside, %",
                pictures,
            ),
            "",
            *_wrapped(f"PSNR over seen pixels. {origin(turned)}"),
        ],
    }


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 100, break_on_hyphens=False)
