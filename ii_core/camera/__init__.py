"""II-cameras: arrays of lenses, optical elements, poses, presets and stored maps."""

from .camera import Camera, IICamera

__all__ = ["Camera", "IICamera"]
