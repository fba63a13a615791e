"""Looking Glass displays: tiles and size of their quilts, aspect, and cone of view.

Values are those of the maker's documentation of quilts and of its toolkit's device templates, third generation where
there are several.
"""

from __future__ import annotations

from typing import NamedTuple

from ..base.checks import Pair, one_of


class Device(NamedTuple):
    """Quilt of a display.

    Attributes
    ----------
    tiles : (columns, rows)
    quilt : (width, height)
        Pixels of the quilt. Tiles have whole pixels: the rest of the division is left out.
    aspect : float
        Width over height of the display. A tile is stretched to it, whatever its own sides.
    cone_deg : float
        Angle that the views cover.
    """

    tiles: Pair
    quilt: Pair
    aspect: float
    cone_deg: float

    @property
    def tile(self) -> Pair:
        """(width, height), pixels of a tile."""
        return self.quilt[0] // self.tiles[0], self.quilt[1] // self.tiles[1]


DEVICES = {
    "go": Device((11, 6), (4092, 4092), 9 / 16, 54.0),
    "portrait": Device((8, 6), (3360, 3360), 3 / 4, 40.0),
    "16": Device((7, 7), (5999, 5999), 16 / 9, 50.0),
    "16-portrait": Device((11, 6), (5995, 6000), 9 / 16, 50.0),
    "32": Device((7, 7), (8190, 8190), 16 / 9, 50.0),
    "32-portrait": Device((11, 6), (8184, 8184), 9 / 16, 54.0),
    "65": Device((8, 9), (8192, 8192), 16 / 9, 40.0),
}
"""Displays by name: Go, Portrait, and those of 16, 32 and 65 inches, landscape unless named otherwise."""


def device(name: str) -> Device:
    """Return a display by its name; ValueError lists the known ones."""
    one_of(*DEVICES)("device", name)
    return DEVICES[name]
