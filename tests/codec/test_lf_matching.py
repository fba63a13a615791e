"""Disparity in `si-lf`: the encoder's table of inner products, table of bit costs, and comparison of sources."""

import numpy as np
import pytest

from codec.coders.lf import arithmetic, contexts, matching, synthesis
from codec.coders.lf.agreement import new_matching
from codec.coders.lf.blocks import predict_explicit
from codec.coders.lf.kinds import DIFFERENT
from codec.coders.lf.matching import CELLS, fill_errors, fill_products, new_match
from codec.coders.lf.state import UNKNOWN, Job, new_blocks, new_work
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
    match = new_match(HIGH - LOW + 1, every)
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


@pytest.mark.parametrize("at_once", first_fast([52, 32]))
def test_errors_are_sums_of_squared_differences(at_once):
    """Of all references, at every disparity, also beyond the border."""
    job, errors = example(), np.zeros((HIGH - LOW + 1, 9, 13), np.float32)
    fill_errors(job, job.views[3], *(np.zeros(n, np.float32) for n in (at_once + 1, 4 * at_once, at_once)), errors)
    for k, index in enumerate(range(LOW, HIGH + 1)):
        d = index * UNIT / 256
        missed = [moved(job.views[r, 0], d * down, d * across) - job.views[3, 0] for r, across, down in REFERENCES]
        expected = np.square(missed).sum(axis=0).reshape(9, 4, 13, 4).sum(axis=(1, 3))
        np.testing.assert_allclose(errors[k], expected, rtol=0, atol=60)


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


@pytest.mark.slow  # two kernels are compiled for it
def test_inner_products_as_decoded_are_those_of_predictions():
    """Of a block, of one that has a part of them, of its parts, and of blocks of another square, which has none."""
    job, work, match = example(), new_work(), new_match(HIGH - LOW + 1, 1)
    original = job.views[3]
    shapes = (16, 16, (4, 4)), (0, 0, (5, 5)), (8, 16, (3, 4)), (28, 0, (2, 5)), (0, 32, (4, 4)), (8, 40, (3, 3))
    for index in (np.int64(-9), np.int64(4)):
        square = None
        for y0, x0, shape in shapes:
            if square != (y0 // 32, x0 // 32):
                square = y0 // 32, x0 // 32
                fill_products(job, original, 32 * square[0], 32 * square[1], match)
            h, w = 1 << shape[0], 1 << shape[1]
            missed = []
            for r in range(3):
                predict_explicit(job, work, y0, x0, shape, index, np.int64(1 << r))
                missed.append(work.predicted[:, :h, :w] - original[:, y0 : y0 + h, x0 : x0 + w].astype(np.int64))
            expected = [np.sum(missed[r] * missed[s]) for r in range(3) for s in range(r + 1)]
            matching._decoded_products(job, match, work, original, np.int64(3), y0, x0, shape, index)
            # Sums of 3072 products of up to 1800² in single precision.
            np.testing.assert_allclose(match.pairs[:6], expected, rtol=1e-5, atol=300)


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


def _sources(rng, count, shifted, shape):
    """Views around view 0: index, how far across and down, and shifts by square as `rig.departing` gives them."""
    places = np.array([[1, -1000, 90], [2, 1100, -60], [3, 30, 1024], [4, 2048, -2048]])[:count]
    if not shifted:
        return places
    squares = -(-shape[0] // 32) * -(-shape[1] // 32)
    return np.hstack([places, rng.integers(-300, 300, (count, 2 * squares))])


def _led(source, y, x, d, shape):
    """How far a disparity leads to a source, in 2^-8 samples, as docs/lf.md has it."""
    across, down = (d * source[1]) >> 10, (d * source[2]) >> 10
    if len(source) > 3:
        row, col = min(max(y, 0), shape[0] - 1) // 32, min(max(x, 0), shape[1] - 1) // 32
        at = 3 + 2 * (row * -(-shape[1] // 32) + col)
        across, down = across + source[at], down + source[at + 1]
    return down, across


def _between(plane, y, x):
    """A plane's sample at a position in 2^-8 samples, bilinearly by sixteenths, its border repeated."""
    (py, px), (height, width) = ((y >> 4) & 15, (x >> 4) & 15), plane.shape
    rows, cols = (np.clip([k >> 8, (k >> 8) + 1], 0, n - 1) for k, n in ((y, height), (x, width)))
    four = plane[np.ix_(rows, cols)].astype(int)
    return int(np.array([16 - py, py]) @ four @ np.array([16 - px, px])) >> 8


def _sees(y, x, shape):
    return -128 <= y <= 256 * shape[0] - 128 and -128 <= x <= 256 * shape[1] - 128


def _apart(views, sources, y, x, d):
    """How far the samples of the sources are from the one most like the others."""
    shape, values = views.shape[2:], []
    for source in sources:
        dy, dx = _led(source, y, x, d, shape)
        if _sees(256 * y + dy, 256 * x + dx, shape):
            values.append(_between(views[source[0], 0], 256 * y + dy, 256 * x + dx))
    if len(values) < 2:
        return 176
    least = min(sum(min(abs(a - b), 320) for b in values) for a in values)
    return least // (len(values) - 1) + 16 * (len(sources) - len(values))


def _disagreement(views, disparities, sources, y, x, d):
    """Sixth of the sum over a cross, its middle twice, and more, the fewer sources say the same of themselves."""
    cross = (0, 0), (0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)
    total = sum(_apart(views, sources, y + j, x + i, d) for j, i in cross)
    agreeing, shape = 0, views.shape[2:]
    for source in sources:
        dy, dx = _led(source, y, x, d, shape)
        j, i = y + ((dy + 128) >> 8), x + ((dx + 128) >> 8)
        if 0 <= j < shape[0] and 0 <= i < shape[1] and disparities[source[0], j, i] != UNKNOWN:
            far = max(abs(source[1]), abs(source[2])) / 1024
            agreeing += abs(int(disparities[source[0], j, i]) - d) * far < DIFFERENT
    return total // 6 + (64, 32, 16, 10, 8)[agreeing]


def _mismatch(views, sources, y, x, d):
    """Sum of the two sources that differ least from view 0 over 3×3 samples."""
    (height, width), sums = views.shape[2:], []
    for source in sources:
        dy, dx = _led(source, y, x, d, (height, width))
        if not (-1 <= x + (dx >> 8) <= width and -1 <= y + (dy >> 8) <= height):
            sums.append(9 * 176)
            continue
        total = 0
        for j in range(max(y - 1, 0), min(y + 2, height)):
            for i in range(max(x - 1, 0), min(x + 2, width)):
                there = _between(views[source[0], 0], 256 * j + dy, 256 * i + dx)
                total += min(abs(there - int(views[0, 0, j, i])), 320)
        sums.append(total)
    return sum(sorted(sums)[:2]) if len(sums) > 1 else 2 * sums[0]


@pytest.mark.parametrize(("count", "shifted"), [(4, False), (4, True), (3, False), (1, False)])
def test_samples_compared_together_differ_as_one_by_one(count, shifted):
    rng = np.random.default_rng(count + 10 * shifted)
    views = rng.integers(-900, 900, (5, 3, 68, 44)).astype(np.int16)
    disparities = rng.integers(-500, 500, (5, 68, 44)).astype(np.int16)  # so many are kept from all over the view
    disparities[rng.random(disparities.shape) < 0.1] = UNKNOWN
    sources = _sources(rng, count, shifted, views.shape[2:])
    made, matching = synthesis.new_synthesis(views, disparities, sources), new_matching(68, 44)
    synthesis.synthesise(made, matching, 16)
    for y, x, d, found in _kept(rng, matching, 44):
        assert found == _disagreement(views, disparities, sources, y, x, d), (y, x, d)
    synthesis.refine(made, matching, 0)
    kept = _kept(rng, matching, 44)
    for y, x, d, found in kept:
        assert found == _mismatch(views, sources, y, x, d), (y, x, d)
    assert min(len({row[k] for row in kept}) for k in range(3)) > 3


def _kept(rng, matching, width):
    """What is kept, some of it: row, column, disparity and cost."""
    found = []
    for place in rng.permutation(np.flatnonzero(matching.marks >= 0))[:60]:
        mark = int(matching.marks[place])
        y, across = divmod(mark >> 16, width)
        i = int(rng.integers(16))
        if 16 * across + i < width:
            found.append((y, 16 * across + i, (mark + 32768) % 65536 - 32768, int(matching.kept[place, i])))
    return found
