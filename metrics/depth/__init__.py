"""Depth from focus and quality over depth, Q_depth."""
