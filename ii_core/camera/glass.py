"""Glasses: refractive index against wavelength, by Sellmeier's formula or from index and Abbe number."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..base.checks import number, within

LINE_D_NM, LINE_F_NM, LINE_C_NM = 587.5618, 486.1327, 656.2725  # spectral lines of the Abbe number
LEAST_NM, MOST_NM = 200.0, 2500.0
MOST_INDEX = 10.0


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


def _schott(name: str, *six: float) -> Glass:
    return Glass(name=name, sellmeier=six)


# Coefficients of Schott's catalogue of optical glasses.
CATALOGUE = {
    glass.name: glass
    for glass in (
        _schott("N-BK7", 1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653),
        _schott("N-SK2", 1.28189012, 0.257738258, 0.96818604, 0.0072719164, 0.0242823527, 110.377773),
        _schott("N-SK16", 1.34317774, 0.241144399, 0.994317969, 0.00704687339, 0.0229005, 92.7508526),
        _schott("N-SSK2", 1.4306027, 0.153150554, 1.01390904, 0.00823982975, 0.0333736841, 106.870822),
        _schott("F2", 1.34533359, 0.209073176, 0.937357162, 0.00997743871, 0.0470450767, 111.886764),
        _schott("F5", 1.3104463, 0.19603426, 0.96612977, 0.00958633048, 0.0457627627, 115.011883),
        _schott("N-SF11", 1.73759695, 0.313747346, 1.89878101, 0.013188707, 0.0623068142, 155.23629),
        _schott("N-LAK9", 1.46231905, 0.344399589, 1.15508372, 0.00724270156, 0.0243353131, 85.4686868),
    )
}


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
        known = CATALOGUE.get(value) or CATALOGUE.get(f"N-{value}")
        if known is None:
            raise ValueError(
                f"unknown glass {value!r}: known are {', '.join(CATALOGUE)}; others are given by ior and abbe"
            )
        return known
    if not isinstance(value, Mapping):
        number("glass", value)
        return Glass(ior=value)
    if unknown := set(value) - {"name", "ior", "abbe", "sellmeier"}:
        raise ValueError(f"glass has no {', '.join(sorted(map(str, unknown)))}: known are name, ior, abbe, sellmeier")
    return Glass(**{**value, "name": str(value.get("name", ""))})
