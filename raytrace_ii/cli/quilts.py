"""Options of quilts, and the quilt of a display by its name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .common import pair
from .words import say

if TYPE_CHECKING:
    from ii_core import IIPicture

For = Annotated[
    str | None,
    typer.Option("--for", help="Quilt for a Looking Glass: go, portrait, 16, 16-portrait, 32, 32-portrait or 65."),
]
Tiles = Annotated[str | None, typer.Option(help="Quilt: columns x rows.")]
Whole = Annotated[
    bool, typer.Option("--whole", help="Quilt: black borders instead of sides cut to the display's aspect.")
]
TILES, SIZE = "8x6", "800x400"


class QuiltPlan:
    """Tiles, size of a tile, aspect and cone of a quilt, as options say or as a display needs them."""

    def __init__(
        self, device_name: str | None, tiles: str | None, size: str | None, cone: float | None, whole: bool
    ) -> None:
        from ii_core.display.devices import device

        known = None if device_name is None else device(device_name)
        if known is not None and (tiles is not None or size is not None):
            raise ValueError(f"tiles and size are those of the display {device_name}: leave them out, or --for")
        self.tiles = known.tiles if known else pair("tiles", TILES if tiles is None else tiles)
        self.size = known.tile if known else pair("size", SIZE if size is None else size)
        self.aspect = known.aspect if known else self.size[0] / self.size[1]
        self.device, self.name, self.given_cone, self.whole = known, device_name, cone, whole

    def path(self, output: Path) -> Path:
        """Return the path with tiles and aspect in its name."""
        from ii_core.formats.quilt import quilt_name

        return quilt_name(output, self.tiles, self.aspect)

    def options(self, picture: IIPicture, depth_mm: float | None) -> dict[str, Any]:
        """Return the arguments of `ii_core.display.quilt.quilt` beside the tiles for a picture with its camera."""
        from ii_core.display.quilt import cone_share, shown_shares

        picture.check_regular()
        cone = 0.9 if self.given_cone is None else self.given_cone
        if self.device is not None and self.given_cone is None:
            cone = cone_share(picture, self.device.cone_deg)
            if cone == 1.0:
                say(
                    f"{self.name} shows {self.device.cone_deg:g}°; the zone of the picture is narrower and used whole"
                )
        across, down = shown_shares(picture, self.aspect, whole=self.whole)
        if min(across, down) < 1:
            say(f"{across:.0%} of the width and {down:.0%} of the height of the picture fill the display")
        return {
            "size": self.size, "aspect": self.aspect, "whole": self.whole, "depth_mm": depth_mm, "cone": cone,
        }  # fmt: skip
