"""Benchmarks of time: rendering, metrics and the viewer, alone and against accuracy."""
