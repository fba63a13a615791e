"""Profiles of the benchmark: pictures, rates, measures and rules; one TOML file per profile and version."""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import assets
from ii_core import IICamera, IIPicture, preset
from ii_core.base import checks
from ii_core.base.files import one_line, read_text

from ..measures.measure import measure_of
from .source import Source, source_of

FIELDS = {
    "name",
    "version",
    "about",
    "rates_bpp",
    "measures",
    "rank_by",
    "anchor",
    "rate_tolerance",
    "seconds",
    "picture",
}
MAX_FRAMES = 10_000
PICTURE = {"name", "use", "scene", "frames", "camera", "scale", "samples", "at_mm", "sha256"}
PHOTOGRAPH = {"name", "use", "views", "view_pixels", "sha256", "source", "middle"}


@dataclass(frozen=True, kw_only=True)
class Reference:
    """Reference picture or II-video, rendered or photographed, and the hash of its pixels.

    Parameters
    ----------
    name, use : str
        Name, and what the picture is for.
    scene : str
        Scene of the package; empty for a photograph.
    frames : int, optional
        First frames of the scene's take that form a video; None for a still.
    camera : str or mapping, optional
        Camera of the package, or its values; None for a photograph.
    scale, samples : int
    at_mm : (x, y, z)
        Place of the camera in the scene.
    sha256 : str, optional
        SHA-256 of the pixels, of a video those of all frames in order; None if not fixed yet.
    views, view_pixels : (int, int), optional
        Columns and rows of a photograph's views, and width and height of a view.
    middle : bool
        Whether these are the middle views of the stored photograph, and the middle of each.
    source : Source, optional
        Where a photograph is had.
    """

    name: str
    use: str
    scene: str = ""
    camera: Any = None
    frames: int | None = None
    scale: int = 1
    samples: int = 1
    at_mm: tuple[float, ...] = (0.0, 0.0, 0.0)
    sha256: str | None = None
    views: tuple[int, int] | None = None
    view_pixels: tuple[int, int] | None = None
    middle: bool = False
    source: Source | None = None

    def made_camera(self) -> IICamera:
        """Return the camera of a rendered picture."""
        if isinstance(self.camera, str):
            return preset(self.camera, scale=self.scale)
        return IICamera.from_json({"name": self.name, **self.camera})

    def part(self, picture: IIPicture) -> IIPicture:
        """Return the part of a stored photograph that the definition takes.

        Raises
        ------
        ValueError
            If the photograph is smaller.
        """
        if not self.middle or self.views is None or self.view_pixels is None:
            return picture
        (columns, rows), (width, height) = self.views, self.view_pixels
        field = picture.light_field
        spans = []
        for name, few, most in zip("TSVU", (height, width, rows, columns), field.shape, strict=False):
            if few > most:
                raise ValueError(f"{self.name} has {name} = {most}: at least {few} is needed")
            spans.append(slice((most - few) // 2, (most - few) // 2 + few))
        pixels = field[tuple(spans)].transpose(0, 2, 1, 3, 4).reshape(height * rows, width * columns, 3)
        return IIPicture(np.ascontiguousarray(pixels), (width, height), (columns, rows))

    def matches(self, sha256: str) -> bool | None:
        """Return whether pixels of this hash are those of the definition; None if it does not fix them."""
        return None if self.sha256 is None else self.sha256 == sha256


@dataclass(frozen=True, kw_only=True)
class Profile:
    """Definition of a benchmark.

    Parameters
    ----------
    name : str
    version : int
        Results of different versions are never ranked together.
    about : str
    rates_bpp : tuple of float
        Targets: bits of the coded file per pixel of the II-picture, of all frames of a video.
    measures : tuple of str
        Registered measures.
    rank_by : str
        The measure of the ranking.
    anchor : str
        Coder whose curve Bjøntegaard differences refer to.
    rate_tolerance : float
        A file meets a target if it is at most this share larger.
    seconds : float
        Time limit of one external command.
    pictures : tuple of Reference
    digest : str
        SHA-256 of the file, which results name.
    """

    name: str
    version: int
    about: str
    rates_bpp: tuple[float, ...]
    measures: tuple[str, ...]
    rank_by: str
    anchor: str
    rate_tolerance: float
    seconds: float
    pictures: tuple[Reference, ...]
    digest: str

    def meets(self, bpp: float, target: float) -> bool:
        """Return whether a rate counts as that target."""
        return bpp <= target * (1 + self.rate_tolerance)

    def only(self, names: Iterable[str]) -> Profile:
        """Return the profile with some of its pictures, in its order.

        Raises
        ------
        ValueError
            If no picture has one of the names.
        """
        asked, known = set(names), [reference.name for reference in self.pictures]
        if unknown := sorted(asked - set(known)):
            raise ValueError(f"{self.name} has no picture {unknown[0]!r}: known are {', '.join(known)}")
        return replace(self, pictures=tuple(one for one in self.pictures if one.name in asked))


def profile_names() -> dict[str, str]:
    """Return the names of the profiles of the package with a description in one line."""
    return {path.stem: profile(path.stem).about for path in sorted(_folder().glob("*.toml"))}


@checks.checked(name=checks.path)
def profile(name: str) -> Profile:
    """Return a profile by name or from a file that ends in ``.toml``.

    Raises
    ------
    ValueError
        If the name is unknown, or the file is no profile.
    OSError
        If the file cannot be read.
    """
    path = Path(name)
    if path.suffix != ".toml":
        path = _folder() / f"{name}.toml"
        if "/" in str(name) or not path.is_file():
            known = ", ".join(p.stem for p in sorted(_folder().glob("*.toml")))
            raise ValueError(f"unknown profile {str(name)!r}: known are {known}, or give a .toml file")
    text = read_text(path)
    try:
        return _profile(tomllib.loads(text), hashlib.sha256(text.encode()).hexdigest())
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{path}: {one_line(error)}") from None


def _profile(data: Mapping[str, Any], digest: str) -> Profile:
    _check_keys("profile", data, FIELDS)
    rates = tuple(checks.number("rates_bpp", rate) for rate in data["rates_bpp"])
    if not rates or list(rates) != sorted(set(rates)) or not (rates[0] > 0 and math.isfinite(rates[-1])):
        raise ValueError(f"rates_bpp are {list(rates)}: positive rates, each larger than the one before, are needed")
    measures = tuple(measure_of(name).name for name in data["measures"])
    if data["rank_by"] not in measures:
        raise ValueError(f"rank_by is {data['rank_by']!r}: one of the measures, {', '.join(measures)}, is needed")
    pictures = tuple(_reference(values) for values in data["picture"])
    names = [picture.name for picture in pictures]
    if not names or len(set(names)) != len(names):
        raise ValueError(f"pictures are {names}: at least one, each of its own name, is needed")
    return Profile(
        name=str(data["name"]),
        version=checks.whole("version", data["version"]),
        about=str(data["about"]),
        rates_bpp=rates,
        measures=measures,
        rank_by=data["rank_by"],
        anchor=str(data["anchor"]),
        rate_tolerance=checks.within("rate_tolerance", data["rate_tolerance"], 0, 1),
        seconds=checks.within("seconds", data["seconds"], 1, 1e6),
        pictures=pictures,
        digest=digest,
    )


def _reference(values: Mapping[str, Any]) -> Reference:
    if "source" in values:
        return _photograph(values)
    _check_keys("picture", values, PICTURE, optional={"frames", "scale", "samples", "at_mm", "sha256"})
    given = dict(values)
    if "frames" in given:
        checks.whole_from(1, MAX_FRAMES)("frames", given["frames"])
    if "at_mm" in given:
        given["at_mm"] = checks.place("at_mm", given["at_mm"], 3)
    return Reference(**given)


def _photograph(values: Mapping[str, Any]) -> Reference:
    _check_keys("photograph", values, PHOTOGRAPH, optional={"middle"})
    checks.flag("middle", values.get("middle", False))
    sizes: Any = {name: checks.whole_pair(name, values[name]) for name in ("views", "view_pixels")}
    return Reference(**{**values, **sizes, "source": source_of(values["source"])})


def _check_keys(what: str, data: Mapping[str, Any], known: set[str], optional: set[str] | None = None) -> None:
    if unknown := set(data) - known:
        raise ValueError(f"{what} has no {', '.join(sorted(unknown))}: known are {', '.join(sorted(known))}")
    if missing := known - set(data) - (optional or set()):
        raise ValueError(f"{what}: {', '.join(sorted(missing))} missing")


def _folder() -> Path:
    return Path(str(files(assets) / "benchmarks"))
