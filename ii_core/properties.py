"""What an II-camera can do: viewing angle, image plane, resolution, depth range, what limits them, and a design aid.

Symbols: δL lens pitch, Λ gap, δP pixel pitch, U = δL/δP pixels under a lens, f focal length, α viewing angle.
Distances z are from the lens plane into the scene unless a name says otherwise.
"""

from __future__ import annotations

import math
import textwrap
from typing import Any

import numpy as np

from .camera import IICamera
from .optics import Lens, Lenslet, SphericalLenslet
from .regular import owners

WAVELENGTH_MM = 0.00055  # green, where eyes and sensors see best
MAP_BYTES = {"exr": 24, "png16": 12, "png8": 6, "hdr": 8}  # of L and D, a pixel, before the file type packs them
SAMPLING = ("lens_pitch_mm", "pixel_pitch_mm", "ei_pixels")
SEEING = ("lens_pitch_mm", "gap_mm", "view_angle_deg")
ALL = ("lens_pitch_mm", "gap_mm", "pixel_pitch_mm", "ei_pixels", "view_angle_deg")
PATCH = 512  # pixels each way over which borders of cells are looked at


def view_angle_deg(*, lens_pitch_mm: float, gap_mm: float) -> float:
    """α = 2·arctan(δL / 2Λ) (2.1), the full angle, in degrees, that one lens sees: 180 as Λ → 0.

    Raises
    ------
    ValueError
        If a length is not positive and finite, as in all functions here.
    """
    _lengths(lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm)
    return math.degrees(2 * math.atan(lens_pitch_mm / (2 * gap_mm)))


def image_plane_mm(*, focal_mm: float, gap_mm: float) -> float:
    """z = f·Λ / (Λ − f) (2.3), mm: where a lens images the pixels.

    Infinite for Λ = f, depth priority. Negative for Λ < f: rays diverge as from a plane behind the lenses. −Λ for an
    infinite f, which bends nothing.
    """
    _lengths(gap_mm=gap_mm)
    if not focal_mm > 0:
        raise ValueError(f"focal_mm is {focal_mm:g}: a positive length is needed")
    if focal_mm == gap_mm:
        return math.inf
    return gap_mm / (gap_mm / focal_mm - 1)


def image_pixel_mm(*, z_mm: float, gap_mm: float, pixel_pitch_mm: float, lens_pitch_mm: float) -> float:
    """δPI = min(|z|·δP / Λ, δL) (2.2), mm: the size of a pixel's image in a plane z.

    Never above the lens pitch: from |z| = U·Λ on, to infinity, the lenses sample coarser than the pixels do.
    """
    _lengths(gap_mm=gap_mm, pixel_pitch_mm=pixel_pitch_mm, lens_pitch_mm=lens_pitch_mm)
    _distance(z_mm)
    return min(abs(z_mm) * pixel_pitch_mm / gap_mm, lens_pitch_mm)


def resolution_per_mm(*, image_pixel_mm: float) -> float:
    """R_I = 1 / δPI, image pixels a millimetre; 1/δL at the least, where Λ = f."""
    _lengths(image_pixel_mm=image_pixel_mm)
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
    _lengths(resolution_per_mm=resolution_per_mm, depth_range_mm=depth_range_mm)
    _angle(view_angle_deg)
    return resolution_per_mm**2 * depth_range_mm * math.tan(math.radians(view_angle_deg) / 2)


def diffraction_limited_per_mm(*, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """Δz·R_I² = 1 / λ (2.7), per mm: where diffraction alone limits both (Λ = f)."""
    _lengths(wavelength_mm=wavelength_mm)
    return 1 / wavelength_mm


def pixel_limited_per_mm(*, pixel_pitch_mm: float, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """Δz·R_I²·α² = λ / δP² (2.8), per mm, α in radians: where pixels limit R_I = Λ/(z·δP) and diffraction Δz.

    The depth of focus is then λ·(z/δL)², and α ≈ δL/Λ.
    """
    _lengths(pixel_pitch_mm=pixel_pitch_mm, wavelength_mm=wavelength_mm)
    return wavelength_mm / pixel_pitch_mm**2


def diffraction_spot_mm(*, lens_pitch_mm: float, gap_mm: float, wavelength_mm: float = WAVELENGTH_MM) -> float:
    """λ·Λ / δL, mm: the width, on the pixels, of the spot to which a lens can focus at best."""
    _lengths(lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm, wavelength_mm=wavelength_mm)
    return wavelength_mm * gap_mm / lens_pitch_mm


def solve(
    *,
    lens_pitch_mm: float | None = None,
    gap_mm: float | None = None,
    pixel_pitch_mm: float | None = None,
    ei_pixels: float | None = None,
    view_angle_deg: float | None = None,
) -> dict[str, float]:
    """All of lens pitch, gap, pixel pitch, pixels under a lens and viewing angle from three of them.

    Two equations bind them, δL = U·δP and tan(α/2) = δL / 2Λ (2.1).

    Returns
    -------
    dict
        Values by parameter name, all five.

    Raises
    ------
    ValueError
        If a value is out of range, or the values leave some other open, give one twice, or contradict one another.
    """
    values = dict(
        lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm, pixel_pitch_mm=pixel_pitch_mm, ei_pixels=ei_pixels,
        view_angle_deg=view_angle_deg,
    )  # fmt: skip
    known = {name: float(value) for name, value in values.items() if value is not None}
    _lengths(**{name: value for name, value in known.items() if name != "view_angle_deg"})
    if "view_angle_deg" in known:
        _angle(known["view_angle_deg"])
    _check_determined(known)
    while len(known) < len(values):
        known |= _consequences(known)
    _lengths(
        **{name: value for name, value in known.items() if name != "view_angle_deg"}
    )  # nothing ran out of floats
    _angle(known["view_angle_deg"])
    return {name: known[name] for name in values}


def _consequences(known: dict[str, float]) -> dict[str, float]:
    """What either equation gives of what is not known yet, once it lacks but one."""
    pitch, gap, pixel, count, angle = (known.get(name) for name in ALL)
    tangent = None if angle is None else 2 * math.tan(math.radians(angle) / 2)
    found: dict[str, float | None] = {}
    if pitch is None:
        found["lens_pitch_mm"] = _product(count, pixel) if pixel and count else _product(tangent, gap)
    if gap is None:
        found["gap_mm"] = _ratio(pitch, tangent)
    if pixel is None:
        found["pixel_pitch_mm"] = _ratio(pitch, count)
    if count is None:
        found["ei_pixels"] = _ratio(pitch, pixel)
    if angle is None and pitch and gap:
        found["view_angle_deg"] = math.degrees(2 * math.atan(pitch / (2 * gap)))
    return {name: value for name, value in found.items() if value is not None}


def _product(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a * b


def _ratio(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a / b if b else math.inf


def _check_determined(known: dict[str, float]) -> None:
    """Raise ValueError unless three values are given, and no equation has all of its own."""
    complaints = []
    for names, law, others in ((SAMPLING, "δL = U·δP", SEEING[1:]), (SEEING, "tan(α/2) = δL / 2Λ", SAMPLING[1:])):
        if all(name in known for name in names):
            told = _consequences({name: known[name] for name in names[:-1]})[names[-1]]
            missing = "" if any(name in known for name in others) else f" and give {' or '.join(others)}"
            why = f"{law} binds {', '.join(names)}: leave one out{missing}"
            complaints.append(_complaint(names[-1], known[names[-1]], told, why))
    if not complaints and len(known) > 3:  # all but the lens pitch
        by_pixels, by_angle = (
            _consequences({name: known[name] for name in law[1:]})["lens_pitch_mm"] for law in (SAMPLING, SEEING)
        )
        why = "pixels give it, and gap and angle: leave one of them out"
        complaints.append(_complaint("lens_pitch_mm", by_pixels, by_angle, why))
    if complaints:
        raise ValueError(min(complaints))  # "contradictory" comes before "over-determined"
    if len(known) < 3:
        raise ValueError(
            f"under-determined: {', '.join(known) or 'nothing'} given, three are needed of {', '.join(ALL)}: "
            "at least one of pixel_pitch_mm, ei_pixels and at least one of gap_mm, view_angle_deg"
        )


def _complaint(name: str, given: float, told: float, why: str) -> str:
    if abs(given - told) > 1e-6 * told:  # the rounding of a value copied with six digits is no contradiction
        return f"contradictory: {name} is {given:.6g}, the others make it {told:.6g}. {why}"
    return f"over-determined: the others make {name} {told:.6g} already. {why}"


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


def report(camera: IICamera) -> str:
    """A design report: the camera's properties and, in words, what limits what."""
    p = properties(camera)
    lines = _structure_lines(p) + _plane_lines(camera, p)
    if camera.lenses != (1, 1):
        lines += _zone_lines(p)
    lines += _cell_lines(camera, p)
    sizes = ", ".join(f"{name} {size / 1e6:.4g} MB" for name, size in p["map_bytes"].items())
    lines += [f"L and D maps       {sizes}, unpacked", ""]
    for sentence in _limit_lines(camera, p):
        lines += textwrap.wrap(sentence, 100, initial_indent="- ", subsequent_indent="  ")
    return "\n".join(lines) + "\n"


def _structure_lines(p: dict[str, Any]) -> list[str]:
    (m, n), (k, l), (u, v) = p["pixels"], p["lenses"], p["ei_pixels"]
    across, down = p["view_angle_deg"]
    return [
        f"{p['name'] or 'camera'}: {m}×{n} px of {p['pixel_pitch_mm'] * 1e3:.4g} µm under {k}×{l} lenses, "
        f"{p['lattice']}, {' + '.join(p['optics'])}",
        f"elementary image   {u:.5g}×{v:.5g} px, lens pitch {_pair(p['lens_pitch_mm'])} mm, gap {p['gap_mm']:.4g} mm",
        f"viewing angle      {across:.4g}° across, {down:.4g}° down, {p['view_step_deg']:.3g}° a pixel (2.1)",
    ]


def _plane_lines(camera: IICamera, p: dict[str, Any]) -> list[str]:
    if not p["image_planes"]:
        lines = ["image plane        none: a lone pinhole, sharp throughout, an image pixel is z·δP/Λ"]
    else:
        lines = []
        for plane in p["image_planes"]:
            z, far = plane["z_mm"], plane["image_pixel_mm"] >= p["lens_pitch_mm"][0] * (1 - 1e-9)
            place = f"{z:.4g} mm from the lenses" if math.isfinite(z) else "at infinity"
            about = "lenses (2.5)" if far else "plane (2.4)"
            lens = f"f = {plane['focal_mm']:.4g} mm" if camera.samples_aperture else "no focus: as if Λ = f"
            lines += [
                f"image plane        {place}, {lens} (2.3)",
                f"  image pixel      {plane['image_pixel_mm']:.4g} mm, {plane['resolution_per_mm']:.4g} a mm (2.2)",
                f"  depth range      {plane['depth_range_mm']:.4g} mm about the {about}",
            ]
            if camera.front:
                seen = plane["scene_z_mm"]
                place = f"z = {seen:.4g} mm" if math.isfinite(seen) else "infinity"
                lines.append(f"  through front    imaged to {place}")
    if camera.front:
        display = through_front_mm(camera, camera.gap_mm)
        lines.append(f"display plane      imaged by what stands in front to z = {display:.4g} mm")
    return lines


def _zone_lines(p: dict[str, Any]) -> list[str]:
    zone = p["viewing_zone"]
    there, further = _pair(zone["width_mm"]), _pair(zone["usual_width_mm"])
    return [
        f"viewing zone       every lens shows its own image from {zone['nearest_mm']:.4g} mm on",
        f"  width            {there} mm there, {further} mm three times as far",
    ]


def _cell_lines(camera: IICamera, p: dict[str, Any]) -> list[str]:
    cell, pitch = p["cells"], p["lens_pitch_mm"][0]
    least, most = cell["pixels_per_lens"]
    count = f"{least} px a lens" if least == most else f"{least} to {most} px a lens"
    shares = f"{cell['unowned']:.2%} of pixels under no lens, {cell['shared']:.1%} across a border, mixing two"
    lines = [f"elementary images  {count}, " + ("no pixel dark or shared" if camera.regular else shares)]
    if cell["aperture_share"] is not None:
        lines.append(f"  aperture         {cell['aperture_share']:.1%} of a lens's cell is clear")
    if (rim := cell["rim_image_mm"]) is not None:
        # A hundredth is less than a pixel of any elementary image in use.
        verdict = "would overlap" if rim > pitch * 1.01 else "dark around" if rim < pitch * 0.99 else "just touch"
        lines.append(f"  rim in front     imaged {rim:.4g} mm wide in cells of {pitch:.4g} mm: {verdict}")
    return lines


def _limit_lines(camera: IICamera, p: dict[str, Any]) -> list[str]:
    """What limits what, a sentence each."""
    lines = _array_limits(p) if camera.lenses != (1, 1) else ["One view: pixels alone limit its resolution."]
    if (diffraction := p["diffraction"]) is not None:
        wave, spot, pixel = diffraction["wavelength_mm"] * 1e6, diffraction["spot_mm"], p["pixel_pitch_mm"]
        lines.append(
            f"At {wave:.0f} nm diffraction spreads a point over λΛ/δL = {spot * 1e3:.3g} µm of the sensor, "
            f"a pixel has {pixel * 1e3:.3g} µm: "
            + ("diffraction limits, finer pixels gain nothing." if diffraction["limits"] else "the pixel limits.")
        )
    if not camera.lens_model.vertical_parallax:
        lines.append("No parallax down: rows are sharp to the pixel, and all views have one height.")
    if not camera.regular:
        lines.append(
            "Not regular: component images need smallest rectangles or resampling first, so as to have whole pixels."
        )
    return lines


def _array_limits(p: dict[str, Any]) -> list[str]:
    (u, v), pitch, alias = p["views"], p["lens_pitch_mm"][0], 1 / p["disparity_si_per_mm"]
    fine = any(plane["image_pixel_mm"] < pitch * (1 - 1e-9) for plane in p["image_planes"])
    return [
        f"Pixel pitch limits directions: {u:.4g}×{v:.4g} views, {p['view_step_deg']:.3g}° apart. Finer pixels give "
        "more; so do larger lenses, at the cost of spatial resolution.",
        f"Lens pitch limits spatial resolution: a view has {p['lenses'][0]}×{p['lenses'][1]} points. "
        + (
            "Near its image plane pixels resolve more."
            if fine
            else "The image plane is too far for pixels to resolve more."
        ),
        f"Resolution² × depth range × tan(α/2) is {p['characteristic_per_mm']:.5g} a mm, the sensor's "
        f"{p['pixels_per_mm']:.5g} pixels a mm (2.6): each is bought with another, only finer pixels improve all.",
        f"A point moves {p['disparity_si_per_mm']:.3g} lens pitches from view to view for each mm from the lenses: "
        f"from UΛ = {alias:.4g} mm on by over one, so that fine detail aliases between views.",
    ]


def _pair(values: list[float]) -> str:
    across, down = values
    return f"{across:.4g}" if across == down else f"{across:.4g}×{down:.4g}"


def _lengths(**values: float) -> None:
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise ValueError(f"{name} is {value:g}: a positive, finite number is needed")


def _distance(z_mm: float) -> None:
    if not abs(z_mm) > 0:
        raise ValueError(f"z_mm is {z_mm:g}: a distance other than 0 is needed")


def _angle(view_angle_deg: float) -> None:
    if not 0 < view_angle_deg < 180:
        raise ValueError(f"view_angle_deg is {view_angle_deg:g}: an angle between 0 and 180° is needed")
