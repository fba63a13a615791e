"""Setup 2: best kind of component image over sizes of elementary images and pictures (§5.8.3)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from codec import decode, encode
from codec.inspect.header_bits import floor, si_below_ei, si_below_ri
from ii_core import IIPicture, preset
from ii_core.base.parallel import cores
from metrics import q_global
from raytrace_ii import load_scene, render

from .runner import Step

SIDES = (16, 32, 64, 128, 256)  # pixels of an elementary image
RATES = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
KINDS = ("si", "ei", "ri")
SCENES = ("apples", "car")  # scenes of Figure 5.12
SMALLER = (1, 2, 4, 8)  # divisors of the lenses of setup 2
FEWEST = (4, 2)  # least number of lenses across and down


def steps(scale: int) -> list[Step]:
    """Return the steps of Figure 5.12 at a scale, and of smaller pictures."""
    kept = [(SCENES[0], smaller) for smaller in SMALLER]  # the chart of best kinds needs one scene only
    kept += [(scene, 1) for scene in SCENES[1:]]
    found = []
    for scene, smaller in kept:
        sides = [side for side in SIDES if fits(side, scale * smaller)]
        shows = "Figure 5.12" if smaller == 1 else "(5.14), (5.15) for smaller pictures"
        given = {"scene": scene, "scale": scale * smaller, "sides": sides}
        if sides:
            found.append(Step(name=f"plane-{scene}-{smaller}", shows=shows, run=duels, parameters=given))
    return found


def fits(side: int, scale: int) -> bool:
    """Return whether setup 2 has enough lenses with elementary images of a size."""
    try:
        camera = preset(f"setup2-{side}", scale=scale)
    except ValueError:
        return False
    return camera.lenses[0] >= FEWEST[0] and camera.lenses[1] >= FEWEST[1]


def duels(_folder: Path, *, scene: str, scale: int, sides: list[int]) -> dict[str, Any]:
    """Return results of SI, EI and RI at equal rates, for every size of elementary image."""
    loaded = load_scene(scene)

    def one(side: int) -> dict[str, Any]:
        picture = render(loaded, preset(f"setup2-{side}", scale=scale), support=(), noise=1.0).picture
        return {"side": side, "pixels": list(picture.size), "lenses": list(picture.lenses), **duel(picture)}

    with ThreadPoolExecutor(cores()) as pool:
        return {"duels": list(pool.map(one, sides))}


def duel(picture: IIPicture) -> dict[str, Any]:
    """Return PSNR of the three kinds at equal rates, H.264 at constant bit rate, without missed rates."""
    psnr: dict[str, dict[float, float]] = {}
    for kind in KINDS:
        psnr[kind] = {}
        for rate in RATES:
            coded = encode(picture, f"{kind}-h264:rate=cbr", bpp=rate)
            if coded.reached:
                psnr[kind][rate] = q_global(picture, decode(coded))
    structure = picture.lenses, picture.ei_pixels
    black = {kind: floor(f"{kind}-h264", *structure).bits for kind in KINDS}
    found: dict[str, Any] = {
        "psnr": {kind: {f"{r:g}": q for r, q in points.items()} for kind, points in psnr.items()}
    }
    for other, predicted in (("ei", si_below_ei(*structure)), ("ri", si_below_ri(*structure))):
        both = psnr["si"].keys() & psnr[other].keys()
        found[other] = {
            "predicted": predicted,
            "fewer_header_bits": black["si"] < black[other],
            "gain_db": float(np.mean([psnr["si"][r] - psnr[other][r] for r in both])) if both else None,
            "rates_both": sorted(both),
            "lowest": {kind: min(psnr[kind], default=None) for kind in ("si", other)},
        }
    return found
