"""Figures: an empty matplotlib figure, the colours and marks of its lines, and files in PNG, PDF or SVG."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

from ..base.extras import load
from ..base.files import atomic_path

# Colours of Okabe and Ito, which colour-blind readers can distinguish; without their yellow, too pale on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
LINES = ("-", "--", "-.")
SUFFIXES = (".png", ".pdf", ".svg")


def new_figure(width: float, height: float, layout: Any = "constrained") -> Any:
    """Return an empty matplotlib Figure of a size in inches, registered with no window."""
    figure = load("matplotlib.figure").Figure(figsize=(width, height), layout=layout)
    load("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
    return figure


def plain_text(name: str) -> str:
    """Return a name for a figure that is drawn letter by letter.

    Matplotlib reads text between dollar signs as mathematics, and leaves labels that begin with an underscore out of
    legends. Every name of a user in a figure passes through this function.
    """
    escaped = name.replace("$", r"\$")
    return f"\u200b{escaped}" if escaped.startswith("_") else escaped


def check_suffix(path: str | os.PathLike[str]) -> str:
    """Return the format that a path's suffix names.

    Raises
    ------
    ValueError
        If the suffix is none of `SUFFIXES`.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{path} is no known chart type: known are {', '.join(SUFFIXES)}")
    return suffix[1:]


def save(figure: Any, path: str | os.PathLike[str], *, dpi: int = 130) -> Path:
    """Write a figure in the format of the path's suffix, and return the path.

    Equal figures make equal files. Text in PDF and SVG stays text, which can be edited and searched.

    Raises
    ------
    ValueError
        If the suffix is none of `SUFFIXES`.
    OSError
        If the file cannot be written.
    """
    kind = check_suffix(path)
    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}[kind]
    text: Any = {"pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "raytrace-ii"}
    drawn = io.BytesIO()  # on a full disk matplotlib truncates PDF and SVG files without an error
    with load("matplotlib").rc_context(text):
        figure.savefig(drawn, dpi=dpi, format=kind, metadata=undated)
    with atomic_path(path) as temporary:
        temporary.write_bytes(drawn.getvalue())
    return Path(path)
