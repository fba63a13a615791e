"""Camera modelled as lens meshes in the scene against L/D maps: equal pictures, CPU time.

    python -m benchmarks run camera_in_scene [--scale 16]

One camera is part of the scene: plano-convex lenslets of glass, one triangle mesh each, with black walls between
them, before a black box with the pixels, from which rays start. The other camera is a `SphericalLenslet`, whose rays
start in the scene. Both are traced by the same renderer along the same samples. Numbers go to
``benchmarks/results/camera_in_scene.jsonl``, the pictures to ``docs/images/camera_in_scene.jpg``.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.records import Records
from ii_core import IICamera, preset
from ii_core.camera.optics import Bundle, LensModel, SphericalLenslet, Under
from metrics import q_global
from raytrace_ii import Background, Body, Material, Scene, Shot, load_scene, render
from raytrace_ii.tracing.packing import packed

RECORDS, SCALE = Records("camera_in_scene", ("benchmarks.accuracy.camera_in_scene",)), 16  # scale on the page
GLASS = (1.0, 1.0, 1.0)
BLACK = Material(colour=(0.0, 0.0, 0.0))
REPEATS = 5
FACES = 2  # faces of a lenslet before the scene, each of which costs one generation of rays


@dataclass(frozen=True, kw_only=True)
class FromPixels(LensModel):
    """Rays in air from the pixel towards the lenslet's flat face; the rest of the camera is in the scene."""

    kind: ClassVar[str] = "from-pixels"
    samples_aperture: ClassVar[bool] = True
    aperture_mm: float

    def leave(self, u: Under) -> Bundle:
        dx, dy = (c + self.aperture_mm / 2 * a - p for c, a, p in ((u.cx, u.ax, u.px), (u.cy, u.ay, u.py)))
        return Bundle(u.px, u.py, np.float64(0), dx, dy, np.float64(u.gap))


@dataclass(frozen=True, kw_only=True)
class LossyLenslet(SphericalLenslet):
    """A spherical lenslet whose rays are weighted by Fresnel's transmittance of both faces."""

    kind: ClassVar[str] = "lossy-spherical-lenslet"

    def leave(self, u: Under) -> Bundle:
        rays = super().leave(u)
        assert rays.weight is not None
        direction = _unit(rays.dx, rays.dy, rays.dz)
        spread = (self.aperture_mm or 0.0) / 2
        entering = _unit(u.cx + spread * u.ax - u.px, u.cy + spread * u.ay - u.py, np.float64(u.gap))
        centre = u.gap + self.thickness(u.cell) - self.radius_mm
        normal = _unit(rays.lx - u.cx, rays.ly - u.cy, rays.lz - centre)
        leaving = (direction * normal).sum(axis=-1)  # by reciprocity, light that enters at this cosine
        through = (1 - reflectance(entering[..., 2], self.ior)) * (1 - reflectance(leaving, self.ior))
        return rays._replace(weight=np.where(rays.weight > 0, through, 0.0))


def reflectance(cosine: NDArray[Any], ior: float) -> NDArray[Any]:
    """Unpolarised Fresnel reflectance of glass met from air."""
    within = np.sqrt(1 - (1 - cosine * cosine) / ior**2)
    s = (cosine - ior * within) / (cosine + ior * within)
    p = (ior * cosine - within) / (ior * cosine + within)
    return (s * s + p * p) / 2


def lens_bodies(camera: IICamera, segments: int, *, smooth: bool = True) -> list[Body]:
    """The camera's lenslets as meshes of ``segments``² squares, the black walls between them and the box behind."""
    model, (across, down) = camera.lens_model, camera.lens_pitch_mm
    assert isinstance(model, SphericalLenslet) and camera.lattice == "rectangular"
    centre = model.thickness(camera.lens_pitch_mm) - model.radius_mm
    x, y = np.meshgrid(*(np.linspace(-side / 2, side / 2, segments + 1) for side in (across, down)))
    x, y = x.ravel(), y.ravel()
    z = centre + np.sqrt(np.maximum(0, model.radius_mm**2 - x * x - y * y))
    cap = np.column_stack([x, y, z + camera.gap_mm])
    foot = np.column_stack([x, y, np.full_like(x, camera.gap_mm)])
    corners = np.array([0, segments, segments * (segments + 1), (segments + 1) ** 2 - 1])
    squares = _squares(segments)
    vertices = np.concatenate([cap, foot[corners]])
    flat = len(cap) + np.array([[0, 2, 1], [1, 2, 3]])
    normals = np.column_stack([x, y, z - centre]) / model.radius_mm
    normals = np.concatenate([normals, np.tile([0.0, 0.0, -1.0], (4, 1))])
    rim = _rim(segments)
    wall = np.concatenate([cap[rim], foot[rim]])
    i, n = np.arange(len(rim)), len(rim)
    j = (i + 1) % n
    wall_faces = np.concatenate([np.column_stack([i, j, n + i]), np.column_stack([j, n + j, n + i])])

    k, l = (c.ravel() for c in np.meshgrid(np.arange(camera.lenses[0]), np.arange(camera.lenses[1])))
    cx, cy = camera.lens_lattice.centres(k, l)
    width, height = camera.size_mm
    places = np.column_stack(
        [cx * camera.pixel_pitch_mm - width / 2, height / 2 - cy * camera.pixel_pitch_mm, 0 * cx]
    )
    glass = Material(transmission=GLASS, ior=model.ior)
    lenses = [
        Body(
            name=f"lens {number}", vertices=vertices + place, faces=np.concatenate([squares, flat]), material=glass,
            normals=normals if smooth else None,
        )
        for number, place in enumerate(places)
    ]  # fmt: skip
    walls = Body(
        name="walls", vertices=(wall + places[:, None]).reshape(-1, 3), material=BLACK,
        faces=(wall_faces + np.arange(len(places))[:, None, None] * len(wall)).reshape(-1, 3),
    )  # fmt: skip
    # A box open to the lenslets: light that they reflect back must not hit the scene's floor beside the pixels.
    front, behind = camera.gap_mm, -1.0
    around = np.array([[-width, -height], [width, -height], [width, height], [-width, height]]) / 2
    box = np.concatenate([np.column_stack([around, np.full(4, z)]) for z in (behind, front)])
    sides = [[i, (i + 1) % 4, 4 + i] for i in range(4)] + [[(i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)]
    housing = Body(name="housing", vertices=box, faces=np.array([[0, 1, 2], [0, 2, 3], *sides]), material=BLACK)
    return [*lenses, walls, housing]


def in_scene(scene: Scene, camera: IICamera, segments: int, *, smooth: bool = True) -> tuple[Scene, IICamera]:
    """Return the scene with the camera's lenslets in it, and the rest of the camera: pixels."""
    model = camera.lens_model
    assert isinstance(model, SphericalLenslet)
    bodies = [*scene.bodies, *lens_bodies(camera, segments, smooth=smooth)]
    with_lenses = replace(scene, bodies=bodies, max_depth=scene.max_depth + FACES)
    return with_lenses, replace(camera, optics=(FromPixels(aperture_mm=model.aperture_mm or 0.0),))


def lossy(camera: IICamera) -> IICamera:
    """The camera with Fresnel's losses."""
    model = camera.lens_model
    assert isinstance(model, SphericalLenslet)
    return replace(camera, optics=(LossyLenslet(**vars(model)), *camera.front))


def with_aperture(camera: IICamera, aperture_mm: float) -> IICamera:
    """The camera with another aperture of its lenslets."""
    model: Any = camera.lens_model
    return replace(camera, optics=(replace(model, aperture_mm=aperture_mm), *camera.front))


def away_from_camera(scene: Scene) -> Scene:
    """Return the scene lit from the far side, so that a camera in it casts no shadow into its own picture."""
    lights = [
        replace(light, vector=(*light.vector[:2], -abs(light.vector[2]))) if light.kind == "directional" else light
        for light in scene.lights
    ]
    return replace(scene, lights=lights, name=f"{scene.name}, lit from behind")


def compare(scene: Scene, camera: IICamera, segments: int, samples: int, *, smooth: bool = True) -> dict[str, Any]:
    """Return the similarity of the two pictures, in 8 bits.

    There are three comparisons: as rendered; with Fresnel's losses in the L/D camera; and also without light that is
    reflected inside the glass before it leaves, by a recursion that ends at the scene's first hit.
    """
    started = time.perf_counter()
    scene_with, pixels = in_scene(scene, camera, segments, smooth=smooth)
    _ = packed(scene_with)
    built = time.perf_counter() - started

    def shot(what: Scene, through: IICamera) -> Shot:
        return render(what, through, samples=samples, support=())

    meshed, plain, losing = shot(scene_with, pixels), shot(scene, camera), shot(scene, lossy(camera))
    direct = shot(scene_with.with_depth(FACES), pixels)
    first = shot(scene.with_depth(0), lossy(camera))
    off = abs(first.picture.pixels.astype(int) - direct.picture.pixels).max(axis=2)
    return {
        "triangles_of_the_camera": _faces(scene_with) - _faces(scene),
        "build_seconds": built,
        "psnr_db": q_global(plain.picture, meshed.picture),
        "psnr_with_fresnel_db": q_global(losing.picture, meshed.picture),
        "psnr_direct_light_db": q_global(first.picture, direct.picture),
        "pixels_off_by_more_than_1": float((off > 1).mean()),
        "rays": {"l/d": sum(plain.stats.rays.values()), "in scene": sum(meshed.stats.rays.values())},
        "pictures": (plain, losing, meshed),
    }


def ratio(scene: Scene, camera: IICamera, segments: int, samples: int, *, direct: bool) -> list[float]:
    """Return ratios of the CPU time of the camera in the scene to that of L/D, measured in turn."""
    scene_with, pixels = in_scene(scene, camera, segments)
    if direct:
        scene, scene_with = scene.with_depth(0), scene_with.with_depth(FACES)

    def seconds(what: Scene, through: IICamera) -> float:
        return render(what, through, samples=samples, workers=1, support=()).stats.cpu_seconds

    seconds(scene_with, pixels), seconds(scene, camera)  # build trees and compile kernels
    return [seconds(scene_with, pixels) / seconds(scene, camera) for _ in range(REPEATS)]


def stray_light(camera: IICamera, segments: int) -> tuple[float, float]:
    """Return mean and largest share of light by reflections in the glass, over direct light, under a uniform sky."""
    nothing = Body(name="speck", vertices=1e4 + np.eye(3), faces=np.array([[0, 1, 2]]), material=BLACK)
    even: Any = dict.fromkeys(("horizon", "zenith", "nadir"), (1.0, 1.0, 1.0))
    scene_with, pixels = in_scene(Scene(bodies=[nothing], background=Background(**even)), camera, segments)
    every, direct = (
        render(s, pixels, samples=4, dtype="float32", support=()).picture.pixels[..., 0]
        for s in (scene_with, scene_with.with_depth(FACES))
    )
    return float((every - direct).mean() / direct.mean()), float((every - direct).max() / direct.max())


def transmitted(camera: IICamera) -> tuple[float, float]:
    """Return the least and greatest Fresnel transmittance of chief rays."""
    share = lossy(camera).weighted_rays()[2]
    assert share is not None
    return float(share[share > 0].min()), float(share.max())


def main() -> None:
    """Compare, time and record."""
    asked = command_line(__doc__, scale=SCALE).parse_args()
    RECORDS.run([{"scale": asked.scale}], study, asked.again)


def study(scale: int) -> dict[str, Any]:
    """Compare, time and print; write the picture of both cameras."""
    camera, coarse = preset("spherical", scale=scale), preset("spherical", scale=2 * scale)
    apples = load_scene("apples")
    unshaded = away_from_camera(apples)
    rows: list[dict[str, Any]] = []

    def add(what: str, scene: Scene, c: IICamera, segments: int, samples: int, **options: bool) -> tuple[Shot, ...]:
        found = compare(scene, c, segments, samples, **options)
        pictures: tuple[Shot, ...] = found.pop("pictures")
        aperture = c.lens_model.aperture_mm / c.lens_pitch_mm[0]  # type: ignore[attr-defined]
        row = {
            "what": what, "scene": scene.name, "lenses": list(c.lenses), "segments": segments, "samples": samples,
            "aperture_of_pitch": aperture, **options, **found,
        }  # fmt: skip
        rows.append(row)
        print(row, flush=True)
        return pictures

    pictures = add("picture", apples, camera, 16, 4)
    add("picture", unshaded, camera, 16, 1)
    add("picture", unshaded, camera, 16, 4)
    add("picture", unshaded, with_aperture(camera, camera.lens_pitch_mm[0]), 16, 4)
    wide = with_aperture(coarse, coarse.lens_pitch_mm[0])
    for segments in (2, 4, 8, 16, 32, 64):
        add("tessellation", unshaded, wide, segments, 4)
    for segments in (8, 64):
        add("facets", unshaded, wide, segments, 4, smooth=False)

    times = []
    for segments, samples, direct in ((4, 1, True), (16, 1, True), (16, 4, True), (16, 4, False)):
        values = ratio(apples, camera, segments, samples, direct=direct)
        middle = statistics.median(values)
        times.append({"segments": segments, "samples": samples, "direct": direct, "median": middle, "all": values})
    shares = transmitted(camera)
    stray = {name: stray_light(c, 16) for name, c in (("preset", camera), ("full aperture", wide))}
    write_picture(IMAGES / "camera_in_scene.jpg", side_by_side(pictures))
    numbers = {"fresnel_transmits": shares, "stray_light": stray, "rows": rows, "cpu_ratio": times}
    return {"camera": camera.to_json(), **numbers}


def side_by_side(pictures: Sequence[Shot]) -> NDArray[np.uint8]:
    """L/D and camera in scene above; below, their difference × 8 about grey, without and with Fresnel's losses."""
    plain, losing, meshed = (shot.picture.pixels for shot in pictures)
    difference = [np.clip(128 + 8 * (meshed.astype(int) - one), 0, 255).astype(np.uint8) for one in (plain, losing)]
    gap = np.full((plain.shape[0], 8, 3), 255, np.uint8)
    lines = [np.concatenate([a, gap, b], axis=1) for a, b in ((plain, meshed), difference)]
    return np.concatenate([lines[0], np.full((8, lines[0].shape[1], 3), 255, np.uint8), lines[1]])


def _squares(segments: int) -> NDArray[np.int64]:
    """Two triangles for every square of a grid, seen from z > 0."""
    a = (np.arange(segments)[:, None] * (segments + 1) + np.arange(segments)).ravel()
    up = a + segments + 1
    return np.concatenate([np.column_stack([a, a + 1, up]), np.column_stack([a + 1, up + 1, up])])


def _rim(segments: int) -> NDArray[np.int64]:
    """The border of a grid's vertices, once around."""
    grid = np.arange((segments + 1) ** 2).reshape(segments + 1, -1)
    return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])


def _faces(scene: Scene) -> int:
    return sum(len(body.faces) for body in scene.bodies)


def _unit(x: Any, y: Any, z: Any) -> NDArray[np.float64]:
    vectors = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
