"""Lens files of Zemax OpticStudio, ``.zmx``: surfaces, glasses, stop, rims and the primary wavelength.

The files are lines of words, in UTF-8 or UTF-16. A block of indented lines belongs to the ``SURF`` line before it.
Surface 0 is the object, the last one the image. ``DIAM`` holds half a diameter; many files leave out that of the
stop and have the entrance pupil's diameter (``ENPD``) or the f-number (``FNUM``). ``GLAS`` holds a name, the kind of
solve, the surface of a pickup, index and Abbe number; the latter two are placeholders unless the glass is a model.
"""

from __future__ import annotations

import math
import os
from typing import Any

from ..base.files import MAX_TEXT, check_file
from .glass import LINE_D_NM, PREFIX, catalogue, glass, known_glass
from .surfaces import MOST_ASPHERIC

UNITS_MM = {"MM": 1.0, "CM": 10.0, "IN": 25.4, "METER": 1000.0}
# Kinds of surface whose parameters beside curvature and conic would change the lens.
KNOWN_TYPES = ("STANDARD", "EVENASPH")
FIXED, MODEL, PICKUP, SUBSTITUTE = "0", "1", "2", "3"  # solves of a glass
MAKERS = ("Schott", "Ohara", "CDGM")  # whose catalogues have files for Zemax
# A model glass by the name of a catalogue glass may differ from it by the rounding of its numbers.
SAME_INDEX, SAME_ABBE = 5e-4, 0.01


def read_zmx(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the values of a prescription from a Zemax lens file; see `prescriptions`.

    Planes between air and air, such as dummy surfaces, are left out unless they are the stop.

    Raises
    ------
    ValueError
        If the file is none of Zemax's, or has mirrors, tilts, surfaces that are neither conics nor even aspheres, an
        unknown unit, an unknown glass, a gap of no length, or a stop without a size.
    OSError
        If the file is missing.
    """
    head, blocks = _blocks(_text(path))
    if len(blocks) < 3:
        raise ValueError(f"{len(blocks)} surfaces: a lens between an object and an image is needed")
    unit = _first(head, "UNIT", "MM")
    if unit not in UNITS_MM:
        raise ValueError(f"unit {unit!r}: known are {', '.join(UNITS_MM)}")
    surfaces: list[dict[str, Any]] = []
    for block in blocks[:-1]:
        surfaces.append(_surface(block, UNITS_MM[unit], surfaces, head.get("GCAT", [])))
    if surfaces[0]["glass"] is not None:
        raise ValueError("surface 0, the object, has glass: a lens in air is needed")
    found = surfaces[1:]
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
    for surface in kept:
        if surface["stop"] and surface["diameter_mm"] is None:
            surface["diameter_mm"] = _stop_mm(head, kept, UNITS_MM[unit], wavelength or LINE_D_NM)
    return {
        "about": " ".join(head.get("NAME", [])),
        "source": os.path.basename(os.fspath(path)),
        "back_mm": dropped_back if kept[-1] is not found[-1] else back,
        "surfaces": [{key: value for key, value in surface.items() if value is not None} for surface in kept],
        **({} if wavelength is None else {"wavelength_nm": wavelength}),
    }


def _stop_mm(
    head: dict[str, list[str]], surfaces: list[dict[str, Any]], unit_mm: float, wavelength_nm: float
) -> float:
    """Return the diameter of a stop without a rim, mm.

    A paraxial ray parallel to the axis that enters at the edge of the entrance pupil meets the edge of the stop.
    """
    height, slope, index, at_stop = 1.0, 0.0, 1.0, 0.0
    for surface in surfaces:
        at_stop = height if surface["stop"] else at_stop
        made = glass(surface["glass"])
        after = 1.0 if made is None else made.index(wavelength_nm)
        curvature = 1 / (surface["radius_mm"] or math.inf) + 2 * (surface["aspheric"] or [0.0])[0]
        slope = (index * slope - height * (after - index) * curvature) / after
        height, index = height + slope * surface["thickness_mm"], after
    for key in ("ENPD", "FNUM"):
        if key in head:
            given = _number(key, head[key])
            pupil = given * unit_mm if key == "ENPD" else 1 / (abs(slope) * given) if slope * given else 0.0
            if not (0 < pupil * abs(at_stop) < math.inf):
                raise ValueError(f"{key} is {given:g}: the stop of no DIAM has no diameter from it")
            return pupil * abs(at_stop)
    raise ValueError("the stop has no DIAM, and the file no ENPD or FNUM: one of them is needed")


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


def _surface(
    block: dict[str, list[str]], unit_mm: float, before: list[dict[str, Any]], catalogues: list[str]
) -> dict[str, Any]:
    """Return the values of a surface that follows those of ``before``."""
    kind = _first(block, "TYPE", "STANDARD")
    index = len(before)
    named = f"surface {index}"
    if kind not in KNOWN_TYPES:
        raise ValueError(f"{named} is of type {kind}: {' and '.join(KNOWN_TYPES)} are read")
    curvature = _number(named, block.get("CURV", ["0"]))
    thickness = _number(named, block.get("DISZ", ["0"]))
    diameter = _number(named, block.get("DIAM", ["0"]))
    mirror = block.get("MIRR", ["0"])[:1] not in ([], ["0"], ["2"]) or block.get("GLAS", [""])[:1] == ["MIRROR"]
    if mirror:
        raise ValueError(f"{named} is a mirror: refracting surfaces are read")
    if index and not (math.isfinite(thickness) and thickness >= 0):
        raise ValueError(f"{named}: thickness is {thickness:g}: a distance of at least 0 is needed")
    return {
        "radius_mm": unit_mm / curvature if curvature else None,
        "thickness_mm": thickness * unit_mm,
        "glass": _glass(named, block["GLAS"], before, catalogues) if "GLAS" in block else None,
        "conic": _number(named, block.get("CONI", ["0"])),
        "aspheric": _aspheric(named, block, unit_mm) if kind == "EVENASPH" else None,
        "diameter_mm": 2 * diameter * unit_mm if diameter else None,
        "stop": "STOP" in block,
    }


def _aspheric(named: str, block: dict[str, list[str]], unit_mm: float) -> list[float] | None:
    """Return the coefficients of r², r⁴, … in mm, which the file has in its unit; None if all are 0."""
    given = {key[5:]: _number(named, words) for key, words in block.items() if key.startswith("PARM ")}
    places = [str(i + 1) for i in range(MOST_ASPHERIC)]
    if over := [place for place, value in given.items() if value and place not in places]:
        raise ValueError(f"{named}: PARM {over[0]} of an even asphere: 1 to {MOST_ASPHERIC} are read")
    coefficients = [given.get(place, 0.0) * unit_mm ** (1 - 2 * power) for power, place in enumerate(places, 1)]
    return coefficients if any(coefficients) else None


def _glass(named: str, words: list[str], before: list[dict[str, Any]], catalogues: list[str]) -> Any:
    """Return a catalogue name, or the index and Abbe number of a model glass.

    Raises
    ------
    ValueError
        If the catalogue has no such glass, a model glass has another glass's name, or a pickup has no source.
    """
    name, solve, source = (*words[:3], *["", FIXED, "0"][len(words) :])
    if solve == MODEL:
        return _model(named, name, words)
    if solve == PICKUP:
        earlier = {str(i): surface["glass"] for i, surface in enumerate(before) if i}
        if earlier.get(source) is None:
            raise ValueError(f"{named} has the glass of surface {source}: an earlier surface with glass is needed")
        return earlier[source]
    if solve not in (FIXED, SUBSTITUTE):
        raise ValueError(f"{named}: glass {name!r} has the solve {solve}: 0, 1, 2 and 3 are read")
    try:
        found = known_glass(name)
    except ValueError as error:
        raise ValueError(f"{named}: {error}; others are read as model glasses, of index and Abbe number") from None
    # Makers have glasses of the same short name: F2 of CDGM has an index of 1.61293, that of Schott 1.62004.
    other = catalogues and not any(found.maker[:4].upper() in word.upper() for word in catalogues)
    if other and found.maker in MAKERS and not PREFIX.match(found.glass.name):
        listed = " ".join(catalogues)
        raise ValueError(f"{named}: glass {name!r} is known from {found.maker}, and the file names only {listed}")
    return found.glass.name


def _model(named: str, name: str, words: list[str]) -> dict[str, Any]:
    """Return index and Abbe number of a line; one without an Abbe number has no dispersion."""
    ior, abbe = (_number(named, words[i : i + 1] or ["0"]) for i in (3, 4))
    if not ior > 1:
        raise ValueError(f"{named}: model glass {name!r} has the index {ior:g}: more than 1 is needed")
    printed = catalogue().get(name.upper())
    if printed and (abs(ior - printed.ior) > SAME_INDEX or (abbe > 0 and abs(abbe / printed.abbe - 1) > SAME_ABBE)):
        raise ValueError(
            f"{named}: model glass {name!r} has index {ior:g} and Abbe number {abbe:g}, the catalogue glass of this "
            f"name {printed.ior:g} and {printed.abbe:g}: another name is needed"
        )
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
