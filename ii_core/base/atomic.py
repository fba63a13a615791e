"""Atomic writes: files appear whole or not at all; temporary files of dead processes are removed."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
import socket
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path

# A temporary file's name holds machine, process and the process's start: enough to tell whether its writer lives.
TEMPORARY = re.compile(r"\..*\.ii-tmp-([0-9a-f]{8})-(\d+)-(\d+)-[0-9a-f]{8}(\.\w{1,15})?", re.DOTALL)
STEM = 40  # characters of the target's name that the temporary name keeps: names end at 255 bytes
# Errors of a disk, which come without the name of the file.
DISK = {getattr(errno, name, None) for name in ("ENOSPC", "EFBIG", "EDQUOT", "EIO")}

_live: set[Path] = set()
_swept: set[Path] = set()


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary name in the same folder that becomes ``path`` if the block succeeds; see `atomic_paths`."""
    with atomic_paths([path]) as (temporary,):
        yield temporary


@contextlib.contextmanager
def atomic_paths(paths: Sequence[str | os.PathLike[str]]) -> Iterator[list[Path]]:
    """Temporary names that become files together.

    The temporary files are flushed to the disk, all of them, before the first gets its final name; names are given
    in the order of ``paths``. A block that fails leaves what was there before. A symbolic link is followed.

    Parameters
    ----------
    paths : sequence of path
        Files to be written, all different.

    Yields
    ------
    list of Path
        A temporary name for each, in its folder and with its suffix.

    Raises
    ------
    ValueError
        If two paths name one file.
    OSError
        If a folder does not exist or cannot be written, a target is a folder or a device, or the disk is full.
    """
    targets = [_target(Path(path)) for path in paths]
    for i, target in enumerate(targets):
        if target in targets[:i]:
            raise ValueError(f"{os.fspath(paths[i])} is to be written twice: every output needs a name of its own")
    temporaries: list[Path] = []
    try:
        with disk_errors(*paths):
            for target in targets:
                temporaries.append(_create(target))  # noqa: PERF401 - those made are removed if one fails
            yield temporaries
            for temporary in temporaries:
                _flush(temporary)
            for temporary, target in zip(temporaries, targets, strict=True):
                os.replace(temporary, target)
    finally:
        for temporary in temporaries:
            temporary.unlink(missing_ok=True)
            _live.discard(temporary)


@contextlib.contextmanager
def folder_beside(path: Path) -> Iterator[Path]:
    """A folder for work beside a file, removed with its content; the next run removes that of a killed one."""
    folder = _create(path, folder=True)
    try:
        yield folder
    finally:
        _remove(folder)
        _live.discard(folder)


@contextlib.contextmanager
def atomic_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary folder that becomes the folder ``path`` if the block succeeds.

    A folder that is there already keeps its files, and gets the new ones at the end of the block.
    """
    target = Path(os.path.realpath(path))
    with disk_errors(path), folder_beside(target) as temporary:
        yield temporary
        try:
            os.replace(temporary, target)  # of no folder, or of an empty one
        except OSError:
            for file in sorted(temporary.rglob("*")):
                place = target / file.relative_to(temporary)
                if file.is_dir():
                    place.mkdir(parents=True, exist_ok=True)
                else:
                    place.parent.mkdir(parents=True, exist_ok=True)
                    os.replace(file, place)


@contextlib.contextmanager
def disk_errors(*paths: str | os.PathLike[str]) -> Iterator[None]:
    """Name the files in errors of a full or broken disk."""
    try:
        yield
    except OSError as error:
        if error.errno not in DISK:
            raise
        named = ", ".join(os.fspath(path) for path in paths)
        raise OSError(f"cannot write {named}: {error.strerror}") from error


def remove_temporaries() -> None:
    """Remove this process's unfinished files, for an exit that runs no cleanup."""
    for temporary in list(_live):
        with contextlib.suppress(OSError):
            _remove(temporary)


def _remove(temporary: Path) -> None:
    """Remove a temporary file, or a folder with its content."""
    if temporary.is_dir():
        shutil.rmtree(temporary, ignore_errors=True)
    else:
        temporary.unlink(missing_ok=True)


def _target(path: Path) -> Path:
    """Return the path of a file behind links; OSError if something other than a file is there."""
    real = Path(os.path.realpath(path))
    try:
        mode = real.stat().st_mode
    except OSError:
        return real
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(f"cannot write {path}: it is a folder")
    if not stat.S_ISREG(mode):
        raise OSError(f"cannot write {path}: it is a device, pipe or socket, and a regular file is needed")
    return real


def _create(target: Path, *, folder: bool = False) -> Path:
    """An empty temporary file or folder beside the target."""
    place = target.parent
    suffix = target.suffix if re.fullmatch(r"\.\w{1,15}", target.suffix) else ""
    pid = os.getpid()
    mark = f"ii-tmp-{_machine()}-{pid}-{_started(pid) or 0}-{secrets.token_hex(4)}"
    temporary = place / f".{target.stem[:STEM]}.{mark}{suffix}"
    _live.add(temporary)  # first: an interrupt may come at once after the file
    try:
        _sweep(place)
        if folder:
            temporary.mkdir()
        else:
            os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        _live.discard(temporary)
        raise type(error)(f"cannot write {target}: {error.strerror}") from None
    return temporary


def _flush(temporary: Path) -> None:
    """Have the disk take the content: a full one says so here at the latest."""
    with temporary.open("rb+") as file:
        try:
            os.fsync(file.fileno())
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # file systems without it
                raise


def _sweep(folder: Path) -> None:
    """Remove temporary files and folders in a folder whose writers are dead, once in the life of a process."""
    if folder in _swept:
        return
    _swept.add(folder)
    with os.scandir(folder) as entries:
        marked = [(entry.path, match) for entry in entries if (match := TEMPORARY.fullmatch(entry.name))]
    for path, match in marked:
        machine, pid, started = match[1], int(match[2]), match[3]
        # Without a start time, or from another machine, nobody can say whether the writer lives.
        if machine == _machine() and started != "0" and _started(pid) != started:
            with contextlib.suppress(OSError):
                _remove(Path(path))


def _machine() -> str:
    """A short name of this machine and its space of process numbers."""
    try:
        space = os.readlink("/proc/self/ns/pid")
    except OSError:
        space = ""
    return hashlib.sha256(f"{socket.gethostname()} {space}".encode()).hexdigest()[:8]


def _started(pid: int) -> str | None:
    """When a process started, in ticks since the machine did; None if it is dead or the system does not say."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    fields = status.rpartition(")")[2].split()
    return None if fields[0] == "Z" else fields[19]
