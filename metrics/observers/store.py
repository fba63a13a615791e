"""Folder of results on a server: one append-only file per observer."""

from __future__ import annotations

import os
import re
import threading
from pathlib import Path

from ii_core.base.atomic import disk_errors

from .results import MOST_BYTES, checked_lines, read_observer

NAME = re.compile(r"observer-(\d+)\.jsonl")


class ResultFolder:
    """Files ``observer-001.jsonl`` and so on of one test.

    Parameters
    ----------
    folder : path
        Made if missing.
    plan : str
        Text of the test's plan. Results of another test in the folder are refused.

    Raises
    ------
    ValueError
        If the folder holds a result of another test, or one that cannot be read.
    OSError
        If the folder cannot be made.
    """

    def __init__(self, folder: str | os.PathLike[str], plan: str) -> None:
        self.folder, self.plan, self._lock = Path(folder), plan, threading.Lock()
        self.folder.mkdir(parents=True, exist_ok=True)
        for number in self.numbers():
            path = self.path(number)
            if path.stat().st_size and read_observer(path)[0] != plan:
                raise ValueError(f"{path} is of another test: another folder is needed")

    def path(self, number: int) -> Path:
        """Return the file of an observer."""
        return self.folder / f"observer-{number:03d}.jsonl"

    def numbers(self) -> list[int]:
        """Return the numbers of the observers so far."""
        return sorted(int(found[1]) for path in self.folder.iterdir() if (found := NAME.fullmatch(path.name)))

    def new_observer(self) -> int:
        """Make the empty file of a new observer and return the number."""
        with self._lock:
            number = max(self.numbers(), default=0) + 1
            with self.path(number).open("x"):
                return number

    def extend(self, number: int, data: bytes) -> None:
        """Append the lines of an observer that the file lacks, and flush them to the disk.

        Parameters
        ----------
        number : int
        data : bytes
            All lines of the observer so far.

        Raises
        ------
        FileNotFoundError
            If there is no observer of this number.
        ValueError
            If the lines are not whole, belong to another test, or do not begin with the lines of the file.
        """
        path = self.path(number)
        if not path.is_file():
            raise FileNotFoundError(f"there is no observer of number {number}")
        if len(data) > MOST_BYTES or not data.endswith(b"\n"):
            raise ValueError(f"results of {len(data)} bytes: whole lines of at most {MOST_BYTES >> 20} MB are needed")
        first = checked_lines(data, "result")[0]
        if (first.get("plan"), first.get("observer")) != (self.plan, number):
            raise ValueError("result is of another test or observer")
        with self._lock, disk_errors(path), path.open("r+b") as file:
            held = file.read()
            if not data.startswith(held):
                if held.startswith(data):  # a late request: the file holds these lines already
                    return
                raise ValueError(f"{path.name} holds other lines: nothing is replaced")
            file.write(data[len(held) :])
            file.flush()
            os.fsync(file.fileno())
