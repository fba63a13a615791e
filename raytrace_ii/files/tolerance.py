"""Tolerance for numbers in files that float32 rounding moved past their bounds."""

from __future__ import annotations

BEYOND = 1e-5


def share(value: float) -> float:
    """Return a share clipped to [0, 1] if it is at most 1e-5 outside; other values are returned unchanged."""
    if -BEYOND <= value < 0:
        return 0.0
    return 1.0 if 1 < value <= 1 + BEYOND else value
