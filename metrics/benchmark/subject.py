"""What a coder of the benchmark gets, a picture or a video: identity and measures."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ii_core import IIPicture, IIVideo

from ..measures.batch import measuring
from ..reports.study import picture_json

Subject = IIPicture | IIVideo


@dataclass(frozen=True)
class Decoded:
    """Decoded picture or video, and CPU seconds of the decoder.

    ``codes`` are the YCbCr codes of 10 bit that the coder returned, (N, M, 3), for measures of the common test
    conditions; None if it returned RGB. ``more`` are further numbers of the point.
    """

    picture: Subject
    seconds: float
    codes: NDArray[Any] | None = None
    more: Mapping[str, float] = field(default_factory=dict)


def identity(name: str, subject: Subject) -> dict[str, Any]:
    """Return the identity of a picture as `picture_json` does, or of a video: the hash is that of all its frames."""
    if isinstance(subject, IIPicture):
        return picture_json(name, subject)
    hashed = hashlib.sha256()
    for frame in subject:
        hashed.update(np.ascontiguousarray(frame.pixels).data)
    of_frame = picture_json(name, subject.structure)
    return {**of_frame, "sha256": hashed.hexdigest(), "frames": subject.frames, "fps": float(subject.fps)}


def measuring_subject(reference: Subject, names: Sequence[str]) -> Callable[[Any], dict[str, Any]]:
    """Return a function that measures what was decoded; values of a video are means over its frames.

    It leaves Q_global to `rate_distortion`, which pools the errors of all frames.

    Raises
    ------
    ValueError
        As `measuring`.
    """
    names = [name for name in names if name != "q_global"]
    if isinstance(reference, IIPicture):
        return measuring(reference, names)
    measuring(reference[0], names)  # refuses before anything is coded

    def measure(decoded: IIVideo) -> dict[str, Any]:
        rows = [measuring(before, names)(after) for before, after in zip(reference, decoded, strict=True)]
        return {name: fmean(row[name] for row in rows) for name in names}

    return measure
