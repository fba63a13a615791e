"""Benchmarks of CPU time: rendering, metrics and the viewer, alone and against accuracy."""
