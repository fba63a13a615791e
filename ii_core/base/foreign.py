"""Errors of coders and measures that other packages register."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from traceback import extract_tb

from .files import one_line
from .interrupt import STOPS


class ForeignError(RuntimeError):
    """A coder or measure of another package failed; the message names it, its error and the line."""


@contextlib.contextmanager
def foreign_errors(what: str, of: object) -> Iterator[None]:
    """Turn an error of another package's code into `ForeignError`: SystemExit and AttributeError, for example.

    ValueError, OSError and MemoryError, which speak of the input and the machine, pass. So do interrupts, and
    errors of our own code, except SystemExit.

    Parameters
    ----------
    what : str
        What failed, for the message.
    of : object
        A function, or an object of a class, whose module says whose code it is.
    """
    try:
        yield
    except (ValueError, OSError, MemoryError, ForeignError, *STOPS):
        raise
    except BaseException as error:
        if getattr(of, "__module__", "").partition(".")[0] in ("codec", "metrics") and isinstance(error, Exception):
            raise
        last = extract_tb(error.__traceback__)[-1]
        said = f": {one_line(error)}" if str(error) else ""
        raise ForeignError(f"{what}: {type(error).__name__}{said} ({last.filename}, line {last.lineno})") from error
