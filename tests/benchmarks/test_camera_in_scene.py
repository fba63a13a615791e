"""Camera modelled in the scene, with lens meshes, against its L/D maps."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.accuracy import camera_in_scene
from ii_core import IICamera
from ii_core.camera.optics import SphericalLenslet
from raytrace_ii import Scene, render
from tests.support.trace_scenes import WHITE, body, ramp, reflectance, sun, wall

CAMERA = IICamera(
    pixels=(40, 30), lenses=(4, 3), pixel_pitch_mm=0.1, gap_mm=2.0,
    optics=(SphericalLenslet(radius_mm=1.0, ior=1.5, aperture_mm=0.9),),
)  # fmt: skip
SCENE = Scene(bodies=[ramp(wall(20.0, 12.0), 12.0)], ambient=WHITE, max_depth=0)


def pictures(segments, scene=SCENE, camera=CAMERA, **options):
    """Return linear light through the meshes and through L/D with Fresnel's losses, one ray per sample."""
    meshed, pixels = camera_in_scene.in_scene(scene, camera, segments, **options)
    return [
        render(s, c, samples=4, dtype="float32", support=()).picture.pixels
        for s, c in ((meshed, pixels), (scene, camera_in_scene.lossy(camera)))
    ]


@pytest.mark.slow
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
    meshed, _ = camera_in_scene.in_scene(SCENE, CAMERA, 16)
    assert meshed.max_depth == 2
    axis = replace(CAMERA, pixels=(1, 1), lenses=(1, 1))
    share = camera_in_scene.lossy(axis).weighted_rays()[2]
    assert share == pytest.approx((1 - reflectance(1.0, 1.5)) ** 2, rel=1e-12)  # 0.96²: both faces met squarely
    # Any other ray: by angles, with the cosines found from the rays themselves.
    L, D, share = camera_in_scene.lossy(CAMERA).weighted_rays(place=(0.9, 0.4))
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
    mean, most = camera_in_scene.stray_light(CAMERA, 8)
    # Reflected by both faces, or once and then totally: at least R² ≈ 0.0016 on the axis, never much of the light.
    assert 0.0015 < mean < 0.02 and mean < most < 0.1


def test_a_camera_in_the_scene_shades_it_and_maps_do_not():
    # Lit from behind the camera, as a photographer would not: the wall lies in the shade of a black box.
    lit = Scene(bodies=[body(wall(20.0, 12.0), colour=WHITE)], lights=[sun((0, 0, -1))], max_depth=0)
    meshed, maps = pictures(8, scene=lit)
    assert (maps > 0.9 * maps.max()).all()
    assert (meshed < 0.1 * maps.max()).any()
