"""II-videos: takes and their clock."""

from .video import IIVideo

__all__ = ["IIVideo"]
