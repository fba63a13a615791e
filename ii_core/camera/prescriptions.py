"""Lens prescriptions by name, from JSON files and from Zemax files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import assets

from ..base import checks
from ..base.files import one_line, read_json
from .glass import LINE_D_NM
from .surfaces import Surface, Surfaces
from .zmx import read_zmx

KEYS = {"about", "source", "back_mm", "wavelength_nm", "surfaces"}
MOST_NAME = 255  # characters of a lens or its file in a camera file


@dataclass(frozen=True, kw_only=True)
class Prescription:
    """Surfaces of a lens, without a place.

    Parameters
    ----------
    surfaces : tuple of Surface
        From the scene to the pixels.
    back_mm : float, optional
        Distance from the last vertex to the image in the prescription; None if it has none.
    wavelength_nm : float
        Of the prescription.
    about, source : str
        Description in one line, and origin.
    """

    surfaces: tuple[Surface, ...]
    back_mm: float | None = None
    wavelength_nm: float = LINE_D_NM
    about: str = ""
    source: str = ""

    def at(
        self, z_mm: float, *, enlarge: float = 1.0, wavelength_nm: float | None = None,
        wavelengths_nm: Any = None,
    ) -> Surfaces:  # fmt: skip
        """Return the lens with its last vertex at ``z_mm``, all its lengths times ``enlarge``; see `Surfaces`."""
        checks.length("enlarge", enlarge)
        wavelength = self.wavelength_nm if wavelength_nm is None else wavelength_nm
        if wavelengths_nm is not None and wavelength_nm is None:
            wavelength = LINE_D_NM  # that of the prescription gives way
        made = Surfaces(z_mm=z_mm, surfaces=self.surfaces, wavelength_nm=wavelength, wavelengths_nm=wavelengths_nm)
        return made.enlarged(enlarge)


def lens_names() -> dict[str, str]:
    """Return the names of the lenses of the package with a description in one line."""
    return {path.stem: str(read_json(path).get("about", "")) for path in sorted(_folder().glob("*.json"))}


@checks.checked(name=checks.path)
def lens(name: str | os.PathLike[str]) -> Prescription:
    """Return the prescription of a lens by name or from a file.

    Parameters
    ----------
    name : str or path
        One of `lens_names`, or a file that ends in ``.json`` or ``.zmx``.

    Raises
    ------
    ValueError
        If the name is unknown, or the file is no prescription of spheres, conics and even aspheres.
    OSError
        If the file is missing.
    """
    path = Path(name)
    if path.suffix.lower() not in (".json", ".zmx"):
        if str(name) not in (known := lens_names()):
            said = checks.shown(str(name))
            raise ValueError(f"unknown lens {said}: known are {', '.join(known)}, or give a .json or .zmx file")
        path = _folder() / f"{name}.json"
    try:
        data = read_zmx(path) if path.suffix.lower() == ".zmx" else read_json(path)
        return _prescription(data)
    except (ValueError, TypeError) as error:
        said = one_line(error)
        raise ValueError(said if said.startswith(str(path)) else f"{path}: {said}") from None


def _prescription(data: Any) -> Prescription:
    if not isinstance(data, Mapping) or "surfaces" not in data:
        raise ValueError('no prescription: an object with "surfaces" is needed')
    if unknown := set(data) - KEYS:
        raise ValueError(f"prescription has no {', '.join(sorted(unknown))}: known are {', '.join(sorted(KEYS))}")
    wavelength = data.get("wavelength_nm", LINE_D_NM)
    built = Surfaces(z_mm=0.0, surfaces=data["surfaces"], wavelength_nm=wavelength)
    back = data.get("back_mm")
    return Prescription(
        surfaces=built.surfaces,
        back_mm=None if back is None else checks.number("back_mm", back),
        wavelength_nm=built.wavelength_nm,
        about=str(data.get("about", "")),
        source=str(data.get("source", "")),
    )


def placed(element: Any, folder: Path) -> Any:
    """Return the values of an optical element of a camera file; one with a ``prescription`` gets its surfaces.

    Parameters
    ----------
    element : any
        One element of ``optics``.
    folder : Path
        Where a prescription's file is looked for.

    Raises
    ------
    ValueError
        If a key is missing or unknown, or the prescription is wrong.
    """
    if not isinstance(element, Mapping) or "prescription" not in element:
        return element
    options = ("enlarge", "wavelength_nm", "wavelengths_nm")
    known = {"kind", "prescription", "z_mm", *options}
    if element.get("kind") != Surfaces.kind or (unknown := set(element) - known):
        extra = f" and no {', '.join(sorted(unknown))}" if element.get("kind") == Surfaces.kind else ""
        raise ValueError(f'an element with a prescription has "kind": "surfaces"{extra}')
    if "z_mm" not in element:
        raise ValueError("surfaces: z_mm is missing: the place of the surface nearest the pixels is needed")
    checks.path("surfaces: prescription", element["prescription"])
    name = element["prescription"]
    if len(str(name)) > MOST_NAME:
        raise ValueError(f"surfaces: prescription is {checks.shown(name)}: at most {MOST_NAME} characters are needed")
    is_file = Path(name).suffix.lower() in (".json", ".zmx")
    rest = {key: value for key, value in element.items() if key in options}
    return lens(folder / name if is_file else name).at(element["z_mm"], **rest)


def _folder() -> Path:
    return Path(str(files(assets) / "lenses"))
