"""Plan of a test with observers: pairs of stimuli, and their order for each observer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from ii_core.base.checks import one_of, whole, within

FORMAT, VERSION = "ii-subjective-test", 1
METHODS = ("dsis", "pairs")
SHOWS = ("front", "views", "across", "around")
GRADES = ("imperceptible", "perceptible, but not annoying", "slightly annoying", "annoying", "very annoying")
MOST_PRESENTATIONS = 1000  # upper cap for one observer: about six hours
ROUND_S = 4.0  # duration of one round of a path of viewpoints
Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a test with observers.

    Parameters
    ----------
    method : {"dsis", "pairs"}
        "dsis": double-stimulus impairment scale (ITU-R BT.500-14): the reference, then the picture, then a grade from
        1 to 5. "pairs": comparison of two pictures side by side.
    show : {"front", "views", "across", "around"}
        One view; the five of `five_viewpoints` one after another; a pseudo-video of viewpoints from left to right and
        back, or around the viewing zone.
    frames : int
        Views of a pseudo-video, 2 to 200.
    seconds, grey_seconds : float
        Duration of each picture and of the grey between; BT.500 has 10 s and 3 s.
    block : int
        Presentations between breaks.
    observers : int
        Number of different orders, even. Observers beyond this number start again with the first order.
    training : int
        Number of presentations of the first scene before the test; their answers do not count.
    seed : int
        Seed of the random orders.

    Raises
    ------
    ValueError
        If a value is out of range.
    """

    method: str = "dsis"
    show: str = "around"
    frames: int = 24
    seconds: float = 10.0
    grey_seconds: float = 3.0
    block: int = 40
    observers: int = 24
    training: int = 3
    seed: int = 0

    def __post_init__(self) -> None:
        one_of(*METHODS)("method", self.method)
        one_of(*SHOWS)("show", self.show)
        within("seconds", self.seconds, 0.01, 600.0)
        within("grey_seconds", self.grey_seconds, 0.0, 60.0)
        ranges = {"frames": (2, 200), "block": (1, 1000), "observers": (2, 1000), "training": (0, 20)}
        for field, (low, high) in {**ranges, "seed": (0, 2**63 - 1)}.items():
            if not low <= whole(field, getattr(self, field)) <= high:
                raise ValueError(f"{field} is {getattr(self, field)}: a whole number from {low} to {high} is needed")
        if self.observers % 2:
            raise ValueError(f"observers is {self.observers}: an even number is needed, as orders come in pairs")


def make_plan(
    stimuli: Sequence[Mapping[str, Any]], errors: Sequence[float], options: Options, **rest: Any
) -> dict[str, Any]:
    """Return the plan as plain values for JSON.

    Parameters
    ----------
    stimuli : sequence of mapping
        ``scene``, ``name`` and ``reference``, true for one of each scene.
    errors : sequence of float
        Error of each stimulus against its reference. The training shows the best, the worst, then others evenly
        spread between them.
    options : Options
    **rest
        Further entries of the plan.

    Raises
    ------
    ValueError
        If a scene has not one reference and a picture, or there are more presentations than `MOST_PRESENTATIONS`.
    """
    scenes: dict[str, list[int]] = {}
    for number, one in enumerate(stimuli):
        scenes.setdefault(one["scene"], []).append(number)
    pairs = [pair for name, members in scenes.items() for pair in _pairs(name, members, stimuli, options.method)]
    if len(pairs) > MOST_PRESENTATIONS:
        raise ValueError(
            f"{len(stimuli)} stimuli make {len(pairs)} presentations: at most {MOST_PRESENTATIONS} are possible, "
            "leave pictures out"
        )
    return {
        "format": FORMAT,
        "version": VERSION,
        "method": options.method,
        "seconds": options.seconds,
        "grey_seconds": options.grey_seconds,
        "grades": list(GRADES),
        "block": options.block,
        **rest,
        "stimuli": list(stimuli),
        "training": _training(next(iter(scenes.values())), stimuli, errors, options.training),
        "orders": _orders(pairs, [stimuli[a]["scene"] for a, _ in pairs], options),
    }


def _pairs(scene: str, members: list[int], stimuli: Sequence[Mapping[str, Any]], method: str) -> list[Pair]:
    """Return pairs of reference and picture, the hidden reference included ("dsis"), or all pairs of a scene."""
    references = [number for number in members if stimuli[number]["reference"]]
    if len(references) != 1 or len(members) < 2:
        raise ValueError(
            f"scene {scene!r} has {len(references)} references and {len(members) - len(references)} coded pictures: "
            "one reference and at least one coded picture are needed"
        )
    return [(references[0], one) for one in members] if method == "dsis" else list(combinations(members, 2))


def _training(
    members: list[int], stimuli: Sequence[Mapping[str, Any]], errors: Sequence[float], count: int
) -> list[Pair]:
    reference = next(number for number in members if stimuli[number]["reference"])
    coded = sorted((number for number in members if number != reference), key=lambda number: errors[number])
    places = [0.0, 1.0, *((i + 1) / (count - 1) for i in range(count - 2))][:count]
    return [(reference, coded[round(place * (len(coded) - 1))]) for place in places]


def _orders(pairs: list[Pair], scenes: list[str], options: Options) -> list[list[Pair]]:
    """Return the orders two by two: the second is the first backwards, with the sides of each pair exchanged.

    Each pair's place and each picture's side are balanced over two observers.
    """
    generator = np.random.default_rng(options.seed)
    sides = options.method == "pairs"
    made = []
    for _ in range(options.observers // 2):
        order = [pairs[i] for i in _shuffled(scenes, generator)]
        if sides:
            order = [pair[::-1] if generator.random() < 0.5 else pair for pair in order]
        made += [order, [pair[::-1] if sides else pair for pair in order[::-1]]]
    return made


def _shuffled(scenes: list[str], generator: np.random.Generator) -> list[int]:
    """Return a random order without the same scene twice in a row, as long as other scenes are left."""
    left = {scene: list(generator.permutation([i for i, s in enumerate(scenes) if s == scene])) for scene in scenes}
    order: list[int] = []
    last = ""
    for remaining in range(len(scenes), 0, -1):
        open_ = [scene for scene, rest in left.items() if rest and scene != last] or [last]
        # a scene with more than half of the remaining pairs must be next, else two of its pairs meet at the end
        most = max(open_, key=lambda scene: len(left[scene]))
        weights = np.array([len(left[scene]) for scene in open_], float)
        drawn = open_[generator.choice(len(open_), p=weights / weights.sum())]
        last = most if 2 * len(left[most]) > remaining else drawn
        order.append(int(left[last].pop()))
    return order


def duration_s(plan: Mapping[str, Any]) -> float:
    """Return the duration of a test for one observer, estimated with 3 s for each answer."""
    each = 2 * plan["seconds"] + plan["grey_seconds"] if plan["method"] == "dsis" else plan["seconds"]
    return (len(plan["training"]) + len(plan["orders"][0])) * (each + 3)


def frame_order(show: str, frames: int) -> tuple[int, list[int]]:
    """Return the number of views of a path, and the order in which they are shown in a loop."""
    if show == "front":
        return 1, [0]
    if show == "views":
        return 5, list(range(5))
    return frames, list(range(frames)) + (list(range(frames - 2, 0, -1)) if show == "across" else [])


def frames_per_second(show: str, shown: int, seconds: float) -> float:
    """Return the frame rate: five views share the time of a presentation, a path takes `ROUND_S`."""
    return 5 / seconds if show == "views" else shown / ROUND_S
