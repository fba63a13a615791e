"""Design of an integral-imaging display from a panel, a lens pitch and a viewer's distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ..base.checks import Pair, length, number, place, whole_pair
from ..camera.camera import MOST_ALONG, IICamera

ANGLE_DEG = 30.0  # of a lens, if neither gap nor angle is given
FAR_OFF = 0.25  # share by which whole pixels that divide the panel may miss the wanted pitch


@dataclass(frozen=True)
class PanelDesign:
    """A display: its camera, and notes on what differs from the wishes."""

    camera: IICamera
    notes: tuple[str, ...]


def panel_display(
    *,
    size_mm: float | Sequence[float],
    pixels: Pair,
    lens_pitch_mm: float,
    viewer_mm: float,
    gap_mm: float | None = None,
    view_angle_deg: float | None = None,
    start_mm: float | None = None,
    lenses: Pair | None = None,
    enlarge: float = 1.0,
    name: str = "panel",
) -> PanelDesign:
    """Design the camera whose picture a panel behind lenses has to show.

    Light of a pixel p leaves a lens c towards the viewer along c − p, as if it came from behind the lens along p − c:
    the camera has erect elementary images. Their pitch is P = δL·(1 + Λ/d), so that at the viewer's distance d all
    lenses show their own elementary image over the same zone, P·d/Λ wide.

    Parameters
    ----------
    size_mm : float or (float, float)
        Diagonal of the panel, or width and height.
    pixels : (M, N)
        Of the panel.
    lens_pitch_mm : float
        δL. Without ``lenses`` it is a wish: elementary images get whole pixels that divide the panel, and the pitch
        that comes of it is noted.
    viewer_mm : float
        d, from the lenses.
    gap_mm, view_angle_deg : float, optional
        Λ, or the angle that one lens sees; 30° if neither is given.
    start_mm : float, optional
        How far before the display the scene may reach; half of d if not given.
    lenses : (K, L), optional
        Lenses of a sheet that is there: its pitch is kept, and elementary images need not have whole pixels.
    enlarge : float
        How many times as large the display shows the scene: lengths of the camera are those of the display over it.
    name : str

    Returns
    -------
    PanelDesign

    Raises
    ------
    ValueError
        If a value is out of range, gap and angle are both given, or a lens covers less than 2 pixels.
    """
    across, down = whole_pair("pixels", pixels)
    if max(across, down) > MOST_ALONG:
        raise ValueError(f"pixels are {across}×{down}: at most {MOST_ALONG} a side are needed")
    if start_mm is not None:
        number("start_mm", start_mm)
    if not 0 < number("enlarge", enlarge) <= 1e4:
        raise ValueError(f"enlarge is {enlarge:g}: a positive factor is needed")
    wish, viewer = length("lens_pitch_mm", lens_pitch_mm), length("viewer_mm", viewer_mm)
    width, height = _panel(size_mm, (across, down))
    pixel = width / across
    notes = []
    if abs(height / down / pixel - 1) > 0.01:
        notes.append(f"pixels are {pixel:.5g} mm wide and {height / down:.5g} mm high: square ones are assumed")
    gap = _gap(wish, gap_mm, view_angle_deg)
    if lenses is not None:
        lenses, pitch, used = whole_pair("lenses", lenses), wish, (across, down)
        notes += _off_panel(lenses, pitch * (1 + gap / viewer), pixel, used)
    else:
        under = wish * (1 + gap / viewer) / pixel
        if under < 2:
            raise ValueError(
                f"a lens of {wish:g} mm covers {under:.3g} pixels of {pixel:.4g} mm: at least 2 are needed"
            )
        if under > min(across, down):
            raise ValueError(f"a lens of {wish:g} mm is larger than the panel of size_mm {width:.4g}×{height:.4g}")
        count = _dividing(under, across, down)
        lenses, used = (across // count, down // count), (across // count * count, down // count * count)
        pitch = count * pixel / (1 + gap / viewer)
        if gap_mm is None:  # the angle is kept
            pitch, gap = _with_angle(count * pixel, viewer, wish / (2 * gap))
        notes.append(f"{count} pixels under a lens: a lens pitch of {pitch:.6g} mm for the {wish:g} mm given")
        if used != (across, down):
            notes.append(f"the picture has {used[0]}×{used[1]} of the panel's pixels: show it in the middle")
    camera = IICamera(
        pixels=used, lenses=lenses, pixel_pitch_mm=pixel / enlarge, gap_mm=gap / enlarge, optics=("grin",),  # type: ignore[arg-type]
        lens_pitch_mm=(pitch / enlarge, pitch / enlarge), viewer_mm=viewer / enlarge,
        start_mm=(viewer / 2 if start_mm is None else start_mm) / enlarge, name=name,
    )  # fmt: skip
    zone = camera.ei_pitch_mm[0] * enlarge * viewer / gap
    notes.append(
        f"at {viewer:g} mm the viewing zone is {zone:.4g} mm wide, its views {zone / camera.ei_pixels[0]:.3g} mm"
    )
    if enlarge != 1:
        notes.append(
            f"the scene is shown {enlarge:g} times as large: the camera is the display, {enlarge:g} times smaller"
        )
    return PanelDesign(camera, tuple(notes))


def _panel(size_mm: float | Sequence[float], pixels: Pair) -> tuple[float, float]:
    if isinstance(size_mm, Sequence):
        width, height = place("size_mm", size_mm, 2)
        return length("size_mm", width), length("size_mm", height)
    diagonal = length("size_mm", size_mm)
    return diagonal * pixels[0] / math.hypot(*pixels), diagonal * pixels[1] / math.hypot(*pixels)


def _gap(pitch: float, gap_mm: float | None, view_angle_deg: float | None) -> float:
    if gap_mm is not None and view_angle_deg is not None:
        raise ValueError("gap_mm and view_angle_deg are both given: one follows from the other, leave one out")
    if gap_mm is not None:
        return length("gap_mm", gap_mm)
    angle = ANGLE_DEG if view_angle_deg is None else number("view_angle_deg", view_angle_deg)
    if not 0 < angle < 180:
        raise ValueError(f"view_angle_deg is {angle:g}: an angle between 0 and 180° is needed")
    return pitch / (2 * math.tan(math.radians(angle) / 2))


def _with_angle(ei_pitch: float, viewer: float, tangent: float) -> tuple[float, float]:
    """δL and Λ of elementary images of pitch P, Λ = δL/2t: the root of δL·(1 + δL/2td) = P."""
    pitch = viewer * tangent * (math.sqrt(1 + 2 * ei_pitch / (tangent * viewer)) - 1)
    return pitch, pitch / (2 * tangent)


def _dividing(under: float, across: int, down: int) -> int:
    """Whole pixels under a lens, nearest by ratio of those that divide the panel; plain rounding if none is near."""
    common = math.gcd(across, down)
    divisors = [n for n in range(2, common + 1) if common % n == 0]
    best = min(divisors, key=lambda n: abs(math.log(n / under)), default=0)
    return best if best and abs(best / under - 1) <= FAR_OFF else round(under)


def _off_panel(lenses: Pair, ei_pitch: float, pixel: float, pixels: Pair) -> list[str]:
    notes = []
    for count, size, what in ((lenses[0], pixels[0], "columns"), (lenses[1], pixels[1], "rows")):
        inside = min(count, math.floor(size * pixel / ei_pitch + 1e-9))
        inside -= (count - inside) % 2  # the sheet is centred: as many are off on either side
        if inside < count:
            notes.append(
                f"warning: {count - inside} of {count} {what} of lenses have elementary images of {ei_pitch:.5g} mm "
                f"that leave the panel: at most {inside} {what} fit"
            )
    return notes
