"""What an II-camera can do: viewing angle, image plane, resolution, depth range, what limits them.

Symbols: δL lens pitch, Λ gap, δP pixel pitch, U = δL/δP pixels under a lens, f focal length, α viewing angle.
Distances z are from the lens plane into the scene unless a name says otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .camera import IICamera
from .optics import Lens, Lenslet, SphericalLenslet
from .regular import owners

WAVELENGTH_MM = 0.00055  # green, where eyes and sensors see best
MAP_BYTES = {"exr": 24, "png16": 12, "png8": 6, "hdr": 8}  # of L and D, a pixel, before the file type packs them
PATCH = 512  # pixels each way over which borders of cells are looked at


def view_angle_deg(*, lens_pitch_mm: float, gap_mm: float) -> float:
    """α = 2·arctan(δL / 2Λ) (2.1), the full angle, in degrees, that one lens sees: 180 as Λ → 0.

    Raises
    ------
    ValueError
        If a length is not positive and finite, as in all functions here.
    """
    check_lengths(lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm)
    return math.degrees(2 * math.atan(lens_pitch_mm / (2 * gap_mm)))


def image_plane_mm(*, focal_mm: float, gap_mm: float) -> float:
    """z = f·Λ / (Λ − f) (2.3), mm: where a lens images the pixels.

    Infinite for Λ = f, depth priority. Negative for Λ < f: rays diverge as from a plane behind the lenses. −Λ for an
    infinite f, which bends nothing.
    """
    check_lengths(gap_mm=gap_mm)
    if not focal_mm > 0:
        raise ValueError(f"focal_mm is {focal_mm:g}: a positive length is needed")
    if focal_mm == gap_mm:
        return math.inf
    return gap_mm / (gap_mm / focal_mm - 1)


def image_pixel_mm(*, z_mm: float, gap_mm: float, pixel_pitch_mm: float, lens_pitch_mm: float) -> float:
    """δPI = min(|z|·δP / Λ, δL) (2.2), mm: the size of a pixel's image in a plane z.

    Never above the lens pitch: from |z| = U·Λ on, to infinity, the lenses sample coarser than the pixels do.
    """
    check_lengths(gap_mm=gap_mm, pixel_pitch_mm=pixel_pitch_mm, lens_pitch_mm=lens_pitch_mm)
    _distance(z_mm)
    return min(abs(z_mm) * pixel_pitch_mm / gap_mm, lens_pitch_mm)


def resolution_per_mm(*, image_pixel_mm: float) -> float:
    """R_I = 1 / δPI, image pixels a millimetre; 1/δL at the least, where Λ = f."""
    check_lengths(image_pixel_mm=image_pixel_mm)
    return 1 / image_pixel_mm


def depth_range_mm(*, z_mm: float, gap_mm: float, pixel_pitch_mm: float, lens_pitch_mm: float) -> float:
    """Δz = 2·|z|·δPI / δL (2.4), and 2·Λ·δL / δP (2.5) for Λ = f: the marginal image depth, mm.

    Nearer to and further from the image plane than Δz/2, the cone of rays that a lens sends to a point is wider than
    an image pixel. (2.4) meets (2.5) at |z| = U·Λ. Beyond, where (2.2) holds δPI at δL, (2.4) would run on to
    infinity while depth priority has (2.5), the range about the lens plane in which a pixel's beam spreads by less
    than a lens. That is taken for all of these planes, so that nothing jumps as Λ → f and (2.6) holds everywhere.
    """
    pixel = image_pixel_mm(z_mm=z_mm, gap_mm=gap_mm, pixel_pitch_mm=pixel_pitch_mm, lens_pitch_mm=lens_pitch_mm)
    return 2 * min(abs(z_mm), gap_mm * lens_pitch_mm / pixel_pitch_mm) * pixel / lens_pitch_mm


def characteristic_per_mm(*, resolution_per_mm: float, depth_range_mm: float, view_angle_deg: float) -> float:
    """R_I²·Δz·tan(α/2), per mm: by the characteristic equation (2.6) R = 1/δP, the pixels a millimetre.

    Resolution, depth range and viewing angle can only be traded for one another; finer pixels alone improve all.
    """
    check_lengths(resolution_per_mm=resolution_per_mm, depth_range_mm=depth_range_mm)
    check_angle(view_angle_deg)
    return resolution_per_mm**2 * depth_range_mm * math.tan(math.radians(view_angle_deg) / 2)


def diffraction_limited_per_mm(*, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """Δz·R_I² = 1 / λ (2.7), per mm: where diffraction alone limits both (Λ = f)."""
    check_lengths(wavelength_mm=wavelength_mm)
    return 1 / wavelength_mm


def pixel_limited_per_mm(*, pixel_pitch_mm: float, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """Δz·R_I²·α² = λ / δP² (2.8), per mm, α in radians: where pixels limit R_I = Λ/(z·δP) and diffraction Δz.

    The depth of focus is then λ·(z/δL)², and α ≈ δL/Λ.
    """
    check_lengths(pixel_pitch_mm=pixel_pitch_mm, wavelength_mm=wavelength_mm)
    return wavelength_mm / pixel_pitch_mm**2


def diffraction_spot_mm(*, lens_pitch_mm: float, gap_mm: float, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """λ·Λ / δL, mm: the width, on the pixels, of the spot to which a lens can focus at best."""
    check_lengths(lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm, wavelength_mm=wavelength_mm)
    return wavelength_mm * gap_mm / lens_pitch_mm


def properties(camera: IICamera, *, wavelength_mm: float = WAVELENGTH_MM) -> dict[str, Any]:
    """All of a camera's properties, as plain values; pairs are across and down.

    Returns
    -------
    dict
        ``view_angle_deg``; ``view_step_deg``, between neighbouring pixels on the axis; ``views``; ``image_planes``,
        one for each focal length, see `image_planes`; ``characteristic_per_mm`` (2.6) of the first and
        ``pixels_per_mm``, its other side; ``disparity_si_per_mm``, how far a point moves from view to view, in lens
        pitches, a millimetre of depth; ``diffraction``, None for one lens without an aperture; ``viewing_zone``,
        ``cells`` and ``map_bytes``, see the functions.
    """
    (pitch_x, pitch_y), gap, pixel = camera.lens_pitch_mm, camera.gap_mm, camera.pixel_pitch_mm
    vertical = camera.lens_model.vertical_parallax
    down = view_angle_deg(lens_pitch_mm=pitch_y, gap_mm=gap) if vertical else 0.0
    u, v = camera.ei_pixels
    planes = image_planes(camera)
    first = planes[0] if planes else None
    return {
        "name": camera.name,
        "pixels": list(camera.pixels),
        "lenses": list(camera.lenses),
        "lattice": camera.lattice,
        "optics": [element.kind for element in camera.optics],
        "pixel_pitch_mm": pixel,
        "lens_pitch_mm": [pitch_x, pitch_y],
        "gap_mm": gap,
        "ei_pixels": [u, v],
        "views": [u, v if vertical else 1],
        "view_angle_deg": [camera.view_angle_deg, down],
        "view_step_deg": math.degrees(math.atan(pixel / gap)),
        "image_planes": planes,
        "characteristic_per_mm": characteristic_per_mm(
            resolution_per_mm=first["resolution_per_mm"],
            depth_range_mm=first["depth_range_mm"],
            view_angle_deg=first["view_angle_deg"],
        )
        if first
        else None,
        "pixels_per_mm": 1 / pixel,
        "disparity_si_per_mm": pixel / (gap * pitch_x),
        "viewing_zone": viewing_zone(camera),
        "cells": cells(camera),
        "diffraction": _diffraction(camera, wavelength_mm),
        "map_bytes": map_bytes(camera),
    }


def image_planes(camera: IICamera) -> list[dict[str, float]]:
    """Where each focal length images the pixels, and what is resolved there; none for a lone pinhole.

    Pinholes, graded-index rods and lenticular lenses stand for lenses with Λ = f (3.15). A spherical lenslet's plane
    is the paraxial one: glass of thickness t adds t/n to the gap, and distances are from the top of the sphere.

    Returns
    -------
    list of dict
        ``focal_mm``, ``z_mm`` (2.3), ``image_pixel_mm`` (2.2), ``resolution_per_mm``, ``depth_range_mm`` (2.4, 2.5)
        and the ``view_angle_deg`` that goes with them; ``scene_z_mm``: the plane, seen through what stands in front
        of the array, from the pixel array.
    """
    if camera.lenses == (1, 1) and not camera.samples_aperture:
        return []
    model, pixel, pitch = camera.lens_model, camera.pixel_pitch_mm, camera.lens_pitch_mm[0]
    gap, top = camera.gap_mm, camera.gap_mm
    focals = [gap]
    if isinstance(model, Lenslet):
        focals = sorted({float(f) for f in np.ravel(model.focal_mm)})
    elif isinstance(model, SphericalLenslet):
        thickness = model.thickness(camera.lens_pitch_mm)
        focals = [model.radius_mm / (model.ior - 1) if model.ior > 1 else math.inf]
        gap, top = gap + thickness / model.ior, top + thickness
    planes = []
    for focal in focals:
        z = image_plane_mm(focal_mm=focal, gap_mm=gap)
        size = image_pixel_mm(z_mm=z, gap_mm=gap, pixel_pitch_mm=pixel, lens_pitch_mm=pitch)
        planes.append(
            {
                "focal_mm": focal,
                "z_mm": z,
                "scene_z_mm": through_front_mm(camera, top + z),
                "image_pixel_mm": size,
                "resolution_per_mm": resolution_per_mm(image_pixel_mm=size),
                "depth_range_mm": depth_range_mm(z_mm=z, gap_mm=gap, pixel_pitch_mm=pixel, lens_pitch_mm=pitch),
                "view_angle_deg": view_angle_deg(lens_pitch_mm=pitch, gap_mm=gap),
            }
        )
    return planes


def through_front_mm(camera: IICamera, z_mm: float) -> float:
    """Where what stands in front images a plane z, both in mm from the pixel array: 1/b = 1/f + 1/a at each lens."""
    for element in camera.front:
        if isinstance(element, Lens):
            a = z_mm - element.z_mm
            power = 1 / element.focal_mm + (1 / a if a else math.inf)
            z_mm = element.z_mm + (1 / power if power else math.inf)
    return z_mm


def viewing_zone(camera: IICamera) -> dict[str, Any]:
    """Where a viewer of the display sees every lens show its own elementary image; what stands in front left aside.

    Returns
    -------
    dict
        ``nearest_mm``, the distance from the lens plane from which on a viewer in the middle does, lens borders and
        all; ``width_mm``, across and down, there and, ``usual_width_mm``, at three times that distance, where
        `five_viewpoints` stands. Infinite down if lenses have no parallax down.
    """
    vertical, tangents, spans = camera.lens_model.vertical_parallax, [], []
    for axis in range(2):
        lattice, count = camera.lens_lattice, camera.lenses[axis]
        shift = 0.5 if lattice.hexagonal and axis == 0 and camera.lenses[1] > 1 else 0.0
        tangents.append(camera.lens_pitch_mm[axis] / (2 * camera.gap_mm))
        spans.append((count - 1 + shift) * camera.lens_pitch_mm[axis])
    used = (0, 1) if vertical else (0,)
    nearest = max((spans[axis] + camera.lens_pitch_mm[axis]) / 2 / tangents[axis] for axis in used)

    def width(distance: float) -> list[float]:
        return [
            max(0.0, 2 * distance * tangents[axis] - spans[axis]) if axis in used else math.inf for axis in range(2)
        ]

    return {"nearest_mm": nearest, "width_mm": width(nearest), "usual_width_mm": width(3 * nearest)}


def cells(camera: IICamera) -> dict[str, Any]:
    """How elementary images share the pixels.

    Returns
    -------
    dict
        ``unowned``: share of pixels that no lens owns, see `regular`. ``shared``: share of pixels, in the middle of
        the sensor, that reach over a border into a neighbour's cell and mix two directions. ``pixels_per_lens``:
        least and most. ``aperture_share``: of a cell's area that an aperture leaves clear, None if it has none.
        ``rim_image_mm``: width, under a lens, of the image of the first rim in front, None if there is none; wider
        than a cell, elementary images would overlap, narrower, they are dark around.
    """
    u, v = camera.ei_pixels
    model, pitch = camera.lens_model, camera.lens_pitch_mm
    unowned, shared, least, most = 0.0, 0.0, int(u * v), int(u * v)
    if not camera.regular:
        owner = owners(camera.lens_lattice, camera.pixels)
        unowned = 1 - np.count_nonzero(owner >= 0) / owner.size
        counts = np.bincount(owner[owner >= 0], minlength=camera.lenses[0] * camera.lenses[1])
        least, most, shared = int(counts.min()), int(counts.max()), _shared(camera)
    aperture = getattr(model, "aperture_mm", None)
    rims = [e for e in camera.front if isinstance(e, Lens) and e.diameter_mm is not None]
    distance = rims[0].z_mm - camera.gap_mm if rims else 0.0
    return {
        "unowned": unowned,
        "shared": shared,
        "pixels_per_lens": [least, most],
        "aperture_share": None if aperture is None else math.pi * aperture**2 / 4 / (pitch[0] * pitch[1]),
        "rim_image_mm": rims[0].diameter_mm * camera.gap_mm / distance if distance > 0 else None,  # type: ignore[operator]
    }


def _shared(camera: IICamera) -> float:
    """Share of pixels whose corners have different owners, in the middle of the sensor."""
    lattice, size = camera.lens_lattice, tuple(min(PATCH, n) for n in camera.pixels)
    x, y = (o - (n - s) // 2 for o, n, s in zip(lattice.origin, camera.pixels, size, strict=True))
    inset = 0.499  # of a pixel to each side: a corner right on a border is on neither side of it
    corners = [
        owners(lattice._replace(origin=(x + dx, y + dy)), (size[0], size[1]))
        for dx in (-inset, inset)
        for dy in (-inset, inset)
    ]
    return float((np.ptp(corners, axis=0) > 0).mean())


def map_bytes(camera: IICamera) -> dict[str, int]:
    """Bytes of the L and D maps of one sample by format, before packing: 2 images of 3 numbers; ``hdr`` is RGBE."""
    count = camera.pixels[0] * camera.pixels[1]
    return {name: size * count for name, size in MAP_BYTES.items()}


def _diffraction(camera: IICamera, wavelength_mm: float) -> dict[str, Any] | None:
    """The spot through the whole lens, or its aperture, against the pixel; a lone pinhole's width is not known."""
    aperture = getattr(camera.lens_model, "aperture_mm", None)
    if camera.lenses == (1, 1) and not aperture:
        return None
    width = min(aperture, camera.lens_pitch_mm[0]) if aperture else camera.lens_pitch_mm[0]
    spot = diffraction_spot_mm(lens_pitch_mm=width, gap_mm=camera.gap_mm, wavelength_mm=wavelength_mm)
    return {"wavelength_mm": wavelength_mm, "spot_mm": spot, "limits": spot > camera.pixel_pitch_mm}


def check_lengths(**values: float) -> None:
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise ValueError(f"{name} is {value:g}: a positive, finite number is needed")


def _distance(z_mm: float) -> None:
    if not abs(z_mm) > 0:
        raise ValueError(f"z_mm is {z_mm:g}: a distance other than 0 is needed")


def check_angle(view_angle_deg: float) -> None:
    if not 0 < view_angle_deg < 180:
        raise ValueError(f"view_angle_deg is {view_angle_deg:g}: an angle between 0 and 180° is needed")
