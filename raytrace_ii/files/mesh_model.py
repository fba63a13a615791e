"""Content of a mesh file of any type: parts with materials, lights, and shares with a tolerance."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..scene.scene import Light, Material
from ..shapes.primitives import Mesh

BEYOND = 1e-5  # by so much float32 rounding in files may move numbers past their bounds


@dataclass(frozen=True, eq=False)
class Part:
    """Part of a file: a mesh in the file's units and the scene's left-handed frame, with its material, if any.

    ``name`` is empty for a single unnamed part.
    """

    name: str
    mesh: Mesh
    material: Material | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """Parts and lights of a file. ``left_out`` names the unsupported parts of the file, each once.

    Lengths in materials, as in absorption, have the file's units.
    """

    parts: list[Part]
    lights: list[Light] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def share(value: float) -> float:
    """Return a share clipped to [0, 1] if it is at most 1e-5 outside; other values are returned unchanged."""
    if -BEYOND <= value < 0:
        return 0.0
    return 1.0 if 1 < value <= 1 + BEYOND else value
