"""II-pictures: pixels and structure, component images, view images, regular structures, noise."""

from . import notebook  # gives pictures their still in notebooks
from .picture import IIPicture

__all__ = ["IIPicture", "notebook"]
