"""Viewer page: an II-picture in a browser, with its script and style."""

from .page import JPEG_QUALITY, write_viewer, write_viewer_folder

__all__ = ["JPEG_QUALITY", "write_viewer", "write_viewer_folder"]
