"""Support images: geometry that the first sample of each pixel meets, and coverage by bodies.

Coverage is a cryptomatte (Friedman and Jones 2015): names as 32-bit hashes in the bits of floats, each with its
share of the pixel, the largest first. The header tells the names, so that compositors select bodies by them.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class SupportImage(NamedTuple):
    """Type and numbers of a pixel, names of the channels in an EXR file, unit and frame, and the value of a miss.

    ``missed`` is None for images that are not recorded by the tracer: disparity follows from depth, the number of
    samples is known before, and coverage has rays of its own.
    """

    dtype: str
    shape: tuple[int, ...]
    channels: tuple[str, ...]
    unit: str
    missed: float | None


NAN = float("nan")
LAYER, NAMES = "CryptoObject", 6  # names of a pixel in layers of two
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
    "coverage": SupportImage(
        "f4", (1 + 2 * NAMES,), ("A", *(f"{LAYER}{i:02}.{c}" for i in range(NAMES // 2) for c in "RGBA")),
        f"A: share of the pixel that is not sky; {LAYER}: hash of a name and its share, twice a layer", None,
    ),
}  # fmt: skip
SUPPORT = ("depth", "normal", "object_id")  # those kept unless others are asked for
RECORDED = {name: image for name, image in SUPPORT_IMAGES.items() if image.missed is not None}
UNITS = "; ".join([*(image.unit for image in SUPPORT_IMAGES.values()), "nothing hit: NaN, normal 0, objectId -1"])


def name_hashes(names: Sequence[str]) -> NDArray[np.uint32]:
    """Return the 32-bit hashes of names (MurmurHash3_x86_32), with a bit flipped that keeps floats finite."""
    found = np.array([_murmur(name.encode()) for name in names], np.uint32)
    exponent = found >> np.uint32(23) & np.uint32(255)
    return np.where((exponent == 0) | (exponent == 255), found ^ np.uint32(1 << 23), found)


def _murmur(data: bytes) -> int:
    """Return MurmurHash3_x86_32 of seed 0 (Appleby 2011)."""
    low, state = 0xFFFFFFFF, 0
    for start in range(0, len(data), 4):
        block = int.from_bytes(data[start : start + 4], "little") * 0xCC9E2D51 & low
        block = (block << 15 | block >> 17) * 0x1B873593 & low
        state ^= block
        if len(data) - start >= 4:
            state = ((state << 13 | state >> 19) & low) * 5 + 0xE6546B64 & low
    state ^= len(data)
    state = (state ^ state >> 16) * 0x85EBCA6B & low
    state = (state ^ state >> 13) * 0xC2B2AE35 & low
    return state ^ state >> 16


def coverage_header(names: Sequence[str]) -> dict[str, str]:
    """Return the header of a file with coverage: what the names of a cryptomatte are."""
    key = f"cryptomatte/{name_hashes([LAYER])[0]:08x}"[:-1]
    manifest = {name: f"{value:08x}" for name, value in zip(names, name_hashes(names).tolist(), strict=True)}
    return {
        f"{key}/name": LAYER, f"{key}/hash": "MurmurHash3_32", f"{key}/conversion": "uint32_to_float32",
        f"{key}/manifest": json.dumps(manifest, ensure_ascii=False),
    }  # fmt: skip
