"""Content hash (SHA-256) of scenes, cameras and options."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
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


def _add(digest: Digest, value: Any) -> None:
    # every value starts with its kind and size: different values give different bytes
    if value is None or isinstance(value, bool | int | float | str | np.generic):
        plain = value.item() if isinstance(value, np.generic) else value
        text = repr(plain).encode()
        digest.update(f"{type(plain).__name__}:{len(text)}:".encode() + text)
    elif isinstance(value, np.ndarray):
        digest.update(f"array:{value.dtype.str}:{value.shape}:".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif isinstance(value, list | tuple):
        digest.update(f"list:{len(value)}:".encode())
        for item in value:
            _add(digest, item)
    elif isinstance(value, Mapping):
        _add(digest, [[key, value[key]] for key in sorted(value)])
    elif is_dataclass(value):
        _add(digest, [type(value).__name__, *([f.name, getattr(value, f.name)] for f in fields(value))])
    else:
        raise TypeError(f"{value!r} has no content hash: a {type(value).__name__} is not known")
