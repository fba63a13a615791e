"""Compiled kernels of the tracer; they import numpy and numba alone."""
