"""Setup 3: effect of coding on views and depth layers (§4.3, §5.8.5), over rate and at equal quality."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec import decode, encode
from ii_core import IIPicture, five_viewpoints, view_image
from ii_core.base.files import write_image
from ii_core.base.parallel import cores
from ii_core.picture.view import camera_of
from metrics import (
    FocusDepth,
    angle_axes,
    depth_from_focus,
    linear_layers,
    measuring,
    q_angle,
    q_depth,
    q_global,
    q_view,
)
from raytrace_ii import Shot

from ..pages.pictures import enlarged, sheet
from .coding import CODED, SCENES, curves, rated, setup3_scale, shot
from .rates import REFERENCE, VOLUME
from .runner import Step

PVS = ("si-h264:chroma=420", "ei-h264:chroma=420", "ri-h264:chroma=420")
SHOWN = (REFERENCE, VOLUME, *PVS)  # the order of Figures 5.13 to 5.18
LABELS = ("uncoded", "JPEG 2000", "SI-PVI", "SI-PVS", "EI-PVS", "RI-PVS")
BEYOND = ("si-h264", "ei-h264", "si-hevc", "ei-hevc:fast", "si-av1", "ei-av1:fast", "si-jp3d")
MEASURES = ("q_view", "q_view_min", "q_depth_min", "q_depth_mean", "q_depth_max")
ARTEFACT_RATE = 0.15  # bit per pixel
EQUAL_DB = 28.0
TRIES = 6
CLOSE_DB = 0.05
PANEL = 256  # pixels across
USES = (*CODED, "benchmarks.pages.pictures")


def steps(scale: int) -> list[Step]:
    """Return all steps, with the scale of setup 3."""
    small = setup3_scale(scale)
    found = []
    for figure, scene in enumerate(SCENES, 15):
        for name, shows, run, parameters in (
            ("views", "Figures 5.19, 5.22, 5.23", over_rate, {"schemes": (*SHOWN, *BEYOND)}),
            ("artefacts", f"Figure 5.{figure}", artefacts, {"camera": "setup3", "crop": None}),
            ("equal", "Figures 4.5, 4.6, 5.20, 5.21", equal, {"schemes": SHOWN}),
        ):
            given = {"scene": scene, "scale": small, **parameters}
            shown = f"{shows}, {scene}"
            found.append(Step(name=f"{name}-{scene}", shows=shown, run=run, parameters=given, uses=USES))
    given = {"scene": "apples", "scale": scale, "camera": "setup1", "crop": 2}
    shown = "Figures 5.13, 5.14"
    return [*found, Step(name="artefacts-setup1", shows=shown, run=artefacts, parameters=given, uses=USES)]


def over_rate(_folder: Path, *, scene: str, scale: int, schemes: tuple[str, ...]) -> dict[str, Any]:
    """Return Q_view and Q_depth of all schemes over rate, with true depth."""
    made = shot(scene, "setup3", scale)
    points = curves(made.picture, schemes, measure=measuring(made.picture, MEASURES, **truth(made)))
    depth_mm = points[0]["depth_mm"]
    for point in points:
        del point["depth_mm"]  # equal for all
        point["q_depth"] = rounded(point["q_depth"])
    return {"points": points, "depth_mm": rounded(depth_mm)}


def truth(made: Shot) -> dict[str, Any]:
    """Return true depth on the dissertation's layers."""
    return {"depth": made.depth, "layers_mm": linear_layers(camera_of(made.picture))}


def artefacts(folder: Path, *, scene: str, scale: int, camera: str, crop: int | None) -> dict[str, Any]:
    """Draw front views coded at one rate, and their difference from the uncoded view; white is no difference.

    ``crop`` is the divisor of the shown part around the middle.
    """
    picture = shot(scene, camera, scale).picture
    with ThreadPoolExecutor(cores()) as pool:
        coded = list(pool.map(lambda scheme: encode(picture, scheme, **rated(scheme, ARTEFACT_RATE)), SHOWN))
        decoded = list(pool.map(decode, coded))
    views = [front(one) for one in (picture, *decoded)]
    apart = [255 - np.abs(view.astype(np.int16) - views[0]).astype(np.uint8) for view in views]
    name = "artefacts-setup1" if camera == "setup1" else f"artefacts-{scene}"
    for kind, images in (("views", views), ("differences", apart)):
        write_image(folder / f"{name}_{kind}.png", sheet([large(middle(image, crop)) for image in images], 3, LABELS))
    points = [
        {
            "scheme": scheme, "bpp": one.bpp, "reached": one.reached, "q_global": q_global(picture, back),
            "front_db": psnr(views[0], view), "q_view": q_view(picture, back).mean,
        }
        for scheme, one, back, view in zip(SHOWN, coded, decoded, views[1:], strict=True)
    ]  # fmt: skip
    return {"points": points}


def equal(folder: Path, *, scene: str, scale: int, schemes: tuple[str, ...]) -> dict[str, Any]:
    """Return results of all schemes at one Q_global: rate, views, horizontal Q_angle and Q_depth."""
    made = shot(scene, "setup3", scale)
    assert made.picture.camera is not None
    with ThreadPoolExecutor(cores()) as pool:
        found = list(pool.map(lambda scheme: at_quality(made.picture, scheme, EQUAL_DB), schemes))
    views = [front(made.picture), *(front(decoded) for _, decoded in found)]
    write_image(folder / f"equal-{scene}_views.png", sheet([large(view) for view in views], 3, LABELS))
    focus = depth_from_focus(made.picture, layers_mm=truth(made)["layers_mm"])
    rows = [
        judged(made, focus, decoded, coded) | {"scheme": scheme}
        for scheme, (coded, decoded) in zip(schemes, found, strict=True)
    ]
    degrees, _ = angle_axes(made.picture.camera)
    layers = q_depth(made.picture, made.picture, **truth(made))
    guessed = q_depth(made.picture, made.picture, depth=focus)
    return {
        "rows": rows,
        "angle_deg": rounded(degrees.tolist()),
        "depth_mm": rounded(layers.depth_mm.tolist()),
        "depth_pixels": layers.counts.tolist(),
        "focus_pixels": guessed.counts.tolist(),
    }


def judged(made: Shot, focus: FocusDepth, decoded: IIPicture, coded: Any) -> dict[str, Any]:
    """Return all qualities of a decoded picture, with true depth and with depth from focus."""
    angle = q_angle(made.picture, decoded).values
    layers = q_depth(made.picture, decoded, **truth(made))
    guessed = q_depth(made.picture, decoded, depth=focus)
    return {
        "bpp": coded.bpp,
        "q_global": q_global(made.picture, decoded),
        "q_view": q_view(made.picture, decoded).mean,
        "q_angle": rounded(angle[angle.shape[0] // 2].tolist()),
        "q_depth": rounded(layers.values.tolist()),
        "q_depth_focus": rounded(guessed.values.tolist()),
    }


def at_quality(picture: IIPicture, scheme: str, quality: float) -> tuple[Any, IIPicture]:
    """Return the coded picture nearest to a target Q_global, within 0.05 dB if possible."""

    def coding(rate: float) -> tuple[Any, IIPicture, float]:
        coded = encode(picture, scheme, **rated(scheme, rate))
        decoded = decode(coded)
        return coded, decoded, q_global(picture, decoded)

    tried = [coding(ARTEFACT_RATE)]
    asked = {ARTEFACT_RATE}
    for _ in range(TRIES):
        if min(abs(q - quality) for *_, q in tried) <= CLOSE_DB:
            break
        rate = towards([(coded.bpp, q) for coded, _, q in tried], quality)
        if rate in asked:
            break
        asked.add(rate)
        tried.append(coding(rate))
    coded, decoded, _ = min(tried, key=lambda one: abs(one[2] - quality))
    return coded, decoded


def towards(points: list[tuple[float, float]], quality: float) -> float:
    """Return the next rate to try by linear interpolation over log rate; the first slope is 3 dB per doubling."""
    below = max((p for p in points if p[1] < quality), key=lambda p: p[1], default=None)
    above = min((p for p in points if p[1] >= quality), key=lambda p: p[1], default=None)
    if below is None or above is None:
        rate, found = min(points, key=lambda p: abs(p[1] - quality))
        return rate * 2 ** min(max((quality - found) / 3, -3), 3)
    part = (quality - below[1]) / (above[1] - below[1])
    return math.exp(math.log(below[0]) + part * (math.log(above[0]) - math.log(below[0])))


def front(picture: IIPicture) -> NDArray[np.uint8]:
    """Return the front view."""
    assert picture.camera is not None
    return view_image(picture, five_viewpoints(picture.camera)["front"])[0]


def psnr(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the PSNR of two 8-bit images, dB."""
    error = float(np.square(a.astype(float) - b).mean())
    return 10 * math.log10(255**2 / error) if error else math.inf


def middle(image: NDArray[Any], part: int | None) -> NDArray[Any]:
    """Return 1/``part`` of an image along each axis around its middle; all of it without ``part``."""
    if part is None:
        return image
    (height, width) = (n // part for n in image.shape[:2])
    top, left = (image.shape[0] - height) // 2, (image.shape[1] - width) // 2
    return image[top : top + height, left : left + width]


def large(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image enlarged to a panel."""
    return enlarged(image, max(1, PANEL // image.shape[1]))


def rounded(values: list[float]) -> list[float]:
    """Return numbers rounded to 0.001, below the resolution of charts."""
    return [round(value, 3) for value in values]
