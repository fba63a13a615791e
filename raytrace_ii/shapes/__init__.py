"""Procedural shapes: meshes computed from parameters."""
