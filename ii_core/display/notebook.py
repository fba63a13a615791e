"""Pictures and the viewer in a notebook."""

from __future__ import annotations

import base64
import html
import io
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .. import checks
from ..picture import IIPicture, codes8
from ..view import camera_of, five_viewpoints, view_image
from .look import with_assumed_camera
from .viewer.page import JPEG_QUALITY, write_viewer

WIDTH = 512  # least width in pixels of a shown picture: small ones are magnified by whole numbers


def front_view(picture: IIPicture) -> NDArray[np.uint8]:
    """Return the view from the front, one pixel a lens; of one lens or an irregular structure, the pixels."""
    if not picture.regular or picture.lenses == (1, 1):
        step = max(1, -(-picture.size[0] // WIDTH))
        return codes8(np.ascontiguousarray(picture.pixels[::step, ::step]))
    seen = with_assumed_camera(picture)
    return codes8(view_image(seen, five_viewpoints(camera_of(seen))["front"])[0])


def front_png(picture: IIPicture) -> bytes:
    """Return the PNG of `front_view`."""
    view = front_view(picture)
    zoom = max(1, WIDTH // view.shape[1])
    out = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(view.repeat(zoom, axis=0).repeat(zoom, axis=1))).save(out, "PNG")
    return out.getvalue()


def captioned(png: bytes, caption: str) -> str:
    """Return a picture with its caption, as HTML."""
    data = base64.b64encode(png).decode()
    return (
        f'<figure><img alt="{html.escape(caption)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


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
