"""Highlights on coloured surfaces, by the dichromatic model: they add white to the colour of the surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.colour import linear
from ..base.extras import Lazy

ndimage = Lazy("scipy.ndimage")

# There is a highlight if, in a window of SIDE px, changes along white are MOSTLY all, and exceed those along the
# colour by WHITER of all; it reaches as far as windows of REACH px. Shading and shadows change along the colour.
MOSTLY, WHITER, SIDE, REACH = 0.8, 0.1, 9, 13
SMOOTH = 1.0  # standard deviation of the blur against noise, px
TINY = 1e-12  # squared changes below it are rounding
WHITE = np.full((3, 1, 1), 3**-0.5, np.float32)


def highlights(view: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where a view, (3, H, W) in 16-bit codes of sRGB, shows highlights on coloured surfaces.

    On grey surfaces, highlights change the colour as shading does, and are not found.

    References
    ----------
    Shafer, Using color to separate reflection components, Color Research and Application 1985.
    """
    planes = (linear(plane / 65535).astype(np.float32) for plane in view)  # one by one, for less memory
    light = np.stack([ndimage.gaussian_filter(plane, SMOOTH) for plane in planes])
    colour = ndimage.uniform_filter(light, (0, SIDE, SIDE))
    colour /= np.maximum(np.linalg.norm(colour, axis=0), 1e-6)
    slopes = np.stack(np.gradient(light, axis=(1, 2)))

    def changes(along: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(ndimage.uniform_filter(np.square((slopes * along).sum(axis=1)).sum(axis=0), SIDE))

    every = ndimage.uniform_filter(np.square(slopes).sum(axis=(0, 1)), SIDE)
    white = changes(WHITE)
    whiter = (white > MOSTLY * every) & (white - changes(colour) > WHITER * every + TINY)
    return np.asarray(ndimage.maximum_filter(whiter, REACH))
