"""Demosaicing of lenslet pictures: PSNR of rendered pictures whose colours were thinned to a Bayer mosaic.

    python -m benchmarks run demosaicing

The rendered picture is the truth. Its linear light is thinned to the mosaic bggr, with and without photon noise, and
demosaiced by each method, from pixels of the same lens or of any. PSNR is that of sRGB codes of pixels with a lens.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import preset
from ii_core.base.colour import linear, srgb
from ii_core.calibration.demosaic import METHODS, demosaiced
from ii_core.picture.regular import owners
from raytrace_ii import load_scene, render

RECORDS = Records("demosaicing", ("benchmarks.accuracy.demosaicing",))
PAGE = "docs/calibration.md"
CAMERAS, SCENES, MOSAIC, SCALE = (
    ("hexagonal", "plenoptic", "plenoptic1"),
    ("apples", "car", "dolphin", "objects"),
    "bggr",
    8,
)
NOISE = 0.01  # standard deviation at white, of its square root elsewhere


def main() -> None:
    """Measure and record all cameras and scenes."""
    asked = command_line(__doc__).parse_args()
    keys = [{"camera": camera, "scene": scene} for camera in CAMERAS for scene in SCENES]
    RECORDS.run(keys, measured, asked.again)
    publish(tables())


def measured(camera: str, scene: str) -> dict[str, Any]:
    """Return the PSNR in dB by method, of the same lens or of any pixels, without noise and with it."""
    model = preset(camera, scale=SCALE)
    codes = render(load_scene(scene), model, samples=4, seed=0).picture.pixels
    light = linear(codes / 255).astype(np.float32)
    owner = owners(model.lens_lattice, model.pixels)
    raw = np.empty(owner.shape, np.float32)
    for phase, colour in enumerate(MOSAIC):
        at = slice(phase // 2, None, 2), slice(phase % 2, None, 2)
        raw[at] = light[(*at, "rgb".index(colour))]
    noise = np.random.default_rng(0).normal(size=raw.shape).astype(np.float32)
    noisy = raw + NOISE * np.sqrt(np.maximum(raw, 0) + 0.01) * noise

    def psnr(frame: Any, method: str, lens: Any) -> float:
        made = srgb(np.clip(demosaiced(frame, MOSAIC, lens, method=method), 0, 1))
        return float(-10 * np.log10(((made - codes / 255)[owner >= 0] ** 2).mean()))

    return {
        method: {
            "lens": psnr(raw, method, owner),
            "any": psnr(raw, method, None),
            "noisy": psnr(noisy, method, owner),
        }
        for method in METHODS
    }


def tables() -> Tables:
    """Return the table of the page of calibration."""
    rows = RECORDS.rows()
    if not rows:
        return {(PAGE, "demosaicing"): []}
    names = [f"{method}, {what}" for method in METHODS for what in ("same lens", "any lens", "noise")]
    lines = []
    for camera in CAMERAS:
        found = [row for row in rows if row["camera"] == camera]
        means = [np.mean([row[m][w] for row in found]) for m in METHODS for w in ("lens", "any", "noisy")]
        lines.append([f"`{camera}`", *(f"{mean:.1f}" for mean in means)])
    return {(PAGE, "demosaicing"): [*table(" | ".join(["camera", *names]), lines), "", origin(rows)]}


if __name__ == "__main__":
    main()
