"""Decoded views from a folder as a coder: for coders that run elsewhere.

``FOLDER/PICTURE/TARGET`` has the views, named as for external commands, and ``bytes.txt`` with the size of the coded
file, such as ``views/flowers/0.1/003_002.png``.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ii_core import IIPicture
from ii_core.base.files import read_text
from ii_core.formats.pleno import KINDS, read_pleno_views

from .profile import Reference
from .subject import Decoded, Subject

SIZE = "bytes.txt"


@dataclass
class Delivered:
    """Coder whose decoded views are in a folder.

    Parameters
    ----------
    folder : Path
    kind : {"ppm", "pgx", "ycbcr", "png"}
        Files of the views, as for `External`.
    rate_tolerance : float
        Share by which a file may exceed its target to meet it.
    """

    folder: Path
    kind: str = "png"
    rate_tolerance: float = 0.02
    _names: dict[str, str] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"unknown kind of views {self.kind!r}: known are {', '.join(KINDS)}")
        if not self.folder.is_dir():
            raise ValueError(f"{self.folder} is no folder: views of every picture at every target are needed")

    def named(self, reference: Reference, subject: Subject) -> Subject:
        """Keep which picture this is, and return it."""
        if not isinstance(subject, IIPicture):
            raise ValueError(f"{reference.name} is a video: only pictures are taken from a folder")
        self._names[_hash(subject)] = reference.name
        return subject

    def encode(self, subject: Subject, scheme: str, *, bpp: float) -> _Size:
        """Return the size that ``bytes.txt`` states; the data is the path of the views.

        Raises
        ------
        ValueError
            If there is no such folder, or its size is no positive whole number.
        """
        assert isinstance(subject, IIPicture)
        place = self.folder / self._names[_hash(subject)] / f"{bpp:g}"
        if not place.is_dir():
            raise ValueError(f"{place} is missing: a folder with views and {SIZE} is needed")
        text = read_text(place / SIZE).strip()
        if not text.isdigit() or int(text) < 1:
            raise ValueError(f"{place / SIZE} is {text[:40]!r}: the number of bytes of the coded file is needed")
        rate = 8 * int(text) / math.prod(subject.size)
        return _Size(int(text), str(place).encode(), rate, 0.0, rate <= bpp * (1 + self.rate_tolerance), subject)

    def decode(self, coded: _Size) -> Decoded:
        """Read the views; ValueError if one is missing or wrong."""
        assert isinstance(coded.like, IIPicture)
        return Decoded(read_pleno_views(Path(coded.data.decode()), coded.like, self.kind), 0.0)


@dataclass(frozen=True)
class _Size:
    """Size of a coded file that is elsewhere."""

    nbytes: int
    data: bytes
    bpp: float
    encode_seconds: float
    reached: bool
    like: Subject


def _hash(picture: IIPicture) -> str:
    return hashlib.sha256(np.ascontiguousarray(picture.pixels).data).hexdigest()
