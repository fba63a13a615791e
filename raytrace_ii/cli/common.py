"""Common parts of commands: the app, groups of options, checks of outputs, small parsers."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Iterable, Set
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from .ending import create_folder
from .progress import App
from .words import one_line, say

if TYPE_CHECKING:
    from ii_core import IIPicture

app = App(
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        say(f"raytrace-ii {version('raytrace-ii')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _group(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Integral imaging: synthesize, code and evaluate 3-D pictures."""
    if context.invoked_subcommand is None:
        say(context.get_help())


Force = Annotated[bool, typer.Option("--force", help="Replace existing files.")]
Angle = Annotated[
    float | None, typer.Option(help="Viewing angle in degrees of a picture without camera; 20 by default.")
]
Workers = Annotated[int | None, typer.Option(help="Number of threads; the number of cores by default.")]


def load_any(path: Path) -> IIPicture:
    """Return an II-picture from its file or from a coded file.

    Raises
    ------
    ValueError
        If the file is neither.
    """
    from ii_core import IIPicture
    from ii_core.base.files import IMAGE_TYPES, check_file

    if path.suffix.lower() in IMAGE_TYPES:
        return IIPicture.load(path)
    from codec import decode, is_take

    check_file(path)
    if is_take(path):
        raise ValueError(f"{path} is a take: raytrace-ii decode makes pictures of its frames")
    try:
        return decode(path)
    except ValueError as error:
        if path.suffix == ".ii":
            raise
        raise ValueError(f"{error}; names of pictures end in {', '.join(IMAGE_TYPES)}") from None


def with_camera(picture: IIPicture, name: str, angle_deg: float | None = None) -> IIPicture:
    """Return a picture with its camera, or with one of an assumed viewing angle, of which the error stream tells.

    Raises
    ------
    ValueError
        If an angle is given for a picture with a camera.
    """
    from dataclasses import replace

    from ii_core.picture.assumed import ASSUMED_ANGLE_DEG, is_nominal, with_assumed_camera

    if is_nominal(picture) and angle_deg is not None:
        picture = replace(picture, camera=None)
    tell_nominal(picture, name)
    if picture.camera is not None:
        if angle_deg is not None:
            raise ValueError(f"{name} has a camera with a viewing angle: leave out --angle")
        return picture
    angle = ASSUMED_ANGLE_DEG if angle_deg is None else angle_deg
    seen = with_assumed_camera(picture, angle)
    if angle_deg is None:
        print(f"note: {one_line(name)} has no camera: a viewing angle of {angle:g}° is assumed", file=sys.stderr)
    return seen


def tell_nominal(picture: IIPicture, name: str) -> None:
    """Tell on the error stream that lengths are nominal, if the picture's camera was assumed."""
    from ii_core.picture.assumed import is_nominal

    if is_nominal(picture):
        print(f"note: {one_line(name)} has a nominal camera: lengths in mm are nominal", file=sys.stderr)


def image_file(path: Path | None, dtype: str) -> list[Path]:
    """Return the file of a plain image for `check_outputs`, none for None.

    Raises
    ------
    ValueError
        If the file type cannot store the pixel type.
    """
    from ii_core.base.files import check_type

    if path is None:
        return []
    check_type(path, dtype)
    return [path]


def picture_files(path: Path, dtype: str) -> list[Path]:
    """Return the files of an II-picture for `check_outputs`: picture and sidecar."""
    from ii_core.picture.picture import sidecar

    return [*image_file(path, dtype), sidecar(path)]


def check_page(output: Path | None, serve: bool, port: int, force: bool) -> None:
    """Raise an error unless either a page can be written or a server can use the port."""
    if (output is None) == (not serve):
        raise ValueError("one of --output and --serve is needed")
    if output is not None:
        if output.suffix not in (".html", ".htm"):
            raise ValueError(f"{output} is no page: .html is needed")
        check_outputs([output], force)
    if not 0 <= port < 1 << 16:
        raise ValueError(f"port is {port}: a number from 1 to 65535, or 0 for any free one, is needed")


def check_outputs(
    paths: Iterable[Path], force: bool, *, make_folder: bool = False, own: Set[Path] = frozenset()
) -> None:
    """Raise an error, before any work, unless all files of a command can be written without loss of others.

    Parameters
    ----------
    paths : iterable of Path
        All files that the command writes, with sidecars.
    force : bool
        Replace existing files; folders, devices and pipes are never replaced.
    make_folder : bool
        Create missing folders; a command that fails removes those that are still empty.
    own : set of Path
        Files that an interrupted run of the same command has written: they are replaced.
    """
    from ii_core.base.files import check_name

    files = list(paths)
    seen: set[str] = set()
    for path in files:
        check_name(path)
        _check_place(path.parent, path, make_folder)
        if path.is_dir():
            raise IsADirectoryError(f"cannot write {path}: it is a folder")
        if path.exists() and not path.is_file():
            raise OSError(f"cannot write {path}: it is a device, pipe or socket, and a regular file is needed")
        if os.path.lexists(path) and not force and path not in own:
            raise FileExistsError(f"{path} is there already: --force replaces it")
        if (real := os.path.realpath(path)) in seen:
            raise ValueError(f"{path} is to be written twice: every output needs a name of its own")
        seen.add(real)
    for path in files:
        if os.path.realpath(path.parent) in seen:
            raise ValueError(f"{path.parent} is to be a file and a folder: every output needs a name of its own")
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
        raise FileExistsError(f"{folder} is not empty: --force writes into it anyway")


def pair(name: str, text: str, limit: int = 1 << 16) -> tuple[int, int]:
    """Return two numbers from text like 9x9."""
    try:
        a, b = (int(part) for part in text.lower().replace("×", "x").split("x"))
    except ValueError:
        a = b = 0
    if not (1 <= a <= limit and 1 <= b <= limit):
        raise ValueError(f"{name} is {text!r}: two whole numbers from 1 to {limit} as in 9x9 are needed")
    return a, b


def check_only(context: typer.Context, reason: str, allowed: Set[str]) -> None:
    """Raise ValueError if a command was given options other than these."""
    if others := [name for name in _given(context) if name not in {*allowed, "quiet"}]:
        raise ValueError(f"{reason}: leave out --{others[0].replace('_', '-')}")


def check_unused(context: typer.Context, mode: str, *unused: str) -> None:
    """Raise ValueError if a command was given an option that its mode does not use.

    Parameters
    ----------
    mode : str
        What does not use the options: an option with its value, such as ``--as quilt``, or words.
    unused : str
        Names of parameters.
    """
    if others := [name for name in _given(context) if name in unused]:
        raise ValueError(f"{mode} does not use --{others[0].rstrip('_').replace('_', '-')}: leave it out")


def _given(context: typer.Context) -> list[str]:
    """Return the names of the parameters on the command line."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    return [name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"]


def columns(rows: dict[str, str]) -> None:
    """Print names and descriptions in two columns."""
    width = max(map(len, rows), default=0)
    for name, text in rows.items():
        say(f"{name:<{width}}  {text}")


def grouped(function: Callable[..., None]) -> Callable[..., None]:
    """Return a command with an option for each field of its parameters that are dataclasses, in their places.

    Typer reads the signature of a command: the fields are annotated as parameters of a command are.
    """
    hints = get_type_hints(function, include_extras=True)
    groups: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    parameters: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(function).parameters.items():
        if name not in groups:
            parameters.append(_parameter(name, hints[name], parameter.default))
            continue
        options = get_type_hints(groups[name], include_extras=True)
        for field in fields(groups[name]):
            default = inspect.Parameter.empty if field.default is MISSING else field.default
            parameters.append(_parameter(field.name, options[field.name], default))

    @wraps(function)
    def command(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{field.name: given.pop(field.name) for field in fields(group)})
        function(**given)

    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    vars(command)["__signature__"] = inspect.Signature(parameters)
    return command


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
