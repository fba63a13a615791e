"""Small valid files of every kind as seeds of cases; equal on every machine."""

from __future__ import annotations

import base64
import io
import json
import tomllib
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ii_core import IIPicture, preset

DATA = tomllib.loads(Path(__file__).with_name("seeds.toml").read_text(encoding="utf-8"))
OBJ, MTL, CONFIG, SCENES = (DATA[name] for name in ("OBJ", "MTL", "CONFIG", "SCENES"))
SIZE = 16, 8  # pixels across and down
SEED_CAMERAS = "setup1", "hexagonal", "multi-focus", "spherical", "grin-hexagonal-depth-control", "plenoptic"


def pixels(width: int = SIZE[0], height: int = SIZE[1], kind: str = "uint8") -> NDArray[Any]:
    """Return a picture with detail, (height, width, 3)."""
    y, x = np.mgrid[:height, :width]
    shade = 0.5 + 0.2 * np.sin(x / 2) * np.cos(y / 3) + 0.2 * np.random.default_rng(1).random((height, width))
    values = np.stack([shade, 1 - shade, shade / 2], axis=-1)
    return values.astype(np.float32) if kind == "float32" else (values * np.iinfo(kind).max).astype(kind)


def encoded(kind: str, *, mode: str = "RGB", **options: Any) -> bytes:
    """Return a picture as a file of Pillow's."""
    stream = io.BytesIO()
    Image.fromarray(pixels()).convert(mode).save(stream, kind, **options)
    return stream.getvalue()


@lru_cache
def png_files() -> tuple[bytes, ...]:
    """Return PNG of several kinds of pixels."""
    modes = [encoded("PNG", mode=mode) for mode in ("RGB", "RGBA", "L", "P", "1", "LA")]
    stream = io.BytesIO()
    Image.fromarray(pixels(kind="uint16")[..., 0]).save(stream, "PNG")
    return *modes, stream.getvalue()


@lru_cache
def camera_trees() -> dict[str, Any]:
    """Return the cameras of the package."""
    trees: dict[str, Any] = json.loads((files("assets") / "cameras.json").read_text("utf-8"))
    return trees


@lru_cache
def structures() -> tuple[dict[str, Any], ...]:
    """Return sidecars of pictures of `SIZE`: without a camera, with a plain one, with each of other kinds."""
    plain = {
        "format": "ii-picture",
        "version": 1,
        "lenses": [4, 2],
        "ei_pixels": [4, 4],
        "erect": False,
        "camera": None,
    }
    camera = {"pixels": list(SIZE), "lenses": [4, 2], "pixel_pitch_mm": 0.1, "gap_mm": 3.0}
    picture = IIPicture(pixels(), (4, 2), (4, 4))
    assert picture.structure_json().keys() == plain.keys()
    others = [{**plain, "camera": {**preset(name).to_json(), **camera}} for name in SEED_CAMERAS]
    return plain, {**plain, "camera": camera}, *others


CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], np.float32)
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 3, 2], [0, 2, 1]], np.uint16)


@lru_cache
def gltf() -> tuple[dict[str, Any], bytes]:
    """Return a glTF file's JSON and its buffer: a pyramid with normals, texture, material, two nodes and a light."""
    chunk, views, accessors = b"", list[dict[str, Any]](), list[dict[str, Any]]()

    def view(data: bytes) -> int:
        nonlocal chunk
        views.append({"buffer": 0, "byteOffset": len(chunk), "byteLength": len(data)})
        chunk += data + b"\0" * (-len(data) % 4)
        return len(views) - 1

    def accessor(values: NDArray[Any], component: int, kind: str, **more: Any) -> int:
        number = view(values.tobytes())
        row = {"bufferView": number, "componentType": component, "count": len(values), "type": kind}
        accessors.append({**row, **more})
        return len(accessors) - 1

    attributes = {
        "POSITION": accessor(CORNERS, 5126, "VEC3", min=[-1, -1, 0], max=[1, 1, 1]),
        "NORMAL": accessor(CORNERS / np.linalg.norm(CORNERS, axis=1, keepdims=True), 5126, "VEC3"),
        "TEXCOORD_0": accessor((CORNERS[:, :2] + 1) / 2, 5126, "VEC2", byteOffset=0),
        "COLOR_0": accessor(np.full((5, 4), 200, np.uint8), 5121, "VEC4", normalized=True),
    }
    indices = accessor(FACES.reshape(-1), 5123, "SCALAR")
    places, moved = view(np.array([4], np.uint16).tobytes()), view(np.array([[0, 0, 2]], np.float32).tobytes())
    sparse = {"count": 1, "indices": {"bufferView": places, "componentType": 5123}, "values": {"bufferView": moved}}
    accessors.append({**accessors[0], "sparse": sparse})
    image = view(encoded("PNG"))
    moving = {"KHR_texture_transform": {"offset": [0.1, 0], "scale": [2, 2]}}
    texture = {"index": 0, "texCoord": 0, "extensions": moving}
    glass = {"KHR_materials_transmission": {"transmissionFactor": 0.9}, "KHR_materials_ior": {"ior": 1.5}}
    cone = {"innerConeAngle": 0.1, "outerConeAngle": 0.5}
    spot = {"type": "spot", "intensity": 3, "color": [1, 1, 1], "spot": cone}
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"mesh": 0, "children": [1], "rotation": [0, 0, 0, 1], "translation": [0, 0, 1], "scale": [1, 2, 1]},
            {"mesh": 1, "matrix": np.eye(4).reshape(-1).tolist()},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "meshes": [
            {"primitives": [{"attributes": attributes, "indices": indices, "material": 0, "mode": 4}]},
            {"primitives": [{"attributes": {"POSITION": len(accessors) - 1}, "indices": indices, "material": 1}]},
        ],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": texture, "baseColorFactor": [1, 1, 1, 1],
                "metallicFactor": 0},
                "normalTexture": {"index": 0, "scale": 1}, "emissiveFactor": [0, 0, 0.1], "alphaMode": "MASK",
                "alphaCutoff": 0.5,
            },
            {"extensions": {**glass, "KHR_materials_volume": {"attenuationDistance": 2, "attenuationColor": [1, 0.5,
            1]}}},
        ],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 10497, "wrapT": 33071, "magFilter": 9729}],
        "images": [{"bufferView": image, "mimeType": "image/png"}],
        "extensions": {"KHR_lights_punctual": {"lights": [spot]}},
        "extensionsUsed": ["KHR_lights_punctual"],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(chunk)}],
    }, chunk  # fmt: skip


def embedded(chunk: bytes) -> str:
    """Return a buffer as a data URI."""
    return "data:application/octet-stream;base64," + base64.b64encode(chunk).decode()


@lru_cache
def ply_files() -> tuple[bytes, ...]:
    """Return PLY in ASCII and both binary orders, with normals, colours, texture coordinates and a strip."""
    found = []
    for order, name in ((">", "binary_big_endian"), ("<", "binary_little_endian"), ("", "ascii")):
        strip = [0, 1, 2, -1, 2, 3, 4]
        if not order:
            rows = [" ".join(map(str, [*place, 0, 0, 1, 200, 100, 50])) for place in CORNERS.tolist()]
            rows += [" ".join(map(str, [3, *face])) for face in FACES.tolist()] + [" ".join(map(str, [7, *strip]))]
            body = "\n".join(rows).encode()
        else:
            kind = np.dtype([("place", order + "f4", 6), ("colour", "u1", 3)])
            vertices = np.array([((*place, 0, 0, 1), (200, 100, 50)) for place in CORNERS.tolist()], kind)
            faces = np.array([(3, face) for face in FACES.tolist()], np.dtype([("n", "u1"), ("i", order + "i4", 3)]))
            body = vertices.tobytes() + faces.tobytes() + np.array([7, *strip], order + "i4").tobytes()
        found.append(DATA["PLY"].format(name).encode() + body)
    return tuple(found)


@lru_cache
def stl_files() -> tuple[bytes, ...]:
    """Return STL, binary and ASCII."""
    triangles = np.zeros(len(FACES), [("n", "<f4", 3), ("p", "<f4", (3, 3)), ("a", "<u2")])
    triangles["p"] = CORNERS[FACES]
    text = ["solid pyramid"]
    for triangle in CORNERS[FACES].tolist():
        places = ["   vertex " + " ".join(map(str, place)) for place in triangle]
        text += [" facet normal 0 0 1", "  outer loop", *places, "  endloop", " endfacet"]
    head = b"binary".ljust(80) + len(FACES).to_bytes(4, "little")
    return head + triangles.tobytes(), "\n".join([*text, "endsolid pyramid", ""]).encode()


POINT = {
    "scheme": "si-h264", "options": {"gop": 16, "order": "serpentine"}, "target_bpp": 0.1, "bpp": 0.0991,
    "reached": True, "q_global": 33.1, "q_angle": [30.0, 31.5, None], "q_view": 32.0,
    "q_depth": [31.0, None, "inf"], "encode_seconds": 0.5, "decode_seconds": 0.1, "nbytes": 812,
    "lossless": False,
}  # fmt: skip
STUDY = {
    "format": "ii-rd-study",
    "version": 1,
    "picture": {"name": "apples", "sha256": "0" * 64, "pixels": list(SIZE), "dtype": "uint8", "lenses": [4, 2]},
    "pooling": "pooled MSE over R, G and B",
    "git": None,
    "machine": {"platform": "none", "cpus": 2},
    "versions": {},
    "extra": {},
    "points": [POINT, {**POINT, "scheme": "jpeg2000", "target_bpp": 0.2, "bpp": 0.21, "q_global": 35.0}],
}
POINT_LINE = {"format": "ii-rd-point", "version": 1, "same": "0" * 64, "point": POINT}

FILE = {"bytes": 10, "sha256": "0" * 64}
PRODUCT = {"key": "0" * 64, "files": {"apples.png": FILE, "apples.png.json": FILE}, "rays": {"primary": 5}}
MANIFEST = {
    "format": "ii-picture-set",
    "version": 1,
    "set": "reference",
    "raytrace_ii": "0.1.0",
    "claims": ["apples.png", "contact.png"],
    "scenes": {"apples": {"hash": "0" * 64, "products": {"picture": PRODUCT, "flat": PRODUCT}}},
    "contact.png": {"key": "0" * 64, "files": {"contact.png": FILE}},
}
