"""Header portion H of a coded take (5.11)–(5.13), over all frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ii_core import IIPicture, video_of
from ii_core.camera.camera import whole_pair

from ..checks import check_type, whole
from ..contract import MAX_PIXELS, find
from .api import MAX_FRAMES, EncodedTake, encode_take
from .order import Plan

Pair = tuple[int, int]


@dataclass(frozen=True, kw_only=True)
class TakeFloor:
    """Least bits of a scheme and plan for takes of a structure.

    Parameters
    ----------
    coded : EncodedTake
        A black take at the coarsest quantiser.
    """

    coded: EncodedTake = field(repr=False)

    @property
    def bits(self) -> int:
        """Bits of all payloads; header and checksums of the file are no part of H."""
        return 8 * sum(map(len, self.coded.segments))

    @property
    def bpp(self) -> float:
        """Least rate of the scheme over all frames, for which H = 1."""
        width, height = self.coded.size
        return self.bits / (width * height * self.coded.frames)

    def portion(self, bpp: float) -> float:
        """Return H at a rate (5.13); above 1 the rate cannot be reached."""
        return self.bpp / bpp


def take_floor(scheme: str, lenses: Pair, ei_pixels: Pair, *, frames: int = 8, plan: Plan | None = None) -> TakeFloor:
    """Measure the header portion of a scheme, structure and plan by a black take at the coarsest quantiser.

    A stream with N_I I pictures and N_P others has about N_I·h_I + N_P·h_P bits of headers. All walks have the same
    numbers of them, so that H depends on the groups of the plan, not on its walk.

    Raises
    ------
    TypeError, ValueError
        If the scheme codes no takes, or the structure, plan or number of frames is not allowed.

    References
    ----------
    Olsson 2008, §5.5.3, with all instants in place of one.
    """
    check_type("scheme", scheme, str, "a name")
    (k, l), (u, v) = whole_pair("lenses", lenses), whole_pair("ei_pixels", ei_pixels)
    if k * u * l * v > MAX_PIXELS:
        raise ValueError(f"lenses and ei_pixels make {k * u}×{l * v} pixels: at most {MAX_PIXELS} are allowed")
    black = IIPicture(np.broadcast_to(np.uint8(0), (l * v, k * u, 3)), lenses, ei_pixels)
    video = video_of([black] * whole("frames", frames, 1, MAX_FRAMES))
    coarsest = find(scheme.partition(":")[0]).qp_range
    return TakeFloor(coded=encode_take(video, scheme, qp=coarsest[1] if coarsest else None, plan=plan))
