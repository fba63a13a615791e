"""Command line ``raytrace-ii``: render, code, measure and study II-pictures.

Only this package imports all others. It does so inside functions, so that help starts quickly.
"""

from __future__ import annotations

import io
import sys
import warnings
from typing import Any

import typer

from . import synthesize, render, pictures, calibrating, coding, evaluate, benchmarking, show, eye
from . import depth, focus, measure_depth, observers, retarget, video
from .common import app
from .ending import ends_soon, no_empty_folders
from .words import SPELT, one_line

__all__ = [
    "app",
    "benchmarking",
    "calibrating",
    "coding",
    "depth",
    "evaluate",
    "eye",
    "focus",
    "main",
    "measure_depth",
    "observers",
    "pictures",
    "render",
    "retarget",
    "show",
    "synthesize",
    "video",
]

INTERRUPTED = 130  # exit code of a command ended by Ctrl-C
TERMINATED = 143  # exit code of a command ended by SIGTERM


def main() -> None:
    """Run the command; print one line on the error stream for bad input (exit code 2) and for each warning."""
    warnings.showwarning = _warn
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=SPELT)
    with ends_soon():
        _run()


def _run() -> None:
    try:
        with no_empty_folders():
            code = app(args=sys.argv[1:], standalone_mode=False)
        if code == INTERRUPTED:  # typer's return value after Ctrl-C
            print("interrupted", file=sys.stderr)
        sys.exit(code if isinstance(code, int) else 0)
    except (ValueError, OSError, MemoryError, ArithmeticError) as error:
        _fail(str(error) or type(error).__name__)
    except SystemExit as end:
        if end.code == TERMINATED:
            print("interrupted", file=sys.stderr)
        raise
    except ImportError as error:
        from ii_core.base.extras import NotInstalled

        if not isinstance(error, NotInstalled):
            raise
        _fail(str(error))
    except RecursionError:
        _fail("the input nests too deeply")
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except Exception as error:
        if hasattr(error, "format_message"):  # a wrong option or argument: typer's own message, without its frame
            _fail(error.format_message())
        from ii_core.base.foreign import ForeignError

        if not isinstance(error, ForeignError):
            raise
        _fail(str(error))


def _warn(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None, line: Any = None
) -> None:
    if not issubclass(category, DeprecationWarning):  # for programmers: of libraries that dask makes audible
        print(f"warning: {one_line(str(message))}", file=sys.stderr)


def _fail(message: str) -> None:
    print(f"error: {one_line(message)}", file=sys.stderr)
    sys.exit(2)
