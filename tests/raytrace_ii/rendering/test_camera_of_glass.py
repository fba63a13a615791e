"""A camera of glass lenses inside the scene against the L and D maps of the same camera.

One camera is part of the scene: plano-convex lenslets of glass, one triangle mesh each, with black walls between
them, before a black box with the pixels, from which rays start. The other camera is a `SphericalLenslet`, whose rays
start in the scene. Both are traced by the same renderer along the same samples.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from ii_core import IICamera
from ii_core.camera.optics import Bundle, LensModel, SphericalLenslet, Under
from raytrace_ii import Background, Body, Material, Scene, render
from tests.support.trace_scenes import WHITE, body, ramp, reflectance, sun, wall

GLASS = (1.0, 1.0, 1.0)
BLACK = Material(colour=(0.0, 0.0, 0.0))
FACES = 2  # faces of a lenslet before the scene, each of which costs one generation of rays
CAMERA = IICamera(
    pixels=(40, 30), lenses=(4, 3), pixel_pitch_mm=0.1, gap_mm=2.0,
    optics=(SphericalLenslet(radius_mm=1.0, ior=1.5, aperture_mm=0.9),),
)  # fmt: skip
SCENE = Scene(bodies=[ramp(wall(20.0, 12.0), 12.0)], ambient=WHITE, max_depth=0)


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
        through = (1 - fresnel(entering[..., 2], self.ior)) * (1 - fresnel(leaving, self.ior))
        return rays._replace(weight=np.where(rays.weight > 0, through, 0.0))


def fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
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


def _squares(segments: int) -> np.ndarray:
    """Two triangles for every square of a grid, seen from z > 0."""
    a = (np.arange(segments)[:, None] * (segments + 1) + np.arange(segments)).ravel()
    up = a + segments + 1
    return np.concatenate([np.column_stack([a, a + 1, up]), np.column_stack([a + 1, up + 1, up])])


def _rim(segments: int) -> np.ndarray:
    """The border of a grid's vertices, once around."""
    grid = np.arange((segments + 1) ** 2).reshape(segments + 1, -1)
    return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])


def _unit(x: Any, y: Any, z: Any) -> np.ndarray:
    vectors = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def pictures(segments, scene=SCENE, camera=CAMERA, **options):
    """Return linear light through the meshes and through L/D with Fresnel's losses, one ray per sample."""
    meshed, pixels = in_scene(scene, camera, segments, **options)
    return [
        render(s, c, samples=4, dtype="float32", support=()).picture.pixels
        for s, c in ((meshed, pixels), (scene, lossy(camera)))
    ]


def test_same_picture_up_to_tessellation():
    errors = []
    for segments in (4, 8, 16, 32):
        meshed, maps = pictures(segments)
        errors.append(np.sqrt(np.mean((meshed - maps) ** 2)))
    assert maps.min() > 0.05 and np.ptp(maps[..., 0]) > 0.2  # the scene has content
    # A chord misses its arc, and a normal between two vertices the sphere's, by the square of the mesh size.
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(order, 2, atol=0.3)
    assert errors[-1] < 5e-5  # a hundredth of a step of 8 bits


def test_flat_faces_converge_with_order_1():
    # Flat faces turn rays by the angle between facets: order 1, and at the same mesh far more.
    smooth, maps = pictures(16)
    facets, _ = pictures(16, smooth=False)
    assert np.abs(facets - maps).mean() > 20 * np.abs(smooth - maps).mean()


def test_losses_equal_fresnel_transmittance_of_both_faces():
    meshed, _ = in_scene(SCENE, CAMERA, 16)
    assert meshed.max_depth == 2
    axis = replace(CAMERA, pixels=(1, 1), lenses=(1, 1))
    share = lossy(axis).weighted_rays()[2]
    assert share == pytest.approx((1 - reflectance(1.0, 1.5)) ** 2, rel=1e-12)  # 0.96²: both faces met squarely
    # Any other ray: by angles, with the cosines found from the rays themselves.
    L, D, share = lossy(CAMERA).weighted_rays(place=(0.9, 0.4))
    through = share > 0
    assert through.mean() > 0.9
    model = CAMERA.lens_model
    pinhole, _ = replace(CAMERA, optics=()).rays()
    centre = pinhole + np.array([0, 0, model.thickness(CAMERA.lens_pitch_mm) - 1.0])
    normal, D = (L - centre)[through], D[through]
    cosine = (normal * D).sum(-1) / np.linalg.norm(D, axis=-1)  # the normal has the radius, 1, for its length
    leaving = np.array([reflectance(min(c, 1.0), 1.5) for c in cosine])
    assert (share[through] < (1 - leaving) * (1 - reflectance(1.0, 1.5)) + 1e-12).all()
    assert (share[through] > (1 - leaving) * (1 - reflectance(0.5, 1.5))).all()  # no ray enters that steeply


def test_stray_light_in_the_glass_is_the_remaining_difference():
    mean, most = stray_light(CAMERA, 8)
    # Reflected by both faces, or once and then totally: at least R² ≈ 0.0016 on the axis, never much of the light.
    assert 0.0015 < mean < 0.02 and mean < most < 0.1


def test_a_camera_in_the_scene_shades_it_and_maps_do_not():
    # Lit from behind the camera, as a photographer would not: the wall lies in the shade of a black box.
    lit = Scene(bodies=[body(wall(20.0, 12.0), colour=WHITE)], lights=[sun((0, 0, -1))], max_depth=0)
    meshed, maps = pictures(8, scene=lit)
    assert (maps > 0.9 * maps.max()).all()
    assert (meshed < 0.1 * maps.max()).any()
