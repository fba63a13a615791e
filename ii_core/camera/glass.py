"""Glasses: refractive index against wavelength, by Sellmeier's formula or from index and Abbe number."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import assets

from ..base.checks import number, shown, text, within
from ..base.files import read_json

LINE_D_NM, LINE_F_NM, LINE_C_NM = 587.5618, 486.1327, 656.2725  # spectral lines of the Abbe number
LEAST_NM, MOST_NM = 200.0, 2500.0
MOST_INDEX = 10.0
MOST_NAME = 40  # characters of a name that are compared with the catalogue's
NEAR = 4  # names in the error of an unknown one
PREFIX = re.compile("^[A-Z]+-")  # of glasses without lead, of moulding types and of makers


@dataclass(frozen=True, kw_only=True)
class Glass:
    """Optical glass.

    Parameters
    ----------
    ior : float, optional
        n_d, the index at 587.56 nm, from 1 to 10.
    abbe : float, optional
        V_d = (n_d − 1) / (n_F − n_C). The index follows Cauchy's formula A + B/λ², exact at line d and in n_F − n_C.
        Without it, the index does not depend on the wavelength.
    sellmeier : (B₁, B₂, B₃, C₁, C₂, C₃), optional
        n² = 1 + Σ Bᵢλ² / (λ² − Cᵢ), λ and √Cᵢ in µm. It takes the place of ``ior`` and ``abbe``.
    name : str
        Name in files and messages; a name of `CATALOGUE` stands for the glass in JSON.

    Raises
    ------
    ValueError
        If neither form is given, or a value is out of range.
    """

    ior: float | None = None
    abbe: float | None = None
    sellmeier: tuple[float, ...] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if (self.ior is None) == (self.sellmeier is None):
            raise ValueError("glass: ior with or without abbe, or sellmeier, is needed")
        if self.sellmeier is not None:
            if self.abbe is not None:
                raise ValueError("glass: sellmeier and abbe are given: one of them is needed")
            listed = isinstance(self.sellmeier, Sequence) and not isinstance(self.sellmeier, str)
            if not listed or len(self.sellmeier) != 6:
                raise ValueError(
                    f"glass: sellmeier is {self.sellmeier!r}: six numbers, B1 to B3 and C1 to C3, are needed"
                )
            six = tuple(within("glass: sellmeier", value, -1e6, 1e6) for value in self.sellmeier)
            object.__setattr__(self, "sellmeier", six)
        else:
            object.__setattr__(self, "ior", within("glass: ior", self.ior, 1, MOST_INDEX))
        if self.abbe is not None:
            object.__setattr__(self, "abbe", within("glass: abbe", self.abbe, 1, 1e4))

    def index(self, wavelength_nm: float) -> float:
        """Return n at a wavelength in vacuum.

        Raises
        ------
        ValueError
            If the wavelength is not from 200 to 2500 nm, or Sellmeier's formula has no index from 1 to 10 there.
        """
        wavelength = within("wavelength_nm", wavelength_nm, LEAST_NM, MOST_NM, "wavelength", " nm")
        square = (wavelength / 1e3) ** 2
        if self.sellmeier is None:
            assert self.ior is not None
            if self.abbe is None:
                return self.ior
            d, f, c = (1e6 / line**2 for line in (LINE_D_NM, LINE_F_NM, LINE_C_NM))
            return self.ior + (self.ior - 1) / self.abbe / (f - c) * (1 / square - d)
        b, c3 = self.sellmeier[:3], self.sellmeier[3:]
        if any(square == c for c in c3):
            raise ValueError(
                f"glass {self.name!r} has a resonance at {wavelength:g} nm: another wavelength is needed"
            )
        n2 = 1 + sum(bi * square / (square - ci) for bi, ci in zip(b, c3, strict=True))
        if not 1 <= n2 <= MOST_INDEX**2:
            raise ValueError(f"glass {self.name!r}: n² is {n2:g} at {wavelength:g} nm: 1 to 100 is needed")
        return math.sqrt(n2)

    @property
    def abbe_number(self) -> float:
        """V_d from the indices at lines d, F and C; infinite without dispersion."""
        d, f, c = (self.index(line) for line in (LINE_D_NM, LINE_F_NM, LINE_C_NM))
        return (d - 1) / (f - c) if f != c else math.inf

    def to_json(self) -> Any:
        """Return the name of a catalogue glass, or the values of others."""
        if CATALOGUE.get(self.name) == self:
            return self.name
        values = {"name": self.name or None, "ior": self.ior, "abbe": self.abbe}
        plain = {key: value for key, value in values.items() if value is not None}
        return plain if self.sellmeier is None else {**plain, "sellmeier": list(self.sellmeier)}


class CatalogueGlass(NamedTuple):
    """Glass of the catalogue with its maker, and n_d and V_d of the maker's data sheet."""

    maker: str
    glass: Glass
    ior: float
    abbe: float


@cache
def catalogue() -> Mapping[str, CatalogueGlass]:
    """Return the glasses of ``assets/glasses.json`` by name."""
    lines = read_json(Path(str(files(assets) / "glasses.json")))["glasses"]
    return {
        name: CatalogueGlass(maker, Glass(name=name, sellmeier=tuple(six)), ior, abbe)
        for name, maker, six, ior, abbe in lines
    }


class _Catalogue(Mapping[str, Glass]):
    """Glasses by name, read at first use: most commands need none."""

    def __getitem__(self, name: str) -> Glass:
        return catalogue()[name].glass

    def __iter__(self) -> Iterator[str]:
        return iter(catalogue())

    def __len__(self) -> int:
        return len(catalogue())


CATALOGUE: Mapping[str, Glass] = _Catalogue()


def known_glass(name: str) -> CatalogueGlass:
    """Return the catalogue glass of a name, whose letters may be small.

    A name without its entry is refused: glasses that replace one another, such as SF11 and N-SF11, differ.

    Raises
    ------
    ValueError
        If the name is unknown; the message has the nearest names.
    """
    text("name", name)
    known = catalogue()
    found = known.get(name) or known.get(name.upper())
    if found is not None:
        return found
    wanted = name.upper()[:MOST_NAME]
    kin = [other for other in known if PREFIX.sub("", other) == PREFIX.sub("", wanted)]
    near = list(dict.fromkeys([*kin, *get_close_matches(wanted, known, NEAR)]))[:NEAR]
    listed = ", ".join(f"{other} (n {known[other].ior:g}, V {known[other].abbe:g})" for other in near)
    makers = "Schott, Ohara and CDGM"
    said = f"near it are {listed}" if near else f"known are {len(known)} names of {makers}, such as N-BK7"
    raise ValueError(f"unknown glass {shown(name)}: {said}")


def glass(value: Any) -> Glass | None:
    """Return the glass of a catalogue name, of the values of `Glass.to_json`, or None for air.

    Raises
    ------
    ValueError
        If the name is unknown or the values are wrong.
    """
    if value is None or isinstance(value, Glass):
        return value
    if isinstance(value, str):
        try:
            return known_glass(value).glass
        except ValueError as error:
            raise ValueError(f"{error}; others are given by ior and abbe, or sellmeier") from None
    if not isinstance(value, Mapping):
        number("glass", value)
        return Glass(ior=value)
    if unknown := set(value) - {"name", "ior", "abbe", "sellmeier"}:
        raise ValueError(f"glass has no {', '.join(sorted(map(str, unknown)))}: known are name, ior, abbe, sellmeier")
    return Glass(**{**value, "name": str(value.get("name", ""))})
