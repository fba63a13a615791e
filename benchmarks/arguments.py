"""Command-line arguments that benchmarks share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from benchmarks.records import AGAIN, CHANGED


def command_line(
    description: str | None, *, scale: int | None = None, **names: Sequence[str]
) -> argparse.ArgumentParser:
    """Return a parser with ``--again``.

    Parameters
    ----------
    description : str
        Text of ``--help``: the docstring of the benchmark.
    scale : int, optional
        Default of ``--scale``; without it there is no such option.
    names : sequence of str
        Default of an option whose value is a list of names separated by commas: ``scenes=("apples", "car")``.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    if scale is not None:
        parser.add_argument("--scale", type=int, default=scale, help="divides the number of lenses of the preset")
    for name, default in names.items():
        parser.add_argument(f"--{name}", type=_names, default=list(default), help="names, separated by commas")
    parser.add_argument(
        "--again",
        choices=AGAIN,
        default=CHANGED,
        help="measure again: rows of other code or libraries (changed), missing rows alone (missing), all rows (all)",
    )
    return parser


def _names(text: str) -> list[str]:
    return text.split(",")
