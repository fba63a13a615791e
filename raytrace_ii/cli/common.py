"""Common parts of commands: the app, checks of outputs, progress bars."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .folders import create_folder
from .words import one_line, say

if TYPE_CHECKING:
    from rich.console import Console

    from ii_core import IIPicture

app = typer.Typer(
    help="Integral imaging: synthesize, code and evaluate 3-D pictures.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Force = Annotated[bool, typer.Option("--force", help="Replace existing files.")]
Workers = Annotated[int | None, typer.Option(help="Number of threads; the number of cores by default.")]


def load_any(path: Path) -> IIPicture:
    """Return an II-picture from its file or from a coded file."""
    from ii_core import IIPicture
    from ii_core.files import IMAGE_TYPES, check_file

    if path.suffix in IMAGE_TYPES:
        return IIPicture.load(path)
    from codec import decode

    check_file(path)
    return decode(path)


def image_file(path: Path | None, dtype: str) -> list[Path]:
    """Return the file of a plain image for `check_outputs`, none for None.

    Raises
    ------
    ValueError
        If the file type cannot store the pixel type.
    """
    from ii_core.files import check_type

    if path is None:
        return []
    check_type(path, dtype)
    return [path]


def picture_files(path: Path, dtype: str) -> list[Path]:
    """Return the files of an II-picture for `check_outputs`: picture and sidecar."""
    from ii_core.picture import sidecar

    return [*image_file(path, dtype), sidecar(path)]


def check_outputs(paths: Iterable[Path], force: bool, *, make_folder: bool = False) -> None:
    """Raise an error, before any work, unless all files of a command can be written without loss of others.

    Parameters
    ----------
    paths : iterable of Path
        All files that the command writes, with sidecars.
    force : bool
        Replace existing files; folders, devices and pipes are never replaced.
    make_folder : bool
        Create missing folders; a command that fails removes those that are still empty.
    """
    from ii_core.files import check_name

    files = list(paths)
    seen: set[str] = set()
    for path in files:
        check_name(path)
        _check_place(path.parent, path, make_folder)
        if path.is_dir():
            raise IsADirectoryError(f"cannot write {path}: it is a folder")
        if path.exists() and not path.is_file():
            raise OSError(f"cannot write {path}: it is a device, pipe or socket, and a regular file is needed")
        if os.path.lexists(path) and not force:
            raise FileExistsError(f"{path} is there already: --force replaces it")
        if (real := os.path.realpath(path)) in seen:
            raise ValueError(f"{path} is to be written twice: every output needs a name of its own")
        seen.add(real)
    for path in files if make_folder else ():
        create_folder(path.parent)


def _check_place(folder: Path, path: Path, make_folder: bool) -> None:
    """Raise an error unless a folder exists, or can be created, and can be written."""
    if make_folder:
        folder = next(place for place in (folder, *folder.parents) if place.exists() or place == place.parent)
    if not folder.is_dir():
        raise FileNotFoundError(f"cannot write {path}: {folder} is no folder")
    if not os.access(folder, os.W_OK):
        raise PermissionError(f"cannot write {path}: {folder} cannot be written")


def check_folder(folder: Path, force: bool) -> None:
    """Create an output folder; raise an error if it is not empty."""
    create_folder(folder)
    if any(folder.iterdir()) and not force:
        raise FileExistsError(f"{folder} is not empty: --force writes into it all the same")


def pair(name: str, text: str, limit: int = 1 << 16) -> tuple[int, int]:
    """Return two numbers from text like 9x9."""
    try:
        a, b = (int(part) for part in text.lower().replace("×", "x").split("x"))
    except ValueError:
        a = b = 0
    if not (1 <= a <= limit and 1 <= b <= limit):
        raise ValueError(f"{name} is {text!r}: two whole numbers from 1 to {limit} as in 9x9 are needed")
    return a, b


def columns(rows: dict[str, str]) -> None:
    """Print names and descriptions in two columns."""
    width = max(map(len, rows), default=0)
    for name, text in rows.items():
        say(f"{name:<{width}}  {text}")


def console(**options: Any) -> Console:
    """Return a console without markup: brackets and colons are printed unchanged."""
    from rich.console import Console

    return Console(markup=False, emoji=False, highlight=False, **options)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int, str], None]]:
    """Show a progress bar on the error stream; yield a function of done, total and a text on the last step."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    named = TextColumn("{task.description}", markup=False)
    columns = (named, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, TextColumn("{task.fields[step]}", markup=False), console=console(stderr=True))
    task = bar.add_task(one_line(title), total=None, step="")

    def report(done: int, total: int, step: str) -> None:
        bar.start()  # late start: a failure before the first step leaves no empty bar
        bar.update(task, completed=done, total=total, step=one_line(step))

    try:
        yield report
    finally:
        if bar.live.is_started:
            bar.stop()


@contextmanager
def spinner(title: str) -> Iterator[None]:
    """Show a spinner on the error stream, for work without countable steps."""
    from rich.text import Text

    out = console(stderr=True)
    with out.status(Text(one_line(title)), spinner="dots" if out.encoding.startswith("utf") else "line"):
        yield
