"""Prediction of component images of a take from neighbours in view and time, and its use by encoders.

    python -m benchmarks run neighbours [--takes car,apples,cuboid] [--again missing]

Each sub-image is predicted block by block with motion compensation from original pixels: from the last instant, from
the last view, from the better of both, and from their mean. The rate of a block is that of its residual by reverse
water-filling plus that of its vectors. This estimates the possible gain of a second dimension. The gain reached by an
encoder is measured with x264 at 1 to 16 references, in orders whose references include both neighbours.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks.arguments import command_line
from benchmarks.coding.takes import INSTANTS, SCALE, TAKES, difference, points, rendered
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from codec import Plan
from ii_core import IIVideo, sub_images, video_of

RECORDS = Records("neighbours", ("benchmarks.coding.neighbours", "benchmarks.coding.takes"))
BLOCK, REACH, FINE = 8, 16, 4  # side of a block, search range each way in pixels, steps per pixel
ESTIMATE = "estimate"  # begins the table's rows of estimated bits
QUANTISERS = (27, 32)  # H.264's quantisers; the distortion of a block is at most Δ²/12
SAME = 0.5  # bits of a vector component that equals that of the last block; others are exponential Golomb codes
Floats = NDArray[np.float32]


def codings(span: int = INSTANTS) -> dict[str, tuple[str, Plan]]:
    """Return scheme and plan by name.

    One reference predicts in one dimension. In a time-first walk the last view is at most 2·span − 1 frames back, so
    that 16 references predict in both. Groups of one view have no other view: they show the gain of more instants.
    """

    def scheme(refs: int) -> str:
        return f"si-h264:rate=cq,refs={refs}"

    first, across = Plan(walk="time-first", span=span), Plan(walk="view-first", span=span)
    films = Plan(walk="time-first", span=span, group=1)
    strips = {strip: Plan(walk="interleaved", span=span, strip=strip) for strip in (2, 4, 8)}
    return {
        "time-first, 1 reference": (scheme(1), first),
        "time-first, 16 references": (scheme(16), first),
        "view-first, 1 reference": (scheme(1), across),
        "interleaved by 2 views, 16 references": (scheme(16), strips[2]),
        "interleaved by 4 views, 16 references": (scheme(16), strips[4]),
        "interleaved by 8 views, 16 references": (scheme(16), strips[8]),
        "time-first, groups of 1 view, 1 reference": (scheme(1), films),
        "time-first, groups of 1 view, 16 references": (scheme(16), films),
    }


CODINGS = codings()
ANCHOR = "time-first, 1 reference"


def main() -> None:
    """Measure, print and fill the tables."""
    asked = command_line(__doc__, takes=TAKES).parse_args()
    keys = [{"take": take, "scale": SCALE, "what": what} for take in asked.takes for what in ("bits", *CODINGS)]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda key=key: measured(**key))
        print(key, flush=True)
    print("\n".join(table()))
    publish(tables())


def measured(take: str, scale: int, what: str) -> dict[str, Any]:
    """Return estimated bits of the predictions of a take, or points of one coding."""
    video = rendered(take, scale)
    some = video_of([video[frame] for frame in range(INSTANTS)], fps=video.fps)
    if what == "bits":
        return predicted(some)
    scheme, plan = CODINGS[what]
    return {"points": points(some, plan, scheme)}


def luma_images(video: IIVideo) -> Floats:
    """Return the luma of all sub-images, (T, V, U, L, K)."""
    weights = np.array([0.2126, 0.7152, 0.0722], np.float32)
    return np.stack([sub_images(picture).astype(np.float32) @ weights for picture in video])


def neighbours(video: IIVideo) -> tuple[Floats, dict[str, Floats]]:
    """Return sub-images from the second instant and column of views on, and their neighbours, all (count, L, K).

    Neighbours by name: ``time``, the last instant; ``view``, the last view.
    """
    images = luma_images(video)
    flat = (-1, *images.shape[-2:])
    now = images[1:, :, 1:].reshape(flat)
    return now, {"time": images[:-1, :, 1:].reshape(flat), "view": images[1:, :, :-1].reshape(flat)}


def predicted(video: IIVideo) -> dict[str, Any]:
    """Return bits per pixel of each prediction at each quantiser, over sub-images with both neighbours."""
    now, last = neighbours(video)
    found: dict[str, dict[str, float]] = {}
    for qp in QUANTISERS:
        by = {name: compensated(now, image, weight(qp)) for name, image in last.items()}
        pixels = BLOCK * BLOCK
        rates = {name: residual_bits(now, image, qp) + vectors for name, (image, vectors) in by.items()}
        mean = (by["time"][0] + by["view"][0]) / 2
        both = residual_bits(now, mean, qp) + by["time"][1] + by["view"][1]
        rates["better"] = np.minimum(rates["time"], rates["view"]) + 1  # one bit selects the neighbour
        rates["mean"] = np.minimum(rates["better"], both) + 1
        found[str(qp)] = {name: float(rate.mean()) / pixels for name, rate in rates.items()}
    return {"bits_per_pixel": found}


def weight(qp: int) -> float:
    """Return the squared error that is worth one bit: the λ of H.264's reference software."""
    return float(0.85 * 2 ** ((qp - 12) / 3))


def residual_bits(images: Floats, predictions: Floats, qp: int) -> NDArray[np.float64]:
    """Return bits of each block's residual: ½ log₂(D/θ) per pixel if its mean squared error D > θ = Δ²/12, else 0."""
    step = 2 ** ((qp - 4) / 6)
    error = np.maximum(squared_error(images, predictions), 1e-12)
    return np.asarray(BLOCK * BLOCK * np.maximum(0.0, 0.5 * np.log2(error / (step * step / 12))))


def squared_error(images: Floats, predictions: Floats) -> NDArray[np.float64]:
    """Return the mean squared error of each block, (images, blocks down, blocks across)."""
    count, height, width = images.shape
    apart = np.square(images - predictions, dtype=np.float64)
    return np.asarray(apart.reshape(count, height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean(axis=(2, 4)))


def compensated(images: Floats, references: Floats, weight: float) -> tuple[Floats, NDArray[np.float64]]:
    """Predict each image from its reference, block by block: whole pixels, then half and quarter.

    Parameters
    ----------
    weight : float
        Squared error that is worth one bit of a vector.

    Returns
    -------
    predictions : ndarray, (images, height, width)
    bits : ndarray, (images, blocks down, blocks across)
        Bits of the vectors.
    """
    count, height, width = images.shape
    if height % BLOCK or width % BLOCK:
        raise ValueError(f"images are {width}×{height} px: multiples of {BLOCK} are needed")
    # Both grids end at the same places, so that every FINE-th sample is a pixel.
    sides = [((n - 1) * FINE + 1) / n for n in (height, width)]
    best, bits = np.empty_like(images), np.empty((count, height // BLOCK, width // BLOCK))
    for number, reference in enumerate(references):
        fine = ndimage.zoom(reference, sides, order=3, mode="nearest")
        _predict(images[number], fine, weight, best[number], bits[number])
    return best, bits


@njit(cache=True, nogil=True)
def _vector_bits(down, across):  # type: ignore[no-untyped-def]
    """Return the bits of a vector, coded as the difference from that of the last block."""
    total = 0.0
    for n in (down, across):
        code = 2 * abs(n)
        total += SAME if n == 0 else 2 * np.floor(np.log2(code + 1)) + 1
    return total


@njit(cache=True, nogil=True)
def _error(image, fine, top, left, down, across, least):  # type: ignore[no-untyped-def]
    """Return the squared error of one block moved by fine steps; stop at ``least``. Borders are repeated."""
    rows, cols = fine.shape
    total = 0.0
    for y in range(BLOCK):
        row = min(max((top + y) * FINE + down, 0), rows - 1)
        for x in range(BLOCK):
            col = min(max((left + x) * FINE + across, 0), cols - 1)
            apart = image[top + y, left + x] - fine[row, col]
            total += apart * apart
        if total >= least:
            break
    return total


@njit(cache=True, nogil=True)
def _predict(image, fine, weight, out, bits):  # type: ignore[no-untyped-def]
    """Write the best prediction of each block, and the bits of its vector."""
    rows, cols = fine.shape
    last_down, last_across = 0, 0
    for top in range(0, image.shape[0], BLOCK):
        for left in range(0, image.shape[1], BLOCK):
            down, across, least = 0, 0, np.inf
            step = FINE
            reach = REACH
            while step:
                middle_down, middle_across = down, across
                for j in range(-reach, reach + 1):
                    for i in range(-reach, reach + 1):
                        y, x = middle_down + j * step, middle_across + i * step
                        cost = weight * _vector_bits(y - last_down, x - last_across)
                        if cost < least:
                            cost += _error(image, fine, top, left, y, x, least - cost)
                            if cost < least:
                                least, down, across = cost, y, x
                step //= 2
                reach = 1
            bits[top // BLOCK, left // BLOCK] = _vector_bits(down - last_down, across - last_across)
            last_down, last_across = down, across
            for y in range(BLOCK):
                row = min(max((top + y) * FINE + down, 0), rows - 1)
                for x in range(BLOCK):
                    out[top + y, left + x] = fine[row, min(max((left + x) * FINE + across, 0), cols - 1)]


def tables() -> Tables:
    """Return the table of the page of videos: codings without the estimates."""
    return {("docs/video.md", "takes-neighbours"): [line for line in table() if ESTIMATE not in line]}


def table() -> list[str]:
    """Return the gain of a second dimension, as predicted and as reached by the encoder; one column per take."""
    rows = {(row["take"], row["what"]): row for row in RECORDS.rows(scale=SCALE)}
    if not rows:
        return ["Not measured yet."]
    takes = [take for take in TAKES if any(key[0] == take for key in rows)]
    lines = ["| | " + " | ".join(f"{take}, %" for take in takes) + " |", "|---|" + "---|" * len(takes)]
    names = {"view": "last view alone", "better": "the better of both", "mean": "the better of both, or their mean"}
    for name, text in names.items():
        cells = []
        for take in takes:
            found = rows.get((take, "bits"))
            bits = [found["bits_per_pixel"][str(qp)] for qp in QUANTISERS] if found else []
            cells.append(", ".join(f"{100 * (parts[name] / parts['time'] - 1):+.1f}" for parts in bits) or "–")
        lines.append(f"| {ESTIMATE}, {text} | " + " | ".join(cells) + " |")
    for what in CODINGS:
        cells = []
        for take in takes:
            pair = [rows.get((take, name)) for name in (ANCHOR, what)]
            off = None if None in pair else difference(*(row["points"] for row in pair if row))
            cells.append("anchor" if what == ANCHOR else "–" if off is None else f"{off:+.1f}")
        lines.append(f"| x264, {what} | " + " | ".join(cells) + " |")
    return [origin(rows.values()), "", *lines]


if __name__ == "__main__":
    main()
