"""What every command shares: the app, checks of what is to be written, signs of life."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ii_core import IIPicture

app = typer.Typer(
    help="Integral imaging: synthesize, code and evaluate 3-D pictures.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Force = Annotated[bool, typer.Option("--force", help="Replace files that are there already.")]
Workers = Annotated[int | None, typer.Option(help="Threads; as many as cores if not given.")]


def load_any(path: Path) -> IIPicture:
    """An II-picture, or the one in a coded file."""
    from ii_core import IIPicture
    from ii_core.files import IMAGE_TYPES

    if path.suffix in IMAGE_TYPES:
        return IIPicture.load(path)
    from codec import decode

    return decode(path)


def check_picture(path: Path, dtype: str, force: bool) -> None:
    """Raise, before any work, unless a picture of this type can be written there."""
    from ii_core.files import image_types

    if dtype not in image_types(path):
        raise ValueError(f"{path} cannot hold {dtype} pixels: {path.suffix} takes {', '.join(image_types(path))}")
    check_output(path, force)


def check_output(path: Path, force: bool, *, make_folder: bool = False) -> None:
    """Raise, before any work, unless a file can be written there without losing another."""
    if make_folder:
        path.parent.mkdir(parents=True, exist_ok=True)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"cannot write {path}: {path.parent} is no folder")
    if not os.access(path.parent, os.W_OK):
        raise PermissionError(f"cannot write {path}: {path.parent} cannot be written")
    if path.exists() and not force:
        raise FileExistsError(f"{path} is there already: --force replaces it")


def check_folder(folder: Path, force: bool) -> None:
    """Make a folder to fill, unless it would mix with what is there."""
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()) and not force:
        raise FileExistsError(f"{folder} is not empty: --force writes into it all the same")


def columns(rows: dict[str, str]) -> None:
    """Names and what they are, in two columns."""
    width = max(map(len, rows), default=0)
    for name, text in rows.items():
        print(f"{name:<{width}}  {text}")


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int, str], None]]:
    """A bar on the terminal's error stream; yields what to call with done, total and a word on the last step."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, TextColumn("{task.fields[step]}"), console=Console(stderr=True))
    task = bar.add_task(title, total=None, step="")

    def report(done: int, total: int, step: str) -> None:
        bar.start()  # only now: what fails before its first step leaves no empty bar
        bar.update(task, completed=done, total=total, step=step)

    try:
        yield report
    finally:
        if bar.live.is_started:
            bar.stop()


@contextmanager
def spinner(title: str) -> Iterator[None]:
    """A sign of life on the terminal's error stream, for work whose steps cannot be counted."""
    from rich.console import Console

    with Console(stderr=True).status(title):
        yield
