"""Depth of a picture: from focus by layers, and disparity from all views."""
