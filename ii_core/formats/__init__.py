"""Light-field formats: readers beside writers."""
