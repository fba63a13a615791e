"""What calibration raises where there is nothing to calibrate."""


class NoLenses(ValueError):
    """A picture in which no lens grid is found."""
