"""Chart of opinion scores over the values of measures."""

from __future__ import annotations

import os
from pathlib import Path

from ii_core.base import checks
from ii_core.display.figure import COLOURS, MARKERS, check_suffix, new_figure, plain_text, save

from ..measures.measure import known_measures
from ..observers.verdict import EVERYTHING, Verdict


@checks.checked(made=checks.instance(Verdict), path=checks.path)
def opinion_chart(made: Verdict, path: str | os.PathLike[str]) -> Path:
    """Draw scores with their intervals over each measure that predicts them, and the monotone fit.

    Colours stand for schemes, markers for scenes. If observers are simulated, the vertical axis says so.

    Parameters
    ----------
    made : Verdict
    path : path
        .png, .pdf or .svg; replaced whole, and returned.

    Raises
    ------
    ValueError
        If the suffix is unknown, or no measure predicts scores of all stimuli together.
    OSError
        If the file cannot be written.
    """
    check_suffix(path)
    measures = [measure for measure, group in made.predictions if group == EVERYTHING]
    if not measures:
        raise ValueError("no measure has values for five stimuli: nothing to draw")
    stimuli, known = made.plan["stimuli"], known_measures()
    rows = -(-len(measures) // 3)
    columns = -(-len(measures) // rows)
    figure = new_figure(3.4 * columns + 0.4, 2.9 * rows + 0.9)
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
    schemes, scenes = (list(dict.fromkeys(one[key] for one in stimuli)) for key in ("scheme", "scene"))
    for axes, measure in zip(panels.flat, measures, strict=False):  # the last row may have empty panels
        pairs = made.with_measure(measure)
        for value, one in pairs:
            stimulus = stimuli[one.stimulus]
            colour = COLOURS[schemes.index(stimulus["scheme"]) % len(COLOURS)]
            marker = MARKERS[scenes.index(stimulus["scene"]) % len(MARKERS)]
            label = plain_text(f"{stimulus['scheme']}, {stimulus['scene']}")
            axes.errorbar(
                value, one.score, one.half_width, fmt=marker, color=colour, markersize=4, linewidth=0.8, label=label
            )
        found = made.predictions[measure, EVERYTHING]
        line = sorted(zip((value for value, _ in pairs), found.fitted, strict=True))
        axes.plot(*zip(*line, strict=True), color="0.5", linewidth=1)
        axes.set_title(f"PLCC {found.plcc:.3f}, SROCC {found.srocc:.3f}", fontsize=9)
        axes.set_xlabel(known[measure].axis if measure in known else plain_text(measure))
        axes.grid(True, color="0.92", linewidth=0.8)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels.flat[len(measures) :]:
        axes.axis("off")
    figure.supylabel(made.unit, fontsize=10)
    handles, labels = panels.flat[0].get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    figure.legend(once.values(), once, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return save(figure, path, dpi=110)
