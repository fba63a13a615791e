"""Content of a mesh file of any type: parts with materials, and lights."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..scene.scene import Light, Material
from ..shapes.primitives import Mesh


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
