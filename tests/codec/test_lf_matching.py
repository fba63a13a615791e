"""Encoder search of disparity in `si-lf`: table of inner products, and table of bit costs."""

import numpy as np
import pytest

from codec.coders.lf import arithmetic, contexts
from codec.coders.lf.matching import CELLS, fill_products, new_match
from codec.coders.lf.state import UNKNOWN, Job, new_blocks
from codec.coders.lf.stream import UPRIGHT
from tests.support.slow import first_fast

REFERENCES = np.array([[0, -1, 0], [1, 2, 0], [2, 0, 1]], np.int64)
UNIT, LOW, HIGH = 96, -9, 9


def moved(plane, dy, dx):
    """A plane at (y + dy, x + dx), between samples bilinearly, with its border beyond; in double precision."""
    height, width = plane.shape
    y, x = np.arange(height) + dy, np.arange(width) + dx
    y0, x0 = np.floor(y).astype(int), np.floor(x).astype(int)
    fy, fx = (y - y0)[:, None], (x - x0)[None]

    def at(i, j):
        return plane[np.clip(i, 0, height - 1)][:, np.clip(j, 0, width - 1)].astype(float)

    upper = (1 - fx) * at(y0, x0) + fx * at(y0, x0 + 1)
    lower = (1 - fx) * at(y0 + 1, x0) + fx * at(y0 + 1, x0 + 1)
    return (1 - fy) * upper + fy * lower


def example(disparity=None):
    """Four views of noise, the last of which is coded; with a disparity (36, 52) it is synthesised."""
    views = np.random.default_rng(1).integers(-900, 900, (4, 3, 36, 52)).astype(np.int16)
    blank = np.zeros((1, 1, 1), np.int16)
    return Job(
        views=views,
        disparities=np.full((4, 36, 52), UNKNOWN, np.int16),
        at=3,
        references=REFERENCES * (1, UPRIGHT, UPRIGHT),
        unit=UNIT,
        low=LOW,
        high=HIGH,
        made=blank,
        disparity=blank[0] if disparity is None else disparity,
        doubt=blank[0],
        synthesised=0 if disparity is None else 1,
        crossed=1,
        skipping=False,
        step=64,
        blocks=new_blocks(36, 52),
        levels=np.zeros((3, 36, 52), np.int16),
    )


@pytest.mark.parametrize("every", first_fast([2, 1]))
def test_the_table_holds_inner_products_of_the_differences(every):
    """Also for the squares at the border, and for disparities that lead beyond it."""
    job = example()
    views = job.views
    match = new_match((HIGH - LOW) // every + 1, every)
    for y0 in (0, 32):
        for x0 in (0, 32):
            fill_products(job, views[3], y0, x0, match)
            rows, cols = min(CELLS, (36 - y0) // 4), min(CELLS, (52 - x0) // 4)
            for k, index in enumerate(range(LOW, HIGH + 1, every)):
                d = index * UNIT / 256
                missed = [moved(views[r, 0], d * down, d * across) - views[3, 0] for r, across, down in REFERENCES]
                pairs = [missed[r] * missed[s] for r in range(3) for s in range(r + 1)]
                for at, pair in enumerate(pairs):
                    square = pair[y0 : y0 + 4 * rows, x0 : x0 + 4 * cols]
                    expected = square.reshape(rows, 4, cols, 4).sum(axis=(1, 3))
                    # Sums of 16 products of up to 1800² in single precision.
                    np.testing.assert_allclose(match.products[:rows, :cols, at, k], expected, rtol=0, atol=20)


def test_a_hurried_search_has_the_disparities_of_the_synthesis():
    """Its table has those of the square and of eight samples around it, and every fourth; without synthesis all."""
    disparity = np.zeros((36, 52), np.int16)
    disparity[10:20, 39] = 5 * UNIT  # seven samples beside the first square
    disparity[10:20, 41] = -6 * UNIT  # nine samples
    match = new_match(HIGH - LOW + 1, 1, 1)
    job = example(disparity)
    fill_products(job, job.views[3], 0, 0, match)
    listed = match.indices[: match.count[0]].tolist()
    beside = {index + step for index in (0, 5) for step in (-1, 0, 1, 2)}
    assert listed == sorted(beside | set(range(LOW, HIGH + 1, 4)))
    job = example()
    fill_products(job, job.views[3], 0, 0, match)
    assert match.indices[: match.count[0]].tolist() == list(range(LOW, HIGH + 1))


def test_costs_are_those_of_the_coder():
    """A thousand bits by two contexts take as many bytes as the table says."""
    rng = np.random.default_rng(2)
    states = np.tile([60000, 60000, arithmetic.SEEN], (contexts.COUNT, 1)).astype(np.int32)
    states[1] = 9000, 11000, arithmetic.SEEN
    costs = arithmetic.bit_costs(states)
    assert costs.shape == (contexts.COUNT, 2)
    bits = rng.random(1000) < 0.5
    predicted = 0.0
    coder = arithmetic.writer(states, 4096)
    for context, bit in zip(rng.integers(0, 2, 1000), bits, strict=True):
        before = states.copy()
        arithmetic.code_bit(coder, int(context), int(bit))
        states[:] = before
        predicted += float(costs[context, int(bit)])
    # The coder ends on whole bytes; the table has 4096 probabilities.
    assert 8 * len(arithmetic.finish(coder)) == pytest.approx(predicted, rel=0.002, abs=48)
