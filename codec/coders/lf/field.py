"""The decoded views of a light field, and what encoder and decoder do alike for each next one."""

from __future__ import annotations

import numpy as np

from . import synthesis
from .blocks import DONE, MOST_INDEX, MOST_REFERENCES, Job, Work, new_blocks, new_work
from .pyramid import Node, Place, pyramid
from .stream import Header
from .synthesis import UNKNOWN, Synthesis, new_synthesis

QUARTER = 64  # of a sample, in units of disparity
MOST_SEARCHED = 400  # disparities of one view


class Field:
    """Views decoded so far.

    Parameters
    ----------
    header : Header
    grid : (int, int)
        Rows and columns of views.
    height, width : int
        Of a view.
    """

    def __init__(self, header: Header, grid: Place, height: int, width: int) -> None:
        self.header = header
        self.grid = grid
        self.levels = pyramid(*grid, header.log_stride, MOST_REFERENCES, header.sources)
        self.shape = -(-height // 4) * 4, -(-width // 4) * 4
        self.views = np.zeros((grid[0] * grid[1], 3, *self.shape), np.int16)
        self.disparities = np.zeros((len(self.views), *self.shape), np.int16)
        self.work: Work = new_work()
        nodes = [node for level in self.levels for node in level]
        self.used = {place for node in nodes for place in (*node.references, *node.sources)}

    def number(self, place: Place) -> int:
        """Index of a view."""
        return place[0] * self.grid[1] + place[1]

    def job(self, node: Node) -> tuple[Job, Synthesis]:
        """All that coding of a view needs, its synthesis' disparity included."""
        self.disparities[self.number((node.row, node.col))] = UNKNOWN
        references, sources = (self._offsets(node, places) for places in (node.references, node.sources))
        unit = self._unit(references)
        made = new_synthesis(self.views, self.disparities, sources)
        known = len(sources) > 1 and synthesis.synthesise(made, max(self._unit(sources) // 2, 1))
        job = Job(
            views=self.views,
            at=self.number((node.row, node.col)),
            references=references,
            unit=unit,
            low=self.header.low // unit,
            high=-(-self.header.high // unit),
            made=made.made,
            disparity=made.disparity,
            synthesised=int(known),
            step=self.header.steps[node.level],
            blocks=new_blocks(*self.shape),
            levels=np.zeros((3, *self.shape), np.int16),
        )
        return job, made

    def finish(self, node: Node, job: Job, made: Synthesis) -> None:
        """Note the disparity of a decoded view, for those that follow."""
        if not len(made.sources) or (node.row, node.col) not in self.used:
            return
        synthesis.start(made, job.at, job.blocks, job.unit, job.synthesised)
        synthesis.refine(made, job.at, False)
        synthesis.refine(made, job.at, True)
        if node is self.levels[0][-1]:
            self._first()

    def _first(self) -> None:
        """The first view had no other: its disparity comes from those after it."""
        node = self.levels[0][0]
        others = [(other.row, other.col) for other in self.levels[0][1:]]
        others.sort(key=lambda place: ((place[0] - node.row) ** 2 + (place[1] - node.col) ** 2, place))
        made = new_synthesis(self.views, self.disparities, self._offsets(node, tuple(others[:4])))
        at = self.number((node.row, node.col))
        if synthesis.synthesise(made, max(self._unit(made.sources) // 2, 1)):
            self.disparities[at] = made.disparity
            synthesis.refine(made, at, False)
            synthesis.refine(made, at, True)

    def _offsets(self, node: Node, places: tuple[Place, ...]) -> np.ndarray:
        rows = [
            (self.number(place), place[1] - node.col, self.header.down * (place[0] - node.row)) for place in places
        ]
        return np.array(rows, np.int64).reshape(-1, 3)

    def _unit(self, references: np.ndarray) -> int:
        """A quarter of a sample in the farthest view, or more where the range is wide."""
        if not len(references):
            return QUARTER
        spread = self.header.high - self.header.low
        return max(QUARTER // int(np.abs(references[:, 1:]).max()), -(-spread // MOST_SEARCHED), 1)


assert MOST_INDEX > MOST_SEARCHED and DONE
