"""Good calls of `raytrace_ii`."""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np

import raytrace_ii
from raytrace_ii import Background, Body, Fog, Light, Material, Scene

from .good import CAMERA, Call


def raytrace_calls(folder: Path) -> dict[str, Call]:
    corners, faces = np.array([[-5.0, -5, 20], [5, -5, 20], [0, 5, 20]]), np.array([[0, 1, 2]])
    body = {"name": "a", "vertices": corners, "faces": faces, "material": Material(), "normals": -np.eye(3),
            "texture_coordinates": np.zeros((3, 3))}  # fmt: skip
    light = {"kind": "point", "vector": (0, 0, 0), "colour": (1, 1, 1), "direction": (0, 0, 1), "cone_deg": (10, 20)}
    scene = {"bodies": [Body(**body)], "lights": [Light(**light)], "background": Background(), "fog": None,
             "ambient": (0, 0, 0), "max_depth": 3, "name": "a"}  # fmt: skip
    made = Scene(**scene)
    options = {"samples": 1, "error": 0.5, "seed": 0, "noise": 0.0, "dtype": "uint8", "workers": 1, "executor": None,
               "pose": None, "texture_filter": True}  # fmt: skip
    material = {name: field.default for name, field in inspect.signature(Material).parameters.items()}
    background = {name: field.default for name, field in inspect.signature(Background).parameters.items()}
    named = {
        "Body": (Body, body),
        "Light": (Light, light),
        "Scene": (Scene, scene),
        "Scene.with_depth": (made.with_depth, {"max_depth": 2}),
        "Material": (Material, material),
        "Background": (Background, background),
        "Fog": (Fog, {"colour": (1, 1, 1), "density_per_mm": 0.1}),
        "RenderOptions": (raytrace_ii.RenderOptions, options),
        "load_scene": (raytrace_ii.load_scene, {"name": "cuboid"}),
        "render": (raytrace_ii.render, {"scene": made, "camera": CAMERA, "support": (), "progress": None, **options}),
        "render_to": (raytrace_ii.render_to, {"picture": folder / "r.png", "scene": made, "camera": CAMERA,
            "support": {}, "upright": False, "progress": None, **options}),
        "trace": (raytrace_ii.trace, {"scene": made, "locations": [0.0, 0, 0], "directions": [0.0, 0, 1],
            "pose": None}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}
