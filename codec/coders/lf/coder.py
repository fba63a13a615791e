"""A light field: sub-images on their grid, each predicted by disparity from decoded ones near it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numba
import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture

from ... import clock
from ...contract import Coder, Goal, Option, Options, Pixels
from ...search import Axis, CodingResult, Run, meet_size
from ..volume import principal_axes
from . import arithmetic, planes, ranges, search, stream, synthesis
from .blocks import code_blend, decode_view
from .contexts import starting_contexts
from .field import Field
from .pyramid import Node
from .search import Search
from .stream import Header

FINEST, COARSEST = 0, 63
FRACTIONS = 16  # of a quantiser, between which a rate is searched
OCTAVE = -6.0 * FRACTIONS  # quantisers that double a size, about
START = 34 * FRACTIONS
WEIGHT = 0.1  # squared error a bit is worth, in squared steps
# Quantisers by which each level is finer than the next, for more is predicted from it, and the first finer still.
FINER_A_LEVEL, FINER_FIRST = 2.4, 2.0
MOST_VIEWS = 1 << 14
VIEW_BYTES = 24  # a sample's most


class LightField(Coder):
    """Sub-images as views of a light field; docs/lf.md explains the stream."""

    kind = "si"
    components_alone: ClassVar[bool] = True
    name = "si-lf"
    about = "Sub-images as a light field: a pyramid of views, disparity, synthesis at the decoder"
    dtypes: ClassVar[tuple[str, ...]] = ("uint8", "uint16")
    qp_range: ClassVar[tuple[int, int] | None] = (FINEST, COARSEST)
    scale_about = "the step doubles every 6, and is one 8-bit code at 8"
    options: ClassVar[Mapping[str, Option]] = {
        "stride": Option(about="binary logarithm of the first views' distance on the grid", default=3, low=0, high=6),
        "sources": Option(about="views that a synthesis is made of, 0 for none", default=6, low=0, high=8),
        "effort": Option(about="of the search: 0, 1 or 2", default=1, low=0, high=2),
    }
    presets: ClassVar[Mapping[str, Options]] = {
        "fast": {"effort": 0, "sources": 4},
        "balanced": {"effort": 1},
        "best": {"effort": 2, "sources": 8},
    }

    @property
    def versions(self) -> dict[str, str]:
        """The kernels are our own."""
        return {"numba": numba.__version__}

    def check(self, picture: IIPicture, options: Options) -> None:
        """Any size will do that has no more views than there is patience for."""
        _check_views(picture)

    def encode(self, picture: IIPicture, options: Options, goal: Goal) -> CodingResult:
        """Meet a rate by a search of the quantiser."""
        source = _Source(picture, options)
        if goal.qp is not None:
            return CodingResult(run=source.run(goal.qp * FRACTIONS))
        assert goal.bpp is not None
        axis = Axis(
            low=FINEST * FRACTIONS,
            high=COARSEST * FRACTIONS,
            start=START + OCTAVE * math.log2(min(max(goal.bpp, 1e-3), 100) * 10),
            octave=OCTAVE,
            step=1,
        )
        return meet_size(source.run, goal.bpp * source.count / 8, axis)

    def decode(self, payload: bytes, blank: IIPicture, options: Options) -> tuple[Pixels, float]:
        """Level by level; a level that ends early is damage."""
        started = clock.cpu_seconds()
        _check_views(blank)
        header, levels = stream.unpack(payload, blank.pixels.size // 3)
        height, width, grid = _shape(blank)
        field = Field(header, grid, height, width)
        for _ in decoded_views(field, levels):
            pass
        pixels = np.empty(blank.pixels.shape, blank.pixels.dtype)
        for number in range(len(field.views)):
            row, col = divmod(number, grid[1])
            planes.scatter(field.views, number, grid, row, col, header.axes, pixels.itemsize == 2, pixels)
        return pixels, clock.cpu_seconds() - started

    def decode_component(self, payload: bytes, blank: IIPicture, options: Options, index: int) -> Pixels:
        """One sub-image, counted row by row, decoded with the levels above it and the views before it in its own.

        Raises
        ------
        ValueError
            If the payload is damaged so far as it is read.
        """
        _check_views(blank)
        header, levels = stream.unpack(payload, blank.pixels.size // 3)
        height, width, grid = _shape(blank)
        field = Field(header, grid, height, width)
        wanted = divmod(index, grid[1])
        for node in decoded_views(field, levels):
            if (node.row, node.col) == wanted:
                break
        pixels = np.empty((height, width, 3), blank.pixels.dtype)
        planes.scatter(field.views, field.number(wanted), (1, 1), 0, 0, header.axes, pixels.itemsize == 2, pixels)
        return pixels


def decoded_views(field: Field, levels: list[bytes]) -> Iterator[Node]:
    """Decode one view after another, level by level."""
    contexts = starting_contexts()
    for number, (nodes, data) in enumerate(zip(field.levels, levels, strict=True)):
        coder = arithmetic.reader(contexts, data)
        for node in nodes:
            job, made = field.job(node)
            if job.synthesised:
                synthesis.blend(made, code_blend(coder, 0))
            decode_view(coder, job, field.work)
            if arithmetic.overrun(coder):
                raise ValueError(f"level {number} of its light field ends early")
            field.finish(node, job, made)
            yield node


def _check_views(picture: IIPicture) -> None:
    """Each view takes a millisecond, however small it is."""
    u, v = picture.ei_pixels
    if u * v > MOST_VIEWS:
        raise ValueError(f"the picture has {u}×{v} views: at most {MOST_VIEWS} are coded as a light field")


def _shape(picture: IIPicture) -> tuple[int, int, tuple[int, int]]:
    """Height and width of a view, rows and columns of views."""
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    return l, k, (v, u)


class _Source:
    """A picture to be coded at one quantiser after another."""

    def __init__(self, picture: IIPicture, options: Options) -> None:
        self.pixels = np.ascontiguousarray(picture.pixels)
        self.count = self.pixels.size // 3
        self.height, self.width, self.grid = _shape(picture)
        self.effort = int(options["effort"])
        self.axes = principal_axes(self.pixels)
        low, high, down = ranges.estimated(self.view, self.grid)
        self.header = Header(
            log_stride=int(options["stride"]),
            sources=int(options["sources"]),
            down=down,
            low=low,
            high=high,
            axes=self.axes,
            steps=(),
        )

    def view(self, row: int, col: int) -> NDArray[np.int16]:
        """Planes of a view, with sides that are multiples of 4."""
        out = np.empty((3, -(-self.height // 4) * 4, -(-self.width // 4) * 4), np.int16)
        sixteen = self.pixels.itemsize == 2
        planes.gather(self.pixels, self.grid, row, col, self.axes, sixteen, out)
        return out

    def run(self, setting: float) -> Run:
        """The payload at a quantiser."""
        started = clock.cpu_seconds()
        payload, _ = self.coded(setting)
        return Run(payload, clock.cpu_seconds() - started)

    def coded(self, setting: float) -> tuple[bytes, Field]:
        """The payload at a quantiser, and what the decoder will make of it."""
        last = self.header.log_stride
        offsets = [FINER_A_LEVEL * (last - level) + (0 if level else FINER_FIRST) for level in range(last + 1)]
        steps = tuple(max(1, round(128 * 2 ** ((setting / FRACTIONS - 8 - less) / 6))) for less in offsets)
        header = replace(self.header, steps=steps)
        field = Field(header, self.grid, self.height, self.width)
        contexts, trial = starting_contexts(), search.new_trial()
        levels = []
        for nodes in field.levels:
            room = VIEW_BYTES * field.shape[0] * field.shape[1] + 1024
            coder = arithmetic.writer(contexts, room)
            for node in nodes:
                coder = arithmetic.enlarged(coder, room)
                job, made = field.job(node)
                original = self.view(node.row, node.col)
                if job.synthesised:
                    self._blend(coder, made, original)
                search.encode_view(coder, job, self._search(job, original), field.work, trial)
                field.finish(node, job, made)
            levels.append(arithmetic.finish(coder))
        return stream.pack(header, levels, self.count), field

    def _blend(self, coder: arithmetic.Arithmetic, made: synthesis.Synthesis, original: NDArray[np.int16]) -> None:
        """In the way that comes nearer to the original."""
        synthesis.blend(made, 0)
        smooth, error = made.made.copy(), _error(made.made, original)
        synthesis.blend(made, 1)
        nearest = int(_error(made.made, original) < error)
        code_blend(coder, nearest)
        if not nearest:
            made.made[:] = smooth

    def _search(self, job: Any, original: NDArray[np.int16]) -> Search:
        references = len(job.references)
        indices = job.high - job.low + 1 if references else 1
        height, width = original.shape[1:]
        volume = np.zeros((indices, max(references, 1), height // 4, width // 4), np.float32)
        if references:
            search.fill_volume(job, original, volume)
        return Search(
            original=original,
            volume=volume,
            weight=np.float32(WEIGHT * (job.step / 16) ** 2),
            least=3 if self.effort == 0 else 2,
            intra_tries=(1, 2, 3)[self.effort] if not references else 1,
            planes=1 if self.effort == 0 else 3,
        )


def _error(a: NDArray[np.int16], b: NDArray[np.int16]) -> float:
    return float(np.square(a.astype(np.float32) - b).sum())
