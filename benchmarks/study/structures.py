"""Setup 2: best kind of component image over sizes of elementary images and pictures (§5.8.3)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks.coding.headers import SIDES, duel
from ii_core import preset
from ii_core.base.parallel import cores
from raytrace_ii import load_scene, render

from .runner import Step

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
        name, uses = f"plane-{scene}-{smaller}", ("benchmarks.coding.headers",)
        if sides:
            found.append(Step(name=name, shows=shows, run=duels, parameters=given, uses=uses))
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
