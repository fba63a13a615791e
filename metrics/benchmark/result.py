"""Result files of the benchmark: one coder on one profile, with provenance."""

from __future__ import annotations

import datetime
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ii_core import IIPicture
from ii_core.files import one_line, read_json, write_json

from ..batch import measuring
from ..points import check_points, spelt, unspelt
from ..rd import rate_distortion
from ..study import picture_json, provenance
from .profile import Profile, Reference

FORMAT, VERSION = "ii-benchmark", 1
NEEDED = {"profile", "coder", "pictures", "git", "machine", "versions", "date"}
Made = Callable[[Reference], IIPicture]


def run(
    profile: Profile,
    coder: str,
    pictures: Iterable[tuple[Reference, IIPicture]],
    *,
    encode: Callable[..., Any],
    decode: Callable[[Any], Any],
    commands: Sequence[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> dict[str, Any]:
    """Run a coder on the pictures of a profile.

    Parameters
    ----------
    profile : Profile
    coder : str
        Scheme, or the name of external commands.
    pictures : iterable of (Reference, IIPicture)
    encode, decode : callable
        As for `metrics.rate_distortion`.
    commands : sequence of str, optional
        External commands.
    progress : callable, optional
        ``progress(done, total, text)`` after every point.

    Returns
    -------
    dict
        The result; `write_result` stores it.

    Raises
    ------
    ValueError
        If a point cannot be coded or does not decode: no partial results are kept.
    """
    date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    total, rows = len(profile.pictures) * len(profile.rates_bpp), []
    for number, (reference, picture) in enumerate(pictures):
        made = picture_json(reference.name, picture)

        def report(done: int, _: int, text: str, number: int = number, name: str = reference.name) -> None:
            if progress is not None:
                progress(number * len(profile.rates_bpp) + done, total, f"{name}: {text}")

        try:
            points = rate_distortion(
                picture, [coder], profile.rates_bpp, encode=encode, decode=decode, progress=report, workers=1,
                measure=measuring(picture, [name for name in profile.measures if name != "q_global"]),
            )  # fmt: skip
        except ValueError as error:
            raise ValueError(f"{coder} on {reference.name}: {one_line(error)}") from error
        for point in points:
            point["reached"] = profile.meets(point["bpp"], point["target_bpp"])
        rows.append({**made, "as_defined": _as_defined(reference, made["sha256"]), "points": points})
    return {
        "profile": {"name": profile.name, "version": profile.version, "sha256": profile.digest},
        "coder": coder,
        "commands": None if commands is None else list(commands),
        **provenance(),
        "date": date,
        "pictures": rows,
    }


def _as_defined(reference: Reference, found: str) -> bool | None:
    """Return whether a picture is the one of the profile; None if the profile does not fix it."""
    return None if reference.sha256 is None else reference.sha256 == found


def write_result(path: str | os.PathLike[str], result: Mapping[str, Any]) -> Path:
    """Write a result, whole or not at all."""
    pictures = [{**row, "points": [spelt(dict(point)) for point in row["points"]]} for row in result["pictures"]]
    return write_json(path, {"format": FORMAT, "version": VERSION, **result, "pictures": pictures})


def read_result(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return a result of `write_result`.

    Raises
    ------
    ValueError
        If the file is no result of the benchmark.
    OSError
        If it cannot be read.
    """
    data = read_json(path)
    try:
        if not isinstance(data, dict) or data.get("format") != FORMAT or data.get("version") != VERSION:
            raise ValueError(f'no result of the benchmark: needs "format": "{FORMAT}", "version": {VERSION}')
        if missing := NEEDED - set(data):
            raise ValueError(f"no result of the benchmark: {', '.join(sorted(missing))} missing")
        if not isinstance(data["pictures"], list) or not data["pictures"]:
            raise ValueError("no result of the benchmark: a list of pictures is needed")
        for row in data["pictures"]:
            if not isinstance(row, dict) or not {"name", "sha256", "points"} <= set(row):
                raise ValueError("no result of the benchmark: a picture needs name, sha256 and points")
            check_points(row["points"])
            row["points"] = [unspelt(point) for point in row["points"]]
        if not isinstance(data["profile"], dict) or not {"name", "version", "sha256"} <= set(data["profile"]):
            raise ValueError("no result of the benchmark: profile needs name, version and sha256")
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from None
    return data
