"""Files that appear whole or not at all, and images in and out through OpenImageIO."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

# What each file type can hold without loss.
IMAGE_TYPES: dict[str, tuple[str, ...]] = {
    ".png": ("uint8", "uint16"),
    ".tif": ("uint8", "uint16", "float32"),
    ".tiff": ("uint8", "uint16", "float32"),
    ".exr": ("float32",),
    ".hdr": ("float32",),
}


@contextlib.contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary name in the same folder that becomes ``path`` if the block succeeds, and nothing if it fails.

    Raises
    ------
    OSError
        If the folder does not exist or cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"cannot write {path}: it is a folder")
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise type(error)(f"cannot write {path}: {error.strerror}") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # mkstemp's private mode is not what a user expects of a picture
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(path: str | os.PathLike[str], data: Any) -> None:
    """Write JSON whole or not at all; NaN and infinity become null, which strict readers accept."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(_finite(data), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


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
) -> Iterator[Callable[[NDArray[Any]], None]]:
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
    callable
        Takes the next rows, (h, M, channels).

    Raises
    ------
    ValueError
        If the file type is unknown or cannot hold the type.
    OSError
        If the file cannot be written.
    """
    path = Path(path)
    allowed = image_types(path)
    if dtype not in allowed:
        raise ValueError(f"{path.name} cannot hold {dtype} pixels: {path.suffix} takes {', '.join(allowed)}")
    # OpenImageIO knows no "float32": it would take the file type's own default, half or even uint8, without a word.
    spec = oiio.ImageSpec(*size, channels, "float" if dtype == "float32" else dtype)
    if names:
        spec.channelnames = tuple(names)
    for key, text in (about or {}).items():
        spec[key] = text
    if path.suffix == ".png":
        spec["png:compressionLevel"] = 4  # a quarter of level 6's time for 2 % more bytes on noisy pictures
    if path.suffix == ".exr":
        spec["compression"] = "zip"
    with atomic_path(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if not output or not output.open(str(temporary), spec):
            raise OSError(f"cannot write {path}: {oiio.geterror()}")
        top = 0

        def write(rows: NDArray[Any]) -> None:
            nonlocal top
            rows = np.ascontiguousarray(rows).reshape(-1, size[0], channels)
            if not output.write_scanlines(top, top + len(rows), 0, rows):
                raise OSError(f"cannot write {path}: {output.geterror()}")
            top += len(rows)

        try:
            yield write
        except BaseException:
            output.close()  # of half a picture: what it says of that is of no use
            raise
        if not output.close():
            raise OSError(f"cannot write {path}: {output.geterror()}")


def image_types(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Pixel types a file of this name can hold; ValueError if the type of file is unknown."""
    try:
        return IMAGE_TYPES[Path(path).suffix.lower()]
    except KeyError:
        raise ValueError(f"{path} is no known picture type: known are {', '.join(IMAGE_TYPES)}") from None


def read_image(path: str | os.PathLike[str]) -> NDArray[Any]:
    """Read an (N, M, channels) array of uint8, uint16 or float32, as stored; alpha, if any, is not multiplied in.

    Raises
    ------
    OSError
        If the file is missing or is not a whole image.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} does not exist")
    plain = oiio.ImageSpec()
    plain.attribute("oiio:UnassociatedAlpha", 1)  # left alone it multiplies what PNG stores by alpha
    source = oiio.ImageInput.open(str(path), plain)
    if not source:
        raise OSError(f"cannot read {path}: {oiio.geterror()}")
    try:
        stored = str(source.spec().format)
        pixels = source.read_image(stored if stored in ("uint8", "uint16") else "float")
        if pixels is None:
            raise OSError(f"cannot read {path}: {source.geterror()}")
    finally:
        source.close()
    return pixels


def read_channels(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    """The channels of an image by their names, (N, M) each; errors are those of `read_image`."""
    pixels = read_image(path)
    names = _header(path).channelnames
    return {name: pixels[..., i] for i, name in enumerate(names)}


def read_depth(path: str | os.PathLike[str]) -> NDArray[Any]:
    """The channel depth.Z of an image, or its first if there is none; errors are those of `read_image`."""
    channels = read_channels(path)
    return channels.get("depth.Z", next(iter(channels.values())))


def read_about(path: str | os.PathLike[str], key: str) -> str | None:
    """A text of an image's header, as `image_writer` puts it there; None if there is none."""
    text = _header(path).get(key)
    return None if text is None else str(text)


def _header(path: str | os.PathLike[str]) -> Any:
    source = oiio.ImageInput.open(str(path))
    if not source:
        raise OSError(f"cannot read {path}: {oiio.geterror()}")
    try:
        return source.spec()
    finally:
        source.close()
