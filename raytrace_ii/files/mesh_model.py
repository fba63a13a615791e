"""Content of a mesh file of any type: parts with materials, and lights."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..scene.scene import Light, Material
from ..shapes.primitives import Mesh


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh in the file's units and the scene's left-handed frame, with its material, if the file says one.

    ``name`` is empty where the file has but one nameless part.
    """

    name: str
    mesh: Mesh
    material: Material | None = None


@dataclass(frozen=True, eq=False)
class Model:
    """Parts and lights of a file. ``left_out`` names what stands in the file and is not supported, each once.

    Materials count lengths in the file's units, absorption too.
    """

    parts: list[Part]
    lights: list[Light] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
