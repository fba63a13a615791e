"""The command ``raytrace-ii``: render, code, measure and study II-pictures.

The only package that reaches every other; it does so inside its functions, so that help comes at once.
"""

from __future__ import annotations

import sys
import warnings
from typing import Any

import typer

from . import synthesize, render, pictures, coding, evaluate, show
from .common import app

__all__ = ["app", "coding", "evaluate", "main", "pictures", "render", "show", "synthesize"]

INTERRUPTED = 130  # the exit code of a command that Ctrl-C ended


def main() -> None:
    """Run the command; a bad input is one line on the error stream and exit code 2, a warning one line."""
    warnings.showwarning = _warn
    try:
        code = app(standalone_mode=False)
        if code == INTERRUPTED:  # what typer makes of Ctrl-C
            print("interrupted", file=sys.stderr)
        sys.exit(code if isinstance(code, int) else 0)
    except (ValueError, OSError, MemoryError) as error:
        _fail(str(error) or type(error).__name__)
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except Exception as error:
        # A wrong option or argument: typer's own complaint, without its frame.
        if not hasattr(error, "format_message"):
            raise
        _fail(error.format_message())


def _warn(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None, line: Any = None
) -> None:
    print(f"warning: {' '.join(str(message).split())}", file=sys.stderr)


def _fail(message: str) -> None:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)
