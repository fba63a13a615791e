"""Output folders; a command that fails removes the empty folders that it created."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

_created: list[Path] = []  # folders created by this command


def create_folder(folder: Path) -> None:
    """Create a folder and its parents."""
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    _created.extend(missing)


@contextlib.contextmanager
def no_empty_folders() -> Iterator[None]:
    """Remove the folders that `create_folder` has created and that are empty when the block ends."""
    _created.clear()
    try:
        yield
    finally:
        for folder in sorted(_created, key=lambda folder: len(folder.parts), reverse=True):
            with contextlib.suppress(OSError):  # it holds files
                folder.rmdir()
