"""Contact sheet of a set of scenes: 2-D pictures with depth, normals and object numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ii_core.base.files import read_channels, read_image, write_image

from ..tracing.support_images import SUPPORT_IMAGES

WIDTH, GAP, LINE = 480, 8, 22  # pixels: width of a panel, gap between panels, height of a title
COLUMNS = 2


def contact_sheet(path: Path, panels: Sequence[tuple[str, Path, Path]]) -> Path:
    """Draw a contact sheet, one panel per scene, and return the file's path.

    Parameters
    ----------
    path : path
        A picture file.
    panels : sequence of (str, path, path)
        Title, picture, and the EXR file of its support images from `render_to`.
    """
    drawn = [_panel(title, read_image(picture), read_channels(support)) for title, picture, support in panels]
    rows = -(-len(drawn) // COLUMNS)
    height, width = (max(p.shape[axis] for p in drawn) for axis in (0, 1))
    page = np.full((rows * (height + GAP) + GAP, COLUMNS * (width + GAP) + GAP, 3), 255, np.uint8)
    for i, panel in enumerate(drawn):
        top, left = GAP + i // COLUMNS * (height + GAP), GAP + i % COLUMNS * (width + GAP)
        page[top : top + panel.shape[0], left : left + panel.shape[1]] = panel
    return write_image(path, page)


def _panel(title: str, picture: NDArray[Any], support: dict[str, NDArray[Any]]) -> NDArray[np.uint8]:
    """Return a title, the picture, and small pictures of depth (near is bright), normals and objects."""
    normal = np.stack([support[name] for name in SUPPORT_IMAGES["normal"].channels], axis=-1)
    small = (WIDTH - 2 * GAP) // 3
    images = _depth(support["depth.Z"]), _normal(normal), _ids(support["objectId"])
    beside = [_fitted(image, small) for image in images]
    large = _fitted(picture[..., :3], 3 * small + 2 * GAP)
    page = np.full((LINE + len(large) + GAP + len(beside[0]), large.shape[1], 3), 255, np.uint8)
    page[:LINE] = _name(title, page.shape[1])
    page[LINE : LINE + len(large)] = large
    for i, image in enumerate(beside):
        page[LINE + len(large) + GAP :, i * (small + GAP) : i * (small + GAP) + small] = image
    return page


def _name(title: str, width: int) -> NDArray[np.uint8]:
    strip = Image.new("RGB", (width, LINE), "white")
    ImageDraw.Draw(strip).text((0, 2), title, fill="black", font=ImageFont.load_default(16))
    return np.asarray(strip)


def _fitted(pixels: NDArray[Any], width: int) -> NDArray[np.uint8]:
    height = max(1, round(pixels.shape[0] * width / pixels.shape[1]))
    return np.asarray(Image.fromarray(np.ascontiguousarray(pixels)).resize((width, height), Image.Resampling.BOX))


def _depth(z: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return grey values by the logarithm of depth: white is the nearest, black the 99th percentile."""
    hit = np.isfinite(z) & (z > 0)
    grey = np.zeros(z.shape)
    if hit.any():
        near, far = np.log(z[hit].min()), np.log(np.quantile(z[hit], 0.99))
        grey[hit] = 1 - 0.85 * np.clip((np.log(z[hit]) - near) / max(far - near, 1e-6), 0, 1)
    return np.repeat((255 * grey).astype(np.uint8)[..., None], 3, axis=2)


def _normal(normal: NDArray[np.float32]) -> NDArray[np.uint8]:
    seen = (normal != 0).any(axis=-1, keepdims=True)
    return np.where(seen, 127.5 + 127.5 * normal, 0).astype(np.uint8)


def _ids(ids: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a colour per object; hues advance by the golden ratio."""
    number = ids.astype(np.int64)[..., None]
    hue = 6 * ((number * 0.618034) % 1)
    colour = np.clip(np.abs((hue + np.array([0, 4, 2])) % 6 - 3) - 1, 0, 1)
    return np.where(number >= 0, 70 + 185 * colour, 0).astype(np.uint8)
