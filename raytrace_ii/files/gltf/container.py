"""Storage of glTF 2.0 files: container, buffers, accessors and images."""

from __future__ import annotations

import base64
import binascii
import json
import struct
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import unquote_to_bytes, urlsplit

import numpy as np
from numpy.typing import NDArray

from ..beside import beside, read_bytes, read_texture
from .tables import KNOWN_EXTENSIONS, Accessor, Buffer, BufferView, Gltf, ImageSource

_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SHAPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MOST_ROWS = 10_000_000  # of an accessor without a view: no bytes of the file answer for them
DECODE, KTX2 = "gltf-transform copy in.glb out.glb", "gltf-transform ktxdecompress in.glb out.glb"
# Commands that remove compressed data from a file, by the extension that needs a decoder.
CONVERSIONS = {
    "KHR_draco_mesh_compression": DECODE,
    "EXT_meshopt_compression": DECODE,
    "KHR_texture_basisu": KTX2,
}
_GLB, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


class GltfFile:
    """One file and what it names.

    Arrays and images are read once, so that what shares them in the file shares memory.

    Raises
    ------
    ValueError
        If the file is damaged, or needs an extension that is not known. The message names the part, not the file.
    OSError
        If a file that it names is missing.
    """

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        data = read_bytes(path)
        text, self._chunk = _glb(data) if data[:4] == b"glTF" else (data, None)
        self.tables = _checked(text)
        unknown = sorted(set(self.tables.extensionsRequired) - KNOWN_EXTENSIONS)
        if unknown:
            commands = list(dict.fromkeys(CONVERSIONS[name] for name in unknown if name in CONVERSIONS))
            advice = _advice(*commands) if commands else f"known are {', '.join(sorted(KNOWN_EXTENSIONS))}"
            raise ValueError(f"extensionsRequired: {', '.join(unknown)}: {advice}")
        self._buffers: dict[int, bytes] = {}
        self._arrays: dict[int, NDArray[Any]] = {}
        self._images: dict[int, NDArray[Any]] = {}

    def at(self, table: str, index: int, who: str) -> Any:
        """Row of a table, with a word on who asked for it if it is not there."""
        rows = getattr(self.tables, table)
        if index >= len(rows):
            raise ValueError(f"{who}: {table}.{index} is named, there are {len(rows)}")
        return rows[index]

    def array(self, index: int, who: str) -> NDArray[Any]:
        """Values (count, width) of an accessor; normalised integers as floats."""
        accessor: Accessor = self.at("accessors", index, who)
        if index not in self._arrays:
            where = f"accessors.{index}"
            values = self._accessor(accessor, where)
            if accessor.normalized and values.dtype.kind in "iu":
                values = np.maximum(values / np.float32(np.iinfo(values.dtype).max), -1).astype(np.float32)
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                raise ValueError(f"{where}: holds values that are not finite numbers")
            self._arrays[index] = values
        return self._arrays[index]

    def _accessor(self, a: Accessor, where: str) -> NDArray[Any]:
        if a.type not in _SHAPES:
            raise ValueError(f"{where}: unknown type {a.type!r}: known are {', '.join(_SHAPES)}")
        kind, width = _component(a.componentType, where), _SHAPES[a.type]
        if a.bufferView is None:  # zeros, which sparse values may replace
            if not a.sparse and "KHR_draco_mesh_compression" in self.tables.extensionsUsed:
                raise ValueError(f"{where}: its values are compressed by Draco alone: {_advice(DECODE)}")
            if a.count > MOST_ROWS:
                raise ValueError(f"{where}: {a.count} rows of zeros: at most {MOST_ROWS} are made up")
            values = np.zeros((a.count, width), kind)
        else:
            values = self._rows(a.bufferView, where, a.byteOffset, a.count, kind, width)
        if a.sparse:
            s = a.sparse
            kind_of_rows = _component(s.indices.componentType, where)
            if kind_of_rows.kind != "u":
                raise ValueError(f"{where}: sparse indices are {kind_of_rows}: unsigned integers are needed")
            rows = self._rows(
                s.indices.bufferView,
                where,
                s.indices.byteOffset,
                s.count,
                kind_of_rows,
                1,
            )[:, 0]
            if len(rows) and rows.max() >= a.count:
                raise ValueError(f"{where}: sparse row {rows.max()} is named, there are {a.count}")
            values = values.copy()
            values[rows] = self._rows(s.values.bufferView, where, s.values.byteOffset, s.count, kind, width)
        return values

    def _rows(self, index: int, who: str, offset: int, count: int, kind: np.dtype[Any], width: int) -> NDArray[Any]:
        """``count`` rows of ``width`` numbers in a buffer view."""
        stride = self.at("bufferViews", index, who).byteStride or kind.itemsize * width
        data = self.view(index, who)
        end = offset + (count - 1) * stride + kind.itemsize * width if count else offset
        if end > len(data):
            raise ValueError(f"{who}: bytes up to {end} of bufferViews.{index} are named, there are {len(data)}")
        if stride < kind.itemsize * width:
            raise ValueError(f"bufferViews.{index}: byteStride {stride} is less than a row, {kind.itemsize * width}")
        return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))

    def view(self, index: int, who: str) -> bytes:
        """Bytes of a buffer view."""
        view: BufferView = self.at("bufferViews", index, who)
        where = f"bufferViews.{index}"
        buffer: Buffer = self.at("buffers", view.buffer, where)
        if view.buffer not in self._buffers:
            self._buffers[view.buffer] = self._buffer(view.buffer, buffer)
        data = self._buffers[view.buffer]
        end = view.byteOffset + view.byteLength
        if end > len(data):
            raise ValueError(f"{where}: bytes up to {end} of buffers.{view.buffer} are named, there are {len(data)}")
        return data[view.byteOffset : end]

    def _buffer(self, index: int, buffer: Buffer) -> bytes:
        where = f"buffers.{index}"
        if buffer.uri is not None:
            data = self._fetch(buffer.uri, where)
        elif index == 0 and self._chunk is not None:
            data = self._chunk
        else:
            raise ValueError(f"{where}: neither a uri nor a binary chunk of the file holds it")
        if len(data) < buffer.byteLength:
            raise ValueError(f"{where}: {buffer.byteLength} bytes are needed, there are {len(data)}")
        return data[: buffer.byteLength]

    def image(self, index: int, who: str) -> NDArray[Any]:
        """Stored pixels (H, W, channels) of an image."""
        source: ImageSource = self.at("images", index, who)
        if index not in self._images:
            where = f"images.{index}"
            if source.bufferView is not None:
                data = self.view(source.bufferView, where)
            elif source.uri is not None:
                data = self._fetch(source.uri, where)
            else:
                raise ValueError(f"{where}: neither a uri nor a bufferView is given")
            self._images[index] = _pixels(data, where)
        return self._images[index]

    def missing(self, index: int, who: str) -> str | None:
        """Why the file that an image names cannot be had; None if it can, or the image stands in the glTF itself."""
        source: ImageSource = self.at("images", index, who)
        if source.bufferView is not None or source.uri is None or source.uri.startswith("data:"):
            return None
        try:
            return None if self._path(source.uri).is_file() else f"{source.uri[:80]!r} does not exist"
        except (ValueError, OSError) as error:
            return str(error)

    def _fetch(self, uri: str, where: str) -> bytes:
        """Return the data of a URI: those in it, or of a file that it names in the glTF's own folder."""
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                return base64.b64decode(body, validate=True) if head.endswith(";base64") else unquote_to_bytes(body)
            except binascii.Error as error:
                raise ValueError(f"{where}: data uri: {error}") from None
        try:
            return read_bytes(self._path(uri))
        except ValueError as error:
            raise ValueError(f"{where}: uri {error}") from None
        except OSError as error:
            raise type(error)(f"{where}: {error}") from None

    def _path(self, uri: str) -> Path:
        if urlsplit(uri).scheme:
            raise ValueError(f"{uri[:80]!r}: data or the relative name of a file is needed")
        return beside(self.folder, unquote_to_bytes(uri).decode("utf-8", "replace"))


def _advice(*commands: str) -> str:
    return f"convert the file with `{'`, then `'.join(commands)}` (npm package @gltf-transform/cli)"


def _glb(data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary chunk of a GLB container."""
    if len(data) < 20:
        raise ValueError(f"GLB header: 20 bytes are needed, there are {len(data)}")
    _, version, length = struct.unpack_from("<III", data)
    if version != 2:
        raise ValueError(f"GLB header: version {version}: version 2 is needed")
    if length > len(data):
        raise ValueError(f"GLB header: {length} bytes are announced, there are {len(data)}: the file is cut off")
    chunks: dict[int, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > length:
            raise ValueError(f"GLB chunk at byte {at}: {size} bytes are announced, there are {length - at - 8}")
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if _JSON not in chunks:
        raise ValueError("GLB has no JSON chunk")
    return chunks[_JSON], chunks.get(_BIN)


def _checked(text: bytes) -> Gltf:
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"JSON: {error}") from None
    asset = data.get("asset") if isinstance(data, dict) else None
    version = str(asset.get("version", "")) if isinstance(asset, dict) else ""
    if not version.startswith("2."):
        raise ValueError(f"asset.version {version!r}: glTF 2.0 is needed")
    return Gltf.model_validate(data)


def _component(code: int, where: str) -> np.dtype[Any]:
    if code not in _COMPONENTS:
        raise ValueError(f"{where}: unknown componentType {code}: known are {', '.join(map(str, _COMPONENTS))}")
    return np.dtype(_COMPONENTS[code])


def _pixels(data: bytes, where: str) -> NDArray[Any]:
    """Pixels of an image file held in memory, which OpenImageIO for Python reads from a file only."""
    kinds = {b"\x89PNG": ".png", b"\xff\xd8": ".jpg", b"RIFF": ".webp", b"\xabKTX": ".ktx2"}
    suffix = next((suffix for magic, suffix in kinds.items() if data.startswith(magic)), ".png")
    if suffix == ".ktx2":
        raise ValueError(f"{where}: a KTX2 image: PNG or JPEG is needed, {_advice(KTX2)}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"image{suffix}"
        path.write_bytes(data)
        try:
            return read_texture(path)
        except ValueError as error:
            raise ValueError(f"{where}: {str(error).replace(path.name, 'it')}") from None
        except OSError as error:
            reason = str(error).replace(f"cannot read {path}: ", "").replace(str(path), "it")
            raise ValueError(f"{where}: cannot be read as a picture: {' '.join(reason.split())}") from None
