"""Header of the ``.ii`` file: structure, pixel type, scheme, options and camera of a coded picture.

A header is a list of nine values:

=============  ==================================================================================
value          meaning
=============  ==================================================================================
K, L, U, V     lenses, and pixels of an elementary image
erect          whether elementary images are upright
dtype          pixel type
scheme         name of the coder
options        object: the target as ``bpp``, ``qp`` or ``quality``, then options not at default
camera         object of `IICamera.to_json` without what the values above imply, or null
=============  ==================================================================================

The default of an option is part of the format, since files leave it out (``tests/golden/defaults.json``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from .container import Header
from .contract import Value, checked_options, find, is_number

GOALS = {"bpp": "target_bpp", "qp": "qp", "quality": "quality"}  # name in the file: field of `Encoded`


class Described(Protocol):
    """Fields of a coded picture that its header holds."""

    @property
    def structure(self) -> Mapping[str, Any]: ...
    @property
    def dtype(self) -> str: ...
    @property
    def scheme(self) -> str: ...
    @property
    def options(self) -> Mapping[str, Value]: ...


def values(coded: Described) -> list[Any]:
    """Return the header of a coded picture."""
    defaults = checked_options(find(coded.scheme), {})
    goal = {name: getattr(coded, field) for name, field in GOALS.items()}
    asked = {name: value for name, value in goal.items() if value is not None}
    asked |= {name: value for name, value in coded.options.items() if defaults.get(name) != value}
    (k, l), (u, v) = coded.structure["lenses"], coded.structure["ei_pixels"]
    camera = coded.structure["camera"]
    if camera is not None:
        implied = _implied(k, l, u, v)
        camera = {key: value for key, value in camera.items() if implied.get(key) != value}
    return [k, l, u, v, coded.structure["erect"], coded.dtype, coded.scheme, asked, camera]


def fields(header: Header) -> dict[str, Any]:
    """Return the fields of `codec.Encoded` that a header holds, all options filled in.

    Raises
    ------
    ValueError
        If the header has another form, or its scheme, options or pixel type are unknown. The structure is not
        checked.
    """
    found = _first(header) if isinstance(header, dict) else _second(header)
    if not isinstance(found["scheme"], str) or not isinstance(found["options"], dict):
        raise ValueError("its header names no scheme with options")
    for name in GOALS.values():
        if found[name] is not None and not is_number(found[name]):
            raise ValueError(f"its header has {name} {found[name]!r}: a number is needed")
    coder = find(found["scheme"])
    if found["dtype"] not in coder.dtypes:
        raise ValueError(f"its pixels are {found['dtype']!r}: scheme {coder.name} takes {', '.join(coder.dtypes)}")
    return found | {"options": checked_options(coder, found["options"])}


def _implied(k: int, l: int, u: int, v: int) -> dict[str, Any]:
    """Return the values of a camera that follow from the structure."""
    return {"kind": "lenslet-array", "lenses": [k, l], "pixels": [k * u, l * v]}


def _second(header: list[Any]) -> dict[str, Any]:
    if len(header) != 9:
        raise ValueError(f"its header has {len(header)} values: 9 are needed")
    k, l, u, v, erect, dtype, scheme, asked, camera = header
    if not all(type(count) is int for count in (k, l, u, v)):
        raise ValueError(f"its header has the structure {header[:4]!r}: four whole numbers are needed")
    if not isinstance(asked, dict):
        raise ValueError(f"its header has the options {asked!r}: an object is needed")
    if isinstance(camera, dict):
        camera = _implied(k, l, u, v) | camera
    structure = {"lenses": [k, l], "ei_pixels": [u, v], "erect": erect, "camera": camera}
    return {
        "structure": {"format": "ii-picture", "version": 1, **structure},
        "dtype": dtype,
        "scheme": scheme,
        "options": {name: value for name, value in asked.items() if name not in GOALS},
        **{field: asked.get(name) for name, field in GOALS.items()},
    }


# Fields of the first version, in JSON, and later fields with their defaults.
_NEEDED = {"scheme", "options", "structure", "target_bpp", "qp", "reached", "runs", "versions"}
_LATER = {"dtype": "uint8", "quality": None}


def _first(header: dict[str, Any]) -> dict[str, Any]:
    header = _LATER | header
    if set(header) != _NEEDED | set(_LATER):
        needed = ", ".join(sorted(_NEEDED))
        raise ValueError(f"its header has {', '.join(sorted(header))}: needed are {needed}")
    scheme, options = header["scheme"], header["options"]
    if isinstance(scheme, str) and scheme.startswith("ri-") and isinstance(options, dict):
        # These files number the grid of ray-space images with v down and l across.
        turned = {"rows": "columns", "columns": "rows"}.get(options.get("by", "rows"))
        header |= {"options": options | {"by": turned}}
    return header
