"""Calibration of raw lenslet pictures: lens grid, vignetting, colours."""

from .calibrate import Calibration, calibrate, calibrated_picture, centres_picture
from .peaks import NoLenses

__all__ = ["Calibration", "NoLenses", "calibrate", "calibrated_picture", "centres_picture"]
