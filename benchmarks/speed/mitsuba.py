"""CPU time of rendering against Mitsuba 3 (LLVM) on the same faces and rays, one thread each, in turn.

    PYTHONPATH=FOLDER python -m benchmarks run mitsuba [--scenes apples,cuboid]

The scenes are reduced to what both do alike: one grey, the first light, shadows, no textures, no highlights. The rays
are those of full ``setup1``. Mitsuba gets them ready-made in bands of lenses, by views in each, its fastest order,
and stores linear light, once by default and once with robust intersections, as ours are. `render` makes them itself
and stores 8-bit sRGB. The pictures are compared in linear light. Needs Mitsuba, for instance
``pip install --target FOLDER mitsuba drjit``, an LLVM library, and 6 GiB.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module, metadata
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.records import Records
from ii_core import IICamera, preset
from raytrace_ii import Background, Material, Scene, load_scene, render
from raytrace_ii.tracing.kernels.tables import COORDINATES, NORMALS
from raytrace_ii.tracing.packing import packed

RECORDS = Records("mitsuba", ("benchmarks.speed.mitsuba",))
SCENES = ("apples", "cuboid")
GREY = 0.5
REPEATS = 7
BAND = 8  # rows of lenses that Mitsuba gets at once
LIFT = 1e-4  # of the distance: start of shadow rays above the surface
SAME = 0.01  # of white: difference of linear light up to which two pixels agree
MISSING = (
    "Mitsuba is missing: `pip install --target FOLDER mitsuba drjit` and PYTHONPATH=FOLDER, with an LLVM library"
)


def main() -> None:
    """Measure, print and record."""
    asked = command_line(__doc__, scale=1, scenes=SCENES).parse_args()
    try:
        mitsuba = import_module("mitsuba")
        mitsuba.set_variant("llvm_ad_mono")
    except ImportError:
        sys.exit(MISSING)
    camera = preset("setup1", scale=asked.scale)
    version = metadata.version("mitsuba")
    keys = [{"scene": name, "scale": asked.scale, "mitsuba": version} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        found = RECORDS.measure(key, lambda key=key: compare(mitsuba, plain(load_scene(key["scene"])), camera))
        print(key["scene"], found["result"], flush=True)


def plain(scene: Scene) -> Scene:
    """Return the scene in one grey with its first light."""
    grey = Material(colour=(GREY,) * 3)
    return replace(
        scene, bodies=[replace(body, material=grey) for body in scene.bodies], lights=list(scene.lights)[:1],
        ambient=(0.0,) * 3, background=Background(), fog=None,
    )  # fmt: skip


def compare(mitsuba: Any, scene: Scene, camera: IICamera) -> dict[str, Any]:
    """Return median CPU nanoseconds per pixel of ours, of Mitsuba and of Mitsuba with robust intersections as ours.

    With medians of the ratios, the share of equal pixels, and how busy the machine was with other programs.
    """
    pixels, linear = camera.pixels[0] * camera.pixels[1], render(
        scene, camera, dtype="float32", support=(), workers=1
    ).picture.pixels[..., 0]  # fmt: skip
    ways: dict[str, Callable[[], object]] = {
        "ours": lambda: render(scene, camera, support=(), workers=1),
        "mitsuba": prepared(mitsuba, scene, camera), "robust": prepared(mitsuba, scene, camera, robust=True),
    }  # fmt: skip
    agree = float((np.abs(np.asarray(ways["mitsuba"]()) - linear) <= SAME).mean())
    ways["robust"]()
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(REPEATS):
        for name, shoot in ways.items():
            start = time.process_time()
            shoot()
            times[name].append((time.process_time() - start) / pixels * 1e9)
    return {
        **{f"{name}_ns": median(found) for name, found in times.items()},
        "ratio": median(b / a for a, b in zip(times["ours"], times["mitsuba"], strict=True)),
        "robust_ratio": median(b / a for a, b in zip(times["ours"], times["robust"], strict=True)),
        "agree": agree, "load": os.getloadavg()[0],
    }  # fmt: skip


def prepared(
    mitsuba: Any, scene: Scene, camera: IICamera, *, robust: bool = False
) -> Callable[[], NDArray[np.float32]]:
    """Return the function that renders the scene by Mitsuba, with faces, rays and code at hand, as (N, M)."""
    dr = import_module("drjit")
    dr.set_thread_count(1)
    about = {"type": "scene", "embree_use_robust_intersections": robust, "faces": _mesh(mitsuba, scene)}
    world, light = mitsuba.load_dict(about), scene.lights[0]
    (columns, _), (width, height) = camera.pixels, camera.ei_pixels
    bands = []
    for down in range(0, camera.lenses[1], BAND):
        count = min(BAND, camera.lenses[1] - down)
        L, D = camera.rays(rows=slice(down * height, (down + count) * height))
        D = D / np.linalg.norm(D, axis=-1, keepdims=True)
        cells = (count, height, columns // width, width, 3)
        bands.append([_point(mitsuba, x.reshape(cells).transpose(1, 3, 0, 2, 4)) for x in (L, D)])
    vector = mitsuba.Vector3f(*light.vector)
    far, colour = light.kind == "directional", float(light.colour[0]) * GREY

    def shoot() -> NDArray[np.float32]:
        return np.concatenate([of_band(origins, directions) for origins, directions in bands])

    def of_band(origins: Any, directions: Any) -> NDArray[np.float32]:
        hit = world.ray_intersect(mitsuba.Ray3f(origins, directions), int(mitsuba.RayFlags.All), True)
        normal = dr.select(dr.dot(hit.sh_frame.n, directions) > 0, -hit.sh_frame.n, hit.sh_frame.n)
        face = dr.select(dr.dot(hit.n, directions) > 0, -hit.n, hit.n)
        way = -vector if far else vector - hit.p
        reach = dr.norm(way)
        towards = way / reach
        cosine = dr.dot(normal, towards)
        lit = hit.is_valid() & (cosine > 0) & (dr.dot(face, towards) > 0)
        ray = mitsuba.Ray3f(hit.p + face * (LIFT * hit.t), towards)
        ray.maxt = dr.inf if far else reach * (1 - 1e-4)
        lit &= ~world.ray_test(ray, True, lit)
        radiance = np.array(dr.select(lit, cosine * colour, 0.0), np.float32)
        views = radiance.reshape(height, width, -1, columns // width)
        return views.transpose(2, 0, 3, 1).reshape(-1, columns)

    return shoot


def _mesh(mitsuba: Any, scene: Scene) -> Any:
    """Return the faces as Mitsuba's mesh; normals of shading are those of the tracer."""
    arrays = packed(scene)
    corners = arrays.corners.reshape(-1, 3)
    flat = np.repeat(arrays.faces[:, :3], 3, axis=0)
    table = arrays.surfaces.rows.reshape(-1, arrays.surfaces.columns)
    smooth = table[:, NORMALS:COORDINATES].reshape(-1, 3) if arrays.surfaces.smooth else np.zeros_like(flat)
    normals = np.where(smooth.any(axis=1, keepdims=True), smooth, flat)  # those of flat bodies are 0
    mesh = mitsuba.Mesh("faces", len(corners), len(corners) // 3, has_vertex_normals=True)
    values = mitsuba.traverse(mesh)
    values["vertex_positions"] = corners.astype(np.float32).ravel()
    values["vertex_normals"] = normals.astype(np.float32).ravel()
    values["faces"] = np.arange(len(corners), dtype=np.uint32)
    values.update()
    return mesh


def _point(mitsuba: Any, array: NDArray[np.float64]) -> Any:
    return mitsuba.Point3f(*(np.ascontiguousarray(column, np.float32) for column in array.reshape(-1, 3).T))


if __name__ == "__main__":
    main()
