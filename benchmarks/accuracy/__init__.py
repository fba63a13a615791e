"""Benchmarks of accuracy: pictures, depth and camera maps against closed forms and other programs."""
