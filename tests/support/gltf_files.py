"""Small glTF files, written byte by byte."""

import base64
import io
import json
import struct

import numpy as np
from PIL import Image

TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}


class Gltf:
    """JSON and bytes of a file; every method adds something and returns its index."""

    def __init__(self):
        self.blob = bytearray()
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}

    def add(self, table, item):
        rows = self.json.setdefault(table, [])
        rows.append(item)
        return len(rows) - 1

    def view(self, data, **more):
        self.blob += b"\0" * (-len(self.blob) % 4)
        start = len(self.blob)
        self.blob += data
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data), **more})

    def accessor(self, values, **more):
        values = np.asarray(values)
        if values.dtype == np.float64:
            values = values.astype(np.float32)
        values = values.reshape(len(values), -1)
        kind = {"componentType": COMPONENTS[values.dtype.name], "type": TYPES[values.shape[1]]}
        return self.add(
            "accessors", {"bufferView": self.view(values.tobytes()), "count": len(values), **kind, **more}
        )

    def mesh(self, vertices, faces=None, *, material=None, mode=4, name="", **attributes):
        """One primitive; attributes by their names in the file."""
        values = {"POSITION": np.asarray(vertices, np.float32), **attributes}
        primitive = {"attributes": {k: v if isinstance(v, int) else self.accessor(v) for k, v in values.items()}}
        if faces is not None:
            primitive["indices"] = self.accessor(np.asarray(faces).reshape(-1).astype(np.uint32))
        if material is not None:
            primitive["material"] = material
        if mode != 4:
            primitive["mode"] = mode
        return self.add("meshes", {"primitives": [primitive], "name": name})

    def node(self, *, root=True, **values):
        index = self.add("nodes", values)
        if root:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def material(self, extensions=None, *, pbr=None, **values):
        if pbr is not None:
            values["pbrMetallicRoughness"] = pbr
        if extensions:
            values["extensions"] = extensions
        return self.add("materials", values)

    def matt(self, colour, alpha=1.0):
        """Return a purely matt material."""
        return self.material(
            {"KHR_materials_specular": {"specularFactor": 0}},
            pbr={"baseColorFactor": [*colour, alpha], "metallicFactor": 0, "roughnessFactor": 1},
        )

    def light(self, **values):
        lights = self.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(values)
        return {"KHR_lights_punctual": {"light": len(lights) - 1}}

    def texture(self, pixels, *, uri=None, **sampler):
        """A texture of a PNG in the file, or of the uri given."""
        source = {"uri": uri} if uri else {"bufferView": self.view(png(pixels)), "mimeType": "image/png"}
        texture = {"source": self.add("images", source)}
        if sampler:
            texture["sampler"] = self.add("samplers", sampler)
        return self.add("textures", texture)

    def save(self, path, *, uri=None):
        """As GLB or as JSON with its bytes in a data uri, or in a file beside it, by ``uri``."""
        data = bytes(self.blob)
        buffer = {"byteLength": len(data)}
        if path.suffix == ".glb":
            self.json["buffers"] = [buffer]
            path.write_bytes(glb(self.json, data))
            return path
        buffer["uri"] = uri or "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        self.json["buffers"] = [buffer]
        path.write_text(json.dumps(self.json), encoding="utf-8")
        return path


def png(pixels):
    stream = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(stream, "png")
    return stream.getvalue()


def glb(document, data):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


# A square of side 2 about the origin that faces the viewer, +z of the file; v down as glTF has it.
SQUARE = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
SQUARE_UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
SQUARE_FACES = [[0, 1, 2], [0, 2, 3]]
