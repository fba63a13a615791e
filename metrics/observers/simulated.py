"""Results of SIMULATED observers, for tests of an analysis; no person took part."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ii_core.base import checks
from ii_core.base.atomic import atomic_path

from . import plan as plans
from .results import FORMAT, VERSION, sealed

AT = "2000-01-01T00:00:00.000Z"  # date of all simulated answers


@checks.checked(
    folder=checks.path, plan=checks.mapping, quality=checks.numbers_in_a_row, observers=checks.whole_from(1, 1000),
    bias=checks.number_from(0, 100), spread=checks.number_from(0, 100), seed=checks.whole_from(0, 2**63 - 1),
)  # fmt: skip
def write_simulated(
    folder: str | os.PathLike[str],
    plan: Mapping[str, Any],
    quality: Sequence[float],
    observers: int,
    *,
    bias: float = 0.5,
    spread: float = 0.7,
    seed: int = 0,
) -> list[Path]:
    """Write the files of SIMULATED observers, and return their paths.

    A grade is the quality plus the observer's bias and noise, rounded to 1 to 5. Of two pictures, the one of higher
    quality plus noise is better; if the two differ by less than a fifth of ``spread``, the answer is "the same".

    Parameters
    ----------
    folder : path
        Existing folder.
    plan : dict
        From `write_test`.
    quality : sequence of float
        Quality of each stimulus, 1 to 5.
    observers : int
    bias, spread : float
        Standard deviations of the observers' biases and of the noise of each answer.
    seed : int

    Raises
    ------
    TypeError, ValueError
        If a value is out of range, this is no plan of a test, or there is not one finite quality for each stimulus.
    OSError
        If the folder is missing or cannot be written.
    """
    if (plan.get("format"), plan.get("version")) != (plans.FORMAT, plans.VERSION):
        raise ValueError("plan is none of a test: that of `write_test` is needed")
    if len(quality) != len(plan["stimuli"]) or not np.isfinite(quality).all():
        raise ValueError(f"quality has {len(quality)} values: {len(plan['stimuli'])} finite ones are needed")
    generator = np.random.default_rng(seed)
    text, paths = json.dumps(plan, ensure_ascii=False), []
    for number in range(1, observers + 1):
        own = generator.normal(0, bias)
        line = sealed({"kind": "begin", "at": AT, "format": FORMAT, "version": VERSION, "plan": text, **_who(number)})
        lines = [line]
        order = [*plan["training"], *plan["orders"][(number - 1) % len(plan["orders"])]]
        for place, (a, b) in enumerate(order):
            if plan["method"] == "dsis":
                answer: Any = int(np.clip(np.rint(quality[b] + own + generator.normal(0, spread)), 1, 5))
            else:
                apart = quality[b] - quality[a] + generator.normal(0, spread)
                answer = "same" if abs(apart) < spread / 5 else "right" if apart > 0 else "left"
            record = {"kind": "answer", "at": AT, "place": place, "pair": [int(a), int(b)], "answer": answer}
            lines.append(sealed(record, lines[-1]))
        lines.append(sealed({"kind": "end", "at": AT}, lines[-1]))
        path = Path(folder) / f"observer-{number:03d}.jsonl"
        with atomic_path(path) as temporary:
            temporary.write_text("".join(lines), encoding="utf-8")
        paths.append(path)
    return paths


def _who(number: int) -> dict[str, Any]:
    return {"observer": number, "simulated": True, "colour_vision": "passed"}
