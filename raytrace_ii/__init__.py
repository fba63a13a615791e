"""Whitted ray tracer for the rays of II-cameras.

Names are imported on first use: the help of the command does not wait for numba.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .files.load import load_scene, scene_names
    from .files.rgbd import rgbd_scene
    from .files.take import Take, load_take
    from .rendering.audit import Audit
    from .rendering.options import RenderOptions
    from .rendering.render import Shot, Stats, render, render_to
    from .rendering.render_take import render_take
    from .scene.scene import Background, Body, Fog, Light, Material, Scene
    from .tracing.tracer import trace

__all__ = [
    "Audit",
    "Background",
    "Body",
    "Fog",
    "Light",
    "Material",
    "RenderOptions",
    "Scene",
    "Shot",
    "Stats",
    "Take",
    "load_scene",
    "load_take",
    "render",
    "render_take",
    "render_to",
    "rgbd_scene",
    "scene_names",
    "trace",
]

_HOMES = {
    "load_scene": "files.load",
    "scene_names": "files.load",
    "rgbd_scene": "files.rgbd",
    "Take": "files.take",
    "load_take": "files.take",
    "trace": "tracing.tracer",
    "Audit": "rendering.audit",
    "RenderOptions": "rendering.options",
    "render_take": "rendering.render_take",
}
_HOMES |= dict.fromkeys(["Shot", "Stats", "render", "render_to"], "rendering.render")


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOMES.get(name, 'scene.scene')}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
