"""Lens files of Zemax OpticStudio, ``.zmx``: surfaces, glasses, stop, rims and the primary wavelength.

The files are lines of words, in UTF-8 or UTF-16. A block of indented lines belongs to the ``SURF`` line before it.
Surface 0 is the object, the last one the image. ``DIAM`` holds half a diameter.
"""

from __future__ import annotations

import math
import os
from typing import Any

from ..base.files import MAX_TEXT, check_file
from .glass import CATALOGUE

UNITS_MM = {"MM": 1.0, "CM": 10.0, "IN": 25.4, "METER": 1000.0}
# Kinds of surface whose parameters beside curvature and conic would change the lens.
KNOWN_TYPES = ("STANDARD", "EVENASPH")


def read_zmx(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the values of a prescription from a Zemax lens file; see `prescriptions`.

    Planes between air and air, such as dummy surfaces, are left out unless they are the stop.

    Raises
    ------
    ValueError
        If the file is none of Zemax's, or has mirrors, tilts, aspheric terms, an unknown unit, an unknown glass
        without an index, or a gap of no length.
    OSError
        If the file is missing.
    """
    head, blocks = _blocks(_text(path))
    if len(blocks) < 3:
        raise ValueError(f"{len(blocks)} surfaces: a lens between an object and an image is needed")
    unit = _first(head, "UNIT", "MM")
    if unit not in UNITS_MM:
        raise ValueError(f"unit {unit!r}: known are {', '.join(UNITS_MM)}")
    found = [_surface(i, block, UNITS_MM[unit]) for i, block in enumerate(blocks[:-1])][1:]
    back = found[-1]["thickness_mm"]
    kept: list[dict[str, Any]] = []
    for i, surface in enumerate(found):
        before = found[i - 1]["glass"] if i else None
        if before is None and surface["glass"] is None and not surface["stop"]:
            if kept:
                kept[-1]["thickness_mm"] += surface["thickness_mm"]
            continue
        kept.append(surface)
    if not kept:
        raise ValueError("no refracting surface: a lens is needed")
    dropped_back = kept[-1]["thickness_mm"]
    kept[-1]["thickness_mm"] = 0.0
    wavelength = _wavelength_nm(head)
    return {
        "about": " ".join(head.get("NAME", [])),
        "source": os.path.basename(os.fspath(path)),
        "back_mm": dropped_back if kept[-1] is not found[-1] else back,
        "surfaces": [{key: value for key, value in surface.items() if value is not None} for surface in kept],
        **({} if wavelength is None else {"wavelength_nm": wavelength}),
    }


def _text(path: str | os.PathLike[str]) -> str:
    check_file(path)
    with open(path, "rb") as file:
        data = file.read(MAX_TEXT + 1)
    if len(data) > MAX_TEXT:
        raise ValueError(f"longer than {MAX_TEXT >> 20} MiB, the limit for such files")
    wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")  # older files: names in the code page of their writer


def _blocks(text: str) -> tuple[dict[str, list[str]], list[dict[str, list[str]]]]:
    """Return the words of the head by their key, and those of each surface; the first line of a key counts."""
    head: dict[str, list[str]] = {}
    blocks: list[dict[str, list[str]]] = []
    for line in text.splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "SURF":
            blocks.append({})
        elif blocks and line[:1].isspace():
            blocks[-1].setdefault(words[0], words[1:])
            if words[0] == "PARM" and len(words) > 2:
                blocks[-1][f"PARM {words[1]}"] = words[2:]
        elif words[0] == "WAVM" and len(words) > 2:
            head[f"WAVM {words[1]}"] = words[2:]
        else:
            head.setdefault(words[0], words[1:])
    if not blocks:
        raise ValueError("no Zemax lens file: a line SURF is needed")
    return head, blocks


def _surface(index: int, block: dict[str, list[str]], unit_mm: float) -> dict[str, Any]:
    kind = _first(block, "TYPE", "STANDARD")
    named = f"surface {index}"
    if kind not in KNOWN_TYPES:
        raise ValueError(f"{named} is of type {kind}: {' and '.join(KNOWN_TYPES)} are read")
    for key, words in block.items():
        if key.startswith("PARM ") and kind == "EVENASPH" and _number(named, words):
            raise ValueError(f"{named} has aspheric terms: spheres and conics are read")
    if "MIRR" in block and block["MIRR"] and block["MIRR"][0] not in ("0", "2"):
        raise ValueError(f"{named} is a mirror: refracting surfaces are read")
    curvature = _number(named, block.get("CURV", ["0"]))
    thickness = _number(named, block.get("DISZ", ["0"]))
    diameter = _number(named, block.get("DIAM", ["0"]))
    if index and not (math.isfinite(thickness) and thickness >= 0):
        raise ValueError(f"{named}: thickness is {thickness:g}: a distance of at least 0 is needed")
    return {
        "radius_mm": unit_mm / curvature if curvature else None,
        "thickness_mm": thickness * unit_mm,
        "glass": _glass(named, block["GLAS"]) if "GLAS" in block else None,
        "conic": _number(named, block.get("CONI", ["0"])),
        "diameter_mm": 2 * diameter * unit_mm if diameter else None,
        "stop": "STOP" in block,
    }


def _glass(named: str, words: list[str]) -> Any:
    """Return a catalogue name, or index and Abbe number where the line has them: name, two flags, n, V."""
    name = words[0] if words else ""
    if name == "MIRROR":
        raise ValueError(f"{named} is a mirror: refracting surfaces are read")
    for known in (name, f"N-{name}"):
        if known in CATALOGUE:
            return known
    ior = _number(named, words[3:4] or ["0"])
    if not ior > 1:
        raise ValueError(f"{named}: unknown glass {name!r} without an index: known are {', '.join(CATALOGUE)}")
    abbe = _number(named, words[4:5] or ["0"])
    return {"name": name, "ior": ior, **({"abbe": abbe} if abbe > 0 else {})}


def _wavelength_nm(head: dict[str, list[str]]) -> float | None:
    """Return the primary wavelength; None if the file has none."""
    primary = _first(head, "PWAV", "1")
    if f"WAVM {primary}" in head:
        return 1000 * _number("wavelength", head[f"WAVM {primary}"])
    values = head.get("WAVL", [])
    place = _number("PWAV", [primary])
    return 1000 * _number("wavelength", values[int(place) - 1 :]) if place in range(1, len(values) + 1) else None


def _first(block: dict[str, list[str]], key: str, usual: str) -> str:
    """Return the first word of a line, or the usual one without a line or a word."""
    return (block.get(key) or [usual])[0]


def _number(named: str, words: list[str]) -> float:
    try:
        return float("inf" if words[0].upper() == "INFINITY" else words[0])
    except (ValueError, IndexError):
        raise ValueError(f"{named}: {words[0] if words else 'nothing'!r} is no number") from None
