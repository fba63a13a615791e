"""Scene: bodies, materials, lights, textures. Nothing here depends on Embree."""
