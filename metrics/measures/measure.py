"""Measure of the quality of a decoded picture: contract, needs and registry by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from ii_core.base.files import one_line
from ii_core.base.foreign import ForeignError, foreign_errors
from ii_core.base.plugins import load_plugins

from .pair import PicturePair

PLUGINS = "raytrace_ii.measures"  # entry points of installed packages


@dataclass(frozen=True, kw_only=True)
class Needs:
    """Needs of a measure.

    Parameters
    ----------
    regular : bool
        Regular structure, so that there are sub-images.
    camera : bool
        Camera, for view images.
    lenses : int
        Least number of lenses across and down.
    all_pixels : bool
        No mask.
    depth : bool
        Depth map, or a camera without lenses in front, for depth from focus.
    """

    regular: bool = False
    camera: bool = False
    lenses: int = 1
    all_pixels: bool = False
    depth: bool = False

    def unmet(self, pair: PicturePair) -> str | None:
        """Return the first need that the pair does not meet as a sentence; None if it meets all."""
        picture, camera = pair.reference, pair.reference.camera
        if self.regular and not picture.regular:
            return "the structure is not regular: run `raytrace-ii regular`"
        if self.all_pixels and pair.mask is not None:
            return "needs all pixels, a mask leaves some out"
        if self.camera and camera is None:
            return "the picture has no camera: gap and pixel pitch are needed to look through its lenses"
        if min(picture.lenses) < self.lenses:
            (k, l), least = picture.lenses, self.lenses
            return f"needs at least {least}×{least} lenses, the picture has {k}×{l}"
        flat = camera is not None and camera.viewer_mm is not None and not camera.lens_model.vertical_parallax
        if self.depth and pair.depth is None and flat:
            return "viewing zones that meet without vertical parallax have no disparity down: give a depth map"
        if self.depth and pair.depth is None and camera is not None and camera.front:
            return f"a {camera.front[0].kind} before the lenses bends lines of sight: give a depth map"
        return None


@dataclass(frozen=True, kw_only=True)
class Measure:
    """Measure of the quality of a decoded picture.

    Parameters
    ----------
    name : str
        Key in records, tables and options.
    compute : callable
        ``compute(pair)`` of a `PicturePair`. Measures that share a ``compute`` share its one result.
    value : callable
        ``value(result)`` returns the number for a result of ``compute``.
    text : str
        Description of the number, for captions.
    label : str
        Label of a chart's axis, which may contain mathtext; ``name`` if not given.
    unit : str
        Empty for dimensionless numbers.
    digits : int
        Decimals to print.
    higher_is_better : bool
    needs : Needs
    """

    name: str
    compute: Callable[[PicturePair], Any]
    value: Callable[[Any], float] = float
    text: str
    label: str = ""
    unit: str = ""
    digits: int = 2
    higher_is_better: bool = True
    needs: Needs = field(default_factory=Needs)

    @property
    def axis(self) -> str:
        """Label of a chart's axis."""
        label = self.label or self.name
        return (f"{label} [{self.unit}]" if self.unit else label) + self._direction

    @property
    def caption(self) -> str:
        """Description of the number, its unit, and whether lower is better."""
        return self.text + (f" in {self.unit}" if self.unit else "") + self._direction

    @property
    def _direction(self) -> str:
        return "" if self.higher_is_better else ", lower is better"

    @property
    def best(self) -> float:
        """Value of a picture without error, for measures where it is infinite."""
        return math.inf if self.higher_is_better else -math.inf

    def result(self, pair: PicturePair) -> Any:
        """Return ``compute(pair)``.

        Raises
        ------
        ForeignError
            If a measure of another package fails.
        """
        with foreign_errors(f"measure {self.name} failed", self.compute):
            return self.compute(pair)

    def number(self, result: Any) -> float:
        """Return ``value(result)`` as a float; `ForeignError` if it is no number."""
        with foreign_errors(f"measure {self.name} failed", self.compute):
            try:
                return float(self.value(result))
            except ValueError as error:
                raise ForeignError(f"measure {self.name} failed: {one_line(error)}") from error

    def shown(self, value: float) -> str:
        """Return the text of a number in tables."""
        return f"{value:.{self.digits}f}"


MEASURES: dict[str, Measure] = {}
"""Registered measures by name. `known_measures` includes those of installed packages."""


def register_measure(measure: Measure) -> Measure:
    """Add a measure, for `measuring`, `report`, studies, tables and charts.

    Parameters
    ----------
    measure : Measure

    Returns
    -------
    Measure
        The same.

    Raises
    ------
    TypeError
        If it is no `Measure`.
    ValueError
        If its name is empty, not printable or taken.
    """
    if not isinstance(measure, Measure):
        raise TypeError(f"measure is a {type(measure).__name__}: a Measure is needed")
    if not (isinstance(measure.name, str) and measure.name.isidentifier()):
        raise ValueError(f"measure name is {measure.name!r}: letters, digits and underscores are needed")
    if MEASURES.get(measure.name, measure) != measure:
        raise ValueError(f"measure name {measure.name!r} is taken: another name is needed")
    MEASURES[measure.name] = measure
    return measure


def known_measures() -> dict[str, Measure]:
    """Return all measures by name, those of installed packages too.

    A package registers a measure by an entry point of the group ``raytrace_ii.measures`` that names a `Measure`,
    a list of them, or a module that calls `register_measure`.
    """
    _load_plugins()
    return MEASURES


@cache
def _load_plugins() -> None:
    """Register the measures of installed packages, once."""
    load_plugins(PLUGINS, "measure", register_measure)


def measure_of(name: str) -> Measure:
    """Return the measure of a name.

    Raises
    ------
    ValueError
        If there is none; the message lists the known names.
    """
    known = known_measures()
    if not isinstance(name, str) or name not in known:
        raise ValueError(f"unknown measure {name!r}: known are {', '.join(known)}")
    return known[name]
