"""Calibration of raw lenslet pictures: lens grid, vignetting, colours."""

from .peaks import NoLenses
from .raw_camera import Calibration, calibrate, calibrated_picture, centres_picture, defective_pixels

__all__ = ["Calibration", "NoLenses", "calibrate", "calibrated_picture", "centres_picture", "defective_pixels"]
