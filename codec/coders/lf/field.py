"""Decoded views of a light field, and the steps per view that encoder and decoder share."""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import learnt, loop_filter, motion, rig, synthesis
from .agreement import new_matching
from .arithmetic import Arithmetic
from .blocks import MOST_HALVINGS, MOST_INDEX, code_view
from .exact import code_exact, new_exact, prepare
from .planes import gather, scatter
from .pyramid import Node, Place, batches, pyramid
from .state import DONE, MOST_REFERENCES, UNKNOWN, Job, Work, new_blocks, zeros
from .stream import UPRIGHT, Header
from .synthesis import Synthesis, chosen, new_synthesis
from .warp import LATTICE, UNSHIFTED

EIGHTH = 32  # of a sample, in units of disparity
MOST_SEARCHED = 800  # disparities of one view
LEARNT_LEVELS = 2  # of views whose first plane is guessed by `learnt`
NO_GUESS = np.zeros((0, 0), np.int32)
FIRST_AGAIN = 0, 2  # views of the second level after which the first view's disparity is found anew


class Field:
    """Views decoded so far.

    Parameters
    ----------
    header : Header
    grid : (int, int)
        Rows and columns of views.
    height, width : int
        Of a view.
    dtype : numpy type
        Of a pixel.
    past : sequence of Field
        Earlier instants of a take, the latest first.
    """

    def __init__(
        self, header: Header, grid: Place, height: int, width: int, dtype: Any, past: Sequence[Field] = ()
    ) -> None:
        self.header = header
        self.grid = grid
        self.levels = pyramid(*grid, header.log_stride, MOST_REFERENCES, header.sources)
        self.shape = -(-height // 4) * 4, -(-width // 4) * 4
        self.views, self._memory = zeros((grid[0] * grid[1], 3, *self.shape))
        self.disparities, _ = zeros((len(self.views), *self.shape))
        # Pixels by view, if coding is lossless.
        self.pixels = np.zeros((len(self.views) if header.exact else 0, height, width, 3), dtype)
        self._exact = new_exact(height, width, dtype)
        self.filters = loop_filter.new_filters(len(self.views) if header.filtered else 0)
        self.decoded = np.zeros(grid, bool)
        self.rig = None
        if header.rig:
            middle = self.number((self.levels[0][0].row, self.levels[0][0].col))
            self.rig = rig.rig(rig.unpack(header.rig, len(self.views), middle), *self.shape)
        self.past = tuple(past)
        self.motions = motion.NOTHING
        if past:
            self.motions = np.zeros((len(self.views), motion.FIELDS, *(side // 4 for side in self.shape)), np.int16)
        nodes = [node for level in self.levels for node in level]
        self.used = {place for node in nodes for place in (*node.references, *node.sources)}

    def number(self, place: Place) -> int:
        """Index of a view."""
        return place[0] * self.grid[1] + place[1]

    def job(self, node: Node) -> tuple[Job, Synthesis]:
        """All that coding of a view needs, its synthesis' disparity included."""
        at = self.number((node.row, node.col))
        # `_first` reads views of the second level. Of others that nobody reads, memory is not taken.
        if node.level <= 1 or (node.row, node.col) in self.used:
            self.disparities[at] = UNKNOWN
        references, sources = (self._offsets(node, places) for places in (node.references, node.sources))
        unit = self._unit(references)
        made = new_synthesis(self.views, self.disparities, sources)
        known = len(sources) > 1 and synthesis.synthesise(made, new_matching(*self.shape), self._unit(sources))
        made = chosen(made)
        job = Job(
            views=self.views,
            disparities=self.disparities,
            at=at,
            references=references,
            unit=unit,
            low=self.header.low // unit,
            high=-(-self.header.high // unit),
            made=made.made,
            disparity=made.disparity,
            doubt=made.doubt,
            synthesised=int(known),
            crossed=self.header.crossed,
            finer=int(self.header.tuned),
            dependent=int(self.header.dependent),
            directed=int(self.header.directed),
            guided=int(self.header.guided),
            parted=MOST_HALVINGS[self.header.guided] * self.header.parted,
            skipping=int(self.header.skipping),
            step=self.header.steps[node.level],
            blocks=new_blocks(*self.shape),
            levels=zeros((3, *self.shape))[0],
            past=np.stack([field.views[at] for field in self.past]) if self.past else motion.NOTHING,
            motions=self.motions,
        )
        return job, made

    def code(self, coder: Arithmetic, job: Job, work: Work, same: int = 0) -> None:
        """Write or read a view's blocks and filters, or its pixels if coding is lossless; they predict later views.

        Bit p of ``same`` says that the filter of plane p is the one coded last.
        """
        code_view(coder, job, work)
        if self.header.filtered:
            loop_filter.code_filter(coder, self.filters, job.at, same, self._own_taps())
        if self.header.exact:
            exact = self._exact
            # An encoder's is a transposed array: kernels would be compiled again for it.
            rotation, sixteen = np.ascontiguousarray(self.header.colours), exact.pixels.itemsize == 2
            exact.pixels[:] = self.pixels[job.at]
            prepare(exact, self.views, job.at, rotation, sixteen)
            code_exact(coder, exact)
            self.pixels[job.at] = exact.pixels
            gather(exact.pixels, (1, 1), 0, 0, rotation, sixteen, self.views[job.at])

    def limit(self, step: int) -> np.int32:
        """Of a loop filter's limited differences, at a quantiser's step: a quarter of it; 0 without them."""
        return np.int32(max(step >> 6, 1) if self.header.limited else 0)

    def _own_taps(self) -> int:
        """Of a loop filter, in the first plane."""
        if self.header.learnt:
            return loop_filter.TAPS
        return loop_filter.COMMON if self.header.limited else loop_filter.OWN

    def guess(self, node: Node, job: Job) -> NDArray[np.int32]:
        """Twice what a decoded view's first plane lacks, in samples, by `learnt`; nothing beyond the first levels."""
        if not self.header.learnt or node.level >= LEARNT_LEVELS:
            return NO_GUESS
        memory = learnt.memory(*self.shape)
        learnt.guess(self.views, job.at, job.blocks, job.step, learnt.net(), *memory)
        return np.asarray(memory[-1])

    def view_pixels(self, number: int) -> NDArray[Any]:
        """A decoded view, (H, W, 3)."""
        if self.header.exact:
            return self.pixels[number]
        pixels = np.empty(self._exact.pixels.shape, self._exact.pixels.dtype)
        scatter(self.views, number, (1, 1), 0, 0, self.header.colours, pixels.itemsize == 2, pixels)
        return pixels

    def show(self, pixels: NDArray[Any], nodes: Sequence[Node] | None = None) -> None:
        """Write all views, or those of some nodes, into a picture's pixels (N, M, 3)."""
        rows, cols = self.grid
        places = np.ndindex(rows, cols) if nodes is None else ((node.row, node.col) for node in nodes)
        for row, col in places:
            pixels[row::rows, col::cols] = self.view_pixels(self.number((row, col)))

    def refine(self, node: Node, job: Job, made: Synthesis, guess: NDArray[np.int32] | None = None) -> None:
        """Filter a decoded view, and note its disparity, for those that follow; an encoder has a guess already."""
        if self.header.filtered and self.filters.modes[job.at].any():
            if guess is None:
                wanted = self.filters.modes[job.at, 0] and self.filters.taps[job.at, 0, :, loop_filter.COMMON].any()
                guess = self.guess(node, job) if wanted else NO_GUESS
            limit, memory = self.limit(job.step), loop_filter.memory(*self.shape)
            loop_filter.filter_view(self.views, job.at, self.filters, limit, guess, *memory)
        if (node.row, node.col) not in self.used or not (len(made.sources) or self.past):
            return
        synthesis.start(made, job.at, job.blocks, job.unit, job.synthesised)
        if self.past and not job.synthesised:
            known = np.stack([field.disparities[job.at] for field in self.past])
            motion.carry(job, known, self.disparities[job.at])
        if len(made.sources):
            synthesis.refine(made, new_matching(*self.shape, told=False), job.at)

    def finish(self, nodes: list[Node]) -> None:
        """Count a batch as decoded."""
        for node in nodes:
            self.decoded[node.row, node.col] = True
        last = nodes[-1]
        if last.level == 1 and (last.phase in FIRST_AGAIN or last is self.levels[1][-1]):
            self._first()

    def forget(self, nodes: Sequence[Node]) -> None:
        """Give back the memory of views of a finished batch that no other is predicted from; they become 0."""
        size = self.views[0].nbytes
        for node in nodes:
            if self._memory is not None and node.level > 1 and (node.row, node.col) not in self.used:
                start = self.number((node.row, node.col)) * size
                first, end = -(-start // mmap.PAGESIZE), (start + size) // mmap.PAGESIZE  # whole pages
                if end > first:
                    self._memory.madvise(mmap.MADV_DONTNEED, first * mmap.PAGESIZE, (end - first) * mmap.PAGESIZE)

    def batches(self, level: int) -> Iterator[list[Node]]:
        """Views of a level that are coded together."""
        return batches(self.levels[level])

    def _first(self) -> None:
        """The first view had no other: its disparity comes from those after it."""
        node = self.levels[0][0]
        others = [(other.row, other.col) for other in self.levels[1] if self.decoded[other.row, other.col]]
        made = new_synthesis(self.views, self.disparities, self._offsets(node, tuple(others[:4])))
        at = self.number((node.row, node.col))
        matching = new_matching(*self.shape)
        if synthesis.synthesise(made, matching, self._unit(made.sources)):
            self.disparities[at] = made.disparity
            synthesis.refine(made, matching, at)

    def _offsets(self, node: Node, places: tuple[Place, ...]) -> np.ndarray:
        row, col, (across, down, apart) = node.row, node.col, self.header.lattice
        rows = [
            (self.number((v, u)), UPRIGHT * (u - col) + across * (v - row), down * (u - col) + apart * (v - row))
            for v, u in places
        ]
        found = np.array(rows, np.int64).reshape(-1, 3)
        return found if self.rig is None else rig.departing(found, self.number((row, col)), found[:, 0], self.rig)

    def _unit(self, references: np.ndarray) -> int:
        """An eighth of a sample in the farthest view, or more where the range is wide."""
        if not len(references):
            return EIGHTH
        spread = self.header.high - self.header.low
        farthest = (int(np.abs(references[:, 1:UNSHIFTED]).max()) + UPRIGHT // 2) >> LATTICE
        return max(EIGHTH // max(farthest, 1), -(-spread // MOST_SEARCHED), 1)


assert MOST_INDEX > MOST_SEARCHED and DONE
