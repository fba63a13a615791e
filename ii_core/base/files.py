"""JSON and image files (through OpenImageIO): checked reads, atomic writes."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from .atomic import atomic_path, atomic_paths

__all__ = [
    "IMAGE_TYPES",
    "RowWriter",
    "atomic_path",
    "atomic_paths",
    "check_file",
    "check_form",
    "check_name",
    "check_type",
    "image_header",
    "image_rows",
    "image_types",
    "image_writer",
    "json_text",
    "memory_bytes",
    "pixel_digest",
    "read_about",
    "read_channels",
    "read_depth",
    "read_image",
    "read_json",
    "read_text",
    "write_image",
    "write_json",
]

# Pixel types that each file type stores without loss.
IMAGE_TYPES: dict[str, tuple[str, ...]] = {
    ".png": ("uint8", "uint16"),
    ".tif": ("uint8", "uint16", "float32"),
    ".tiff": ("uint8", "uint16", "float32"),
    ".exr": ("float32",),
    ".hdr": ("float32",),
}
LOSSY = (".hdr",)  # one exponent for three numbers
PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
PNG_UNFILTERED = 8  # PNG_FILTER_NONE of libpng
BAND = 64  # rows read at once to check a file
MAX_TEXT = 16 << 20  # bytes of a JSON or configuration file; a sidecar has under ten thousand
MAX_DIGITS = 20  # of whole numbers in JSON; 64 bits need 20
MAX_DEPTH = 100  # of nested lists and objects; ours have 8
MAX_MESSAGE = 600  # characters of an error that quotes a file
# A list of numbers that starts with a line break, which no JSON text has inside a string.
NUMBERS = re.compile(r"\[\n\s*((?:(?:-?\d[\d.eE+-]*|null),\s*)*(?:-?\d[\d.eE+-]*|null))\s*\]")
NOT_WHOLE = "the file does not hold what was written to it, as if the disk were full"


def check_file(path: str | os.PathLike[str]) -> None:
    """Raise OSError unless the path is a regular file: reading a pipe or a device may never end."""
    named = one_line(os.fspath(path))
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        raise FileNotFoundError(f"{named} does not exist") from None
    except OSError as error:  # a name of 300 characters
        raise type(error)(f"cannot read {named}: {error.strerror}") from None
    except ValueError as error:  # a NUL in the name
        raise OSError(f"cannot read {named!r}: {error}") from None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(f"{named} is a folder: a file is needed")
    if not stat.S_ISREG(mode):
        raise OSError(f"{named} is a device, pipe or socket: a regular file is needed")


def check_name(path: str | os.PathLike[str]) -> None:
    """Raise ValueError unless the name is UTF-8, as image libraries need."""
    try:
        os.fspath(path).encode("utf-8")
    except UnicodeEncodeError:
        raise ValueError(f"{os.fspath(path)!r} is no UTF-8 name: rename the file or its folder") from None


def one_line(text: object) -> str:
    """Return a text as one line; the middle of a text longer than `MAX_MESSAGE` characters is left out."""
    line, half = " ".join(str(text).split()), MAX_MESSAGE // 2
    return line if len(line) <= MAX_MESSAGE else f"{line[:half]} … {line[-half:]}"


def read_text(path: str | os.PathLike[str], limit: int = MAX_TEXT) -> str:
    """Return the text of a small UTF-8 file.

    Raises
    ------
    ValueError
        If it is longer than ``limit`` bytes or not UTF-8.
    OSError
        If it is missing or not regular.
    """
    check_file(path)
    with open(path, "rb") as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        raise ValueError(f"{os.fspath(path)}: longer than {limit >> 20} MiB, the limit for such files")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{os.fspath(path)}: no UTF-8 text, {error.reason} at byte {error.start}") from None


def read_json(path: str | os.PathLike[str]) -> Any:
    """Return the value of a JSON file.

    Raises
    ------
    ValueError
        If the file is not JSON, is longer than `MAX_TEXT`, nests too deeply, or holds a number of more than
        `MAX_DIGITS` digits.
    OSError
        If it is missing or not regular.
    """
    try:
        return parse_json(read_text(path))
    except ValueError as error:
        said = one_line(error)
        raise ValueError(said if said.startswith(os.fspath(path)) else f"{os.fspath(path)}: {said}") from None


def parse_json(text: str | bytes) -> Any:
    """The value of a JSON text; ValueError as `read_json` has it."""
    try:
        value = json.loads(text, parse_int=_whole)
        _check_depth(value, MAX_DEPTH)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"no JSON, line {error.lineno}, column {error.colno}: {error.msg}") from None
    return value


def check_form(data: Any, wrong: str, format: str, version: int, keys: Collection[str] = ()) -> None:
    """Raise ValueError, which starts with ``wrong``, unless data state format and version and have the keys."""
    if not isinstance(data, dict) or (data.get("format"), data.get("version")) != (format, version):
        raise ValueError(f'{wrong}: needs "format": "{format}", "version": {version}')
    if missing := set(keys) - set(data):
        raise ValueError(f"{wrong}: {', '.join(sorted(missing))} missing")


def _check_depth(value: Any, left: int) -> None:
    """Raise RecursionError for deep nesting, before code that walks through the value meets it on a fuller stack."""
    if isinstance(value, dict | list):
        if left == 0:
            raise RecursionError
        for item in value.values() if isinstance(value, dict) else value:
            _check_depth(item, left - 1)


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits: at most {MAX_DIGITS} are read")
    return int(digits)


def json_text(data: Any) -> str:
    """Return the JSON text of a value, lists of numbers on one line; NaN and infinity become null."""
    text = json.dumps(_finite(data), indent=2, ensure_ascii=False)
    return NUMBERS.sub(lambda match: f"[{' '.join(match[1].split())}]", text) + "\n"


def write_json(path: str | os.PathLike[str], data: Any) -> Path:
    """Write `json_text` whole or not at all, and return the file's path."""
    with atomic_path(path) as temporary:
        temporary.write_text(json_text(data), encoding="utf-8")
    return Path(path)


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value


def write_image(path: str | os.PathLike[str], pixels: NDArray[Any]) -> Path:
    """Write an (N, M) or (N, M, channels) array of uint8, uint16 or float32 without loss; return the file's path.

    Raises
    ------
    ValueError
        If the file type is unknown or cannot hold the array's type.
    OSError
        If the file cannot be written.
    """
    pixels = np.ascontiguousarray(pixels)
    pixels = pixels.reshape(*pixels.shape[:2], -1)  # OpenImageIO 3.2 reads past the end of an array of two axes
    height, width, channels = pixels.shape
    with image_writer(path, (width, height), channels, pixels.dtype.name) as write:
        write(pixels)
    return Path(path)


@contextlib.contextmanager
def image_writer(
    path: str | os.PathLike[str],
    size: tuple[int, int],
    channels: int,
    dtype: str,
    *,
    names: Sequence[str] = (),
    about: Mapping[str, str] | None = None,
) -> Iterator[RowWriter]:
    """Write an image band by band from the top; the file appears whole when the block ends, or not at all.

    Parameters
    ----------
    size : (M, N)
        Pixels across and down.
    dtype : str
        uint8, uint16 or float32.
    names : sequence of str
        Names of the channels, which EXR stores.
    about : mapping of str, optional
        Texts of the file's header, by key.

    Yields
    ------
    RowWriter
        Call it with the next rows, (h, M, channels).

    Raises
    ------
    ValueError
        If the file type is unknown or cannot hold the type.
    OSError
        If the file cannot be written, or its pixels differ from the written ones afterwards.
    """
    check_type(path, dtype)
    with (
        atomic_path(path) as temporary,
        image_rows(temporary, size, channels, dtype, names=names, about=about, named=path) as write,
    ):
        yield write


@contextlib.contextmanager
def image_rows(
    file: Path,
    size: tuple[int, int],
    channels: int,
    dtype: str,
    *,
    names: Sequence[str] = (),
    about: Mapping[str, str] | None = None,
    filtered: bool = True,
    named: str | os.PathLike[str],
) -> Iterator[RowWriter]:
    """Write an image as `image_writer` does, into a temporary file of `atomic_path`; errors name ``named``.

    ``filtered=False`` turns off PNG's filters, which predict a pixel from its neighbours.
    """
    # OpenImageIO has no type "float32": it silently uses the default of the file type, half or uint8.
    spec = oiio.ImageSpec(*size, channels, "float" if dtype == "float32" else dtype)
    if names:
        spec.channelnames = tuple(names)
    for key, text in (about or {}).items():
        spec[key] = text
    spec["DateTime"] = ""  # otherwise EXR and TIFF store the time, and equal pictures differ as files
    spec["oiio:UnassociatedAlpha"] = 1  # otherwise PNG divides by alpha
    if file.suffix == ".png":
        spec["png:compressionLevel"] = 4  # a quarter of the time of level 6, 2 % more bytes on noisy pictures
        if not filtered:
            spec["png:filter"], spec["png:compressionLevel"] = PNG_UNFILTERED, 2
    if file.suffix == ".exr":
        spec["compression"] = "zip"
    check_name(named)
    output = oiio.ImageOutput.create(str(file))
    if not output or not output.open(str(file), spec):
        raise OSError(f"cannot write {named}: {_reason(oiio.geterror(), file)}")
    writer = RowWriter(output, (size[1], size[0], channels), dtype, lambda: _failed(output, file, named))
    try:
        yield writer
    except BaseException:
        output.close()  # its message on an incomplete picture does not help
        raise
    if not output.close():
        raise _failed(output, file, named)
    # libpng and libtiff do not report a full disk: compare the file's pixels.
    try:
        writer.digest = _stored_digest(file, names)
    except (OSError, ValueError):
        writer.digest = ""
    if not writer.digest or (writer.written.hexdigest() != writer.digest and file.suffix.lower() not in LOSSY):
        raise OSError(f"cannot write {named}: {NOT_WHOLE}")


def _failed(output: Any, file: Path, named: str | os.PathLike[str]) -> OSError:
    return OSError(f"cannot write {named}: {_reason(output.geterror(), file)}")


def _reason(said: str, file: Path) -> str:
    """Return OpenImageIO's message in one line, without the temporary name; it may be empty for disk errors."""
    return " ".join(said.replace(f' "{file}"', "").split()) or NOT_WHOLE


class RowWriter:
    """Writer of an image, band by band; ``digest`` is that of the stored pixels after the last band."""

    def __init__(self, output: Any, shape: tuple[int, ...], dtype: str, failed: Callable[[], OSError]) -> None:
        self._output, self._shape, self._failed, self._top = output, shape, failed, 0
        self.written = _digest(shape, dtype)
        self.digest = ""

    def __call__(self, rows: NDArray[Any]) -> None:
        """Write the next rows, (h, M, channels)."""
        rows = np.ascontiguousarray(rows).reshape(-1, *self._shape[1:])
        if not self._output.write_scanlines(self._top, self._top + len(rows), 0, rows):
            raise self._failed()
        self.written.update(rows)
        self._top += len(rows)


def _digest(shape: tuple[int, ...], dtype: str) -> Any:
    """Return a BLAKE2b hash to update with the rows of an image; twice as fast as SHA-256 in plain code."""
    return hashlib.blake2b(f"{dtype}:{shape}:".encode(), digest_size=16)


def pixel_digest(pixels: NDArray[Any]) -> str:
    """Return the BLAKE2b hash (128 bits) of an image's type, shape (N, M, channels) and values."""
    digest = _digest(pixels.shape, pixels.dtype.name)
    digest.update(np.ascontiguousarray(pixels))
    return str(digest.hexdigest())


def _stored_digest(path: Path, names: Sequence[str]) -> str:
    """Return the `pixel_digest` of a file, read band by band."""
    if path.suffix.lower() == ".png" and not _ends_with(path, PNG_END):
        raise OSError("cut short")  # libpng would print a message of its own
    with _opened(path) as source:
        spec = source.spec()
        order = [spec.channelnames.index(name) for name in names]  # EXR sorts channels by name
        digest = _digest((spec.height, spec.width, spec.nchannels), _stored_type(spec))
        for top in range(0, spec.height, BAND):
            bottom = min(top + BAND, spec.height)
            rows = source.read_scanlines(top, bottom, 0, 0, spec.nchannels, oiio.TypeDesc(_oiio_type(spec)))
            if rows is None:
                raise OSError(source.geterror())
            digest.update(np.ascontiguousarray(rows[..., order] if order else rows))
    return str(digest.hexdigest())


def _ends_with(path: Path, end: bytes) -> bool:
    with path.open("rb") as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - len(end)))
        return file.read() == end


def check_type(path: str | os.PathLike[str], dtype: str) -> None:
    """Raise ValueError unless a file of this name can store pixels of this type."""
    if dtype not in (allowed := image_types(path)):
        path = Path(path)
        raise ValueError(f"{path} cannot hold {dtype} pixels: {path.suffix} takes {', '.join(allowed)}")


def image_types(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Return the pixel types that a file of this name can store.

    Raises
    ------
    ValueError
        If the file type is unknown.
    """
    try:
        return IMAGE_TYPES[Path(path).suffix.lower()]
    except KeyError:
        raise ValueError(f"{path} is no known picture type: known are {', '.join(IMAGE_TYPES)}") from None


def image_header(path: str | os.PathLike[str]) -> tuple[tuple[int, int, int], str]:
    """Return the shape (N, M, channels) and pixel type of an image from the file's header.

    Raises
    ------
    OSError
        If the file is missing, not regular, or not an image.
    """
    with _opened(Path(path)) as source:
        spec = source.spec()
        return (spec.height, spec.width, spec.nchannels), _stored_type(spec)


def read_image(path: str | os.PathLike[str], *, size: tuple[int, int] | None = None) -> NDArray[Any]:
    """Read an (N, M, channels) array of uint8, uint16 or float32 as stored; colours are not multiplied by alpha.

    Parameters
    ----------
    size : (M, N), optional
        Required pixels across and down; compared with the header before memory is allocated.

    Raises
    ------
    ValueError
        If the image has another size, or more bytes than the machine has memory.
    OSError
        If the file is missing, not regular, or not a whole image.
    """
    path = Path(path)
    with _opened(path) as source:
        spec = source.spec()
        if size is not None and size != (spec.width, spec.height):
            raise ValueError(f"{path} has {spec.width}×{spec.height} pixels: {size[0]}×{size[1]} are needed")
        needed = spec.width * spec.height * spec.nchannels * np.dtype(_stored_type(spec)).itemsize
        if needed > (memory := memory_bytes()):
            raise ValueError(
                f"{path} has {spec.width}×{spec.height} pixels, {needed / 1e9:.1f} GB: "
                f"this machine has {memory / 1e9:.1f} GB of memory"
            )
        pixels = source.read_image(_oiio_type(spec))
        if pixels is None:
            raise OSError(f"cannot read {path}: {one_line(source.geterror())}")
    return pixels


def memory_bytes() -> int:
    """Return the bytes of memory of the machine; 2⁶³ if the system does not report them."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 1 << 63


def read_channels(path: str | os.PathLike[str], *, size: tuple[int, int] | None = None) -> dict[str, NDArray[Any]]:
    """Return the channels of an image, (N, M) each, by name; parameters and errors as `read_image`."""
    pixels = read_image(path, size=size)
    with _opened(Path(path)) as source:
        names = source.spec().channelnames
    return {name: pixels[..., i] for i, name in enumerate(names)}


def read_depth(path: str | os.PathLike[str], *, size: tuple[int, int] | None = None) -> NDArray[Any]:
    """Return the channel depth.Z of an image, or the first channel; parameters and errors as `read_image`."""
    channels = read_channels(path, size=size)
    return channels.get("depth.Z", next(iter(channels.values())))


def read_about(path: str | os.PathLike[str], key: str) -> str | None:
    """Return a text that `image_writer` stored in an image's header; None if there is none."""
    with _opened(Path(path)) as source:
        text = source.spec().get(key)
    return None if text is None else str(text)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open an image file; pixels are read as stored."""
    check_file(path)
    check_name(path)
    plain = oiio.ImageSpec()
    plain.attribute("oiio:UnassociatedAlpha", 1)  # by default OpenImageIO multiplies PNG colours by alpha
    source = oiio.ImageInput.open(str(path), plain)
    if not source:
        raise OSError(f"cannot read {path}: {one_line(oiio.geterror())}")
    try:
        yield source
    finally:
        source.close()


def _stored_type(spec: Any) -> str:
    """Return the numpy type of the pixels that are read."""
    return stored if (stored := str(spec.format)) in ("uint8", "uint16") else "float32"


def _oiio_type(spec: Any) -> str:
    """Return the same type by OpenImageIO's name."""
    return "float" if (kind := _stored_type(spec)) == "float32" else kind
