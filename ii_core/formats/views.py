"""Folder of views: pictures with two numbers in their names."""

from __future__ import annotations

import itertools
import os
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ..base import checks
from ..base.files import one_line, read_json, write_image, write_json
from ..camera.camera import Pair
from ..picture.picture import IIPicture
from .grid import WHOLE_ORDER, Views, camera_views, checked_reader, listed, read_view
from .hci import HCI_VIEW, hci_views
from .positions import named_positions

PICTURES = (".png", ".tif", ".tiff", ".exr", ".hdr", ".jpg", ".jpeg", ".ppm", ".pgm", ".bmp", ".webp")
NUMBER = re.compile(r"-?\d+\.\d+|\d+")
STRUCTURE = "structure.json"
LISTED = 5  # missing views that a message names


def folder_views(folder: Path, grid: Pair | None) -> Views:
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURES and path.is_file())
    if not files:
        raise ValueError(f"{folder} holds no pictures: known are {', '.join(PICTURES)}")
    hci = [path for path in files if HCI_VIEW.fullmatch(path.name)]
    if hci:
        return hci_views(folder, hci, grid)
    families = Counter(NUMBER.sub("#", path.stem) for path in files)
    family = families.most_common(1)[0][0]
    members = [path for path in files if NUMBER.sub("#", path.stem) == family]
    if len(suffixes := sorted({path.suffix.lower() for path in members})) > 1:
        raise ValueError(f"views in {folder} are of mixed types {', '.join(suffixes)}: one is needed")
    if len(members) == 1:
        raise ValueError(f"{folder} holds one view, {members[0].name}: a light field needs at least two")
    return _numbered(folder, members, grid)


def _numbered(folder: Path, members: list[Path], grid: Pair | None) -> Views:
    """Return views with two numbers in their names, or with one number and a given grid."""
    fields = list(zip(*(NUMBER.findall(path.stem) for path in members), strict=True))
    whole = [tuple(map(int, field)) for field in fields if all(text.isdigit() for text in field)]
    varying = [field for field in whole if len(set(field)) > 1]
    own = os.path.lexists(folder / STRUCTURE)  # of one row of views the row number may be the same in all names
    if grid is not None:
        serial = [field for field in varying if len(set(field)) == len(members)]
        in_order = sorted(zip(serial[0], members, strict=True)) if serial else [(0, path) for path in members]
        return listed([path for _, path in in_order], grid, known=frozenset(("transposed",)))
    pairs = [
        (len(set(a)) * len(set(b)), a, b)
        for a, b in itertools.combinations(whole if own else varying, 2)
        if len(set(zip(a, b, strict=True))) == len(members)
    ]
    if not pairs:
        raise ValueError(
            f"the {len(members)} names in {folder} like {members[0].name} do not hold a row and a column number: "
            "give the grid, as in 9x1"
        )
    size, a, b = min(pairs, key=lambda pair: pair[0])
    table = dict(zip(zip(a, b, strict=True), members, strict=True))
    first, second = sorted(set(a)), sorted(set(b))
    if size > len(members):
        missing = [place for place in itertools.product(first, second) if place not in table]
        some = ", ".join(map(str, missing[:LISTED])) + (" …" if len(missing) > LISTED else "")
        raise ValueError(f"{len(missing)} of {size} views are missing in {folder}: {some}")
    for numbers in (first, second):
        steps = set(np.diff(numbers).tolist())
        if len(steps) > 1:
            raise ValueError(f"view numbers in {folder} have gaps: {', '.join(map(str, numbers))}")
    shape = len(first), len(second)
    at = [(first.index(i), second.index(j)) for i, j in zip(a, b, strict=True)]
    return Views(
        shape=shape,
        read=checked_reader(lambda i, j: table[first[i], second[j]], read_view),
        positions=named_positions(fields, at),
        **_written(folder, shape),
    )


def _written(folder: Path, shape: tuple[int, int]) -> dict[str, Any]:
    """Return the order and structure that `write_views` stored in the folder, if any."""
    path = folder / STRUCTURE
    if not os.path.lexists(path):
        return {}
    try:
        structure = read_json(path)
        u, v = structure["ei_pixels"]
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{path} is no structure of an II-picture: {one_line(repr(error))}") from None
    if (v, u) != shape:
        raise ValueError(one_line(f"{path} says {v}×{u} views, {shape[0]}×{shape[1]} are there"))
    return {"structure": structure, "known": WHOLE_ORDER}


@checks.checked(picture=checks.instance(IIPicture), folder=checks.path)
def write_views(picture: IIPicture, folder: str | os.PathLike[str]) -> Path:
    """Write every view as ``view_ROW_COLUMN.png`` (``.exr`` for float pictures), and the structure.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    picture.check_regular()
    folder = Path(folder)
    suffix = ".exr" if picture.pixels.dtype.kind == "f" else ".png"
    digits = max(2, len(str(max(picture.ei_pixels) - 1)))
    for row, col, view in camera_views(picture):
        write_image(folder / f"view_{row:0{digits}}_{col:0{digits}}{suffix}", view)
    write_json(folder / STRUCTURE, picture.structure_json())
    return folder
