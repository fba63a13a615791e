"""Union of all shapes of scene files, by the key ``shape``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from .heightfield import Heightfield
from .implicit import Implicit
from .primitives import Box, BoxGrid, Cylinder, Plane, Revolve, Sphere
from .strands import Strands

AnyShape = Annotated[
    Sphere | Box | Plane | Cylinder | Revolve | BoxGrid | Implicit | Heightfield | Strands,
    Field(discriminator="shape"),
]
