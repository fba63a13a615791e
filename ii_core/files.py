"""JSON and images, in and out (through OpenImageIO); files appear whole or not at all and are checked first."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
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

# What each file type can hold without loss.
IMAGE_TYPES: dict[str, tuple[str, ...]] = {
    ".png": ("uint8", "uint16"),
    ".tif": ("uint8", "uint16", "float32"),
    ".tiff": ("uint8", "uint16", "float32"),
    ".exr": ("float32",),
    ".hdr": ("float32",),
}
LOSSY = (".hdr",)  # a common exponent for three numbers
PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
BAND = 64  # rows in memory at a time when a file is checked
MAX_TEXT = 16 << 20  # bytes of a JSON or configuration file; a sidecar has under ten thousand
MAX_DIGITS = 20  # of whole numbers in JSON: all of 64 bits
MAX_MESSAGE = 600  # characters of an error that quotes what a file holds
NOT_WHOLE = "the file does not hold what was written to it, as if the disk were full"


def check_file(path: str | os.PathLike[str]) -> None:
    """Raise OSError unless a regular file is there: reading a pipe or a device may never end."""
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        raise FileNotFoundError(f"{os.fspath(path)} does not exist") from None
    except ValueError as error:  # a NUL in the name
        raise OSError(f"cannot read {os.fspath(path)!r}: {error}") from None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(f"{os.fspath(path)} is a folder: a file is needed")
    if not stat.S_ISREG(mode):
        raise OSError(f"{os.fspath(path)} is a device, pipe or socket: a regular file is needed")


def check_name(path: str | os.PathLike[str]) -> None:
    """Raise ValueError unless the name is UTF-8, which image libraries need."""
    try:
        os.fspath(path).encode("utf-8")
    except UnicodeEncodeError:
        raise ValueError(f"{os.fspath(path)!r} is no UTF-8 name: rename the file or its folder") from None


def one_line(text: object) -> str:
    """A message as one line of at most about `MAX_MESSAGE` characters, the middle of a longer one left out."""
    line, half = " ".join(str(text).split()), MAX_MESSAGE // 2
    return line if len(line) <= MAX_MESSAGE else f"{line[:half]} … {line[-half:]}"


def read_text(path: str | os.PathLike[str], limit: int = MAX_TEXT) -> str:
    """A small UTF-8 file.

    Raises
    ------
    ValueError
        If it is longer than ``limit`` bytes or no UTF-8.
    OSError
        If it is missing or not regular.
    """
    check_file(path)
    with open(path, "rb") as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        raise ValueError(f"{os.fspath(path)}: longer than {limit >> 20} MiB, the most that is read of such a file")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{os.fspath(path)}: no UTF-8 text, {error.reason} at byte {error.start}") from None


def read_json(path: str | os.PathLike[str]) -> Any:
    """The value in a JSON file.

    Raises
    ------
    ValueError
        If the file is no JSON, is longer than `MAX_TEXT`, nests too deeply, or holds a number of more than
        `MAX_DIGITS` digits.
    OSError
        If it is missing or not regular.
    """
    text = read_text(path)
    try:
        return json.loads(text, parse_int=_whole)
    except RecursionError:
        raise ValueError(f"{os.fspath(path)}: nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}: {error}") from None


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits: at most {MAX_DIGITS} are read")
    return int(digits)


def json_text(data: Any) -> str:
    """JSON as files hold it; NaN and infinity become null, which strict readers accept."""
    return json.dumps(_finite(data), indent=2, ensure_ascii=False) + "\n"


def write_json(path: str | os.PathLike[str], data: Any) -> None:
    """Write `json_text` whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json_text(data), encoding="utf-8")


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value


def write_image(path: str | os.PathLike[str], pixels: NDArray[Any]) -> None:
    """Write an (N, M) or (N, M, channels) array of uint8, uint16 or float32 without loss.

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
    """Write an image band by band from the top; the file appears when the block ends, whole, or not at all.

    Parameters
    ----------
    size : (M, N)
        Pixels across and down.
    dtype : str
        uint8, uint16 or float32.
    names : sequence of str
        Of the channels, which EXR keeps.
    about : mapping of str, optional
        Texts for the file's header.

    Yields
    ------
    RowWriter
        Takes the next rows, (h, M, channels), when called.

    Raises
    ------
    ValueError
        If the file type is unknown or cannot hold the type.
    OSError
        If the file cannot be written, or does not hold afterwards what was written to it.
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
    named: str | os.PathLike[str],
) -> Iterator[RowWriter]:
    """As `image_writer`, into a temporary file of `atomic_path`; errors speak of the file as ``named``."""
    # OpenImageIO knows no "float32": it would take the file type's own default, half or even uint8, without a word.
    spec = oiio.ImageSpec(*size, channels, "float" if dtype == "float32" else dtype)
    if names:
        spec.channelnames = tuple(names)
    for key, text in (about or {}).items():
        spec[key] = text
    spec["DateTime"] = ""  # else EXR and TIFF get the time of day, and equal pictures different files
    spec["oiio:UnassociatedAlpha"] = 1  # else PNG divides by alpha
    if file.suffix == ".png":
        spec["png:compressionLevel"] = 4  # a quarter of level 6's time for 2 % more bytes on noisy pictures
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
        output.close()  # of half a picture: what it says of that is of no use
        raise
    if not output.close():
        raise _failed(output, file, named)
    # libpng and libtiff do not report a full disk: the file itself is read.
    try:
        writer.digest = _stored_digest(file, names)
    except (OSError, ValueError):
        writer.digest = ""
    if not writer.digest or (writer.written.hexdigest() != writer.digest and file.suffix.lower() not in LOSSY):
        raise OSError(f"cannot write {named}: {NOT_WHOLE}")


def _failed(output: Any, file: Path, named: str | os.PathLike[str]) -> OSError:
    return OSError(f"cannot write {named}: {_reason(output.geterror(), file)}")


def _reason(said: str, file: Path) -> str:
    """OpenImageIO's complaint in one line, without the temporary name; some disks' errors come without any."""
    return " ".join(said.replace(f' "{file}"', "").split()) or NOT_WHOLE


class RowWriter:
    """Takes an image band by band, (h, M, channels) each; ``digest`` names the stored pixels when all are written."""

    def __init__(self, output: Any, shape: tuple[int, ...], dtype: str, failed: Callable[[], OSError]) -> None:
        self._output, self._shape, self._failed, self._top = output, shape, failed, 0
        self.written = _digest(shape, dtype)
        self.digest = ""

    def __call__(self, rows: NDArray[Any]) -> None:
        """Write the next rows."""
        rows = np.ascontiguousarray(rows).reshape(-1, *self._shape[1:])
        if not self._output.write_scanlines(self._top, self._top + len(rows), 0, rows):
            raise self._failed()
        self.written.update(rows)
        self._top += len(rows)


def _digest(shape: tuple[int, ...], dtype: str) -> Any:
    """BLAKE2b, which is twice as fast as SHA-256 without special instructions, of an image whose rows follow."""
    return hashlib.blake2b(f"{dtype}:{shape}:".encode(), digest_size=16)


def pixel_digest(pixels: NDArray[Any]) -> str:
    """BLAKE2b (128 bits) of an image's type, shape (N, M, channels) and values."""
    digest = _digest(pixels.shape, pixels.dtype.name)
    digest.update(np.ascontiguousarray(pixels))
    return str(digest.hexdigest())


def _stored_digest(path: Path, names: Sequence[str]) -> str:
    """`pixel_digest` of a file, which is read band by band."""
    if path.suffix.lower() == ".png" and not _ends_with(path, PNG_END):
        raise OSError("cut short")  # libpng would print its own complaint
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
    """Raise ValueError unless a file of this name can hold pixels of this type."""
    if dtype not in (allowed := image_types(path)):
        path = Path(path)
        raise ValueError(f"{path} cannot hold {dtype} pixels: {path.suffix} takes {', '.join(allowed)}")


def image_types(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Pixel types a file of this name can hold; ValueError if the type of file is unknown."""
    try:
        return IMAGE_TYPES[Path(path).suffix.lower()]
    except KeyError:
        raise ValueError(f"{path} is no known picture type: known are {', '.join(IMAGE_TYPES)}") from None


def image_header(path: str | os.PathLike[str]) -> tuple[tuple[int, int, int], str]:
    """Shape (N, M, channels) and type of an image as `read_image` gives it, from the file's header alone.

    Raises
    ------
    OSError
        If the file is missing, not regular, or no image.
    """
    with _opened(Path(path)) as source:
        spec = source.spec()
        return (spec.height, spec.width, spec.nchannels), _stored_type(spec)


def read_image(path: str | os.PathLike[str], *, size: tuple[int, int] | None = None) -> NDArray[Any]:
    """Read an (N, M, channels) array of uint8, uint16 or float32, as stored; alpha, if any, is not multiplied in.

    Parameters
    ----------
    size : (M, N), optional
        Pixels across and down that are needed. The header is held against it, so that no memory is taken for others.

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
    """Memory of the machine; 2⁶³ where the system does not say."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 1 << 63


def read_channels(path: str | os.PathLike[str], *, size: tuple[int, int] | None = None) -> dict[str, NDArray[Any]]:
    """The channels of an image by their names, (N, M) each; parameters and errors are those of `read_image`."""
    pixels = read_image(path, size=size)
    with _opened(Path(path)) as source:
        names = source.spec().channelnames
    return {name: pixels[..., i] for i, name in enumerate(names)}


def read_depth(path: str | os.PathLike[str], *, size: tuple[int, int] | None = None) -> NDArray[Any]:
    """The channel depth.Z of an image, or its first if there is none; as `read_image`."""
    channels = read_channels(path, size=size)
    return channels.get("depth.Z", next(iter(channels.values())))


def read_about(path: str | os.PathLike[str], key: str) -> str | None:
    """A text of an image's header, as `image_writer` puts it there; None if there is none."""
    with _opened(Path(path)) as source:
        text = source.spec().get(key)
    return None if text is None else str(text)


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """An image file, opened for reading as stored."""
    check_file(path)
    check_name(path)
    plain = oiio.ImageSpec()
    plain.attribute("oiio:UnassociatedAlpha", 1)  # left alone it multiplies what PNG stores by alpha
    source = oiio.ImageInput.open(str(path), plain)
    if not source:
        raise OSError(f"cannot read {path}: {one_line(oiio.geterror())}")
    try:
        yield source
    finally:
        source.close()


def _stored_type(spec: Any) -> str:
    """Type of the pixels as they are read."""
    return stored if (stored := str(spec.format)) in ("uint8", "uint16") else "float32"


def _oiio_type(spec: Any) -> str:
    """The same in OpenImageIO's words."""
    return "float" if (kind := _stored_type(spec)) == "float32" else kind
