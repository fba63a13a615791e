"""A Whitted ray tracer driven by an II-camera's rays."""

from .load import load_scene, scene_names
from .render import Shot, Stats, render
from .scene import Background, Body, Fog, Light, Material, Scene
from .trace import trace

__all__ = [
    "Background",
    "Body",
    "Fog",
    "Light",
    "Material",
    "Scene",
    "Shot",
    "Stats",
    "load_scene",
    "render",
    "scene_names",
    "trace",
]
