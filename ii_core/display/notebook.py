"""Pictures and the viewer in a notebook."""

from __future__ import annotations

import html
import tempfile
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..base import checks
from ..picture.picture import IIPicture
from .viewer.page import JPEG_QUALITY, write_viewer


class EmbeddedViewer:
    """The viewer of a picture, as a cell of a notebook shows it.

    Parameters
    ----------
    page : str
        The whole page, HTML.
    height : int
        Height of the cell in pixels.
    """

    def __init__(self, page: str, height: int) -> None:
        self.page, self.height = page, height

    def __repr__(self) -> str:
        return f"EmbeddedViewer({len(self.page) / 2**20:.1f} MB)"

    def _repr_html_(self) -> str:
        source = html.escape(self.page, quote=True)
        return f'<iframe srcdoc="{source}" style="width:100%;height:{self.height}px;border:0"></iframe>'


@checks.checked(
    picture=checks.instance(IIPicture), decoded=checks.instance(IIPicture), depth=checks.array, height=checks.whole
)
def embed_viewer(
    picture: IIPicture, decoded: IIPicture | None = None, *, depth: NDArray[Any] | None = None, height: int = 600
) -> EmbeddedViewer:
    """Return the viewer of a picture for a notebook: drag to look around.

    Parameters
    ----------
    picture, decoded, depth
        As for `ii_core.display.viewer.write_viewer`.
    height : int
        Height of the cell in pixels.

    Raises
    ------
    ValueError
        As `write_viewer`.
    """
    with tempfile.TemporaryDirectory(prefix="raytrace-ii-") as folder:
        page = Path(folder) / "view.html"
        write_viewer(page, picture, decoded, depth=depth, quality=JPEG_QUALITY)
        return EmbeddedViewer(page.read_text(encoding="utf-8"), height)
