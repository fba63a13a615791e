"""Defocus and spherical aberration of real lenslets, from the camera's own rays through their pupil."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera.camera import IICamera
from ..camera.optics import SphericalLenslet

# Two rings of the pupil with the mean square of a whole pupil, for errors up to the third power (Gauss).
RINGS = tuple(np.sqrt(0.5 + 0.5 * np.array([-1.0, 1.0]) / np.sqrt(3)).tolist())
Floats = NDArray[np.float64]


def traced_spread(
    camera: IICamera, lens: SphericalLenslet, aperture_mm: float, distance_mm: Floats
) -> tuple[Floats, Floats]:
    """Return diameters of the disks of defocus and of third-order spherical aberration, for every pixel.

    Rays of a pixel pass the pupil at four places on each of two rings. They meet the plane of the point beside the
    ray through the centre; the movement of that ray from pixel to pixel turns this into a place on the pixel plane.
    The mean over a ring leaves out coma and astigmatism, and keeps the curvature of the field.

    Parameters
    ----------
    camera : IICamera
        Of a regular structure.
    lens : SphericalLenslet
        Of the camera.
    aperture_mm : float
        Diameter of the pupil, on the flat face.
    distance_mm : ndarray, () or (N, M)
        From the lens plane to the point of each pixel; infinity is allowed.

    Returns
    -------
    defocus, aberration : ndarray, (N, M)
        A ray through the share ρ of the pupil's radius ends (defocus·ρ + aberration·ρ³)/2 from the image's middle,
        on its own side of it.

    Raises
    ------
    ValueError
        If a point lies inside the glass.
    """
    thick = lens.thickness(camera.lens_pitch_mm)
    if not (distance_mm > thick).all():
        raise ValueError(
            f"depth_mm holds a place {distance_mm.min():g} mm from the lens plane: one outside the lens, which is "
            f"{thick:g} mm thick, is needed"
        )
    opened = replace(camera, optics=(replace(lens, aperture_mm=aperture_mm), *camera.front))
    # all lenses are alike, unless viewing zones meet at a viewer
    (width, height), (u, v) = camera.pixels, camera.ei_pixels
    block = (slice(0, height), slice(0, width)) if camera.viewer_mm is not None else (slice(0, v), slice(0, u))
    repeats = (height // block[0].stop, width // block[1].stop)
    vergence = 1 / distance_mm
    nearer, farther = (_displacements(opened, block, ring, vergence, repeats) for ring in RINGS)
    first, second = RINGS
    both = first * second**3 - second * first**3
    defocus = 2 * (nearer * second**3 - farther * first**3) / both
    return defocus, 2 * (farther * first - nearer * second) / both


def _displacements(
    camera: IICamera, block: tuple[slice, slice], ring: float, vergence: Floats, repeats: tuple[int, int]
) -> Floats:
    """Mean way on the pixel plane, away from the axis, of rays through a ring of the pupil; (N, M)."""
    total: Any = 0.0
    for axis in (0, 1):
        there, back = (0.5 + side * ring / 2 * np.eye(2)[axis] for side in (1, -1))
        across = _seen(camera, block, axis, (0.5, 0.5), there) - _seen(camera, block, axis, (0.5, 0.5), back)
        # a pixel's edges, right and up
        edges = [np.array([0.5, 0.5]) + side * np.array([0.5, -0.5]) * np.eye(2)[axis] for side in (1, -1)]
        chief = _seen(camera, block, axis, edges[0], (0.5, 0.5)) - _seen(camera, block, axis, edges[1], (0.5, 0.5))
        far, near = (np.tile(one, repeats) for one in across)
        far_chief, near_chief = (np.tile(one, repeats) for one in chief)
        total = total - (far + near * vergence) / (far_chief + near_chief * vergence)
    return np.asarray(total * camera.pixel_pitch_mm / 4, np.float64)  # of two axes, and of two sides


def _seen(camera: IICamera, block: tuple[slice, slice], axis: int, sample: Any, place: Any) -> Floats:
    """Direction in which a ray meets a plane, from the lens plane: of infinity, and its change with 1/distance."""
    L, D, _ = camera.weighted_rays(*block, sample, place)
    slope = D[..., axis] / D[..., 2]
    start = L[..., 2] - camera.origin_mm[2] - camera.gap_mm
    return np.stack([slope, L[..., axis] - slope * start])
