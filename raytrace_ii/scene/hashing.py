"""Content hash (SHA-256) of scenes, cameras and options."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

Digest = Any


def content_hash(*values: Any) -> str:
    """Return the SHA-256 of numbers, texts and arrays, and of dataclasses, lists and mappings of them.

    The hash of a scene covers its file and everything that the file uses, since it is computed from the loaded
    meshes, textures and shapes.

    Raises
    ------
    TypeError
        If a value has another type.
    """
    digest = hashlib.sha256()
    for value in values:
        _add(digest, value)
    return digest.hexdigest()


class SceneHashes:
    """Content hashes of the scenes of a take, one after the other.

    An array that a scene shares with the one before is hashed once. It must not change meanwhile. The hashes differ
    from those of `content_hash`.
    """

    def __init__(self) -> None:
        self._arrays: dict[int, tuple[np.ndarray[Any, Any], bytes]] = {}  # of the last scene, by identity
        self._last: tuple[Any, str] | None = None

    def of(self, scene: Any) -> str:
        """Return the SHA-256 of a scene."""
        if self._last is None or self._last[0] is not scene:
            there: dict[int, tuple[np.ndarray[Any, Any], bytes]] = {}

            def known(array: np.ndarray[Any, Any]) -> bytes:
                found = there.get(id(array)) or self._arrays.get(id(array))
                there[id(array)] = found or (array, hashlib.sha256(_array_bytes(array)).digest())
                return there[id(array)][1]

            digest = hashlib.sha256()
            _add(digest, scene, known)
            self._arrays, self._last = there, (scene, digest.hexdigest())
        return self._last[1]


def _array_bytes(array: np.ndarray[Any, Any]) -> memoryview:
    return np.ascontiguousarray(array).data


def _add(digest: Digest, value: Any, array_bytes: Callable[[Any], Any] = _array_bytes) -> None:
    # every value starts with its kind and size: different values give different bytes
    if value is None or isinstance(value, bool | int | float | str | np.generic):
        plain = value.item() if isinstance(value, np.generic) else value
        text = repr(plain).encode()
        digest.update(f"{type(plain).__name__}:{len(text)}:".encode() + text)
    elif isinstance(value, np.ndarray):
        digest.update(f"array:{value.dtype.str}:{value.shape}:".encode())
        digest.update(array_bytes(value))
    elif isinstance(value, list | tuple):
        digest.update(f"list:{len(value)}:".encode())
        for item in value:
            _add(digest, item, array_bytes)
    elif isinstance(value, Mapping):
        _add(digest, [[key, value[key]] for key in sorted(value)], array_bytes)
    elif is_dataclass(value):
        named = ([f.name, getattr(value, f.name)] for f in fields(value))
        _add(digest, [type(value).__name__, *named], array_bytes)
    else:
        raise TypeError(f"{value!r} has no content hash: a {type(value).__name__} is not known")
