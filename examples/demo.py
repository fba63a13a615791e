"""Demo: two scenes rendered, shown as views, coded, and compared in rate–distortion charts (``make demo``).

python examples/demo.py [--scale 2] [--scenes apples,cuboid] [-o out/demo]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import (
    IIPicture,
    five_viewpoints,
    orthoscopic,
    preset,
    projection_camera,
    sub_images,
    view_image,
)
from ii_core.base.files import write_image
from metrics.rates.rd import RATES
from raytrace_ii import Scene, Shot, load_scene, render
from raytrace_ii.cli.evaluate import SCHEMES, run_study
from raytrace_ii.cli.progress import progress_bar, spinner


def main() -> None:
    """Run the demo and print the paths of its files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scale", type=int, default=2, help="divides setup1's lenses")
    parser.add_argument("--scenes", default="apples,cuboid")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/demo"))
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    for name in arguments.scenes.split(","):
        scene = load_scene(name)
        shot = shoot(scene, name, arguments.scale)
        with spinner(f"write the pictures of {name}"):
            write_pictures(scene, shot, name, arguments.output)
        rays = {"rays": shot.stats.rays, "render_seconds": shot.stats.seconds, "sensor_noise_sigma": 1.0, "seed": 0}
        run_study(shot.picture, name, SCHEMES, RATES, arguments.output, extra=rays, anchor="jpeg2000")
    print(f"{time.perf_counter() - started:.0f} s; pictures, charts (.png) and numbers (.json): {arguments.output}/")


def shoot(scene: Scene, name: str, scale: int) -> Shot:
    """Return the scene through setup1, with sensor noise."""
    with progress_bar(f"render {name}") as report:
        return render(
            scene,
            preset("setup1", scale=scale),
            noise=1.0,
            support=("depth",),
            progress=lambda a, b: report(a, b, ""),
        )


def write_pictures(scene: Scene, shot: Shot, name: str, folder: Path) -> None:
    """Write II-picture, detail, depth map, five views, sheet of sub-images and 2D projection."""
    picture = shot.picture
    assert picture.camera is not None and shot.depth is not None
    picture.save(folder / f"{name}.png")
    write_image(folder / f"{name}_detail.png", detail(picture))
    write_image(folder / f"{name}_depth.exr", shot.depth)
    write_image(folder / f"{name}_depth.png", depth_picture(shot.depth))
    for view, viewpoint in five_viewpoints(picture.camera).items():
        write_image(folder / f"{name}_view_{view}.png", view_image(picture, viewpoint)[0])
    write_image(folder / f"{name}_sub_images.png", sheet(picture))
    pinhole, pose = projection_camera(picture.camera, 1024)
    flat = render(scene, pinhole, samples=9, pose=pose, support=())
    write_image(folder / f"{name}_projection.png", orthoscopic(flat.picture).pixels)


def detail(picture: IIPicture, lenses: tuple[int, int] = (16, 8), zoom: int = 4) -> NDArray[Any]:
    """Return a block of elementary images around the middle, magnified."""
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    left, top = (k - lenses[0]) // 2 * u, (l - lenses[1]) // 2 * v
    block = picture.pixels[top : top + lenses[1] * v, left : left + lenses[0] * u]
    return block.repeat(zoom, axis=0).repeat(zoom, axis=1)


def depth_picture(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a depth map as a picture: near is bright, on a logarithmic scale; pixels without a hit are black."""
    found = np.isfinite(depth)
    near, far = np.log(np.percentile(depth[found], [0.5, 99.5]))
    level = 255 - 220 * np.clip((np.log(np.where(found, depth, 1.0)) - near) / max(far - near, 1e-9), 0, 1)
    return np.repeat(np.where(found, level, 0).astype(np.uint8)[..., None], 3, axis=2)


def sheet(picture: IIPicture, count: int = 4, gap: int = 4) -> NDArray[Any]:
    """Return a sheet of count × count sub-images, evenly spread over the directions, on white."""
    stack = sub_images(picture)
    rows, columns, height, width, _ = stack.shape
    page = np.full((count * (height + gap) - gap, count * (width + gap) - gap, 3), 255, stack.dtype)
    for i, v in enumerate(np.linspace(0, rows - 1, count).astype(int)):
        for j, u in enumerate(np.linspace(0, columns - 1, count).astype(int)):
            top, left = i * (height + gap), j * (width + gap)
            page[top : top + height, left : left + width] = stack[v, u]
    return page


if __name__ == "__main__":
    main()
