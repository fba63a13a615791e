"""Still of a picture, as notebooks show it."""

from __future__ import annotations

import base64
import html
import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .assumed import with_assumed_camera
from .picture import IIPicture, codes8
from .view import camera_of, five_viewpoints, view_image

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


def _shown(picture: IIPicture) -> str:
    return captioned(front_png(picture), picture.about)


# Added here and not in the class: its module stands below those of views.
setattr(IIPicture, "_repr_png_", front_png)  # noqa: B010
setattr(IIPicture, "_repr_html_", _shown)  # noqa: B010
