"""Rows and columns of each case that the page shows: around the limit. The records hold all of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.stability.geometry import Row
from ii_core.depth.focus import METHODS


@dataclass(frozen=True, kw_only=True)
class Excerpt:
    """Part of a case's rows.

    Parameters
    ----------
    keep : mapping of str to tuple
        Values of a column whose rows are shown; all by default.
    columns : tuple of str
        Columns that are shown; all by default.
    across : bool
        Whether the swept quantity stands in the head of the table, with a row for each other column.
    """

    keep: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    columns: tuple[str, ...] = ()
    across: bool = True

    def of(self, rows: Sequence[Row]) -> list[Row]:
        """Return the shown part of rows."""
        shown = [row for row in rows if all(_among(row[name], values) for name, values in self.keep.items())]
        return [{name: row.get(name) for name in self.columns or row} for row in shown]


def _among(value: Any, values: tuple[Any, ...]) -> bool:
    if isinstance(value, float):
        return any(isinstance(one, int | float) and math.isclose(value, one) for one in values)
    return value in values


NOISE = {"noise, steps": (0, 8)}
EXCERPTS: dict[str, Excerpt] = {
    "lift": Excerpt(keep={"lift": (0, 1e-8, 3e-8, 1e-7, 4e-6)}, columns=("lift", "0 radii off", "1000 radii off")),
    "scales": Excerpt(keep={"radii off": (0, 1e4, 1e5, 1e6)}, columns=("radii off", "form off, radii")),
    "coplanar": Excerpt(
        keep={"gap / distance": (0, 3e-8, 1e-7, 3e-7, 1e-6)}, columns=("gap / distance", "far wall seen")
    ),
    "contact_shadow": Excerpt(keep={"height / lift": (0.25, 0.9, 1.1, 10)}, columns=("height / lift", "in shadow")),
    "bad_faces": Excerpt(
        columns=("share of faces", "matt, missing", "mirror, missing", "glass, missing", "glass, turned")
    ),
    "huge_beside_tiny": Excerpt(
        keep={"floor, mm": (None, 10, 1e4, 1e5, 2e7)},
        columns=("floor, mm", "built in, s", "rays a second", "lift, mm", "shadows there"),
    ),
    "terminator": Excerpt(
        keep={"segments": (12, 48, 384)},
        columns=("segments", "band, degrees", "light off by, rms"),
    ),
    "covered": Excerpt(keep={"height, sagittas": (0.25, 0.5, 1, 1.5, 2, 2.5)}),
    "grazing": Excerpt(
        keep={"angle, rad": (0.1, 1e-3, 1e-5, 1e-6, 1e-7)}, columns=("angle, rad", "seen", "place off by, mm")
    ),
    "camera_in_glass": Excerpt(keep={"depth in the glass, mm": (4, 0.01, 1e-3, 1e-4)}),
    "camera_in_body": Excerpt(columns=("scene", "inside seen", "lit")),
    "lamp_at_surface": Excerpt(keep={"height / lift": (-1, 0, 0.9, 1.1, 10)}, columns=("height / lift", "lit")),
    "bounces": Excerpt(keep={"depth": (0, 4, 16, 64)}, columns=("depth", "light missing", "largest difference")),
    "view_borders": Excerpt(
        keep={"of half the viewing angle": (0, 0.95, 1, 1.05, 1.5)},
        columns=("of half the viewing angle", "PSNR of linear light, dB", "without a pixel"),
    ),
    "rate_ends": Excerpt(keep={"asked, bit/pixel": (0.001, 1, 12, 60)}, across=False),
    "tiny_frames": Excerpt(keep={"pixels a lens": ("1×1", "2×2", "7×9")}, across=False),
    "depth_contrast": Excerpt(keep={"contrast, steps": (0, 8, 16, 32, 128)}),
    "depth_kinds": Excerpt(keep=NOISE, across=False),
    "depth_two_layers": Excerpt(
        keep={"of the light from behind": (0.1, 0.25, 0.5, 0.75, 1)},
        columns=(
            "of the light from behind",
            *(f"mirror, {method}: {where}" for method in METHODS for where in ("wall", "behind")),
        ),
    ),
    "depth_highlight": Excerpt(keep={"strength": (0, 0.125, 0.5, 2)}),
    "bd_overlap": Excerpt(keep={"curves share": (1, 0.75, 0.5, 0.3, 0.2, 0.02)}),
    "bd_dents": Excerpt(keep={"point too low by, dB": (0.1, 0.5, 1, 1.5, 2)}),
    "bd_points": Excerpt(
        keep={"points a curve": (4, 5, 6, 8, 24)},
        columns=("points a curve", "akima, median", "akima, most", "cubic, median", "cubic, most"),
    ),
}
