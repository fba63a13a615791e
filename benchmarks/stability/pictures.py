"""Pictures of failures for docs/stability.md: two sheets of details."""

from __future__ import annotations

import tempfile
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.analytic import still_life
from benchmarks.stability import depth, geometry, light
from benchmarks.study.sheets import enlarged, sheet
from codec import decode, encode
from ii_core import add_sensor_noise, preset, read_maps, view_image, write_maps
from ii_core.base.colour import srgb
from ii_core.depth.focus import METHODS
from raytrace_ii import Body, Scene, load_scene, render, trace
from raytrace_ii.shapes.primitives import rotation

RENDERING = [
    "1 ball, 12 segments", "2 ball, 48 segments", "3 walls 6e-8 apart", "4 walls 1e-7 apart", "5 faces reversed",
    "6 faces missing",
]  # fmt: skip
CODING_AND_DEPTH = [
    "1 from aside", "2 lowest rate", "3 camera in 8 bits", "4 flat wall, dissertation", "5 flat wall, robust",
    "6 half mirror",
]  # fmt: skip


def rendering() -> NDArray[np.uint8]:
    """Draw six failures of rendering."""
    corners = np.array([[-1.5, -1.5, 0], [1.5, -1.5, 0], [1.5, 1.5, 0], [-1.5, 1.5, 0.0]]) @ rotation((17, 29, 5)).T
    away = rotation((17, 29, 5)) @ [0, 0, 1]
    red, blue = (replace(geometry.WHITE, colour=colour) for colour in ((0.8, 0.1, 0.1), (0.1, 0.2, 0.8)))

    def walls(gap: float) -> Scene:
        faces = np.array([[0, 2, 1], [0, 3, 2]])
        both = [
            Body(name="wall", vertices=corners + np.array([0, 0, 10]) + by * away, faces=faces, material=material)
            for by, material in ((10 * gap, red), (0.0, blue))
        ]
        return Scene(bodies=both, ambient=(1, 1, 1))

    still, generator = still_life().scene(96), np.random.default_rng(0)
    scenes = [light.terminator_scene(12), light.terminator_scene(48), walls(6e-8), walls(1e-7)]
    pictures = [_seen(scene, (0, 0, 10), 0.16) for scene in scenes]
    for change in (geometry._turned, geometry._missing):
        broken = [
            replace(b, faces=change(np.asarray(b.faces), 0.1, generator)) if b.name == "glass" else b
            for b in still.bodies
        ]
        pictures.append(_seen(replace(still, bodies=broken), (4, -4, 26), 0.2))
    return sheet(pictures, 3, RENDERING)


def coding_and_depth() -> NDArray[np.uint8]:
    """Draw six failures of views, coding, stored cameras and depth from focus; 64 × 32 lenses."""
    camera = preset("setup1", scale=8)
    apples = render(load_scene("apples"), camera, support=()).picture
    aside = camera.gap_mm - 40 * camera.size_mm[0]
    eye = np.array([-aside * np.tan(np.radians(1.05 * camera.view_angle_deg / 2)), 0, aside])
    coarse = decode(encode(add_sensor_noise(apples, 1.0), "si-h264", bpp=1e-4))
    with tempfile.TemporaryDirectory() as folder:
        write_maps([camera], folder, format="png8")
        stored = render(load_scene("apples"), read_maps(folder)[0], support=()).picture
    front = camera.gap_mm * (1 - camera.lenses[0]) * np.array([0, 0, 1.0])
    even = add_sensor_noise(depth.seen(depth.wall(depth.LAYER, 0)), 1.0, seed=1)
    half = depth.seen(depth.wall(depth.LAYER, 128, mirror=(0.5,) * 3), depth.mirrored())
    views = [view_image(apples, eye)[0], view_image(coarse, front)[0], view_image(stored, front)[0]]
    maps = [depth.shown(depth.estimated(even, method)) for method in METHODS]
    maps.append(depth.shown(depth.estimated(half, "dissertation")))
    tiles = [*views, *(np.repeat(one[..., None], 3, axis=2) for one in maps)]
    return sheet([enlarged(np.rint(tile).astype(np.uint8), 3) for tile in tiles], 3, CODING_AND_DEPTH)


def _seen(scene: Scene, towards: tuple[float, float, float], half: float, size: int = 200) -> NDArray[np.uint8]:
    """Return a pinhole's picture from the origin, 8-bit sRGB."""
    across = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(across, -across)
    d = np.stack([x * half, y * half, np.ones_like(x)], axis=-1) + np.asarray(towards) / towards[2] - [0, 0, 1]
    seen = np.clip(trace(scene, np.zeros_like(d), d).radiance.reshape(size, size, 3), 0, 1)
    return np.rint(255 * srgb(seen)).astype(np.uint8)
