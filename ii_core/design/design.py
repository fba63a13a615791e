"""Design of cameras: solver for lengths and angles, report of properties and limits.

Symbols as in `ii_core.design.properties`.
"""

from __future__ import annotations

import math
import textwrap
from typing import Any

from ..base.checks import number
from ..camera.camera import IICamera
from .properties import check_angle, check_lengths, check_positive, properties, through_front_mm

SAMPLING = ("lens_pitch_mm", "pixel_pitch_mm", "ei_pixels")
SEEING = ("lens_pitch_mm", "gap_mm", "view_angle_deg")
ALL = ("lens_pitch_mm", "gap_mm", "pixel_pitch_mm", "ei_pixels", "view_angle_deg")


def solve(
    *,
    lens_pitch_mm: float | None = None,
    gap_mm: float | None = None,
    pixel_pitch_mm: float | None = None,
    ei_pixels: float | None = None,
    view_angle_deg: float | None = None,
) -> dict[str, float]:
    """Solve for lens pitch, gap, pixel pitch, pixels under a lens and viewing angle, given three of them.

    They satisfy two equations, δL = U·δP and tan(α/2) = δL / 2Λ (2.1).

    Returns
    -------
    dict
        Values by parameter name, all five.

    Raises
    ------
    ValueError
        If a value is out of range, or the values are too few, too many or contradictory.
    """
    values = dict(
        lens_pitch_mm=lens_pitch_mm, gap_mm=gap_mm, pixel_pitch_mm=pixel_pitch_mm, ei_pixels=ei_pixels,
        view_angle_deg=view_angle_deg,
    )  # fmt: skip
    known = {name: number(name, value) for name, value in values.items() if value is not None}
    _check(known)
    _check_determined(known)
    while len(known) < len(values):
        known |= _consequences(known)
    _check(known)
    return {name: known[name] for name in values}


def _check(known: dict[str, float]) -> None:
    check_lengths(**{name: value for name, value in known.items() if name.endswith("_mm")})
    check_positive(**{name: value for name, value in known.items() if name == "ei_pixels"})
    if "view_angle_deg" in known:
        check_angle(known["view_angle_deg"])


def _consequences(known: dict[str, float]) -> dict[str, float]:
    """Return the unknowns that follow from an equation with one unknown."""
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
    """Raise ValueError unless three values are given that do not determine one equation completely."""
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
    if abs(given - told) > 1e-6 * told:  # tolerance for values rounded to six digits
        return f"contradictory: {name} is {given:.6g}, the others make it {told:.6g}. {why}"
    return f"over-determined: the others make {name} {told:.6g} already. {why}"


def report(camera: IICamera) -> str:
    """Return a design report: the properties of a camera, and sentences on their limits."""
    p = properties(camera)
    lines = _structure_lines(p) + _plane_lines(camera, p)
    if camera.lenses != (1, 1):
        lines += _zone_lines(p)
    if camera.start_mm:
        lines.append(f"rays start         {camera.start_mm:.4g} mm behind the lenses: a virtual display plane")
    if camera.viewer_mm is not None:
        image = f"elementary images of {_pair(list(camera.ei_pitch_mm))} mm"
        lines.append(f"zones meet         {camera.viewer_mm:.4g} mm before the lenses, {image}")
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
        f"  width            {there} mm there, {further} mm at {zone['usual_mm']:.4g} mm",
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
        # 1 % is less than a pixel of all elementary images in use.
        verdict = "would overlap" if rim > pitch * 1.01 else "dark around" if rim < pitch * 0.99 else "just touch"
        lines.append(f"  rim in front     imaged {rim:.4g} mm wide in cells of {pitch:.4g} mm: {verdict}")
    return lines


def _limit_lines(camera: IICamera, p: dict[str, Any]) -> list[str]:
    """Return one sentence per limit."""
    lines = _array_limits(p) if camera.lenses != (1, 1) else ["One view: pixels alone limit its resolution."]
    if (diffraction := p["diffraction"]) is not None:
        wave, spot, pixel = diffraction["wavelength_mm"] * 1e6, diffraction["spot_mm"], p["pixel_pitch_mm"]
        lines.append(
            f"At {wave:.0f} nm diffraction spreads a point over λΛ/δL = {spot * 1e3:.3g} µm of the sensor, "
            f"a pixel has {pixel * 1e3:.3g} µm: "
            + ("diffraction limits, finer pixels gain nothing." if diffraction["limits"] else "the pixel limits.")
        )
    if not camera.vertical_parallax:
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
