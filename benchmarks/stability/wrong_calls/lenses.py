"""Good calls of waves, point-spread functions, glasses and optical elements."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ii_core.camera import glass, optics, prescriptions, surfaces
from ii_core.camera.maps import write_maps
from ii_core.waves import spread, spread_files, wave

from .good import CAMERA, PICTURE, Call


def lens_calls(folder: Path) -> dict[str, Call]:
    """Return a good call of each function and class of lenses by name; files are in a folder."""
    x = np.linspace(-1.0, 1.0, 65)
    slit = {"width_mm": 0.1, "gap_mm": 0.2, "wavelength_nm": 550.0}
    maps = spread.spread_maps(CAMERA, 50.0)
    written = write_maps([CAMERA], folder / "spread")
    spread_files.write_spread([maps], written)
    doublet = prescriptions.lens("doublet") if "doublet" in prescriptions.lens_names() else None
    name = next(iter(prescriptions.lens_names()))
    built = (doublet or prescriptions.lens(name)).at(10.0)
    named = {
        "angular_spectrum": (wave.angular_spectrum, {"field": np.ones(64), "step_mm": 0.001, "wavelength_mm": 5e-4,
            "distance_mm": 1.0}),
        "lens_spread": (wave.lens_spread, {**slit, "focal_mm": 0.2, "depth_mm": 20.0, "spherical_mm": 0.0,
            "dimensions": 1}),
        "defocus_mm": (wave.defocus_mm, {"width_mm": 0.1, "gap_mm": 0.2, "focal_mm": 0.2, "depth_mm": 20.0}),
        "diffraction_limit": (wave.diffraction_limit, {"x": x, **slit, "dimensions": 1}),
        "model_spread": (wave.model_spread, {"x": x, **slit, "focal_mm": 0.2, "depth_mm": 20.0}),
        "pixel_kernel": (wave.pixel_kernel, {"x": x, "intensity": np.ones(65), "pixel_mm": 0.1, "reach": 3}),
        "spread_width": (wave.spread_width, {"x": x, "intensity": np.ones(65)}),
        "lens_blurred": (wave.lens_blurred, {"picture": PICTURE, "camera": CAMERA, "depth_mm": 20.0,
            "wavelengths_nm": (610.0, 550.0, 465.0)}),
        "spread_maps": (spread.spread_maps, {"camera": CAMERA, "depth_mm": 50.0, "focal_mm": 1.5,
            "wavelengths_nm": (610.0, 550.0, 465.0)}),
        "spread_picture": (spread.spread_picture, {"picture": PICTURE, "maps": maps}),
        "spread_files": (spread_files.spread_files, {"count": 1, "format": "exr"}),
        "write_spread": (spread_files.write_spread, {"maps": [maps], "folder": written, "format": "exr"}),
        "read_spread": (spread_files.read_spread, {"folder": written}),
        "Lenslet": (optics.Lenslet, {"focal_mm": 1.5, "aperture_mm": 0.4}),
        "SphericalLenslet": (optics.SphericalLenslet, {"radius_mm": 0.8, "ior": 1.52, "aperture_mm": 0.4}),
        "Lens": (optics.Lens, {"z_mm": 10.0, "focal_mm": 50.0, "diameter_mm": 20.0}),
        "element": (optics.element, {"data": {"kind": "lens", "z_mm": 10.0, "focal_mm": 50.0}}),
        "Surface": (surfaces.Surface, {"radius_mm": 50.0, "thickness_mm": 2.0, "glass": "N-BK7", "conic": 0.0,
            "aspheric": (0.0, 1e-6), "diameter_mm": 20.0, "stop": False}),
        "Surfaces": (surfaces.Surfaces, {"z_mm": 10.0, "surfaces": built.surfaces, "wavelength_nm": 550.0}),
        "Surfaces.moved": (built.moved, {"by_mm": 1.0}),
        "Surfaces.image_mm": (built.image_mm, {"z_mm": 500.0}),
        "Glass": (glass.Glass, {"ior": 1.5, "abbe": 60.0, "name": "a"}),
        "Glass by Sellmeier": (glass.Glass, {"sellmeier": (1.0, 0.2, 1.0, 0.006, 0.02, 100.0), "name": "a"}),
        "Glass.index": (glass.Glass(ior=1.5).index, {"wavelength_nm": 550.0}),
        "glass": (glass.glass, {"value": "N-BK7"}),
        "lens": (prescriptions.lens, {"name": name}),
        "Prescription.at": (prescriptions.lens(name).at, {"z_mm": 10.0}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}
