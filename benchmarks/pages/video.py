"""Pictures of the page of videos: frames of the reference takes, and a chart over time.

    python -m benchmarks run video

Views are the middle sub-images of frames that `benchmarks.coding.takes` renders.
"""

from __future__ import annotations

import numpy as np
from PIL import Image

from benchmarks.coding.takes import INSTANTS, SCALE, SCHEME, TAKES, rendered
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.records import ROOT
from codec import Plan, encode_take, open_take
from ii_core import video_of
from ii_core.display.look import viewpoints_around
from metrics import measure_take, time_chart

SHOWN = (0, 5, 10, 15)
HEIGHT = 180


def main() -> None:
    """Write the pictures."""
    rows = []
    for take in TAKES:
        video = rendered(take, SCALE)
        u, v = video.structure.ei_pixels
        views = [video.component(frame, "si", (u // 2, v // 2)) for frame in SHOWN]
        rows.append(np.hstack([np.asarray(Image.fromarray(view).resize((2 * HEIGHT, HEIGHT), 0)) for view in views]))
    write_picture(IMAGES / "takes_frames.jpg", np.vstack(rows))
    video = rendered("car", SCALE)
    some = video_of([video[frame] for frame in range(INSTANTS)], fps=video.fps)
    path = viewpoints_around(some.structure, INSTANTS)
    plans = {"stills": Plan(span=1), "time-first, 8 instants": Plan(walk="time-first")}
    measured = {
        name: measure_take(some, open_take(encode_take(some, SCHEME, qp=32, plan=plan)), viewpoints_mm=path)
        for name, plan in plans.items()
    }
    out = ROOT / "out" / "takes_time.png"
    out.parent.mkdir(exist_ok=True)
    write_picture(IMAGES / "takes_time.png", time_chart(measured, out))


if __name__ == "__main__":
    main()
