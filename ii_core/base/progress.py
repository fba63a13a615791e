"""Progress of long computations as one line of text."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

EVERY_SECONDS = 0.2


def reporter(progress: Callable[..., Any] | bool | None, title: str) -> Callable[..., Any] | None:
    """Return a function of done, total and further values: the given one, for True one that prints, else None."""
    if progress is not True:
        return progress or None
    started, told = time.monotonic(), [0.0]

    def report(done: int, total: int, *more: Any) -> None:
        now = time.monotonic()
        if done < total and now - told[0] < EVERY_SECONDS:
            return
        told[0] = now
        left = (now - started) * (total - done) / max(done, 1)
        state = f"{left:.0f} s left" if done < total else f"{now - started:.1f} s"
        text = f"{title} {done}/{total}, {state}" + "".join(f", {word}" for word in more if word)
        print(f"\r{text:<78}", end="\n" if done == total else "", file=sys.stderr, flush=True)

    return report
