"""Option ``--plugin``: Python files that register coders and measures."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from typing import Annotated

import typer

Plugins = Annotated[
    list[Path] | None,
    typer.Option("--plugin", help="A Python file that registers coders or measures; may be repeated."),
]


def load_plugins(paths: Sequence[Path] | None) -> None:
    """Run the files.

    Raises
    ------
    ValueError
        If a file is no Python file, fails, or registers nothing.
    OSError
        If it cannot be read.
    """
    for path in paths or ():
        before = _registered()
        _run(path)
        if _registered() == before:
            raise ValueError(
                f"plugin {path} registers nothing: codec.register(coder) or "
                "metrics.register_measure(measure) is needed"
            )


def _run(path: Path) -> None:
    from ii_core.base.files import check_file, one_line
    from ii_core.base.interrupt import STOPS

    check_file(path)
    if path.suffix != ".py":
        raise ValueError(f"plugin {path} is no Python file: .py is needed")
    spec = spec_from_file_location(f"plugin_{path.stem}", path)
    assert spec is not None and spec.loader is not None  # a .py file always has both
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # classes of the file can be pickled
    try:
        spec.loader.exec_module(module)
    except STOPS:
        raise
    except BaseException as error:  # also SystemExit
        del sys.modules[spec.name]
        lines = [frame.lineno for frame in extract_tb(error.__traceback__) if frame.filename == str(path.resolve())]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
        where = f"{path}, line {line}" if line else str(path)
        raise ValueError(f"plugin {where}: {type(error).__name__}: {one_line(error)}") from error


def _registered() -> set[str]:
    """Return the names of all coders and measures."""
    from codec import schemes
    from metrics import known_measures

    return {*(f"coder {name}" for name in schemes()), *(f"measure {name}" for name in known_measures())}
