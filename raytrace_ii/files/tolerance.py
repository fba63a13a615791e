"""Tolerance for numbers in files that float32 rounding moved past their bounds."""

from __future__ import annotations

BEYOND = 1e-5


def share(value: float) -> float:
    """A share from 0 to 1: at most 1e-5 beyond a bound is the bound, what is further off is left to be refused."""
    if -BEYOND <= value < 0:
        return 0.0
    return 1.0 if 1 < value <= 1 + BEYOND else value
