"""Good calls of tests with observers; all answers are simulated."""

from __future__ import annotations

from pathlib import Path

from metrics import observers
from metrics.observers.simulated import write_simulated
from metrics.plots.opinion_chart import opinion_chart

from .good import PICTURE, Call


def observer_calls(folder: Path) -> dict[str, Call]:
    """Return a good call of each function and class of tests with observers by name; files are in a folder."""
    stimuli = [
        observers.Stimulus(scene="a", name=str(i), picture=PICTURE, reference=i == 0, measures={"q_global": 20.0 + i})
        for i in range(6)
    ]
    options = observers.Options(show="front", frames=2, observers=2, training=1)
    plan = observers.write_test(folder / "test.html", stimuli, options)
    quality = [5.0, 4.0, 3.0, 2.5, 2.0, 1.0]
    (folder / "answers").mkdir()
    answers = write_simulated(folder / "answers", plan, quality, 3)
    results = observers.read_results(answers)
    made = observers.verdict(results)
    named = {
        "Stimulus": (observers.Stimulus, {"scene": "a", "name": "b", "picture": PICTURE, "reference": False,
            "scheme": "si-h264", "bpp": 1.0, "measures": {"q_global": 30.0}}),
        "Options": (observers.Options, {"method": "dsis", "show": "front", "frames": 2, "seconds": 10.0,
            "grey_seconds": 3.0, "block": 40, "observers": 2, "training": 1, "seed": 0}),
        "write_test": (observers.write_test, {"path": folder / "t.html", "stimuli": stimuli, "options": options,
            "size": None, "title": "a", "served": False, "progress": None}),
        "read_results": (observers.read_results, {"paths": answers}),
        "verdict": (observers.verdict, {"results": results, "confidence": 0.95}),
        "Verdict.with_measure": (made.with_measure, {"measure": "q_global", "group": "all"}),
        "write_simulated": (write_simulated, {"folder": folder / "answers", "plan": plan, "quality": quality,
            "observers": 2, "bias": 0.5, "spread": 0.7, "seed": 0}),
        "opinion_chart": (opinion_chart, {"made": made, "path": folder / "opinions.png"}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}
