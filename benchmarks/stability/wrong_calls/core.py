"""Good calls of `ii_core`."""

from __future__ import annotations

from pathlib import Path

import ii_core
from ii_core import IICamera, IIPicture
from ii_core.camera.maps import read_maps, write_maps
from ii_core.design import design, properties
from ii_core.display.lenticular import lenticular
from ii_core.formats.find import find_views

from .good import BLOCK, CAMERA, DEPTH, FRONT, PICTURE, PIXELS, SAMPLE, Call


def core_calls(folder: Path) -> dict[str, Call]:
    views = folder / "views"
    for name in ("views", "written", "hci"):
        (folder / name).mkdir()
    ii_core.write_views(PICTURE, views)
    write_maps([CAMERA], folder / "maps")
    PICTURE.save(folder / "picture.png")
    maps = read_maps(folder / "maps")[0]
    lengths = {"lens_pitch_mm": 1.0, "gap_mm": 1.0}
    named = {
        "IICamera": (IICamera, {"pixels": (4, 4), "lenses": (2, 2), "pixel_pitch_mm": 0.1, "gap_mm": 1.0,
            "lens_pitch_mm": 0.2, "lattice": "hexagonal", "optics": ("pinhole",), "lens_offset_mm": (0, 0),
            "origin_mm": (0, 0, 0), "name": "a"}),
        "IICamera.rays": (CAMERA.rays, BLOCK | SAMPLE),
        "IICamera.rays_at": (CAMERA.rays_at, {"m": 1, "n": 1} | SAMPLE),
        "IICamera.weighted_rays": (CAMERA.weighted_rays, BLOCK | SAMPLE),
        "IICamera.weighted_rays_at": (CAMERA.weighted_rays_at, {"m": 1, "n": 1} | SAMPLE),
        "IICamera.separable_rays": (CAMERA.separable_rays, BLOCK),
        "IICamera.from_json": (IICamera.from_json, {"data": CAMERA.to_json()}),
        "IIPicture": (IIPicture, {"pixels": PIXELS, "lenses": (12, 12), "ei_pixels": (4, 4), "camera": CAMERA,
            "erect": False}),
        "IIPicture.with_pixels": (PICTURE.with_pixels, {"pixels": PIXELS}),
        "IIPicture.check_same_structure": (PICTURE.check_same_structure, {"other": PICTURE}),
        "IIPicture.save": (PICTURE.save, {"path": folder / "saved.png"}),
        "IIPicture.load": (IIPicture.load, {"path": folder / "picture.png", "lenses": None, "ei_pixels": None}),
        "IIPicture.from_structure_json": (IIPicture.from_structure_json,
            {"pixels": PIXELS, "data": PICTURE.structure_json()}),
        "MapCamera.rays": (maps.rays, BLOCK),
        "MapCamera.stored_rays": (maps.stored_rays, {"sample": 0} | BLOCK),
        "add_sensor_noise": (ii_core.add_sensor_noise, {"picture": PICTURE, "sigma": 1.0, "seed": 0}),
        "component_images": (ii_core.component_images, {"picture": PICTURE, "kind": "si"}),
        "picture_pixels": (ii_core.picture_pixels, {"stack": ii_core.sub_images(PICTURE), "kind": "si"}),
        "find_views": (find_views, {"source": views, "grid": None}),
        "load_mosaic": (ii_core.load_mosaic, {"path": folder / "picture.png", "ei_pixels": (4, 4)}),
        "picture_of": (ii_core.picture_of, {"views": find_views(views), "transposed": False, "flip_down": False,
            "flip_across": False}),
        "write_views": (ii_core.write_views, {"picture": PICTURE, "folder": folder / "written"}),
        "write_hci": (ii_core.write_hci, {"picture": PICTURE, "folder": folder / "hci", "depth": DEPTH}),
        "write_quilt": (ii_core.write_quilt, {"picture": PICTURE, "path": folder / "q.png", "row": 0}),
        "write_maps": (write_maps, {"folder": folder / "again", "cameras": [CAMERA], "format": "exr",
            "samples": [((0.5, 0.5), (0.5, 0.5))], "progress": None}),
        "read_maps": (read_maps, {"folder": folder / "maps"}),
        "preset": (ii_core.preset, {"name": "setup1", "scale": 8}),
        "preset_cameras": (ii_core.preset_cameras, {"name": "setup1", "scale": 8}),
        "five_viewpoints": (ii_core.five_viewpoints, {"camera": CAMERA}),
        "projection_camera": (ii_core.projection_camera, {"camera": CAMERA, "across": 10}),
        "stand_back": (ii_core.stand_back, {"camera": CAMERA, "plane_mm": 1.0}),
        "refocus": (ii_core.refocus, {"picture": PICTURE, "depth_mm": 10.0}),
        "view_image": (ii_core.view_image, {"picture": PICTURE, "viewpoint_mm": FRONT, "interpolation": "linear"}),
        "resampled": (ii_core.resampled, {"picture": PICTURE, "ei_pixels": (4, 4), "deshift": False}),
        "camera_pose": (ii_core.camera_pose, {"at_mm": (0, 0, -9), "look_at_mm": (0, 0, 0), "turn_deg": (0, 0, 0),
            "up": (0, 1, 0)}),
        "disparity_of_depth": (ii_core.disparity_of_depth, {"camera": CAMERA, "z_mm": 10.0}),
        "depth_of_disparity": (ii_core.depth_of_disparity, {"camera": CAMERA, "disparity": 0.5}),
        "panel_display": (ii_core.panel_display, {"size_mm": (300.0, 200.0), "pixels": (3000, 2000),
            "lens_pitch_mm": 1.0, "viewer_mm": 600.0, "view_angle_deg": 20.0, "gap_mm": None, "lenses": None,
            "start_mm": 0.0, "name": "a", "enlarge": 1.0}),
        "from_smallest_rectangle": (ii_core.from_smallest_rectangle, {"picture": PICTURE, "camera": CAMERA}),
        "lenticular": (lenticular, {"picture": PICTURE, "size": (48, 48), "pitch_px": 4.0, "slope": 0.1,
            "centre_px": 0.0, "views": 4, "depth_mm": 10.0, "cone": 1.0}),
        "solve": (design.solve, {**lengths, "pixel_pitch_mm": 0.1, "ei_pixels": None, "view_angle_deg": None}),
        "report of a camera": (design.report, {"camera": CAMERA}),
        "properties": (properties.properties, {"camera": CAMERA, "wavelength_mm": 5e-4}),
        "view_angle_deg": (properties.view_angle_deg, lengths),
        "image_plane_mm": (properties.image_plane_mm, {"focal_mm": 2.0, "gap_mm": 1.0}),
        "depth_range_mm": (properties.depth_range_mm, {**lengths, "z_mm": 9.0, "pixel_pitch_mm": 0.1}),
    }  # fmt: skip
    for name in ("elementary_images", "sub_images", "ray_space_images", "orthoscopic", "smallest_rectangle"):
        named[name] = (getattr(ii_core, name), {"picture": PICTURE})
    return {name: Call(*call) for name, call in named.items()}
