"""Properties of cameras and displays, and their design from wanted properties."""
