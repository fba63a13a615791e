"""Lenses of full setup1 as point-spread functions: effect on pictures, disparity and coding; spots off the axis."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from codec import decode, encode
from ii_core import IICamera, IIPicture, add_sensor_noise, preset
from ii_core.camera.optics import SphericalLenslet
from ii_core.depth.virtual_camera import virtual_camera_pixels
from ii_core.picture.disparity import disparity_of_depth
from ii_core.waves.spread import spread_maps, spread_picture
from metrics import depth_from_focus, q_global, q_view
from raytrace_ii import load_scene, render

LENSES = ("rays", "ideal", "glass")
RATES = (0.1, 0.2, 0.4, 0.8)  # bit per pixel
IOR = 1.52
PUPIL = 41  # places across the pupil


def lens_camera(lens: str) -> IICamera:
    """Return full setup1 with ideal lenses, or plano-convex ones whose paraxial focus is at infinity."""
    from scipy.optimize import brentq

    camera = preset("setup1")
    if lens != "glass":
        return camera
    cell = camera.lens_pitch_mm

    def power(radius: float) -> float:
        return SphericalLenslet(radius_mm=radius, ior=IOR).vergence(camera.gap_mm, cell)

    radius = float(brentq(power, math.hypot(*cell) / 2 * 1.001, 10 * cell[0]))
    return replace(camera, optics=(SphericalLenslet(radius_mm=radius, ior=IOR),))


def spread_scene(scene: str, scale: int, lens: str) -> dict[str, Any]:
    """Return the effect of a lens on a picture: error, views, disparity, coding gain of SI-PVS.

    The picture is of coarser pixels than full setup1; every pixel is spread as one of full setup1 at its depth.
    """
    camera = preset("setup1", scale=scale)
    shot = render(load_scene(scene), camera, samples=4, support=("depth",))
    pictures = [shot.picture]
    if lens != "rays":
        full = lens_camera(lens)
        part = replace(full, pixels=camera.pixels, lenses=camera.lenses)
        pictures.append(spread_picture(shot.picture, spread_maps(part, shot.depth)))
    sharp, *soft = [add_sensor_noise(picture, 1.0) for picture in pictures]
    shown = soft[0] if soft else sharp
    here = virtual_camera_pixels(camera)
    first, second = (
        disparity_of_depth(camera, depth_from_focus(p, method="robust").depth_mm) for p in (sharp, shown)
    )
    true = disparity_of_depth(camera, np.asarray(shot.depth)[here])
    found: dict[str, Any] = {"gain": gain(shown), "disparity_error": float(np.nanmedian(abs(second - true)))}
    if soft:
        found |= {"psnr": q_global(sharp, shown), "q_view": q_view(sharp, shown).mean}
        found["disparity_change"] = float(np.nanmedian(abs(second - first)))
        found["disparity_shift"] = float(np.nanmean(second - first))
    return found


def gain(picture: IIPicture) -> float:
    """Return the mean PSNR of SI-PVS less that of JPEG 2000, dB, over `RATES`."""
    gains = []
    for rate in RATES:
        ours, theirs = (q_global(picture, decode(encode(picture, one, bpp=rate))) for one in ("si-h264", "jpeg2000"))
        gains.append(ours - theirs)
    return float(np.mean(gains))


def oblique() -> list[dict[str, float]]:
    """Return rms radii, pixels, of a far spot along the diagonal of a glass lens: of all rays, and of maps."""
    camera = lens_camera("glass")
    u, v = camera.ei_pixels
    block, pixel = (slice(0, v), slice(0, u)), camera.pixel_pitch_mm
    lens: Any = camera.lens_model
    opened = replace(camera, optics=(replace(lens, aperture_mm=min(camera.lens_pitch_mm)),))
    places = np.stack(np.meshgrid(*[(np.arange(PUPIL) + 0.5) / PUPIL] * 2), axis=-1).reshape(-1, 2)
    slopes = np.array([_slopes(opened, block, place) for place in places])  # (places, v, u, 2)
    chief = _slopes(opened, block, np.array([0.5, 0.5]))
    step = np.stack([np.gradient(chief[..., 0], axis=1), np.gradient(chief[..., 1], axis=0)], axis=-1)
    way = (slopes - chief) / step  # pixels, to the right and down
    spot = np.sqrt(((way - way.mean(axis=0)) ** 2).sum(axis=-1).mean(axis=0))
    maps = spread_maps(replace(camera, pixels=(u, v), lenses=(1, 1), lens_pitch_mm=camera.lens_pitch_mm))
    d, a = maps.defocus_mm / pixel, np.asarray(maps.aberration_mm) / pixel
    ours = np.sqrt(d * d / 8 + d * a / 6 + a * a / 16)
    return [
        {
            "from_axis_px": math.hypot(i + 0.5 - u / 2, i + 0.5 - v / 2),
            "traced_px": float(spot[i, i]),
            "maps_px": float(ours[i, i]),
        }
        for i in range(min(u, v) // 2, min(u, v))
    ]


def _slopes(camera: IICamera, block: tuple[slice, slice], place: Any) -> Any:
    _, D, _ = camera.weighted_rays(*block, (0.5, 0.5), place)
    return D[..., :2] / D[..., 2:]
