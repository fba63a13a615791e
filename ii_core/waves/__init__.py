"""Light as a wave: spread of a point on the pixels, and pictures with it."""
