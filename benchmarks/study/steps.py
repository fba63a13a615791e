"""All steps of the study in order: quick steps and steps that others depend on come first."""

from __future__ import annotations

from . import pictures, rates, scripts, structures, views
from .runner import Step


def all_steps(scale: int) -> list[Step]:
    """Return every step at a scale of the coding setups.

    Raises
    ------
    ValueError
        If the scale does not divide setup 1.
    """
    if scale not in (1, 2, 4, 8, 16):
        raise ValueError(f"scale is {scale}: 1, 2, 4, 8 or 16 is needed")
    return [
        *pictures.steps(scale),
        *rates.steps(scale),
        *views.steps(scale),
        *structures.steps(scale),
        *scripts.steps(scale),
    ]
