"""Camera of a raw lenslet picture, from a white image or from the picture itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.checks import length
from ..base.colour import linear, srgb
from ..camera.camera import IICamera
from ..camera.lattice import DRIFT_TERMS, LATTICES, Drift
from ..formats.lytro import RawColour
from ..picture.picture import IIPicture
from ..picture.regular import owners
from .demosaic import METHODS, MOSAICS, demosaiced, evened
from .peaks import NoLenses

if TYPE_CHECKING:  # scipy takes a third of a second
    from .grid import LensGrid
    from .lens_types import LensTypes
    from .multi_focus import Foci

PIXEL_MM = 0.0061  # where nothing is known: that of the presets, and their viewing angle
HALF_ANGLE_TAN = math.tan(math.radians(29.9 / 2))
CURVES = ("linear", "srgb")
BLOCK = 256  # rows in one call of numpy
MOST_LEAN = 20.0  # degrees that rows of a hexagonal lattice may rise before columns are taken for rows


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A lenslet camera found in a picture.

    Attributes
    ----------
    camera : IICamera
        Of the picture, whose lattice is turned, offset and sheared as it was found.
    grid : LensGrid
        Centres and residuals.
    source : str
        What the centres were found in: "white image" or "picture itself".
    types : LensTypes
        Whether lenses of several kinds take turns.
    turned : bool
        The picture must be turned by 90° (`numpy.rot90`) first, because its rows of lenses run down.
    assumed : tuple of str
        Measures of the camera that no picture tells, and that were not given.
    foci : Foci, optional
        Where each type of lens is in focus, of `lens_foci`; the camera then has its focal lengths.
    """

    camera: IICamera
    grid: LensGrid
    source: str
    types: LensTypes
    turned: bool
    assumed: tuple[str, ...]
    foci: Foci | None = None

    def report(self) -> dict[str, Any]:
        """Everything that was found, as plain values: pixels, degrees, counts, and what could not be told."""
        grid, lattice = self.grid, self.grid.lattice
        residuals = np.hypot(*grid.residuals.T)
        width, height = self.camera.pixels
        left, top = lattice.origin
        (k, l), (across, down) = lattice.lenses, lattice.pitch
        return {
            "source": self.source,
            "lattice": "hexagonal" if lattice.hexagonal else "rectangular",
            "lenses": [k, l],
            "lens_pitch_px": [across, down],
            "middle_px": [float(x) for x in lattice.middle],
            "turn_deg": grid.turn_deg,
            "shear": grid.shear,
            "picture_turned_90_deg": self.turned,
            "pitch_error_px": [float(e) for e in self._pitch_error()],
            "residual_rms_px": grid.rms_px,
            "residual_median_px": float(np.median(residuals)),
            "residual_greatest_px": float(residuals.max()),
            "centres": len(grid.places),
            "centres_used": int(grid.used.sum()),
            "dark_lenses": int(grid.dark.sum()),
            "saturated_lenses": int(grid.saturated.sum()),
            "drift_px": grid.drift_px,
            "drift_pitches": grid.drift_px / min(across, down),
            "straight_grid_rms_px": grid.straight_rms_px,
            "lens_types": self.types.describe(),
            "lens_type_rows": [list(row) for row in self.types.rows],
            "foci_shift": None if self.foci is None else list(self.foci.shifts),
            "pixels_outside": {
                "left": max(0.0, left),
                "right": max(0.0, width - left - k * across),
                "top": max(0.0, top),
                "bottom": max(0.0, height - top - l * down),
            },
            "not_told": self.not_told(),
        }

    def not_told(self) -> list[str]:
        """Parameters that were assumed, since a picture does not contain them."""
        notes = [f"{what}: assumed, depth in millimetres has no scale" for what in self.assumed]
        notes.append("lens centres: the middles of micro-images stand for them, as if seen from far away")
        notes.append("main lens: depth is that of the image that it makes, on both sides of the lens plane")
        if self.source != "white image":
            notes.append(
                "centres: found in the picture itself, whose content pulls them about; a white image is surer"
            )
        return notes

    def describe(self) -> str:
        """The report in a few lines."""
        r, lattice = self.report(), self.grid.lattice
        (k, l), (across, down), outside = lattice.lenses, lattice.pitch, r["pixels_outside"]
        errors, drift = r["pitch_error_px"], self.grid.drift_px
        return "\n".join(
            [
                f"{r['lattice']}, {k}×{l} lenses of {across:.4f}×{down:.4f} px (± {errors[0]:.4f}, {errors[1]:.4f}), "
                f"turned by {r['turn_deg']:.4f}°, shear {r['shear']:.5f}; from the {self.source}",
                f"centres lie {r['residual_rms_px']:.3f} px rms off the grid, at most "
                f"{r['residual_greatest_px']:.2f}; {r['centres_used']} of {r['centres']} used, "
                f"{r['dark_lenses']} dark, {r['saturated_lenses']} saturated",
                *(
                    [
                        f"centres drift by up to {drift:.2f} px, {r['drift_pitches']:.2f} of the pitch, off the "
                        f"straight grid of the middle: the camera follows; the best straight grid misses them by "
                        f"{r['straight_grid_rms_px']:.3f} px rms"
                    ]
                    if drift
                    else []
                ),
                f"beyond the lenses lie {outside['left']:.1f} px at the left, {outside['right']:.1f} at the right, "
                f"{outside['top']:.1f} at the top, {outside['bottom']:.1f} at the bottom: no view shows them",
                f"lens types: {r['lens_types']}",
                *([] if self.foci is None else [self.foci.describe()]),
                *(["rows of lenses run down: the picture is turned by 90°"] if self.turned else []),
                *(f"not told: {note}" for note in r["not_told"]),
            ]
        )

    def _pitch_error(self) -> NDArray[np.float64]:
        """Standard error of the pitch, across and down, pixels."""
        used = self.grid.places[self.grid.used]
        spread = np.maximum((used - used.mean(axis=0)).std(axis=0) / np.array(self.grid.lattice.pitch), 1e-9)
        return self.grid.residuals.std(axis=0) / spread / math.sqrt(len(used))


@checks.checked(
    raw=checks.array, white=checks.array, dark=checks.array, mosaic=checks.one_of(*MOSAICS),
    lattice=checks.one_of(*LATTICES), name=checks.text,
)  # fmt: skip
def calibrate(
    raw: NDArray[Any],
    *,
    white: NDArray[Any] | None = None,
    dark: NDArray[Any] | None = None,
    mosaic: str | None = None,
    lattice: str | None = None,
    pixel_pitch_mm: float | None = None,
    gap_mm: float | None = None,
    name: str = "calibrated",
) -> Calibration:
    """The camera of a raw lenslet picture.

    Its periods are found in its autocorrelation; then the centres of all micro-images, to a fraction of a pixel; then
    the lattice through them by least squares, with a drift if there is one, outliers thrown out. See
    ``calibration.grid.lens_grid``.

    Parameters
    ----------
    raw : ndarray, (N, M) or (N, M, 1 or 3)
        The picture as the sensor gave it.
    white : ndarray, as ``raw``, optional
        Taken of an even, bright surface. Without it the picture itself is searched, whose micro-images must have
        dark borders, as behind a main lens.
    dark : ndarray, as ``raw``, optional
        Taken without light; subtracted.
    mosaic : {"rggb", "bggr", "grbg", "gbrg"}, optional
        Of the sensor's colours, if the picture is not demosaiced.
    lattice : {"rectangular", "hexagonal"}, optional
        Found if not given.
    pixel_pitch_mm, gap_mm : float, optional
        δP and Λ, which no picture tells: 6.1 µm, and a viewing angle of 29.9°, are assumed.
    name : str
        Of the camera.

    Returns
    -------
    Calibration

    Raises
    ------
    NoLenses
        If there is no lens grid in the picture, or its drift is too steep for a camera. It is a ValueError.
    ValueError
        If the frames differ in size or have values that are not finite, or a length is not positive.
    """
    from .lens_types import lens_types

    for what, value in (("pixel_pitch_mm", pixel_pitch_mm), ("gap_mm", gap_mm)):
        if value is not None:
            length(what, value)
    frames = {"raw": raw, "white": white, "dark": dark}
    for what, frame in frames.items():
        if frame is not None and (frame.ndim not in (2, 3) or frame.shape[:2] != raw.shape[:2]):
            raise ValueError(f"{what} is {frame.shape} and raw {raw.shape}: frames of one size are needed")
        if frame is not None:
            _finite(what, frame)
    picture = raw if white is None else white
    clipped = _clipped(picture)
    grey = _grey(picture, mosaic) - (0 if dark is None else _grey(dark, None))
    grid, turned = _either_way(grey, clipped, lattice)
    shape = raw.shape[1::-1] if not turned else raw.shape[:2]
    source = "white image" if white is not None else "picture itself"
    content = _grey(raw, mosaic)
    try:
        camera = _camera(grid, (shape[0], shape[1]), pixel_pitch_mm, gap_mm, name)
    except ValueError as error:
        if not grid.drift_px:
            raise
        raise NoLenses(
            f"centres drift by up to {grid.drift_px:.1f} px off a straight grid, which no camera can follow: {error}"
        ) from error
    return Calibration(
        camera=camera,
        grid=grid,
        source=source,
        types=lens_types(np.rot90(content) if turned else content, grid),
        turned=turned,
        assumed=tuple(w for w, v in (("pixel_pitch_mm", pixel_pitch_mm), ("gap_mm", gap_mm)) if v is None),
    )


def _either_way(grey: NDArray[np.float32], clipped: NDArray[np.bool_], lattice: str | None) -> tuple[LensGrid, bool]:
    """The grid of the picture or, where rows of lenses run down, of the picture turned by 90°, and whether it is."""
    from .grid import lens_grid

    try:
        straight = lens_grid(grey, lattice, clipped)
        if not straight.lattice.hexagonal or abs(straight.turn_deg) <= MOST_LEAN:
            return straight, False
    except NoLenses as error:
        straight, failure = None, error
    try:
        turned = lens_grid(np.rot90(grey), lattice, np.rot90(clipped))
    except NoLenses:
        turned = None
    if turned is not None and abs(turned.turn_deg) <= (MOST_LEAN if straight is None else abs(straight.turn_deg)):
        return turned, True
    if straight is None:
        raise failure
    return straight, False


def _clipped(picture: NDArray[Any]) -> NDArray[np.bool_]:
    """Pixels at the picture's greatest value, if that is the end of a scale: a thousandth of them or more have it."""
    top = picture.max()
    clipped = picture == top if picture.ndim == 2 else (picture == top).any(axis=2)
    return clipped if clipped.mean() > 1e-3 else np.zeros(clipped.shape, bool)


def _finite(name: str, frame: NDArray[Any]) -> None:
    """Raise ValueError if a frame has values that are NaN or infinite."""
    if frame.dtype.kind != "f" or np.isfinite(frame).all():
        return
    row, col = np.argwhere(~np.isfinite(frame))[0][:2]
    nans, infinite = int(np.isnan(frame).sum()), int(np.isinf(frame).sum())
    counted = " and ".join(f"{n} {kind}" for n, kind in ((nans, "NaN"), (infinite, "infinite")) if n)
    raise ValueError(
        f"{name} has {counted} of {frame.size} values, the first at row {row}, column {col}: finite values are "
        "needed; replace bad pixels by the mean of their neighbours first"
    )


def _grey(frame: NDArray[Any], mosaic: str | None) -> NDArray[np.float32]:
    grey = frame.astype(np.float32) if frame.ndim == 2 else frame[..., :3].astype(np.float32).mean(axis=2)
    return grey if mosaic is None else evened(grey, mosaic)


def _camera(
    grid: LensGrid, size: tuple[int, int], pixel_pitch_mm: float | None, gap_mm: float | None, name: str
) -> IICamera:
    lattice = grid.lattice
    pixel = PIXEL_MM if pixel_pitch_mm is None else float(pixel_pitch_mm)
    pitch = lattice.pitch[0] * pixel, lattice.pitch[1] * pixel
    x, y = (middle - n / 2 for middle, n in zip(lattice.middle, size, strict=True))
    return IICamera(
        name=name,
        pixels=size,
        lenses=lattice.lenses,
        pixel_pitch_mm=pixel,
        gap_mm=pitch[0] / 2 / HALF_ANGLE_TAN if gap_mm is None else float(gap_mm),
        lens_pitch_mm=pitch,
        lattice="hexagonal" if lattice.hexagonal else "rectangular",
        lens_offset_mm=(float(x) * pixel, -float(y) * pixel),
        lens_turn_deg=grid.turn_deg,
        lens_shear=grid.shear,
        lens_drift_mm=None if lattice.drift is None else _drift_mm(lattice.drift, pixel),
        both_sides=True,  # micro-images are the main lens's, whose power no picture tells
    )


def _drift_mm(drift: Drift, pixel_mm: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return a drift over the picture in millimetres, with y up: see `IICamera`."""
    flips = [(-1) ** j * pixel_mm for _, j in DRIFT_TERMS]
    right, down = (tuple(a * flip for a, flip in zip(row, flips, strict=True)) for row in (drift.right, drift.down))
    return right, tuple(-b for b in down)


@checks.checked(
    calibration=checks.instance(Calibration), raw=checks.array, white=checks.array, dark=checks.array,
    mosaic=checks.one_of(*MOSAICS), curve=checks.one_of(*CURVES), full_scale=checks.number_from(1e-9, 1e9),
    bits=checks.whole, colour=checks.instance(RawColour), demosaic=checks.one_of(*METHODS),
)  # fmt: skip
def calibrated_picture(
    calibration: Calibration,
    raw: NDArray[Any],
    *,
    white: NDArray[Any] | None = None,
    dark: NDArray[Any] | None = None,
    mosaic: str | None = None,
    curve: str = "linear",
    full_scale: float | None = None,
    bits: int = 8,
    colour: RawColour | None = None,
    demosaic: str = "directional",
) -> IIPicture:
    """The II-picture of a raw one: dark frame off, dead pixels, vignetting, colours, sRGB, camera.

    Dead pixels are those of `defective_pixels`, replaced by the mean of their neighbours under the same lens.

    Parameters
    ----------
    calibration : Calibration
    raw, white, dark, mosaic
        As `calibrate` got them.
    curve : {"linear", "srgb"}
        What the values of the frames mean. Whole numbers of sensors are linear; pictures of 8 bit are mostly sRGB.
    full_scale : float, optional
        The raw value, above the dark frame, that becomes white. If not given: of sRGB pictures the end of their
        scale, of others what a thousandth of the pixels exceed.
    bits : {8, 16}
        Of the picture. Most coders take 8.
    colour : RawColour, optional
        Gains of white balance, and the matrix to sRGB, of the camera's metadata. Values above the scale are white.
    demosaic : {"directional", "bilinear"}
        See `demosaiced`.

    Returns
    -------
    IIPicture
        With the calibration's camera; not regular, see `resampled`. Brighter pixels than white are white.

    Raises
    ------
    ValueError
        If the frames are not of the calibration's size or have values that are not finite, or the picture is dark.
    """
    return developed(
        calibration, raw, white=white, dark=dark, mosaic=mosaic, curve=curve, full_scale=full_scale, bits=bits,
        colour=colour, demosaic=demosaic,
    )[0]  # fmt: skip


def developed(
    calibration: Calibration, raw: NDArray[Any], *, white: NDArray[Any] | None, dark: NDArray[Any] | None,
    mosaic: str | None, curve: str, full_scale: float | None, bits: int, colour: RawColour | None, demosaic: str,
) -> tuple[IIPicture, int]:  # fmt: skip
    """Return the picture of `calibrated_picture`, and the number of defective pixels."""
    from .white import gain, repaired

    if bits not in (8, 16):
        raise ValueError(f"bits are {bits}: 8 or 16 are needed")
    frames, mosaic = _upright(calibration, mosaic, raw=raw, white=white, dark=dark)
    raw, white, dark = frames["raw"], frames["white"], frames["dark"]
    owner = _owners(calibration)
    values, repairs = _linear(raw, curve), 0
    if dark is not None:
        values = values - _linear(dark, curve)
    if white is not None:
        smooth, bad = _white(calibration, white, dark, mosaic, curve)
        factors = gain(smooth)
        values = values * (factors if values.ndim == 2 else factors[..., None])
        repairs = int(bad.sum())
        if repairs:
            values = repaired(values, bad, owner, 1 if mosaic is None else 2)
    if mosaic is not None:
        values = demosaiced(values if values.ndim == 2 else values[..., 0], mosaic, owner, method=demosaic)
    if values.ndim == 2 or values.shape[2] == 1:
        values = np.repeat(values.reshape(*values.shape[:2], 1), 3, axis=2)
    if colour is not None:  # a saturated pixel stays white: the smallest gain is 1
        values = values * np.array(colour.gains, np.float32) / np.float32(min(colour.gains))
    if full_scale is None:
        full_scale = 1.0 if curve == "srgb" else float(np.percentile(values, 99.9))
    if not full_scale > 0:
        raise ValueError("the picture is dark: no pixel is brighter than the dark frame")
    dtype = np.uint8 if bits == 8 else np.uint16
    codes = np.empty((*values.shape[:2], 3), dtype)
    for top in range(0, len(codes), BLOCK):
        rows = np.clip(values[top : top + BLOCK, :, :3] / np.float32(full_scale), 0, 1)
        if colour is not None:
            rows = np.clip(rows @ np.array(colour.matrix, np.float32).T, 0, 1)
        codes[top : top + BLOCK] = np.rint((2**bits - 1) * srgb(rows))
    camera = calibration.camera
    return IIPicture(codes, camera.lenses, camera.ei_pixels, camera), repairs


@checks.checked(
    calibration=checks.instance(Calibration), white=checks.array, dark=checks.array, mosaic=checks.one_of(*MOSAICS),
    curve=checks.one_of(*CURVES),
)  # fmt: skip
def defective_pixels(
    calibration: Calibration,
    white: NDArray[Any],
    *,
    dark: NDArray[Any] | None = None,
    mosaic: str | None = None,
    curve: str = "linear",
) -> NDArray[np.bool_]:
    """Dead and hot pixels, by the white image: far from the values at the same place under the lenses around.

    Returns
    -------
    ndarray of bool, (N, M)
        In the frame of the calibration's picture.

    Raises
    ------
    ValueError
        If the frames are not of the calibration's size or have values that are not finite.
    """
    frames, mosaic = _upright(calibration, mosaic, white=white, dark=dark)
    return _white(calibration, frames["white"], frames["dark"], mosaic, curve)[1]


def _upright(
    calibration: Calibration, mosaic: str | None, **frames: NDArray[Any] | None
) -> tuple[dict[str, Any], str | None]:
    """Return checked frames, turned as the calibration is, and the mosaic that turns with them."""
    width, height = calibration.camera.pixels
    turned = {what: f if f is None or not calibration.turned else np.rot90(f) for what, f in frames.items()}
    for what, frame in turned.items():
        if frame is not None and frame.shape[1::-1] != (width, height):
            raise ValueError(f"{what} is {frame.shape}: {height}×{width}, the calibration's size, is needed")
        if frame is not None:
            _finite(what, frame)
    if calibration.turned and mosaic is not None:
        tile = np.rot90(np.array(list(mosaic)).reshape(2, 2))
        mosaic = "".join((tile[::-1] if height % 2 else tile).ravel())
    return turned, mosaic


def _white(
    calibration: Calibration, white: NDArray[Any], dark: NDArray[Any] | None, mosaic: str | None, curve: str
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the white image without noise and defects, and where it had defects."""
    from .white import averaged, defects, repaired

    values = _linear(white, curve) - (0 if dark is None else _linear(dark, curve))
    grey, lattice = _grey(values, mosaic), calibration.grid.lattice
    smooth = averaged(grey, lattice)
    bad = defects(grey, smooth)
    if bad.any():  # again without them: a defect spoils the mean of its likes
        smooth = averaged(repaired(grey, bad, _owners(calibration), 1), lattice)
        bad = defects(grey, smooth)
    return smooth, bad


def _owners(calibration: Calibration) -> NDArray[np.int32]:
    return owners(calibration.grid.lattice, calibration.camera.pixels)


def _linear(frame: NDArray[Any], curve: str) -> NDArray[np.float32]:
    if curve == "linear":
        return frame.astype(np.float32)
    peak = 1.0 if frame.dtype.kind == "f" else float(np.iinfo(frame.dtype).max)
    return linear(frame.astype(np.float32) / np.float32(peak)).astype(np.float32)


@checks.checked(
    calibration=checks.instance(Calibration), picture=checks.instance(IIPicture), zoom=checks.whole_from(1, 16)
)
def centres_picture(calibration: Calibration, picture: IIPicture, *, zoom: int = 2) -> NDArray[np.uint8]:
    """Centres over the raw picture, (zoom·N, zoom·M, 3): green of the grid, yellow found, red left out."""
    from ..picture.picture import codes8

    image = np.repeat(np.repeat(codes8(picture.pixels), zoom, axis=0), zoom, axis=1)
    grid = calibration.grid
    colours = np.where(grid.used[:, None], np.array([[255, 220, 0]], np.uint8), np.array([[255, 40, 40]], np.uint8))
    arm = np.arange(-2, 3)
    marked = np.where(grid.used[:, None], grid.found, grid.places)
    for places, colour, steps in (
        (marked, colours, [(s, s) for s in arm] + [(s, -s) for s in arm]),
        (grid.places, np.broadcast_to(np.array([0, 255, 0], np.uint8), colours.shape), [(0, 0), (1, 0), (0, 1)]),
    ):
        x, y = np.floor(places * zoom).astype(np.int64).T
        for dx, dy in steps:
            col, row = x + dx, y + dy
            inside = (col >= 0) & (col < image.shape[1]) & (row >= 0) & (row < image.shape[0])
            image[row[inside], col[inside]] = colour[inside]
    return image
