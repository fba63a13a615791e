"""Compile the kernels that several test files use, before the tests: ``python -m tests.support.kernels [part]``.

Two workers of pytest-xdist that start with an empty cache compile most kernels twice, and commands in subprocesses
once more. ``make test`` therefore compiles them first, each kernel once, in two processes. Tests do not depend on it.
"""

import sys

import numpy as np


def light_field():
    """Kernels of `si-lf`: half of all compilation time, half of that one kernel that no second process can share."""
    from codec import Plan, decode, encode, encode_take, open_take
    from ii_core import IIPicture, video_of

    shape = (48, 72, 3)
    noise = np.random.default_rng(0).integers(0, 65536, (3, *shape)).astype(np.uint16)
    for pixels in (noise >> 8).astype(np.uint8), noise:
        pictures = [IIPicture(p, (24, 16), (3, 3)) for p in pixels]
        for scheme, options in ("si-lf", {"qp": 20}), ("si-lf:lossless=1", {}):
            decode(encode(pictures[0], scheme, **options))
            open_take(encode_take(video_of(pictures, fps=1), scheme, plan=Plan(span=3), **options))[2]


def others():
    """Kernels of rendering, of the other coders and of measures."""
    rendering()
    coding_and_measures()


def rendering():
    from ii_core import preset, resampled, smallest_rectangle
    from raytrace_ii import load_scene, render, trace
    from tests.support.trace_scenes import hall

    for name in "apples", "car", "objects", "twins":
        scene = load_scene(name)
        for camera in preset("setup1", scale=64), preset("pinhole2d", scale=64):
            render(scene, camera, support=("depth", "normal"))
    preset("plenoptic1-double-gauss", scale=64).rays()
    render(hall(), preset("setup1", scale=128), samples=(4, 16), error=4.0)
    render(load_scene("twins"), preset("pinhole2d", scale=32), error=2.0)
    render(hall(), preset("setup1", scale=128), samples=4, dtype="float32", audit=0.1)
    trace(hall(), np.zeros((99, 3)), np.ones((99, 3)))
    hexagonal = render(load_scene("apples"), preset("hexagonal", scale=8)).picture
    smallest_rectangle(hexagonal)
    resampled(hexagonal)


def coding_and_measures():
    from codec import decode, encode
    from ii_core import IIPicture, add_sensor_noise, preset, view_image
    from metrics import depth_from_focus, q_depth, q_global

    camera = preset("setup1", scale=128)
    shape = (camera.pixels[1], camera.pixels[0], 3)
    noise = np.random.default_rng(0).integers(0, 65536, shape).astype(np.uint16)
    for pixels in (noise >> 8).astype(np.uint8), noise:
        picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
        noisy = add_sensor_noise(picture)
        q_global(picture, noisy)
        view_image(picture, (0, 0, -100.0))
        for method in "dissertation", "robust":
            q_depth(picture, noisy, depth=depth_from_focus(picture, method=method))
        for scheme in "ei-h264", "si-hevc:chroma=420", "si-jp3d", "ei-dct3d":
            if pixels.dtype == np.uint8 or scheme == "si-jp3d":
                decode(encode(picture, scheme, bpp=1.0))


PARTS = {"light-field": light_field, "others": others}

if __name__ == "__main__":
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()
