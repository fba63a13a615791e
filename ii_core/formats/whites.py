"""White pictures of a camera's calibration data: a folder, a ``.tar``, a bundle of the first generation.

A white picture is ``NAME.RAW`` with metadata in ``NAME.TXT`` or ``NAME.JSON``, or a container. The maker's programs
keep them as folders and ``.tar`` files (second generation) or in containers ``data.C.0`` … whose table of contents
lists files (first generation).
"""

from __future__ import annotations

import os
import tarfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base import checks
from ..base.files import check_file, one_line, parse_json
from .lfp import CONTAINERS, MAGIC, PACKED, TOLD, raw_picture, read_raw, read_sections
from .lytro import RawPicture, Setting, setting_of

MOST_FILES = 20_000  # in a folder or archive; the maker's calibration data have about 400
MOST_TEXT, MOST_SAMPLES = 1 << 20, 1 << 28  # bytes of a file of metadata, of samples
DIM = 1 / 16  # of the scale: a picture with less mean light is no white one
Bytes = Callable[[], bytes]


class White(NamedTuple):
    """A white picture that can be read.

    Attributes
    ----------
    name : str
    setting : Setting
    read : callable
        Returns the `RawPicture`.
    """

    name: str
    setting: Setting
    read: Callable[[], RawPicture]


@checks.checked(source=checks.path)
def white_pictures(source: str | os.PathLike[str]) -> list[White]:
    """Return the white pictures of a folder, ``.tar`` or bundle, by name; pixels are read later.

    Raises
    ------
    ValueError
        If there are none with zoom and focus, or the archive is damaged.
    OSError
        If it cannot be read.
    """
    path = Path(source)
    if path.is_dir():
        files = _folder_files(path)
    else:
        check_file(path)
        with path.open("rb") as file:
            files = _bundle_files(path) if file.read(3) == MAGIC else _tar_files(path)
    whites = sorted(_pairs(files), key=lambda white: white.name)
    if not whites:
        raise ValueError(
            f"{path} holds no white pictures: .RAW files with .TXT or .JSON of zoom and focus are needed"
        )
    return whites


def nearest_white(whites: list[White], setting: Setting | None) -> tuple[White, RawPicture]:
    """Return the white picture of the same camera that is nearest in zoom, then in focus.

    Pictures marked as dark frames, or with too little light, are passed over.

    Raises
    ------
    ValueError
        If the setting is unknown, or none of the pictures is of this camera, or all are dark.
    """
    if setting is None:
        raise ValueError("the picture says no zoom and focus to choose a white picture by: give one white picture")
    same = [w for w in whites if not (setting.serial and w.setting.serial) or w.setting.serial == setting.serial]
    if not same:
        others = sorted({checks.shown(w.setting.serial) for w in whites})
        raise ValueError(one_line(f"the picture is of camera {setting.serial}, the white pictures of "
                                  f"{', '.join(others)}: those of the same camera are needed"))  # fmt: skip
    same.sort(key=lambda w: (abs(w.setting.zoom - setting.zoom), abs(w.setting.focus - setting.focus)))
    for white in same:
        if white.setting.dark:
            continue
        picture = white.read()
        if picture.samples.size and float(np.mean(picture.samples)) >= DIM * (picture.full_scale or 0.0):
            return white, picture
    raise ValueError(f"all {len(same)} white pictures of the camera are dark")


def _folder_files(folder: Path) -> dict[str, Bytes]:
    found: dict[str, Bytes] = {}
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.suffix.lower() in (*PACKED, *TOLD, *CONTAINERS, ".tar"):
            if file.suffix.lower() == ".tar":
                found |= {f"{file.relative_to(folder)}/{name}": read for name, read in _tar_files(file).items()}
            else:
                limit = MOST_TEXT if file.suffix.lower() in TOLD else MOST_SAMPLES
                found[str(file.relative_to(folder))] = partial(_small, file, limit)
        if len(found) > MOST_FILES:
            raise ValueError(f"{folder} holds more than {MOST_FILES} files: a camera's folder is needed")
    return found


def _small(file: Path, limit: int) -> bytes:
    if file.stat().st_size > limit:
        raise ValueError(f"{file} has {file.stat().st_size} bytes: at most {limit} are read")
    return file.read_bytes()


def _tar_files(path: Path) -> dict[str, Bytes]:
    """Return the files of a ``.tar`` without extracting it; links are left out."""
    found: dict[str, Bytes] = {}
    try:
        with tarfile.open(path, "r:") as archive:
            for count, member in enumerate(archive):
                if count > MOST_FILES:
                    raise ValueError(f"it holds more than {MOST_FILES} files")
                if member.isreg() and Path(member.name).suffix.lower() in (*PACKED, *TOLD):
                    found[member.name] = partial(_part, path, member.offset_data, member.size)
    except (tarfile.TarError, ValueError, EOFError, OverflowError) as error:
        raise ValueError(f"{path} is no folder, .tar or bundle of white pictures: {one_line(error)}") from None
    return found


def _part(path: Path, offset: int, size: int) -> bytes:
    if not 0 <= size <= MOST_SAMPLES:
        raise ValueError(f"a file in {path} has {size} bytes: at most {MOST_SAMPLES} are read")
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(size)


def _bundle_files(path: Path) -> dict[str, Bytes]:
    """Return the files of a bundle, a container whose table lists ``files`` with names such as C:\\CALIB\\A.RAW."""
    try:
        table, sections = read_sections(_small(path, 4 * MOST_SAMPLES))
        entries = [(str(e["name"]).replace("\\", "/"), sections[e["dataRef"]]) for e in table.get("files", [])]
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"{path} is no bundle of white pictures: {one_line(error)}") from None
    return {name: partial(bytes, content) for name, content in entries}


def _pairs(files: dict[str, Bytes]) -> Iterator[White]:
    """Yield the samples that have metadata of zoom and focus beside them, and containers."""
    by_stem: dict[str, str] = {}
    for name in files:
        if Path(name).suffix.lower() in TOLD:
            by_stem.setdefault(str(Path(name).with_suffix("")).lower(), name)
    for name, samples in files.items():
        told = by_stem.get(str(Path(name).with_suffix("")).lower())
        if Path(name).suffix.lower() not in PACKED or told is None:
            continue
        metadata, setting = _setting(told, files[told])
        if setting is not None:
            yield White(name, setting, partial(_white, name, samples, metadata))


def _setting(name: str, text: Bytes) -> tuple[Any, Setting | None]:
    """Return the metadata of a text and their setting; None for texts of other kinds."""
    try:
        metadata = parse_json(text().decode("utf-8").rstrip("\0"))
        return metadata, setting_of(metadata)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError):
        return None, None


def _white(name: str, samples: Bytes, metadata: Any) -> RawPicture:
    try:
        return raw_picture(samples(), metadata)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError) as error:
        raise ValueError(f"{one_line(name)} is no white picture: {one_line(repr(error))}") from None


def read_white(source: str | os.PathLike[str], setting: Setting | None) -> tuple[str, RawPicture]:
    """Return the white picture of a file, or the nearest one of a folder, ``.tar`` or bundle, with its name."""
    path = Path(source)
    if not path.is_dir() and path.suffix.lower() not in (".tar", *(f".{i}" for i in range(10))):
        return path.name, read_raw(path)
    white, picture = nearest_white(white_pictures(path), setting)
    return white.name, picture
