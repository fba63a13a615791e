"""Setup 1: rate–distortion of all schemes, orders, picture types, motion range and rate control (§5.8.1–5.8.4)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from codec.inspect.header_bits import floor
from codec.order import ORDERS

from .coding import CODED, SCENES, curves, shot
from .runner import Step

# The dissertation coded 4:2:0, as all H.264 encoders of its time; 4:4:4 shows the effect.
PVS = tuple(f"{kind}-h264{chroma}" for chroma in (":chroma=420", "") for kind in ("si", "ei", "ri"))
VOLUME = "si-jp3d:wavelet=53"  # CDF 5/3, as the dissertation's
REFERENCE = "jpeg2000"
# Volumes of each colour alone: coded by the verification model of JPEG 2000 Part 10, and by our coder. Records alone
# are left: OpenJPEG has no model from version 2.5 on, and the step that ran it is in git up to 018e29e.
MODEL, APART = "verification model", f"{VOLUME}, colours apart"
MODERN = ("si-hevc", "si-av1", "si-jp3d")
SI = "si-h264:chroma=420"
GOPS = (0, 128, 32, 16)  # 0: one I picture for all
BFRAMES = (0, 1, 2, 3)
RANGES = (16, 32, 64, 128)
CONTROLS = ("cbr", "cq", "2pass", "crf")


def steps(scale: int) -> list[Step]:
    """Return all steps at a scale of setup 1."""
    each = [
        Step(
            name=f"{name}-{scene}",
            shows=f"{shows}, {scene}",
            run=code,
            parameters={"scene": scene, "scale": scale, "schemes": schemes, **more},
            uses=CODED,
        )
        for name, shows, schemes, scenes, more in (
            ("rates", "Figure 5.10, Table 5.8", (*PVS, VOLUME, REFERENCE, *MODERN), SCENES, {}),
            ("orders", "Figure 5.11", tuple(f"{SI},order={order}" for order in ORDERS), SCENES, {}),
            ("types", "Table 5.5", types(), ("apples",), {}),
            ("types-as-references", "Table 5.5 with B pictures as references", types("pyramid=1"), ("apples",), {}),
            ("ranges", "Table 5.6", tuple(f"{SI},merange={r}" for r in RANGES), ("apples", "twins"), {"workers": 1}),
            ("control", "Table 5.7", tuple(f"{SI},rate={c}" for c in CONTROLS), ("apples", "twins"), {"workers": 1}),
        )
        for scene in scenes
    ]
    shows = "the lowest rates of Figure 5.10"
    return [*each, Step(name="floors", shows=shows, run=floors, parameters={"scale": scale}, uses=CODED)]


def types(*more: str) -> tuple[str, ...]:
    """Return the schemes of Table 5.5, row by row."""
    return tuple(
        ",".join([SI, f"gop={gop}", f"bframes={count}", *(more if count else ())])
        for gop in GOPS
        for count in BFRAMES
    )


def code(
    _folder: Path, *, scene: str, scale: int, schemes: tuple[str, ...], workers: int | None = None
) -> dict[str, Any]:
    """Return curves of Q_global."""
    return {"points": curves(shot(scene, "setup1", scale).picture, schemes, workers=workers)}


def floors(_folder: Path, *, scale: int) -> dict[str, Any]:
    """Return the least rates of pseudo video sequences: a black picture at the coarsest quantiser."""
    picture = shot("apples", "setup1", scale).picture
    kinds = [scheme for scheme in PVS if "chroma=420" in scheme]
    return {"bpp": {scheme: floor(scheme, picture.lenses, picture.ei_pixels).bpp for scheme in kinds}}
