"""Textures of the reference scenes, drawn by formulas: ``python -m benchmarks.pages.make_textures``.

The random numbers are seeded: the files are reproducible to the byte.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ii_core.base.files import write_image

TILE, TILES = 128, 4  # pixels a side, tiles a side


def cuboid_tiles() -> NDArray[np.uint8]:
    """Return 4×4 detailed patterns, each with its own colours and a dark frame, for the small cubes of *Cuboid*."""
    generator = np.random.default_rng(20261121)
    y, x = np.mgrid[0:TILE, 0:TILE] / TILE
    patterns = [
        lambda f: (np.floor(x * f) + np.floor(y * f)) % 2,
        lambda f: (np.hypot(x - 0.5, y - 0.5) * f * 2) % 1 > 0.5,
        lambda f: ((x + y) * f) % 1 > 0.5,
        lambda f: (x * f) % 1 > 0.45,
        lambda f: np.hypot((x * f) % 1 - 0.5, (y * f) % 1 - 0.5) < 0.32,
        lambda f: (np.abs((x * f + 0.5 * np.floor(y * f)) % 1 - 0.5) < 0.43) & ((y * f) % 1 > 0.14),
        lambda f: (np.arctan2(y - 0.5, x - 0.5) / np.pi * f) % 1 > 0.5,
        lambda f: generator.random((int(f) * 2, int(f) * 2))[(y * f * 2).astype(int), (x * f * 2).astype(int)] > 0.5,
    ]
    sheet = np.empty((TILES * TILE, TILES * TILE, 3))
    for i in range(TILES * TILES):
        where = np.asarray(patterns[i % len(patterns)](float(generator.integers(2, 4))), float)[..., None]
        dark, light = generator.uniform(0.2, 0.5, 3), generator.uniform(0.5, 0.85, 3)
        tile = dark + where * (light - dark)
        frame = np.minimum.reduce([x, y, 1 - x, 1 - y]) < 0.035
        tile[frame] *= 0.5
        row, column = divmod(i, TILES)
        sheet[row * TILE : (row + 1) * TILE, column * TILE : (column + 1) * TILE] = tile
    return np.rint(np.clip(sheet, 0, 1) * 255).astype(np.uint8)


FACE_MM = (-8.0, -12.0, 8.0, 10.0)  # rectangle of the face on a head 20 mm high: least x and y, greatest x and y


def face(skin: str, iris: str, lips: str, brow: str) -> NDArray[np.uint8]:
    """Return a woman's face, projected onto a head from the front: eyes, brows, lips, a blush."""
    x0, y0, x1, y1 = FACE_MM
    rows, columns = 484, 352
    x = x0 + (x1 - x0) * (np.arange(columns) + 0.5)[None, :] / columns + np.zeros((rows, 1))
    y = y1 - (y1 - y0) * (np.arange(rows) + 0.5)[:, None] / rows + np.zeros((1, columns))
    out = np.empty((rows, columns, 3))
    out[...] = _rgb(skin)
    side = np.abs(x)

    def lay(colour: str, distance: NDArray[np.float64], soft: float = 0.08, share: float = 1.0) -> None:
        """Draw a colour where the distance is negative, with a border ``soft`` mm wide."""
        cover = share * np.clip(0.5 - distance / soft, 0, 1)[..., None]
        out[...] += cover * (_rgb(colour) - out)

    def oval(cx: float, cy: float, rx: float, ry: float) -> NDArray[np.float64]:
        return (np.hypot((side - cx) / rx, (y - cy) / ry) - 1) * min(rx, ry)

    lay("#e08878", oval(4.2, -2.9, 1.6, 1.3), 2.4, 0.38)  # blush
    lay("#7a4a3c", oval(2.75, 0.75, 1.75, 1.0), 1.3, 0.3)  # shade of the socket
    lay("#6f3a30", oval(0.62, -3.35, 0.36, 0.2), 0.25, 0.6)  # nostrils
    lay("#7a4a3c", oval(0, -6.7, 1.2, 0.3), 0.6, 0.25)  # under the lip
    # an almond between two arcs; the upper one is the line of the lashes
    across = (side - 2.75) / 1.5
    upper = 0.45 + 0.78 * (1 - across**2) + 0.1 * across
    lower = 0.45 - 0.52 * (1 - across**2) + 0.1 * across
    lid = np.maximum(y - upper, lower - y)
    lay("#f7f4ef", lid)
    ball = np.hypot(side - 2.72, y - 0.62)
    lay(iris, np.maximum(ball - 0.68, lid))
    lay("#101014", np.maximum(ball - 0.32, lid))
    lay("#ffffff", np.hypot(x - 0.22 - 2.72 * np.sign(x), y - 0.85) - 0.16)
    lay("#1c1210", np.maximum(np.abs(y - upper - 0.06) - 0.13 - 0.05 * across, np.abs(side - 2.85) - 1.62))
    lay("#5d3a30", np.maximum(np.abs(y - lower + 0.03) - 0.05, np.abs(side - 2.8) - 1.4), 0.08, 0.7)
    arch = 2.25 + 0.5 * np.sin(np.clip((side - 1.1) / 3.6, 0, 1) * 2.4)
    lay(
        brow,
        np.maximum(np.abs(y - arch) - 0.26 * np.clip((4.9 - side) / 2.5, 0.15, 1), np.abs(side - 2.95) - 1.8),
        0.2,
    )
    t = np.clip(side / 2.0, 0, 1)
    bow = -4.95 + 0.52 * (1 - t**2) - 0.16 * np.exp(-((side / 0.35) ** 2)) + 0.06 * t
    middle = -5.05 + 0.1 * t**2
    below = -5.05 - 0.95 * (1 - t**2.4)
    lay(lips, np.maximum(np.maximum(y - bow, below - y), side - 2.0), 0.14)
    lay("#6a2020", np.maximum(np.abs(y - middle) - 0.07, side - 1.95), 0.12, 0.8)
    lay("#ffffff", oval(0.45, -5.55, 0.35, 0.12), 0.25, 0.25)
    return _bytes(out)


def flowers() -> NDArray[np.uint8]:
    """Return a repeating print of blossoms and leaves on dark blue, for a dress."""
    size = 256
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    out = np.empty((size, size, 3))
    out[...] = _rgb("#1d2c63")
    generator = np.random.default_rng(7)
    for i in range(46):
        cx, cy = generator.uniform(0, 1, 2)
        dx, dy = (x - cx + 0.5) % 1 - 0.5, (y - cy + 0.5) % 1 - 0.5
        radius, angle = np.hypot(dx, dy), np.arctan2(dy, dx) + generator.uniform(0, 6)
        if i < 20:
            leaf = np.abs(angle % np.pi - np.pi / 2) > 1.25
            out[leaf & (radius < 0.085)] = _rgb("#3f8f55")
            continue
        petals = 0.062 * (0.72 + 0.28 * np.cos(5 * angle))
        out[radius < petals] = _rgb(("#f6d4dd", "#ef5d7a", "#f7efe2", "#f0a23c")[i % 4])
        out[radius < 0.016] = _rgb("#f7d046")
    return _bytes(out)


def tartan() -> NDArray[np.uint8]:
    """Return a repeating check of woven bands, for a blouse."""
    size = 128
    place = (np.arange(size) + 0.5) / size
    bands = np.empty((size, 3))
    bands[...] = _rgb("#b3262e")
    for low, high, colour in (
        (0.0, 0.22, "#1f3a2c"),
        (0.3, 0.36, "#f0e6d0"),
        (0.5, 0.72, "#1f2740"),
        (0.82, 0.86, "#f2c230"),
    ):
        bands[(place >= low) & (place < high)] = _rgb(colour)
    twill = ((np.add.outer(np.arange(size), np.arange(size)) // 2) % 2).astype(bool)[..., None]
    return _bytes(np.where(twill, bands[None, :, :], bands[:, None, :]) * 0.8 + 0.1 * (bands[None] + bands[:, None]))


def _rgb(text: str) -> NDArray[np.float64]:
    return np.array([int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def _bytes(colours: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(np.clip(colours, 0, 1) * 255).astype(np.uint8)


TEXTURES = {
    "cuboid_tiles": cuboid_tiles,
    "face_fair": lambda: face("#f0c4a8", "#4f83a8", "#c4454f", "#6b4426"),
    "face_tan": lambda: face("#c98d66", "#5a3417", "#a83a44", "#1c1310"),
    "flowers": flowers,
    "tartan": tartan,
}


def main() -> None:
    """Write all of them."""
    for name, draw in TEXTURES.items():
        write_image(Path(__file__).parents[2] / "assets" / "textures" / f"{name}.png", draw())


if __name__ == "__main__":
    main()
