"""Pictures of the setups, and rate–distortion curves of schemes on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

from benchmarks.coding.coders import qualities
from benchmarks.coding.rd import rd_point
from codec.contract import find
from ii_core import IIPicture, preset
from ii_core.base.parallel import cores
from raytrace_ii import Shot, load_scene, render

SCENES = ("apples", "twins", "car", "cuboid")
RATES = (0.015, 0.03, 0.06, 0.15, 0.3, 0.63, 1.0, 1.5)  # bit per pixel, the range of Olsson 2008, §5.7.3
BY_QUANTISER = ("si-hevc", "ei-hevc", "si-av1", "ei-av1", "si-vp9")
# Modules behind every coded point, for `Step.uses`.
CODED = ("benchmarks.study.coding", "benchmarks.coding.coders", "benchmarks.coding.rd")
# A larger miss means a rate below the range of the scheme; a smaller one falls between two quantisers.
FLOOR = 1.1
# Setup 3 has 64×64 lenses; with fewer than 16×16, views are too small for the window of MSSIM.
COARSEST_SETUP3 = 4

Measure = Callable[[IIPicture], Mapping[str, Any]]


@lru_cache(maxsize=2)
def shot(scene: str, camera: str, scale: int) -> Shot:
    """Return a scene through a coding setup, with sensor noise and true depth."""
    return render(load_scene(scene), preset(camera, scale=scale), noise=1.0, support=("depth",))


def setup3_scale(scale: int) -> int:
    """Return the scale of setup 3 for a scale of the study."""
    return min(scale, COARSEST_SETUP3)


def point(picture: IIPicture, scheme: str, goal: Mapping[str, Any], measure: Measure | None = None) -> dict[str, Any]:
    """Return an operating point: rate, quality, CPU seconds of one run inside encoder and decoder."""
    made = rd_point(picture, scheme, **goal)
    return {
        "scheme": scheme, "target_bpp": goal.get("bpp", made.bpp), "bpp": made.bpp, "reached": made.reached,
        "runs": made.runs, "q_global": made.q_global, **(measure(made.picture) if measure else {}),
        "encode_seconds": made.encoder_seconds, "decode_seconds": made.decoder_seconds,
    }  # fmt: skip


def curve(
    picture: IIPicture, scheme: str, goals: Sequence[Mapping[str, Any]], measure: Measure | None = None
) -> list[dict[str, Any]]:
    """Return points by rate, from the highest rate down to the first below the range of the scheme."""
    points: list[dict[str, Any]] = []
    for goal in reversed(goals):
        points.insert(0, point(picture, scheme, goal, measure))
        if points[0]["bpp"] > FLOOR * points[0]["target_bpp"]:
            break
    return points


def goals_of(scheme: str) -> list[dict[str, Any]]:
    """Return the goals of a scheme: the dissertation's rates, or quantisers for schemes with a long search."""
    if scheme.startswith(BY_QUANTISER):
        return sorted(qualities(scheme), key=lambda goal: -goal["qp"])
    return [rated(scheme, rate) for rate in RATES]


def rated(scheme: str, bpp: float) -> dict[str, Any]:
    """Return the goal of a rate: the dissertation's constant bit rate for H.264 that names no other rate control."""
    plain = "-h264" in scheme and find(scheme.partition(":")[0]).rated and "rate=" not in scheme
    return {"bpp": bpp, "rate": "cbr"} if plain else {"bpp": bpp}


def curves(
    picture: IIPicture, schemes: Sequence[str], measure: Measure | None = None, workers: int | None = None
) -> list[dict[str, Any]]:
    """Return the curves of all schemes, coded in ``workers`` threads, by default one per core."""
    with ThreadPoolExecutor(workers or cores()) as pool:
        found = pool.map(lambda scheme: curve(picture, scheme, goals_of(scheme), measure), schemes)
        return [point for points in found for point in points]
