"""Errors of calibration for pictures without a lens grid."""


class NoLenses(ValueError):
    """A picture in which no lens grid is found."""
