"""Ray tracing: intersection, packed scene, shading."""
