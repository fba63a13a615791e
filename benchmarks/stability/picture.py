"""Limits of pictures: non-integer lens pitch, border of the viewing zone, extreme rates, tiny frames."""

from __future__ import annotations

import numpy as np

from benchmarks.accuracy.analytic import still_life
from benchmarks.stability.geometry import Row
from codec import decode, encode
from ii_core import IIPicture, preset, view_image
from metrics import q_global
from raytrace_ii import load_scene, render, trace


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def view_borders() -> list[Row]:
    """Return PSNR of view images over the viewing angle, against the scene, ray traced through each lens."""
    scene = still_life().scene(192)
    camera = preset("setup1", scale=8)
    picture = render(scene, camera, dtype="float32", support=()).picture
    k, l = (c.ravel() for c in np.meshgrid(np.arange(camera.lenses[0]), np.arange(camera.lenses[1])))
    cx, cy = camera.lens_lattice.centres(k, l)
    width, height = camera.size_mm
    centres = np.column_stack(
        [cx * camera.pixel_pitch_mm - width / 2, height / 2 - cy * camera.pixel_pitch_mm, 0 * cx + camera.gap_mm]
    )
    far, half = 40 * width, camera.view_angle_deg / 2  # far enough for one viewing angle over all lenses
    rows = []
    for share in (0.0, 0.5, 0.8, 0.9, 0.95, 1.0, 1.05, 1.2, 1.5):
        eye = np.array([far * np.tan(np.radians(share * half)), 0, camera.gap_mm - far])
        seen, valid = view_image(picture, eye)
        true = trace(scene, centres, centres - eye).radiance.reshape(seen.shape)
        mse = float(np.mean((seen - true)[valid] ** 2))
        rows.append(
            {
                "of half the viewing angle": share, "degrees": share * half,
                "PSNR of linear light, dB": float(-10 * np.log10(mse)), "without a pixel": float(1 - valid.mean()),
            }
        )  # fmt: skip
    return rows


RATES = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 4.0, 12.0, 24.0, 60.0)


def rate_ends() -> list[Row]:
    """Return reached rates and reports of coders for targets from far too low to above the size of the picture."""
    picture = render(load_scene("apples"), preset("setup1", scale=16), noise=1.0, support=()).picture
    return [
        {"scheme": scheme, "asked, bit/pixel": bpp, **_coded(picture, scheme, bpp)}
        for scheme in ("si-h264", "ei-h264", "jpeg2000")
        for bpp in RATES
    ]


def tiny_frames() -> list[Row]:
    """Return results of pictures of very few lenses and pixels, at a third of a bit per pixel."""
    generator = np.random.default_rng(0)
    rows = []
    for lenses, ei in (((1, 1), (1, 1)), ((1, 1), (16, 16)), ((2, 2), (2, 2)), ((2, 2), (16, 16)), ((5, 3), (7, 9))):
        size = (lenses[1] * ei[1], lenses[0] * ei[0], 3)
        picture = IIPicture(generator.integers(0, 256, size, dtype=np.uint8), lenses, ei)
        for scheme in ("si-h264", "ei-h264", "ri-h264", "jpeg2000"):
            row = {"lenses": f"{lenses[0]}×{lenses[1]}", "pixels a lens": f"{ei[0]}×{ei[1]}", "scheme": scheme}
            rows.append({**row, **_coded(picture, scheme, 0.33)})
    return rows


def _coded(picture: IIPicture, scheme: str, bpp: float) -> Row:
    try:
        coded = encode(picture, scheme, bpp=bpp)
        decoded = decode(coded)
    except ValueError as error:
        return {"got, bit/pixel": None, "said reached": None, "PSNR, dB": None, "refused": str(error)}
    quality = q_global(picture, decoded)
    return {
        "got, bit/pixel": float(coded.bpp), "said reached": bool(coded.reached), "PSNR, dB": _finite(quality),
        "refused": "",
    }  # fmt: skip
