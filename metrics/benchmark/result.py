"""Result files of the benchmark: one coder on one profile, with provenance."""

from __future__ import annotations

import datetime
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ii_core.base import checks
from ii_core.base.files import check_form, one_line, read_json, write_json

from ..rates.points import check_points, spelt, unspelt
from ..rates.rd import rate_distortion
from ..reports.study import provenance
from .profile import Profile, Reference
from .run_log import RunLog
from .subject import Subject, identity, measuring_subject

FORMAT, VERSION = "ii-benchmark", 1
NEEDED = {"profile", "coder", "pictures", "git", "machine", "versions", "date"}
Made = Callable[[Reference], Subject]


def run(
    profile: Profile,
    coder: str,
    made: Made,
    *,
    encode: Callable[..., Any],
    decode: Callable[[Any], Any],
    commands: Sequence[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    log: RunLog | None = None,
    means: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Run a coder on the pictures of a profile.

    Parameters
    ----------
    profile : Profile
    coder : str
        Scheme, or the name of external commands.
    made : callable
        ``made(reference)`` returns the picture or video; it is not called if all its points are in the log.
    encode, decode : callable
        As for `metrics.rate_distortion`.
    commands : sequence of str, optional
        External commands.
    progress : callable, optional
        ``progress(done, total, text)`` after every point.
    log : RunLog, optional
        Finished points, which are not measured again; every new point is added.
    means : mapping, optional
        ``workers`` or ``executor`` of `metrics.rate_distortion`; one worker if not given.

    Returns
    -------
    dict
        The result; `write_result` stores it.

    Raises
    ------
    ValueError
        If a point cannot be coded or does not decode: there is no result of a part. Or if the log has points of other
        pixels.
    """
    origin, date = provenance(), datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    total, rows = len(profile.pictures) * len(profile.rates_bpp), []
    for number, reference in enumerate(profile.pictures):
        done = number * len(profile.rates_bpp)

        def report(found: int, _: int, text: str, done: int = done, name: str = reference.name) -> None:
            if progress is not None:
                progress(done + found, total, f"{name}: {text}")

        rows.append(
            _row(
                profile,
                coder,
                reference,
                made,
                log,
                encode=encode,
                decode=decode,
                progress=report,
                **(means or {"workers": 1}),
            )
        )
    return {
        "profile": {"name": profile.name, "version": profile.version, "sha256": profile.digest},
        "coder": coder,
        "commands": None if commands is None else list(commands),
        **origin,
        "date": date,
        "pictures": rows,
    }


def _row(
    profile: Profile, coder: str, reference: Reference, made: Made, log: RunLog | None, **tools: Any
) -> dict[str, Any]:
    """Return a picture's identity and points; points of the log are not measured again."""
    known = {point["target_bpp"]: point for point in (log.points(reference.name) if log else ())}
    found = log.picture(reference.name) if log else None
    if found is None or set(profile.rates_bpp) - set(known):
        subject = made(reference)
        before, found = found, identity(reference.name, subject)
        if before is not None and before["sha256"] != found["sha256"]:
            raise ValueError(
                f"{reference.name} has pixels {found['sha256'][:12]}, finished points in {log and log.path} are of "
                f"{before['sha256'][:12]}: --force starts again"
            )
        of = found

        def keep(point: dict[str, Any]) -> None:
            if log is not None:
                log.keep(of, _judged(profile, point))

        try:
            points = rate_distortion(
                subject, [coder], profile.rates_bpp, keep=keep,
                known={(coder, rate): point for rate, point in known.items()},
                measure=measuring_subject(subject, profile.measures), **tools,
            )  # fmt: skip
        except ValueError as error:
            raise ValueError(f"{coder} on {reference.name}: {one_line(error)}") from error
    else:
        points = [known[rate] for rate in profile.rates_bpp]
    return {
        **found,
        "as_defined": reference.matches(found["sha256"]),
        "points": [_judged(profile, point) for point in points],
    }


def _judged(profile: Profile, point: Mapping[str, Any]) -> dict[str, Any]:
    """Return a point that counts as reached by the rule of the profile."""
    return {**point, "reached": profile.meets(point["bpp"], point["target_bpp"])}


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
        check_form(data, "no result of the benchmark", FORMAT, VERSION, NEEDED)
        if not isinstance(data["pictures"], list) or not data["pictures"]:
            raise ValueError("no result of the benchmark: a list of pictures is needed")
        for row in data["pictures"]:
            if not isinstance(row, dict) or not {"name", "sha256", "points"} <= set(row):
                raise ValueError("no result of the benchmark: a picture needs name, sha256 and points")
            check_points(row["points"])
            row["points"] = [unspelt(point) for point in row["points"]]
        if not isinstance(data["profile"], dict) or not {"name", "version", "sha256"} <= set(data["profile"]):
            raise ValueError("no result of the benchmark: profile needs name, version and sha256")
        named = [data, *data["pictures"], data["profile"]]
        for key in ("coder", "name", "sha256"):
            if wrong := [one[key] for one in named if not isinstance(one.get(key, ""), str)]:
                raise ValueError(f"no result of the benchmark: {key} is {checks.shown(wrong[0])}: text is needed")
    except ValueError as error:
        raise ValueError(f"{path}: {one_line(error)}") from None
    return data
