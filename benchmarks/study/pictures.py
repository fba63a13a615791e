"""Pictures without measurements: component images, other cameras, the five views."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ii_core import (
    IIPicture,
    elementary_images,
    five_viewpoints,
    preset,
    ray_space_images,
    sub_images,
    view_image,
)
from ii_core.base.files import write_image
from raytrace_ii import load_scene, render

from ..pages.pictures import GAP, enlarged, sheet
from .coding import setup3_scale, shot
from .runner import Step

PANEL = (208, 104)  # pixels of a panel of Figure 2.25 and Figure 3.8
USES = ("benchmarks.study.coding", "benchmarks.pages.pictures")
CLOSE = 8  # lenses across a detail of Figure 3.8


def steps(scale: int) -> list[Step]:
    """Return all steps."""
    coarse = {"scale": max(scale, 4)}  # finer lenses are not visible at this size
    small = {"scale": setup3_scale(scale)}
    return [
        Step(name="component-images", shows="Figure 2.25", run=components, parameters=coarse, uses=USES),
        Step(name="other-cameras", shows="Figure 3.8", run=cameras, parameters={"scale": max(scale, 8)}, uses=USES),
        Step(name="five-views", shows="Figure 4.3", run=five_views, parameters=small, uses=USES),
    ]


_KINDS = ("elementary images", "sub-images", "ray-space images")
COMPONENT_LABELS = (*_KINDS, *(f"{kind}, middle 16" for kind in _KINDS))
_CAMERAS = [f"{scene}, {camera}" for scene in ("Objects", "Hairdo") for camera in ("HPO", "GRIN")]
CAMERA_LABELS = [name + part for name in _CAMERAS for part in ("", ", detail")]


def components(folder: Path, *, scale: int) -> dict[str, Any]:
    """Draw *Twins* as elementary, sub- and ray-space images: all of them, and the central 4×4."""
    picture = shot("twins", "setup1", scale).picture
    stacks = {"ei": elementary_images(picture), "si": sub_images(picture), "ri": ray_space_images(picture)}
    whole, close = [], []
    for stack in stacks.values():
        rows, columns = stack.shape[:2]
        top, left = max(rows // 2 - 2, 0), max(columns // 2 - 2, 0)
        whole.append(fitted(laid_out(stack)))
        close.append(fitted(laid_out(stack[top : top + 4, left : left + 4], gap=1)))
    write_image(folder / "component-images.png", sheet([*whole, *close], 3, COMPONENT_LABELS))
    return {"shapes": {kind: list(stack.shape[:4]) for kind, stack in stacks.items()}}


def laid_out(stack: NDArray[np.uint8], gap: int = 0) -> NDArray[np.uint8]:
    """Return component images on a grid with white lines."""
    stack = np.pad(stack, ((0, 0), (0, 0), (0, gap), (0, gap), (0, 0)), constant_values=255)
    rows, columns, height, width, _ = stack.shape
    return np.ascontiguousarray(stack.transpose(0, 2, 1, 3, 4)).reshape(rows * height, columns * width, 3)


def fitted(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image scaled to a panel, averaged where it is reduced."""
    down = pixels.shape[0] > PANEL[1] or pixels.shape[1] > PANEL[0]
    image = Image.fromarray(pixels).resize(PANEL, Image.Resampling.BOX if down else Image.Resampling.NEAREST)
    return np.asarray(image)


def cameras(folder: Path, *, scale: int) -> dict[str, Any]:
    """Draw *Objects* and *Hairdo* through lenticular (HPO) and GRIN lenses: picture and detail."""
    panels = []
    for scene in ("objects", "hairdo"):
        loaded = load_scene(scene)
        for name in ("hpo", "grin"):
            picture = render(loaded, preset(name, scale=scale), samples=4, support=()).picture
            panels += [fitted(picture.pixels), fitted(detail(picture))]
    write_image(folder / "other-cameras.png", sheet(panels, 4, CAMERA_LABELS))
    return {}


def detail(picture: IIPicture) -> NDArray[np.uint8]:
    """Return some lenses in the middle."""
    (u, v), (k, l) = picture.ei_pixels, picture.lenses
    across, down = min(CLOSE, k), max(1, min(CLOSE * u // 2 // v, l))
    left, top = (k - across) // 2 * u, (l - down) // 2 * v
    return picture.pixels[top : top + down * v, left : left + across * u]


def five_views(folder: Path, *, scale: int) -> dict[str, Any]:
    """Draw *Twins* from the five viewpoints, arranged as a cross."""
    picture = shot("twins", "setup3", scale).picture
    assert picture.camera is not None
    views = {
        name: enlarged(view_image(picture, viewpoint)[0], 3)
        for name, viewpoint in five_viewpoints(picture.camera).items()
    }
    blank = np.full_like(views["front"], 255)
    order = (blank, views["up"], blank, views["left"], views["front"], views["right"], blank, views["down"], blank)
    write_image(folder / "five-views.png", sheet(order, 3, ("", "up", "", "left", "front", "right", "", "down", "")))
    return {"gap": GAP, "viewpoints_mm": {n: p.tolist() for n, p in five_viewpoints(picture.camera).items()}}
