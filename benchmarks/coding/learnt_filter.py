"""Train the network of `codec.coders.lf.learnt` on photographs as `si-lf` decodes them before its loop filter.

    python -m benchmarks run learnt_filter --pictures FOLDER

``FOLDER`` holds JPEG photographs, here the 500 of the Berkeley Segmentation Data Set (BSDS500, `BIDS/BSDS500` on
GitHub, ``BSDS500/data/images``); none is used to measure the coder. A part of each, at a random size, is coded as one
view at two quantisers. The network minimises the squared error of the first plane, each picture's in parts of what it
is without (Adam: Kingma and Ba 2015). Written is ``assets/learnt_filter.npy``, after 25 minutes on two cores.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from skimage.transform import resize

from benchmarks.records import ROOT
from codec import encode
from codec.coders.lf import learnt, loop_filter_search
from codec.coders.lf.field import Field
from codec.coders.lf.state import CODED, TALL, WIDE
from ii_core import IIPicture
from ii_core.base.atomic import atomic_path
from ii_core.base.files import read_image

WEIGHTS = ROOT / "assets" / "learnt_filter.npy"
LARGEST, SIZES, QUANTISERS, EACH = (192, 256), (1.0, 0.75, 0.6, 0.5), (33, 37, 41, 45, 49, 53), 2
STEPS, BATCH, SIDE, RATE = 6500, 16, 48, 2e-3
CLIP, MOST, LEAST_ERROR = 2.0, 4.0, 1e-4  # steps; of a layer's result; squared steps
FRACTIONS = 256, 256, 1 << 14, 1 << 14  # of weights of the first, middle and last layer, and of biases
Array = np.ndarray[Any, Any]


class Sample(NamedTuple):
    """A decoded first plane and what is wanted of it, in steps of the quantiser, and what the blocks tell."""

    decoded: Array  # (H, W)
    wanted: Array  # (H, W)
    marks: Array  # (H, W, 3)
    weight: float  # 1 / squared error


def main() -> None:
    """Train, and write the weights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=Path, required=True, help="folder of JPEG photographs")
    folder = parser.parse_args().pictures
    names = sorted(folder.rglob("*.jpg"))
    if not names:
        parser.error(f"{folder} has no *.jpg")
    with ProcessPoolExecutor() as pool:
        samples = list(pool.map(samples_of, range(len(names)), names, chunksize=8))
    weights = whole(trained([sample for each in samples for sample in each]))
    with atomic_path(WEIGHTS) as part, open(part, "wb") as file:
        np.save(file, weights)


def samples_of(seed: int, name: Path) -> list[Sample]:
    """Return what a part of a picture becomes at some quantisers."""
    draw, pixels = np.random.default_rng(seed), read_image(name)
    size = draw.choice(SIZES)
    if size < 1:
        shape = [int(size * side) for side in pixels.shape[:2]]
        pixels = np.rint(255 * np.clip(resize(pixels, shape, 3, anti_aliasing=True), 0, 1)).astype(np.uint8)
    height, width = (min(side, most) // 8 * 8 for side, most in zip(pixels.shape, LARGEST, strict=False))
    top, left = (draw.integers(side - own + 1) for side, own in zip(pixels.shape, (height, width), strict=False))
    part = np.ascontiguousarray(pixels[top : top + height, left : left + width])
    picture = IIPicture(part, (width, height), (1, 1))
    return [decoded(picture, quantiser) for quantiser in draw.choice(QUANTISERS, EACH, replace=False).tolist()]


def decoded(picture: IIPicture, quantiser: int) -> Sample:
    """Return the decoded first plane of a picture of one view before its filter."""
    kept: list[Any] = []
    search = loop_filter_search.search_filters

    def guess(field: Field, node: Any, job: Any) -> Array:
        kept.append(job)
        return np.zeros((0, 0), np.int32)

    def searched(views: Array, view: int, original: Array, *rest: Any) -> Any:
        kept[-1] = kept[-1], views[view, 0].astype(np.float32), original[0].astype(np.float32)
        return search(views, view, original, *rest)

    with patch.object(Field, "guess", guess), patch.object(loop_filter_search, "search_filters", searched):
        encode(picture, "si-lf", qp=quantiser)
    job, plane, original = kept[-1]
    step = np.float32(job.step / 16)  # samples are in eighths of a code
    error = np.mean(((original - plane) / step) ** 2)
    return Sample(plane / step, original / step, marks_of(job.blocks, plane.shape), 1 / max(error, LEAST_ERROR))


def marks_of(blocks: Array, shape: tuple[int, ...]) -> Array:
    """Return whether samples lie beside a vertical and a horizontal border of a block, and in one with a residual."""
    tall, wide, coded = (blocks[k].repeat(4, axis=0).repeat(4, axis=1).astype(int) for k in (TALL, WIDE, CODED))
    y, x = np.indices(shape)
    beside = [(at % (1 << side) == 0) | (at % (1 << side) == (1 << side) - 1) for at, side in ((x, wide), (y, tall))]
    return np.stack([*beside, coded > 0], axis=-1).astype(np.float32)


def trained(samples: list[Sample]) -> list[Array]:
    """Return weights and biases of all layers, by turns."""
    draw, c = np.random.default_rng(0), learnt.CHANNELS
    sizes = [(learnt.INPUTS, c), *[(9 * c, c)] * learnt.LAYERS, (9 * c, 1)]
    spread = [0.3, *[(2 / (9 * c)) ** 0.5] * learnt.LAYERS, 0.01]
    net = [draw.normal(0, s, size).astype(np.float32) for s, size in zip(spread, sizes, strict=True)]
    net[0][-3:] /= 6  # of what blocks tell
    net = [part for weights in net for part in (weights, np.zeros(weights.shape[1], np.float32))]
    mean, square = [np.zeros_like(part) for part in net], [np.zeros_like(part) for part in net]
    for step in range(1, STEPS + 1):
        slopes = slopes_of(net, *batch(draw, samples))
        rate = RATE * (0.5 + 0.5 * np.cos(np.pi * step / STEPS)) + 1e-5
        for part, slope, m, v in zip(net, slopes, mean, square, strict=True):
            m += 0.1 * (slope - m)
            v += 0.001 * (slope**2 - v)
            part -= rate * (m / (1 - 0.9**step)) / (np.sqrt(v / (1 - 0.999**step)) + 1e-8)
        net[-1][:] = 0  # no guess where nothing differs
    return net


def batch(draw: np.random.Generator, samples: list[Sample]) -> tuple[Array, Array, Array]:
    """Return inputs, what the decoded samples lack, and weights of random parts, turned or mirrored."""
    inputs, lacks, weights, m = [], [], [], learnt.MARGIN
    for which in draw.integers(len(samples), size=BATCH):
        s = samples[which]
        top, left = (draw.integers(side - SIDE + 1) for side in s.decoded.shape)
        part = slice(top, top + SIDE), slice(left, left + SIDE)
        both, marks = np.stack([s.decoded[part], s.wanted[part]]), s.marks[part]
        turn, down, across = draw.integers(2, size=3)
        if turn:
            both, marks = both.transpose(0, 2, 1), marks.transpose(1, 0, 2)[..., [1, 0, 2]]
        if down:
            both, marks = both[:, ::-1], marks[::-1]
        if across:
            both, marks = both[:, :, ::-1], marks[:, ::-1]
        inputs.append(inputs_of(both[0], marks))
        lacks.append((both[1] - both[0])[m:-m, m:-m])
        weights.append(s.weight)
    return np.stack(inputs), np.stack(lacks), np.array(weights, np.float32)


def inputs_of(plane: Array, marks: Array) -> Array:
    """Return the limited differences from the samples around, and the marks, (H - 4, W - 4, INPUTS)."""
    r = learnt.AROUND
    windows = sliding_window_view(plane, (2 * r + 1, 2 * r + 1)).reshape(*(side - 2 * r for side in plane.shape), -1)
    differences = np.delete(windows, windows.shape[-1] // 2, axis=-1) - plane[r:-r, r:-r, None]
    return np.concatenate([np.clip(differences, -CLIP, CLIP), marks[r:-r, r:-r]], axis=-1)


def around(values: Array) -> Array:
    """Return the values (B, H, W, C) of 3×3 samples, (B, H - 2, W - 2, 9 C)."""
    height, width = (side - 2 for side in values.shape[1:3])
    parts = [values[:, i : i + height, j : j + width] for i in range(3) for j in range(3)]
    return np.concatenate(parts, axis=-1)


def forward(net: list[Array], inputs: Array) -> tuple[Array, list[Array], list[Array]]:
    """Return the guess, the inputs of all layers, and their results before the rectifier."""
    taken, sums = [inputs], []
    for k in range(0, len(net) - 2, 2):
        sums.append(taken[-1] @ net[k] + net[k + 1])
        taken.append(around(np.clip(sums[-1], 0, MOST)))
    return (taken[-1] @ net[-2] + net[-1])[..., 0], taken, sums


def slopes_of(net: list[Array], inputs: Array, lacks: Array, weights: Array) -> list[Array]:
    """Return the slopes of the squared error by all weights and biases."""
    guess, taken, sums = forward(net, inputs)
    slope = (2 / guess.size * weights[:, None, None] * (guess - lacks))[..., None]
    slopes: list[Array] = []
    for k in range(len(net) - 2, -1, -2):
        flat = slope.reshape(-1, slope.shape[-1])
        slopes[:0] = taken[k // 2].reshape(len(flat), -1).T @ flat, flat.sum(axis=0)
        if k:
            nine, before = slope @ net[k].T, sums[k // 2 - 1]
            height, width, c = slope.shape[1], slope.shape[2], before.shape[-1]
            slope = np.zeros_like(before)
            for i in range(9):
                slope[:, i // 3 : i // 3 + height, i % 3 : i % 3 + width] += nine[..., c * i : c * (i + 1)]
            slope *= (before > 0) & (before < MOST)
    return slopes


def whole(net: list[Array]) -> Array:
    """Return the numbers of `learnt.net`."""
    c, layers = learnt.CHANNELS, range(2, len(net) - 2, 2)
    first, last = FRACTIONS[0] * net[0].T, FRACTIONS[2] * net[-2].reshape(9, c).T
    between = [FRACTIONS[1] * net[k].reshape(9, c, c).transpose(2, 1, 0) for k in layers]
    biases = [FRACTIONS[3] * part for part in net[1:-1:2]]
    numbers = np.rint(np.concatenate([part.ravel() for part in (first, *between, last, *biases)]))
    return np.asarray(numbers, np.int16)


if __name__ == "__main__":
    main()
