"""Pictures of docs/concepts.md: the parts of an II-picture, from one small render.

    python -m benchmarks run concepts

*Apples* through ``setup1`` with a quarter of its lenses each way; a few seconds on two cores.
"""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from benchmarks.pages.pictures import write_picture
from benchmarks.records import ROOT
from codec.order import ORDERS, selection_order
from ii_core import (
    IICamera,
    IIPicture,
    elementary_images,
    five_viewpoints,
    preset,
    ray_space_images,
    sub_images,
    view_image,
)
from raytrace_ii import load_scene, render

from .cameras import as_colour

FOLDER = ROOT / "docs" / "images" / "concepts"
CORNER = (76, 32)  # upper left lens (k, l) of the detail shown: an apple's edge
SHOWN = (6, 3)  # lenses across and down in the detail
INK = "#d81b60"


def main() -> None:
    """Render once and draw all pictures."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    camera = preset("setup1", scale=4)
    picture = render(load_scene("apples"), camera, support=()).picture
    save("rays", draw_rays(camera))
    save("maps", draw_maps(camera))
    save("pixels", draw_pixels(picture))
    save("components", draw_components(picture))
    save("views", draw_views(picture))
    save("sequence", draw_sequence(picture))


def save(name: str, figure: Any) -> None:
    """Write a picture and print its path."""
    figure.savefig(FOLDER / f"{name}.png", dpi=110, bbox_inches="tight", facecolor="white")
    plt.close(figure)
    write_picture(FOLDER / f"{name}.png", FOLDER / f"{name}.png")
    print(FOLDER / f"{name}.png", flush=True)


def panels(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, list[Axes]]:
    """Return a figure of empty panels."""
    figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False)
    for axis in axes.flat:
        axis.set_axis_off()
    return figure, list(axes.flat)


def show(axis: Axes, pixels: NDArray[Any], title: str) -> None:
    """Draw pixels as squares under a title."""
    axis.imshow(pixels, interpolation="nearest")
    axis.set_title(title, fontsize=9)


def draw_rays(camera: IICamera) -> Any:
    """Draw a section through three lenses of the camera: pixels, lens plane and the rays of L and D."""
    u, v = camera.ei_pixels
    k = camera.lenses[0] // 2 - 1
    columns = slice(int(k * u), int((k + 3) * u))
    row = slice(int(v) * (camera.lenses[1] // 2), int(v) * (camera.lenses[1] // 2) + 1)
    L, D = (a[0] for a in camera.rays(rows=row, cols=columns))
    figure, axis = plt.subplots(figsize=(7.5, 3.6), layout="constrained")
    pitch, gap = camera.pixel_pitch_mm, camera.gap_mm
    colours = plt.get_cmap("viridis")(np.linspace(0, 0.9, int(u)))
    for i, (start, way) in enumerate(zip(L, D, strict=True)):
        x = (columns.start + i + 0.5) * pitch - camera.pixels[0] * pitch / 2
        colour = colours[i % int(u)]
        axis.plot([0, start[2]], [x, start[0]], color=colour, lw=0.6, ls=":")
        end = start + way * (1.6 * gap / way[2])
        axis.annotate("", end[[2, 0]], start[[2, 0]], arrowprops={"arrowstyle": "->", "color": colour, "lw": 0.8})
        axis.add_patch(Rectangle((-0.03 * gap, x - pitch / 2), 0.03 * gap, pitch, color=colour))
    for lens in range(3):
        centre = L[int(lens * u)]
        axis.plot(centre[2], centre[0], "o", color=INK, ms=5, zorder=3)
    axis.axvline(gap, color="grey", lw=0.8)
    axis.set(xlabel="z, mm", ylabel="x, mm", xlim=(-0.1 * gap, 2.7 * gap))
    axis.text(gap, axis.get_ylim()[1], " lens plane, z = Λ", va="top", fontsize=9)
    axis.text(0, axis.get_ylim()[1], " pixels, z = 0", va="top", fontsize=9)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
    return figure


def draw_maps(camera: IICamera) -> Any:
    """Draw L and D of the detail as pictures."""
    (k, l), (across, down) = CORNER, SHOWN
    u, v = (int(n) for n in camera.ei_pixels)
    block = {"rows": slice(l * v, (l + down) * v), "cols": slice(k * u, (k + across) * u)}
    L, D = camera.rays(**block)
    D = D / np.linalg.norm(D, axis=-1, keepdims=True)
    every = np.ones(L.shape[:2], bool)
    figure, axes = panels(1, 2, (7.5, 2.2))
    show(axes[0], as_colour(L, every), "L: where each pixel's ray starts")
    show(axes[1], as_colour(D, every), "D: where it goes")
    return figure


def draw_pixels(picture: IIPicture) -> Any:
    """Draw the pixels of a detail that belong to one EI, one SI and one RI."""
    (k, l), (across, down) = CORNER, SHOWN
    u, v = picture.ei_pixels
    detail = picture.pixels[l * v : (l + down) * v, k * u : (k + across) * u]
    masks = np.zeros((3, *detail.shape[:2]), bool)
    masks[0, v : 2 * v, 2 * u : 3 * u] = True
    masks[1, v // 2 :: v, u // 2 :: u] = True
    masks[2, v + v // 2] = True
    titles = ("elementary image: all under one lens", "sub-image: one under each lens", "ray-space image: one row")
    figure, axes = panels(2, 2, (9, 5))
    show(axes[0], detail, f"II-picture: {across}×{down} lenses")
    for axis, mask, title in zip(axes[1:], masks, titles, strict=True):
        show(axis, np.where(mask[..., None], detail, 255 - (255 - detail) // 5), title)
    for axis in axes:
        grid(axis, detail.shape[:2], (u, v))
    return figure


def grid(axis: Axes, size: tuple[int, ...], cell: tuple[int, int]) -> None:
    """Draw lines between elementary images."""
    for x in range(0, size[1] + 1, cell[0]):
        axis.axvline(x - 0.5, color="black", lw=0.4)
    for y in range(0, size[0] + 1, cell[1]):
        axis.axhline(y - 0.5, color="black", lw=0.4)


def draw_components(picture: IIPicture) -> Any:
    """Draw one component image of each kind, and its neighbour."""
    (K, L), (U, V) = picture.lenses, picture.ei_pixels
    k, l = CORNER
    ei, si, ri = elementary_images(picture), sub_images(picture), ray_space_images(picture)
    figure, axes = plt.subplots(
        2, 3, figsize=(11, 6.5), layout="constrained", gridspec_kw={"width_ratios": [1, 2.2, 1]}
    )
    for axis in axes.flat:
        axis.set_axis_off()
    for i in (0, 1):
        show(axes[i, 0], ei[l + 1, k + 2 + i], f"EI {k + 2 + i}, {l + 1}: {U}×{V} px")
        show(axes[i, 1], si[V // 2, U // 2 + i], f"SI {U // 2 + i}, {V // 2}: {K}×{L} px")
        show(axes[i, 2], ri[V // 2 + i, l + 1], f"RI {V // 2 + i}, {l + 1}: {U}×{K} px")
        axes[i, 2].set_aspect("auto")
    return figure


def draw_views(picture: IIPicture) -> Any:
    """Draw views from the left, the front and the right."""
    assert picture.camera is not None
    eyes = five_viewpoints(picture.camera)
    figure, axes = panels(1, 3, (12, 2.4))
    for axis, name in zip(axes, ("left", "front", "right"), strict=True):
        seen, _ = view_image(picture, eyes[name])
        x, _, z = eyes[name]
        show(axis, seen, f"{name}: viewer at x = {x:.0f} mm, z = {z:.0f} mm".replace("-", "−"))
    return figure


def draw_sequence(picture: IIPicture) -> Any:
    """Draw the orders of sub-images as frames, and some frames of the parallel order."""
    V, U = picture.ei_pixels[1], picture.ei_pixels[0]
    frames = sub_images(picture).reshape(V * U, *picture.lenses[::-1], 3)
    figure = plt.figure(figsize=(11, 4.2), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[1, 0.62])
    for axis, order in zip(upper.subplots(1, len(ORDERS)), ORDERS, strict=True):
        path = selection_order(order, 8, 8)
        axis.plot(path % 8, path // 8, "-", color="grey", lw=1)
        axis.scatter(path % 8, path // 8, c=np.arange(64), s=18, zorder=2)
        axis.set(aspect="equal", ylim=(7.6, -0.6), xlim=(-0.6, 7.6), title=order)
        axis.set_axis_off()
    chosen = selection_order("parallel", V, U)[::51][:6]
    for axis, (j, index) in zip(lower.subplots(1, 6), enumerate(chosen), strict=True):
        show(axis, frames[index], f"frame {51 * j}: SI {index % U}, {index // U}")
        axis.set_axis_off()
    return figure
