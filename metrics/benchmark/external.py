"""External commands as a coder: the encoder reads files of views, the decoder writes them.

Of a video, each frame has a folder of its own, ``frame_0000`` and on.

Commands run without a shell, in folders of their own, with a time limit. The folder of the decoder holds nothing but
the coded file.
"""

from __future__ import annotations

import math
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from ii_core import IIPicture, video_of
from ii_core.base.files import one_line
from ii_core.formats.pleno import KINDS, make_view_folder, read_pleno_views, write_pleno_views

from .subject import Decoded, Subject

KNOWN = (
    "{in}", "{out}", "{bpp}", "{bytes}", "{rows}", "{columns}", "{width}", "{height}", "{frames}", "{fps}"
)  # fmt: skip
MAX_OUTPUT = 300  # characters of a failed command's output that the message quotes


class Refused(ValueError):
    """The benchmark refuses a coder: a command fails, runs too long, or returns no picture."""


@dataclass(frozen=True)
class ExternalFile:
    """Coded file of an external command; ``like`` is what was coded."""

    data: bytes
    bpp: float
    encode_seconds: float
    reached: bool
    like: Subject

    @property
    def nbytes(self) -> int:
        """Size of the file."""
        return len(self.data)


@dataclass(frozen=True, kw_only=True)
class External:
    """Coder of two external commands.

    Parameters
    ----------
    encoder, decoder : str
        Commands, split by a shell's rules, but run without one. Both need ``{in}`` and ``{out}``: for the encoder the
        folder of views and the coded file, for the decoder the coded file and the folder of views. Optional are
        ``{bpp}``, ``{bytes}`` (the target), ``{rows}``, ``{columns}`` (views), ``{width}``, ``{height}`` (of a view),
        ``{frames}`` (1 for a picture), ``{fps}`` (0 for a picture).
    kind : {"ppm", "pgx", "ycbcr", "png"}
        Files of the views: binary PPM of 10 bit, PGX of 10 bit in folders 0, 1 and 2 of red, green and blue or of Y,
        Cb and Cr, or PNG of 8 bit; named CCC_RRR, the column first.
    seconds : float
        Limit of each command.
    rate_tolerance : float
        Share by which a file may exceed its target to meet it.

    Raises
    ------
    ValueError
        If a command cannot be split, is empty, lacks a placeholder, has an unknown one, or its program is not found.
    """

    encoder: str
    decoder: str
    kind: str = "ppm"
    seconds: float = 3600.0
    rate_tolerance: float = 0.02

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"unknown kind of views {self.kind!r}: known are {', '.join(KINDS)}")
        for name, command in (("encoder", self.encoder), ("decoder", self.decoder)):
            words = _split(name, command)
            for needed in ("{in}", "{out}"):
                if not any(needed in word for word in words):
                    raise ValueError(f"{name} {command!r} has no {needed}: both {{in}} and {{out}} are needed")
            if unknown := sorted(set(re.findall(r"\{\w*\}", command)) - set(KNOWN)):
                raise ValueError(f"{name} {command!r} has an unknown {unknown[0]}: known are {', '.join(KNOWN)}")
            if shutil.which(words[0]) is None:
                raise ValueError(f"{name}: program {words[0]!r} is not found")

    def encode(self, subject: Subject, scheme: str, *, bpp: float) -> ExternalFile:
        """Code a picture or a video at a rate; the arguments are those of `metrics.rate_distortion`.

        Raises
        ------
        Refused
            If the command fails, runs too long or writes nothing.
        """
        with _folder() as folder:
            views, out = folder / "views", folder / "coded"
            places = _places(subject, views)
            for place, picture in zip(places, [subject] if isinstance(subject, IIPicture) else subject, strict=True):
                write_pleno_views(picture, place, self.kind)
            pixels = len(places) * math.prod(subject.size)
            values = _values(subject) | {
                "{in}": str(views),
                "{out}": str(out),
                "{bpp}": f"{bpp:.6g}",
                "{bytes}": str(int(bpp * pixels / 8)),
            }
            seconds = self._run("encoder", self.encoder, values, folder)
            if not out.is_file() or not out.stat().st_size:
                raise Refused(f"encoder wrote no file at {bpp:g} bpp: {{out}} is one file")
            data = out.read_bytes()
        rate = 8 * len(data) / pixels
        return ExternalFile(data, rate, seconds, rate <= bpp * (1 + self.rate_tolerance), subject)

    def decode(self, coded: ExternalFile) -> Decoded:
        """Decode a file in a folder that holds nothing else.

        Raises
        ------
        Refused
            If the command fails, runs too long, or views are missing or wrong.
        """
        with _folder() as folder:
            like, source, views = coded.like, folder / "coded", folder / "views"
            source.write_bytes(coded.data)
            places = _places(like, views)
            for place in places:
                make_view_folder(place, self.kind)
            values = _values(like) | {"{in}": str(source), "{out}": str(views)}
            seconds = self._run("decoder", self.decoder, values, folder)
            try:
                found = [read_pleno_views(place, _still(like), self.kind) for place in places]
            except (ValueError, OSError) as error:
                raise Refused(f"decoder: {one_line(error)}") from None
        return Decoded(found[0] if isinstance(like, IIPicture) else video_of(found, fps=like.fps), seconds)

    def _run(self, name: str, command: str, values: dict[str, str], folder: Path) -> float:
        """Run a command; return its CPU seconds."""
        words = [_filled(word, values) for word in _split(name, command)]
        before = _children_seconds()
        with (folder / "said").open("wb") as said:
            started = subprocess.Popen(
                words, cwd=folder, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True
            )
            try:
                code = started.wait(self.seconds)
            except subprocess.TimeoutExpired:
                raise Refused(f"{name} ran longer than {self.seconds:g} s: it was ended") from None
            finally:
                _end(started)
        if code:
            text = one_line((folder / "said").read_bytes()[-MAX_OUTPUT:].decode("utf-8", "replace"))
            raise Refused(f"{name} ended with code {code}: {text or 'without output'}")
        return _children_seconds() - before


def _still(subject: Subject) -> IIPicture:
    """Return a picture of the structure."""
    return subject if isinstance(subject, IIPicture) else subject.structure


def _places(subject: Subject, folder: Path) -> list[Path]:
    """Return the folder of a picture's views, or those of the frames of a video."""
    if isinstance(subject, IIPicture):
        return [folder]
    return [folder / f"frame_{number:04}" for number in range(subject.frames)]


def _values(subject: Subject) -> dict[str, str]:
    frames, fps = (1, 0.0) if isinstance(subject, IIPicture) else (subject.frames, subject.fps)
    (columns, rows), (width, height) = _still(subject).ei_pixels, _still(subject).lenses
    return {
        "{rows}": str(rows), "{columns}": str(columns), "{width}": str(width), "{height}": str(height),
        "{frames}": str(frames), "{fps}": f"{fps:g}", "{bpp}": "", "{bytes}": "",
    }  # fmt: skip


def _split(name: str, command: str) -> list[str]:
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise ValueError(f"{name} {command!r} cannot be split into words: {error}") from None
    if not words:
        raise ValueError(f"{name} is empty: a command is needed")
    return words


def _filled(word: str, values: dict[str, str]) -> str:
    for key, value in values.items():
        word = word.replace(key, value)
    return word


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a command with all processes of its session."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _children_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def _folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="raytrace-ii-") as folder:
        yield Path(folder)
