"""Methods of depth: CPU time against error, growth with the size of a field, and fields that others published.

    python -m benchmarks run depth_methods [--published FOLDER] [--scenes cuboid]

*Methods*: the middle of a field of the profile ``jpeg-pleno`` as `estimated_depth` has it, 9×9 views of 256² px.
OpenCV's stereo methods see two views, the middle one and the one four steps to the right, if
``opencv-python-headless`` is installed beside.
*Growth*: parts of the field of cuboid; memory is the peak of what numpy allocates.
*Published*: those of the folders ``antinous`` (4D Light Field Benchmark; chshin10/epinet on GitHub),
``stillLife_lf_3x3`` (the benchmark of 2013; truth in steps of 0.22 px) and ``checker_15cm`` (a chequered plane, by a
Lytro; Vincentqyw/Depth-Estimation-Light-Field) that FOLDER has.
"""

from __future__ import annotations

import importlib
import time
import tracemalloc
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.accuracy.estimated_depth import BORDER, FIELDS, SURE, centres, warm_up
from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, tidy
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import IICamera, IIPicture, add_sensor_noise, camera_pose, disparity_of_depth, estimate_depth, sub_images
from ii_core.base.files import read_image
from ii_core.depth.focus import depth_from_focus
from ii_core.display.figure import COLOURS, MARKERS, new_figure, save
from ii_core.formats.pfm import read_pfm
from metrics.benchmark.profile import profile
from raytrace_ii import load_scene, render

RECORDS = Records("depth_methods", ("benchmarks.accuracy.depth_methods",))
METHODS = ("all views", "all views, range known", "focus, robust", "focus, dissertation", "SGBM", "StereoBM")
PUBLISHED = ("antinous", "stillLife_lf_3x3", "checker_15cm")
PARTS = ((9, 128), (9, 256), (9, 512), (5, 256))  # views and px a side
RANGE = -6.0, 8.0  # of growth
SIDE = 256  # px of the middle of a view in which methods are compared
REACH, FINE = 4, 16  # steps between the two views of OpenCV, and its parts of a pixel
CHART = IMAGES / "depth_methods.svg"


def main() -> None:
    """Measure, keep, draw and print."""
    parser = command_line(__doc__, scenes=("cuboid",))
    parser.add_argument("--published", type=Path, help="folder with the published fields")
    asked = parser.parse_args()
    keys: list[dict[str, Any]] = [
        {"study": "method", "scene": s, "method": m} for s in asked.scenes for m in METHODS if _there(m)
    ]
    keys += [{"study": "growth", "views": views, "side": side} for views, side in PARTS]
    if asked.published:
        keys += [{"study": "published", "field": name} for name in PUBLISHED if (asked.published / name).is_dir()]

    def row(study: str, **key: Any) -> dict[str, Any]:
        if study == "method":
            return method(key["scene"], key["method"])
        return growth(key["views"], key["side"]) if study == "growth" else published(asked.published, key["field"])

    RECORDS.run(keys, row, asked.again)
    save(draw(RECORDS.rows(study="method")), CHART)
    publish(tables())


def _there(name: str) -> bool:
    return name not in METHODS[-2:] or importlib.util.find_spec("cv2") is not None


@lru_cache(maxsize=1)
def field(scene: str) -> tuple[IIPicture, IICamera, np.ndarray]:
    """Return a field of the profile with noise of one code, its camera, and the true disparity of its middle view."""
    defined = next(p for p in profile("jpeg-pleno").pictures if p.scene == scene)
    camera, pose = defined.made_camera(), camera_pose(defined.at_mm)
    shot = render(load_scene(scene), camera, samples=defined.samples, pose=pose)
    return add_sensor_noise(shot.picture, 1.0, 0), camera, centres(scene, camera, pose)


def method(scene: str, name: str) -> dict[str, Any]:
    """Return error and CPU time of a method, compiled before."""
    whole, camera, true = field(scene)
    cut = slice((true.shape[0] - SIDE) // 2, (true.shape[0] + SIDE) // 2)
    true, (u, v) = true[cut, cut], camera.ei_pixels
    camera = replace(camera, pixels=(SIDE * u, SIDE * v), lenses=(SIDE, SIDE))
    picture = IIPicture(of_views(sub_images(whole)[:, :, cut, cut]).pixels, camera.lenses, (u, v), camera)
    ends = float(np.nanmin(true)), float(np.nanmax(true))

    def found(shown: IIPicture) -> np.ndarray:
        if name.startswith("all views"):
            low, high = ends if "known" in name else (None, None)
            return estimate_depth(shown, low=low, high=high).disparity
        if name.startswith("focus"):
            return disparity_of_depth(camera, depth_from_focus(shown, method=name.split(", ")[1]).depth_mm)
        return stereo(shown, name, ends)

    warm_up()
    before = time.process_time()
    disparity = found(picture)
    return {**errors(disparity, true), "cpu": time.process_time() - before}


def errors(disparity: np.ndarray, true: np.ndarray, sure: np.ndarray | None = None) -> dict[str, Any]:
    """Return shares of bad pixels and the median error inside the border."""
    inner = np.zeros(true.shape, bool)
    inner[BORDER:-BORDER, BORDER:-BORDER] = True
    inner &= np.isfinite(true)
    error = np.where(np.isfinite(disparity), np.abs(disparity - true), np.inf)[inner]
    out = {"bad_007": float((error > 0.07).mean()), "bad_02": float((error > 0.2).mean())}
    if sure is not None:
        held = error[sure[inner]]
        out["sure"] = held.size / error.size
        shares = {"bad_where_sure": 0.07, "bad_02_where_sure": 0.2}
        out |= {name: float((held > most).mean()) if held.size else None for name, most in shares.items()}
    return {**out, "median": float(np.median(error))}


def stereo(picture: IIPicture, name: str, ends: tuple[float, float]) -> np.ndarray:
    """Return the disparity of the middle view by a method of OpenCV, from it and a view to the right."""
    cv2 = importlib.import_module("cv2")
    views = sub_images(picture)
    v, u = (side // 2 for side in views.shape[:2])
    pair = [np.ascontiguousarray(views[v, at]) for at in (u, u + REACH)]
    low = int(np.floor(ends[0] * REACH)) - 2
    labels = int(-(-(ends[1] * REACH + 2 - low) // FINE) * FINE)
    if name == "SGBM":
        prices = {"P1": 8 * 3 * 25, "P2": 32 * 3 * 25}  # of OpenCV's example
        matcher = cv2.StereoSGBM_create(low, labels, 5, **prices, mode=cv2.STEREO_SGBM_MODE_HH)
    else:
        matcher = cv2.StereoBM_create(labels, 15)
        matcher.setMinDisparity(low)
        matcher.setTextureThreshold(0)
        pair = [cv2.cvtColor(view, cv2.COLOR_RGB2GRAY) for view in pair]
    matcher.setUniquenessRatio(0)
    found = matcher.compute(*pair).astype(np.float32) / FINE
    return np.where(found < low, np.nan, found / REACH)


def growth(views: int, side: int) -> dict[str, Any]:
    """Return CPU time and peak memory for a part of the field of cuboid."""
    stack = sub_images(field("cuboid")[0])
    first, at = (stack.shape[0] - views) // 2, (stack.shape[2] - side) // 2
    part = stack[first : first + views, first : first + views, at : at + side, at : at + side]
    picture = of_views(np.ascontiguousarray(part))
    warm_up()
    tracemalloc.start()
    before = time.process_time()
    estimate_depth(picture, low=RANGE[0], high=RANGE[1])
    seconds = time.process_time() - before
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return {"cpu": seconds, "memory": peak / picture.pixels.nbytes}


def of_views(stack: np.ndarray) -> IIPicture:
    """Return an II-picture of views (V, U, L, K, 3)."""
    v, u, l, k, _ = stack.shape
    return IIPicture(np.ascontiguousarray(stack.transpose(2, 0, 3, 1, 4)).reshape(l * v, k * u, 3), (k, l), (u, v))


def published(folder: Path, name: str) -> dict[str, Any]:
    """Return errors on a published field; the truth of the plane is one fitted to sure pixels."""

    def views(pattern: str, rows: range, cols: range) -> IIPicture:
        files = [[folder / name / pattern.format(j=j, i=i, n=j * len(cols) + i) for i in cols] for j in rows]
        return of_views(np.stack([[read_image(file)[..., :3] for file in row] for row in files]))

    if name == "antinous":
        picture = views("input_Cam{n:03d}.png", range(9), range(9))
        true = read_pfm(folder / name / "gt_disp_lowres.pfm")
    elif name == "checker_15cm":
        picture = views("view_{i}_{j}.png", range(1, 8), range(1, 8))  # the first number counts columns
    else:
        picture = views("lf/{j:02d}_{i:02d}.png", range(3), range(3))
        words = [float(line.split()[0]) for line in (folder / name / "attributes.dat").read_text().splitlines()[:7]]
        z = np.fromfile(folder / name / "depth.bin", np.float32).reshape(int(words[1]), int(words[0]))
        true = words[4] * words[6] / z - words[5]
    before = time.process_time()
    found = estimate_depth(picture)
    seconds, sure = time.process_time() - before, found.confidence >= SURE
    if name == "checker_15cm":
        y, x = np.mgrid[: sure.shape[0], : sure.shape[1]]
        plane = np.stack([x, y, np.ones_like(x)], axis=-1).astype(float)
        true = plane @ np.linalg.lstsq(plane[sure], found.disparity[sure], rcond=None)[0]
    size = f"{picture.ei_pixels[0]}×{picture.ei_pixels[1]} of {picture.lenses[0]}×{picture.lenses[1]}"
    return {**errors(found.disparity, true, sure), "views": size, "cpu": seconds}


def draw(rows: list[dict[str, Any]]) -> Any:
    """Return the chart: CPU time against bad pixels, a colour a method and a mark a field."""
    figure = new_figure(7.5, 3.6)
    axes = figure.subplots()
    for row in rows:
        axes.plot(
            max(row["cpu"], 0.01), 100 * row["bad_007"], MARKERS[FIELDS.index(row["scene"])],
            color=COLOURS[METHODS.index(row["method"])], markersize=8,
        )  # fmt: skip
    for n, name in enumerate(METHODS):
        axes.plot([], [], "o", color=COLOURS[n], label=name)
    scenes = sorted({row["scene"] for row in rows}, key=FIELDS.index)
    for scene in scenes if len(scenes) > 1 else ():
        axes.plot([], [], MARKERS[FIELDS.index(scene)], color="0.5", label=scene)
    axes.set(xscale="log", xlabel="CPU time, s", ylabel="pixels above 0.07 px, %", ylim=(0, 100))
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    tidy(axes)
    return figure


def tables() -> Tables:
    """Return the tables of the page of depth."""
    rows, page = RECORDS.rows(), "docs/depth.md"
    if not rows:
        return {(page, mark): ["No record yet."] for mark in ("growth", "published")}
    grown = [r for r in rows if r["study"] == "growth"]
    sizes = [
        [f"{r['views']}×{r['views']}", f"{r['side']}×{r['side']}", f"{r['cpu']:.1f}", f"{r['memory']:.1f}"]
        for r in grown
    ]
    theirs = [
        [
            r["field"], r["views"], f"{100 * r['bad_007']:.1f}", f"{100 * r['bad_02']:.1f}", f"{r['median']:.3f}",
            f"{100 * r['sure']:.0f}",
            # records before 2026-11-27 hold NaN where no pixel is sure
            *(f"{100 * r[n]:.1f}" if r["sure"] > 0 else "–" for n in ("bad_where_sure", "bad_02_where_sure")),
            f"{r['cpu']:.0f}",
        ]
        for r in rows if r["study"] == "published"
    ]  # fmt: skip
    heads = (
        "field | views, px | > 0.07 px, % | > 0.2 px | median, px | sure, % | of these > 0.07 px | > 0.2 px | CPU s"
    )
    return {
        (page, "growth"): [*table("views | px | CPU s | memory, fields", sizes), "", origin(grown)],
        (page, "published"): [*table(heads, theirs), "", origin(r for r in rows if r["study"] == "published")],
    }
