"""Sampling of pixels: places of samples, their number, and cells cut by edges."""
