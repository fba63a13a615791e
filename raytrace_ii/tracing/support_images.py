"""Support images: geometry that the first sample of each pixel meets."""

from __future__ import annotations

from typing import NamedTuple


class SupportImage(NamedTuple):
    """Type and numbers of a pixel, names of the channels in an EXR file, unit and frame, and the value of a miss.

    ``missed`` is None for images that are not recorded by the tracer: disparity follows from depth, and the number
    of samples is known before.
    """

    dtype: str
    shape: tuple[int, ...]
    channels: tuple[str, ...]
    unit: str
    missed: float | None


NAN = float("nan")
SUPPORT_IMAGES = {
    "depth": SupportImage(
        "f4", (), ("depth.Z",), "depth.Z: z in mm in the camera's frame, from its pixel plane", NAN
    ),
    "normal": SupportImage(
        "f4", (3,), ("normal.X", "normal.Y", "normal.Z"),
        "normal: unit vectors of the faces, outward, in the scene's frame", 0,
    ),
    "object_id": SupportImage("i4", (), ("objectId",), "objectId: a place in objectNames", -1),
    "ray_length": SupportImage(
        "f4", (), ("rayLength",), "rayLength: mm from the ray's origin, pinhole or place on the lens", NAN
    ),
    "shading_normal": SupportImage(
        "f4", (3,), ("shadingNormal.X", "shadingNormal.Y", "shadingNormal.Z"), "shadingNormal: normal as shaded", 0
    ),
    "disparity": SupportImage(
        "f4", (), ("disparity",),
        "disparity: pixels to the right from one elementary image to the next on the right", None,
    ),
    "samples": SupportImage("i4", (), ("samples",), "samples: rays that the pixel got", None),
}  # fmt: skip
SUPPORT = ("depth", "normal", "object_id")  # those kept unless others are asked for
RECORDED = {name: image for name, image in SUPPORT_IMAGES.items() if image.missed is not None}
UNITS = "; ".join([*(image.unit for image in SUPPORT_IMAGES.values()), "nothing hit: NaN, normal 0, objectId -1"])
