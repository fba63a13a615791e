"""Draw the textures of the reference scenes: ``python -m assets.make_textures``. Same numbers, same bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ii_core.files import write_image

TILE, TILES = 128, 4  # pixels a side, tiles a side


def cuboid_tiles() -> NDArray[np.uint8]:
    """4×4 busy patterns, each with its own colours and a dark frame, for the small cubes of *Cuboid*."""
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


if __name__ == "__main__":
    write_image(Path(__file__).parent / "textures" / "cuboid_tiles.png", cuboid_tiles())
