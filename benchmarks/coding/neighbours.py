"""Component images of a take predicted from their neighbours in view and time, and what encoders make of both.

    python -m benchmarks run neighbours [--takes car,apples,cuboid] [--again missing]

Each sub-image is predicted block by block, motion-compensated, from the last instant, from the last view, from the
better of both and from their mean, original pixels. A block's rate is that of reverse water-filling, as `bits`. The
same takes are coded by x264 with 1 to 16 references in orders whose references are both neighbours. The first numbers
are what a second dimension can bring, the second what the encoder makes of it.
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
BLOCK, REACH, FINE = 8, 16, 4  # pixels of a block, of the search each way, and steps of a pixel
QUANTISERS = (27, 32)  # of H.264; the distortion of a block is at most Δ²/12
Floats = NDArray[np.float32]


def codings(span: int = INSTANTS) -> dict[str, tuple[str, Plan]]:
    """Scheme and plan by name; a time-first walk has the last view at most 2·span − 1 frames back."""

    def scheme(refs: int) -> str:
        return f"si-h264:rate=cq,refs={refs}"

    first, across = Plan(walk="time-first", span=span), Plan(walk="view-first", span=span)
    strips = {strip: Plan(walk="interleaved", span=span, strip=strip) for strip in (2, 4, 8)}
    return {
        "time-first, 1 reference": (scheme(1), first),
        "time-first, 16 references": (scheme(16), first),
        "view-first, 1 reference": (scheme(1), across),
        "interleaved by 2 views, 16 references": (scheme(16), strips[2]),
        "interleaved by 4 views, 16 references": (scheme(16), strips[4]),
        "interleaved by 8 views, 16 references": (scheme(16), strips[8]),
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
    """Estimated bits of the predictions of a take, or points of one coding."""
    video = rendered(take, scale)
    some = video_of([video[frame] for frame in range(INSTANTS)], fps=video.fps)
    if what == "bits":
        return predicted(some)
    scheme, plan = CODINGS[what]
    return {"points": points(some, plan, scheme)}


def luma_images(video: IIVideo) -> Floats:
    """Luma of all sub-images, (T, V, U, L, K)."""
    weights = np.array([0.2126, 0.7152, 0.0722], np.float32)
    return np.stack([sub_images(picture).astype(np.float32) @ weights for picture in video])


def neighbours(video: IIVideo) -> tuple[Floats, dict[str, Floats], dict[str, Floats]]:
    """Sub-images from the second instant and column of views on, their neighbours, and predictions from these.

    All are (count, L, K). Neighbours and predictions by name: ``time``, the last instant; ``view``, the last view.
    """
    images = luma_images(video)
    flat = (-1, *images.shape[-2:])
    now = images[1:, :, 1:].reshape(flat)
    last = {"time": images[:-1, :, 1:].reshape(flat), "view": images[1:, :, :-1].reshape(flat)}
    return now, last, {name: compensated(now, image) for name, image in last.items()}


def predicted(video: IIVideo) -> dict[str, Any]:
    """Bits a pixel of each prediction at each quantiser, by reverse water-filling over blocks.

    Images that have both neighbours count.
    """
    now, _, by = neighbours(video)
    errors = {name: squared_error(now, image) for name, image in by.items()}
    errors["better"] = np.minimum(errors["time"], errors["view"])
    errors["mean"] = np.minimum(errors["better"], squared_error(now, (by["time"] + by["view"]) / 2))
    return {
        "bits_per_pixel": {str(qp): {name: bits(error, qp) for name, error in errors.items()} for qp in QUANTISERS},
        "share_of_blocks_by_view": float((errors["view"] < errors["time"]).mean()),
    }


def bits(squared: NDArray[np.float64], qp: int) -> float:
    """Bits a pixel of blocks with these mean squared errors: ½ log₂(D/θ) where D > θ = Δ²/12, else none."""
    step = 2 ** ((qp - 4) / 6)
    return float(np.maximum(0.0, 0.5 * np.log2(np.maximum(squared, 1e-12) / (step * step / 12))).mean())


def squared_error(images: Floats, predictions: Floats) -> NDArray[np.float64]:
    """Mean squared error of each block, (images, blocks down, blocks across)."""
    count, height, width = images.shape
    apart = np.square(images - predictions, dtype=np.float64)
    return np.asarray(apart.reshape(count, height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean(axis=(2, 4)))


def compensated(images: Floats, references: Floats) -> Floats:
    """Best prediction of each block of each image from its reference: whole pixels, then half and quarter."""
    height, width = images.shape[1:]
    if height % BLOCK or width % BLOCK:
        raise ValueError(f"images are {width}×{height} px: multiples of {BLOCK} are needed")
    sides = [((n - 1) * FINE + 1) / n for n in (height, width)]  # ends on ends: every FINE-th sample is a pixel
    best = np.empty_like(images)
    for number, reference in enumerate(references):
        fine = ndimage.zoom(reference, sides, order=3, mode="nearest")
        _predict(images[number], fine, best[number])
    return best


@njit(cache=True, nogil=True)
def _error(image, fine, top, left, down, across, least):  # type: ignore[no-untyped-def]
    """Squared error of one block, moved by so many fine steps, until it is at least ``least``; borders go on."""
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
def _predict(image, fine, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` with the best prediction of each block."""
    rows, cols = fine.shape
    for top in range(0, image.shape[0], BLOCK):
        for left in range(0, image.shape[1], BLOCK):
            down, across = 0, 0
            least = _error(image, fine, top, left, 0, 0, np.inf)
            for j in range(-REACH, REACH + 1):
                for i in range(-REACH, REACH + 1):
                    error = _error(image, fine, top, left, j * FINE, i * FINE, least)
                    if error < least:
                        least, down, across = error, j * FINE, i * FINE
            step = FINE // 2
            while step:
                middle_down, middle_across = down, across
                for j in (-step, 0, step):
                    for i in (-step, 0, step):
                        error = _error(image, fine, top, left, middle_down + j, middle_across + i, least)
                        if error < least:
                            least, down, across = error, middle_down + j, middle_across + i
                step //= 2
            for y in range(BLOCK):
                row = min(max((top + y) * FINE + down, 0), rows - 1)
                for x in range(BLOCK):
                    out[top + y, left + x] = fine[row, min(max((left + x) * FINE + across, 0), cols - 1)]


def tables() -> Tables:
    """Return the table of the page of videos."""
    return {("docs/video.md", "takes-neighbours"): table()}


def table() -> list[str]:
    """What a second dimension can bring by prediction, and brings by the encoder; a column a take."""
    rows = {(row["take"], row["what"]): row for row in RECORDS.rows(scale=SCALE)}
    if not rows:
        return ["Not measured yet."]
    takes = [take for take in TAKES if any(key[0] == take for key in rows)]
    lines = ["| | " + " | ".join(takes) + " |", "|---|" + "---|" * len(takes)]
    names = {"view": "last view alone", "better": "the better of both", "mean": "the better of both, or their mean"}
    for qp in map(str, QUANTISERS):
        for name, text in names.items():
            cells = []
            for take in takes:
                found = rows.get((take, "bits"))
                parts = found and found["bits_per_pixel"][qp]
                cells.append(f"{100 * (parts[name] / parts['time'] - 1):+.1f} %" if parts else "–")
            lines.append(f"| predicted from {text}, step of quantiser {qp} | " + " | ".join(cells) + " |")
    for what in CODINGS:
        cells = []
        for take in takes:
            pair = [rows.get((take, name)) for name in (ANCHOR, what)]
            off = None if None in pair else difference(*(row["points"] for row in pair if row))
            cells.append("anchor" if what == ANCHOR else "–" if off is None else f"{off:+.1f} %")
        lines.append(f"| x264, {what} | " + " | ".join(cells) + " |")
    return [origin(rows.values()), "", *lines]


if __name__ == "__main__":
    main()
