"""Analysis of a test with observers: scores of stimuli with intervals, and their prediction by measures."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base import checks

from .results import Observer, Results
from .subjective import Prediction, opinion_scores, pair_scale, predicted_scores, screened_observers

EVERYTHING = "all"


class Judged(NamedTuple):
    """Score of one stimulus.

    Attributes
    ----------
    stimulus : int
        Index of the stimulus in the plan.
    score, half_width : float
        Mean opinion score, 1 to 5, or quality above the reference's on the scale of pairs; half width of its
        confidence interval.
    given : int
        Number of answers.
    """

    stimulus: int
    score: float
    half_width: float
    given: int


class Verdict(NamedTuple):
    """Scores of all stimuli, and their prediction by measures.

    Attributes
    ----------
    plan : dict
    judged : list of Judged
    predictions : dict of (str, str) to Prediction
        By measure, and by group of stimuli: "all", a scene, or a scheme. Groups of fewer than five stimuli are left
        out.
    notes : list of str
        Lines on files and observers left out, and scenes without a scale.
    observers : int
        Number of observers whose answers count.
    simulated : bool
        Whether one of the observers is simulated; the scores are then not those of people.
    """

    plan: dict[str, Any]
    judged: list[Judged]
    predictions: dict[tuple[str, str], Prediction]
    notes: list[str]
    observers: int
    simulated: bool

    @property
    def unit(self) -> str:
        """Name of the score's scale."""
        what = "MOS" if self.plan["method"] == "dsis" else "quality above the reference"
        return what + (" of SIMULATED observers" if self.simulated else "")

    def with_measure(self, measure: str, group: str = EVERYTHING) -> list[tuple[float, Judged]]:
        """Return value and score of the stimuli of a group that the measure has a value for."""
        checks.text("measure", measure)
        checks.text("group", group)
        stimuli = self.plan["stimuli"]
        pairs = [(stimuli[one.stimulus], one) for one in self.judged]
        return [(s["measures"][measure], one) for s, one in pairs if _in_group(s, group) and measure in s["measures"]]

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the verdict as plain values for JSON; None for NaN."""
        stimuli = self.plan["stimuli"]
        judged = [
            {**stimuli[one.stimulus], "score": one.score, "half_width": _known(one.half_width), "answers": one.given}
            for one in self.judged
        ]
        names = ("plcc", "srocc", "rmse", "outlier_ratio")
        predictions = [
            {"measure": measure, "group": group, **{name: _known(getattr(found, name)) for name in names}}
            for (measure, group), found in self.predictions.items()
        ]
        head = {"method": self.plan["method"], "simulated": self.simulated, "observers": self.observers}
        return {**head, "notes": self.notes, "stimuli": judged, "predictions": predictions}


@checks.checked(results=checks.instance(Results), confidence=checks.number)
def verdict(results: Results, *, confidence: float = 0.95) -> Verdict:
    """Analyse results: screening, scores with intervals, prediction by measures.

    Observers who did not read the plates of colours are left out, then the outliers of `screened_observers`.

    Parameters
    ----------
    results : Results
        From `read_results`.
    confidence : float
        Level of the confidence intervals.

    Raises
    ------
    ValueError
        If no observer is left, or no scene has a scale.

    References
    ----------
    ITU-R BT.500-14; ITU-T P.1401.
    """
    plan, notes = results.plan, list(results.notes)
    blind = [one.number for one in results.observers if not one.colours]
    notes += [f"observer {number} did not read the plates of colours: left out" for number in blind]
    kept = [one for one in results.observers if one.colours and one.answers]
    if not kept:
        raise ValueError("no observer is left who read the plates of colours and answered")
    if plan["method"] == "dsis":
        kept, judged, more = _graded(kept, len(plan["stimuli"]), confidence)
    else:
        judged, more = _compared(kept, plan["stimuli"], confidence)
    simulated = any(one.simulated for one in kept)
    made = Verdict(plan, judged, {}, [*notes, *more], len(kept), simulated)
    made.predictions.update(_predictions(made))
    return made


def _graded(
    observers: list[Observer], count: int, confidence: float
) -> tuple[list[Observer], list[Judged], list[str]]:
    """Return the observers kept by the screening, mean opinion scores, and notes."""
    scores = np.full((len(observers), count), np.nan)
    for row, one in enumerate(observers):
        for (_, shown), grade in one.answers:
            scores[row, shown] = grade
    out = screened_observers(scores)
    notes = [
        f"observer {one.number} is left out by the screening of BT.500"
        for one, left in zip(observers, out, strict=True)
        if left
    ]
    scores = scores[~out]
    seen = np.flatnonzero(np.isfinite(scores).any(axis=0))
    found = opinion_scores(scores[:, seen], confidence=confidence)
    judged = [Judged(int(n), float(a), float(b), int(c)) for n, a, b, c in zip(seen, *found, strict=True)]
    return [one for one, left in zip(observers, out, strict=True) if not left], judged, notes


def _compared(
    observers: list[Observer], stimuli: list[dict[str, Any]], confidence: float
) -> tuple[list[Judged], list[str]]:
    """Return scores on the scale of each scene, relative to its reference, and notes."""
    wins = np.zeros((len(stimuli), len(stimuli)))
    for one in observers:
        for (left, right), answer in one.answers:
            wins[left, right] += {"left": 1.0, "same": 0.5, "right": 0.0}[answer]
            wins[right, left] += {"left": 0.0, "same": 0.5, "right": 1.0}[answer]
    judged: list[Judged] = []
    notes = []
    for scene in dict.fromkeys(one["scene"] for one in stimuli):
        members = [number for number, one in enumerate(stimuli) if one["scene"] == scene]
        table: NDArray[np.float64] = wins[np.ix_(members, members)]
        zero = next(place for place, number in enumerate(members) if stimuli[number]["reference"])
        try:
            found = pair_scale(table, confidence=confidence)
        except ValueError as error:
            names = ", ".join(f"{place} {stimuli[number]['name']}" for place, number in enumerate(members))
            notes.append(f"{scene} has no scale: {error} ({names})")
            continue
        own = np.diag(found.covariance)
        apart = np.sqrt(np.maximum(own + own[zero] - 2 * found.covariance[zero], 0))
        quantile = found.half_width[0] / math.sqrt(own[0])
        given = (table + table.T).sum(axis=1)
        rows = zip(members, found.scale - found.scale[zero], quantile * apart, given, strict=True)
        judged += [Judged(number, float(a), float(b), int(c)) for number, a, b, c in rows]
    if not judged:
        raise ValueError(notes[0])
    return judged, notes


def _predictions(made: Verdict) -> Iterator[tuple[tuple[str, str], Prediction]]:
    """Yield the prediction by each measure for each group of five or more stimuli that are not all equal."""
    stimuli = made.plan["stimuli"]
    groups = [EVERYTHING, *dict.fromkeys(s["scene"] for s in stimuli), *dict.fromkeys(s["scheme"] for s in stimuli)]
    for measure in dict.fromkeys(name for one in stimuli for name in one["measures"]):
        for group in filter(None, dict.fromkeys(groups)):
            pairs = made.with_measure(measure, group)
            if len(pairs) < 5:
                continue
            values = [value for value, _ in pairs]
            scores, widths = [one.score for _, one in pairs], [one.half_width for _, one in pairs]
            if np.ptp(values) > 0 and np.ptp(scores) > 0:
                yield (measure, group), predicted_scores(values, scores, widths)


def _in_group(stimulus: dict[str, Any], group: str) -> bool:
    return group in (EVERYTHING, stimulus["scene"], stimulus["scheme"])


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value
