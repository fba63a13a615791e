"""Properties of an II-camera: viewing angle, image plane, resolution, depth range and their limits.

Symbols: δL lens pitch, Λ gap, δP pixel pitch, U = δL/δP pixels under a lens, f focal length, α viewing angle.
Distances z are from the lens plane into the scene unless a name says otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..base import checks
from ..base.checks import length, number, within
from ..camera.camera import IICamera
from ..camera.optics import Lenslet, SphericalLenslet
from ..picture.regular import owners

WAVELENGTH_MM = 0.00055  # green, the maximum of sensitivity of eyes and sensors
MAP_BYTES = {"exr": 24, "png16": 12, "png8": 6, "hdr": 8}  # of L and D per pixel, uncompressed
PATCH = 512  # side of the area in which borders of cells are counted, pixels


def view_angle_deg(*, lens_pitch_mm: float, gap_mm: float) -> float:
    """Return α = 2·arctan(δL / 2Λ) (2.1), the full angle of view of one lens in degrees; 180 as Λ → 0.

    Raises
    ------
    ValueError
        If a length is not positive and finite, as in all functions here.
    """
    check_lengths(lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm)
    return math.degrees(2 * math.atan(lens_pitch_mm / (2 * gap_mm)))


def image_plane_mm(*, focal_mm: float, gap_mm: float) -> float:
    """Return z = f·Λ / (Λ − f) (2.3), the distance of the image plane in mm.

    It is infinite for Λ = f, depth priority. It is negative for Λ < f, for which rays diverge from a plane behind the
    lenses. It is −Λ for infinite f, which does not refract.
    """
    check_lengths(gap_mm=gap_mm)
    if number("focal_mm", focal_mm) != math.inf:
        check_positive(focal_mm=focal_mm)
    if focal_mm == gap_mm:
        return math.inf
    return gap_mm / (gap_mm / focal_mm - 1)


def image_pixel_mm(*, z_mm: float, gap_mm: float, pixel_pitch_mm: float, lens_pitch_mm: float) -> float:
    """Return δPI = min(|z|·δP / Λ, δL) (2.2), the size of a pixel's image in a plane z, in mm.

    The lens pitch is its upper bound: beyond |z| = U·Λ the lenses sample more coarsely than the pixels.
    """
    check_lengths(gap_mm=gap_mm, pixel_pitch_mm=pixel_pitch_mm, lens_pitch_mm=lens_pitch_mm)
    _distance(z_mm)
    return min(abs(z_mm) * pixel_pitch_mm / gap_mm, lens_pitch_mm)


def resolution_per_mm(*, image_pixel_mm: float) -> float:
    """Return R_I = 1 / δPI, image pixels per mm; its minimum is 1/δL, for Λ = f."""
    check_positive(image_pixel_mm=image_pixel_mm)
    return 1 / image_pixel_mm


def depth_range_mm(*, z_mm: float, gap_mm: float, pixel_pitch_mm: float, lens_pitch_mm: float) -> float:
    """Return the marginal image depth Δz = 2·|z|·δPI / δL (2.4), in mm; 2·Λ·δL / δP (2.5) for Λ = f.

    At more than Δz/2 from the image plane, the cone of rays from a lens to a point is wider than an image pixel.
    (2.4) equals (2.5) at |z| = U·Λ. Beyond, δPI is bounded by δL (2.2), and (2.4) grows without limit. (2.5) is the
    range about the lens plane in which the beam of a pixel widens by less than a lens. It is returned for all these
    planes, so that Δz is continuous as Λ → f and (2.6) always holds.
    """
    pixel = image_pixel_mm(z_mm=z_mm, gap_mm=gap_mm, pixel_pitch_mm=pixel_pitch_mm, lens_pitch_mm=lens_pitch_mm)
    return 2 * min(abs(z_mm), gap_mm * lens_pitch_mm / pixel_pitch_mm) * pixel / lens_pitch_mm


def characteristic_per_mm(*, resolution_per_mm: float, depth_range_mm: float, view_angle_deg: float) -> float:
    """Return R_I²·Δz·tan(α/2), per mm; by the characteristic equation (2.6) it is R = 1/δP, pixels per mm.

    Resolution, depth range and viewing angle trade off against each other. Only finer pixels improve all three.
    """
    check_positive(resolution_per_mm=resolution_per_mm, depth_range_mm=depth_range_mm)
    check_angle(view_angle_deg)
    return resolution_per_mm**2 * depth_range_mm * math.tan(math.radians(view_angle_deg) / 2)


def diffraction_limited_per_mm(*, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """Return Δz·R_I² = 1 / λ (2.7), per mm: the limit by diffraction alone (Λ = f)."""
    check_lengths(wavelength_mm=wavelength_mm)
    return 1 / wavelength_mm


def pixel_limited_per_mm(*, pixel_pitch_mm: float, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """Return Δz·R_I²·α² = λ / δP² (2.8), per mm, α in radians.

    Pixels limit R_I = Λ/(z·δP), and diffraction limits Δz. The depth of focus is λ·(z/δL)², and α ≈ δL/Λ.
    """
    check_lengths(pixel_pitch_mm=pixel_pitch_mm, wavelength_mm=wavelength_mm)
    return wavelength_mm / pixel_pitch_mm**2


def diffraction_spot_mm(*, lens_pitch_mm: float, gap_mm: float, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """Return λ·Λ / δL, the width in mm of the diffraction-limited spot of a lens on the pixels."""
    check_lengths(lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm, wavelength_mm=wavelength_mm)
    return wavelength_mm * gap_mm / lens_pitch_mm


@checks.checked(camera=checks.instance(IICamera))
def properties(camera: IICamera, *, wavelength_mm: float = WAVELENGTH_MM) -> dict[str, Any]:
    """Return all properties of a camera as plain values; pairs are across and down.

    Returns
    -------
    dict
        ``view_angle_deg``; ``view_step_deg`` between neighbouring pixels on the axis; ``views``; ``image_planes``,
        one per focal length, see `image_planes`; ``characteristic_per_mm``, the left side of (2.6) for the first
        plane, and ``pixels_per_mm``, its right side; ``disparity_si_per_mm``, the disparity between neighbouring
        views in lens pitches per mm of depth; ``diffraction``, None for one lens without an aperture;
        ``viewing_zone``, ``cells`` and ``map_bytes``, see the functions of these names.
    """
    (pitch_x, pitch_y), gap, pixel = camera.lens_pitch_mm, camera.gap_mm, camera.pixel_pitch_mm
    vertical = camera.vertical_parallax
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


@checks.checked(camera=checks.instance(IICamera))
def image_planes(camera: IICamera) -> list[dict[str, float]]:
    """Return the image plane of each focal length with its resolution; none for a single pinhole.

    Pinholes, GRIN rods and lenticular lenses are treated as lenses with Λ = f (3.15). The plane of a spherical
    lenslet is the paraxial one: glass of thickness t adds t/n to the gap, and distances are from the top of the
    sphere.

    Returns
    -------
    list of dict
        ``focal_mm``, ``z_mm`` (2.3), ``image_pixel_mm`` (2.2), ``resolution_per_mm``, ``depth_range_mm`` (2.4, 2.5)
        and their ``view_angle_deg``; ``scene_z_mm``: the image of the plane by the elements in front of the array,
        measured from the pixel array.
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
    """Return the paraxial image of a plane z by the elements in front, mm from the pixel array."""
    for element in camera.front:
        z_mm = element.image_mm(z_mm)
    return z_mm


def viewing_zone(camera: IICamera) -> dict[str, Any]:
    """Return the viewing zone: from there every lens shows its own elementary image. Lenses in front are ignored.

    Returns
    -------
    dict
        ``nearest_mm``, the least distance of a central viewer from the lens plane, for whole lenses; ``width_mm``,
        the width across and down at that distance; ``usual_width_mm``, the width at ``usual_mm``, which
        `five_viewpoints` uses: where viewing zones meet, else three times the least distance. Widths down are
        infinite without vertical parallax.
    """
    vertical, tangents, spans = camera.vertical_parallax, [], []
    for axis in range(2):
        lattice, count = camera.lens_lattice, camera.lenses[axis]
        shift = 0.5 if lattice.hexagonal and axis == 0 and camera.lenses[1] > 1 else 0.0
        tangents.append(camera.ei_pitch_mm[axis] / (2 * camera.gap_mm))
        spans.append((count - 1 + shift) * camera.lens_pitch_mm[axis])
    used = (0, 1) if vertical else (0,)
    meeting = 0.0 if camera.viewer_mm is None else 1 / camera.viewer_mm
    halves = [(span + pitch) / 2 for span, pitch in zip(spans, camera.lens_pitch_mm, strict=True)]
    nearest = max(halves[axis] / (tangents[axis] + halves[axis] * meeting) for axis in used)

    def width(distance: float) -> list[float]:
        apart = abs(1 - distance * meeting)  # of the zones of the outermost lenses, as a share of the array
        return [
            max(0.0, 2 * distance * tangents[axis] - spans[axis] * apart) if axis in used else math.inf
            for axis in range(2)
        ]

    return {
        "nearest_mm": nearest, "width_mm": width(nearest), "usual_mm": camera.viewer_mm or 3 * nearest,
        "usual_width_mm": width(camera.viewer_mm or 3 * nearest),
    }  # fmt: skip


def cells(camera: IICamera) -> dict[str, Any]:
    """Return how elementary images divide the pixels.

    Returns
    -------
    dict
        ``unowned``: share of pixels without an owner, see `regular`. ``shared``: share of pixels in the middle of the
        sensor that lie in two cells and mix two directions. ``pixels_per_lens``: least and most. ``aperture_share``:
        area of the aperture over that of the cell, None without an aperture. ``rim_image_mm``: width under a lens of
        the image of the first rim or pupil in front, None without one. Elementary images overlap if it is wider than
        a cell and have a dark border if it is narrower.
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
    opening, width = next(filter(None, (e.pupil() for e in camera.front)), (camera.gap_mm, 0.0))
    distance = opening - camera.gap_mm
    return {
        "unowned": unowned,
        "shared": shared,
        "pixels_per_lens": [least, most],
        "aperture_share": None if aperture is None else math.pi * aperture**2 / 4 / (pitch[0] * pitch[1]),
        "rim_image_mm": width * camera.gap_mm / abs(distance) if distance else None,
    }


def _shared(camera: IICamera) -> float:
    """Return the share of pixels in the middle of the sensor whose corners have different owners."""
    lattice, size = camera.lens_lattice, tuple(min(PATCH, n) for n in camera.pixels)
    x, y = (o - (n - s) // 2 for o, n, s in zip(lattice.origin, camera.pixels, size, strict=True))
    inset = 0.499  # of a pixel: a corner exactly on a border is on neither side
    corners = [
        owners(lattice._replace(origin=(x + dx, y + dy)), (size[0], size[1]))
        for dx in (-inset, inset)
        for dy in (-inset, inset)
    ]
    return float((np.ptp(corners, axis=0) > 0).mean())


def map_bytes(camera: IICamera) -> dict[str, int]:
    """Return the bytes of the L and D maps of one sample by format, uncompressed; ``hdr`` is RGBE."""
    count = camera.pixels[0] * camera.pixels[1]
    return {name: size * count for name, size in MAP_BYTES.items()}


def _diffraction(camera: IICamera, wavelength_mm: float) -> dict[str, Any] | None:
    """Return the diffraction spot of the lens or its aperture against the pixel; None for a single pinhole."""
    aperture = getattr(camera.lens_model, "aperture_mm", None)
    if camera.lenses == (1, 1) and not aperture:
        return None
    width = min(aperture, camera.lens_pitch_mm[0]) if aperture else camera.lens_pitch_mm[0]
    spot = diffraction_spot_mm(lens_pitch_mm=width, gap_mm=camera.gap_mm, wavelength_mm=wavelength_mm)
    return {"wavelength_mm": wavelength_mm, "spot_mm": spot, "limits": spot > camera.pixel_pitch_mm}


def check_lengths(**values: float) -> None:
    """Check parameters of a camera."""
    for name, value in values.items():
        length(name, value)


def check_positive(**values: float) -> None:
    """Check what follows from lengths: a camera of allowed lengths never leaves these bounds."""
    for name, value in values.items():
        within(name, value, 1e-100, 1e100)


def _distance(z_mm: float) -> None:
    if not abs(number("z_mm", z_mm)) > 0:
        raise ValueError(f"z_mm is {z_mm:g}: a distance other than 0 is needed")


def check_angle(view_angle_deg: float) -> None:
    if not 0 < number("view_angle_deg", view_angle_deg) < 180:
        raise ValueError(f"view_angle_deg is {view_angle_deg:g}: an angle between 0 and 180° is needed")
