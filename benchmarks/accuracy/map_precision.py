"""Cameras stored as pictures: errors of L, D and the rendered picture against bytes.

    python -m benchmarks run map_precision [--scale 4]

For each format the largest and the root mean square angle between stored and true direction (µrad), the same for
locations (µm), and the PSNR of *Apples* and *Cuboid* rendered from the maps against float maps. Numbers go
to ``benchmarks/results/map_precision.jsonl``.
"""

from __future__ import annotations

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.records import Records
from ii_core import IICamera, IIPicture, preset, read_maps, write_maps
from ii_core.camera.maps import FORMATS
from metrics import q_global
from raytrace_ii import load_scene, render

RECORDS = Records("map_precision", ("benchmarks.accuracy.map_precision",))
SCALE = 4  # scale on the pages
SCENES = ("apples", "cuboid")
CAMERAS = ("setup1", "setup3", "spherical")


def main() -> None:
    """Measure and keep."""
    asked = command_line(__doc__, scale=SCALE, cameras=CAMERAS).parse_args()
    keys = [{"scale": asked.scale, "camera": name, "format": form} for name in asked.cameras for form in FORMATS]
    RECORDS.run(keys, measured, asked.again)


def measured(scale: int, camera: str, format: str) -> dict[str, Any]:
    """Return bytes, errors of rays, and PSNR of pictures of one format."""
    of = preset(camera, scale=scale)
    maps, size = stored(of, format)
    psnr = {f"psnr_{scene}": q_global(exact(scene, camera, scale), shown(scene, maps)) for scene in SCENES}
    return {"bytes_per_pixel": size / of.pixels[0] / of.pixels[1], **errors(of, maps), **psnr}


@lru_cache(maxsize=len(SCENES))
def exact(scene: str, camera: str, scale: int) -> IIPicture:
    """Return a scene's picture from float maps."""
    return shown(scene, stored(preset(camera, scale=scale), "exr")[0])


def shown(scene: str, maps: Any) -> IIPicture:
    """Return a scene's picture from maps."""
    return render(load_scene(scene), maps, support=()).picture


def stored(camera: IICamera, format: str) -> tuple[Any, int]:
    """Return the camera loaded from stored maps, and the bytes of the two images."""
    with tempfile.TemporaryDirectory() as folder:
        write_maps([camera], folder, format=format)
        size = sum(path.stat().st_size for path in Path(folder).iterdir() if path.suffix != ".json")
        return read_maps(folder)[0], size


def errors(camera: IICamera, maps: Any) -> dict[str, float]:
    """Angle and location errors over all rays that carry light."""
    L, D, weight = camera.weighted_rays()
    l, d, _ = maps.stored_rays(0)
    on = np.ones(L.shape[:2], bool) if weight is None else weight > 0
    D, d = (x[on] / np.linalg.norm(x[on], axis=-1, keepdims=True) for x in (D, d))
    angle = np.linalg.norm(np.cross(D, d), axis=-1)  # its sine, which is the angle at this size
    place = np.linalg.norm((L - l)[on], axis=-1)
    return {
        "angle_max_urad": float(angle.max() * 1e6),
        "angle_rms_urad": float(np.sqrt((angle**2).mean()) * 1e6),
        "place_max_um": float(place.max() * 1e3),
        "place_rms_um": float(np.sqrt((place**2).mean()) * 1e3),
    }
