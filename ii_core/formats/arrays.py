"""Light fields as arrays: ``LF[v, u, y, x, c]`` in MATLAB's files (version 5 and 7.3) and in HDF5.

MATLAB's version 7.3 is HDF5 with the axes in opposite order. The Light Field Toolbox appends a weight to the colours.
The old HDF5 files of the HCI add ``GT_DEPTH`` and the attributes dV, dH, focalLength and shift, and number views from
right to left. Ours add the structure of the picture and its camera as JSON: an attribute of ``LF`` in HDF5, the
variable ``structure`` in MATLAB's files.

References
----------
D. Dansereau's Light Field Toolbox. S. Wanner et al., "Datasets and benchmarks for densely sampled 4D light fields",
2013.
"""

from __future__ import annotations

import math
import mmap
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base import checks
from ..base.atomic import atomic_path
from ..base.extras import Lazy
from ..base.files import MAX_TEXT, check_file, memory_bytes, one_line, parse_json
from ..picture.picture import IIPicture
from . import matlab5
from .grid import WHOLE_ORDER, Views, camera_views
from .rig import Rig

h5py, matlab = Lazy("h5py"), Lazy("scipy.io")

ARRAYS = (".mat", ".h5", ".hdf5")
NAME, STRUCTURE, DEPTH = "LF", "structure", "GT_DEPTH"
HDF5 = b"\x89HDF\r\n\x1a\n"
HEAP = b"GCOL\x01\0\0\0"  # a collection of texts of any length in HDF5
MATLAB_5 = b"MATLAB 5.0 MAT-file".ljust(116)  # the text that such a file begins with
MATLAB_73 = 512  # bytes of text before the HDF5 of MATLAB's version 7.3
MOST_MATLAB = 2**31 - 1  # bytes of a variable of version 5
MOST_ALONG = 1 << 16  # views or pixels along an axis
PIXEL_MM = 0.01  # of cameras whose focal length is known in pixels only


class Stored(NamedTuple):
    """Array of a file: its shape in the order v, u, y, x[, c], and a view of it."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    view: Callable[[int, int], NDArray[Any]]
    structure: Any = None
    attributes: dict[str, Any] | None = None  # of the HCI


@checks.checked(path=checks.path)
def array_views(path: str | os.PathLike[str]) -> Views:
    """Return the views of a light field stored as an array; HDF5 is read view by view.

    Integers of 8 and 16 bit stay. Numbers from 0 to 1 become codes of 16 bit; our own float32 stay linear light.

    Raises
    ------
    ValueError
        If there is no array of four or five axes, or its values are of another type, or outside 0 to 1.
    OSError
        If the file cannot be read.
    """
    path = Path(path)
    stored = _stored(path)
    _check(path, stored)
    flipped = stored.attributes is not None
    exact = stored.structure is not None

    def read(a: int, b: int) -> NDArray[Any]:
        return _pixels(path, stored.view(a, stored.shape[1] - 1 - b if flipped else b), exact)

    known = WHOLE_ORDER if exact or flipped else frozenset(("transposed",))
    rig = None if stored.attributes is None else _rig(stored.attributes, stored.shape)
    return Views(
        shape=(stored.shape[0], stored.shape[1]), read=read, known=known, structure=stored.structure, rig=rig
    )


@checks.checked(path=checks.path)
def array_depth(path: str | os.PathLike[str]) -> NDArray[np.float32] | None:
    """Return the depth of every pixel of an old file of the HCI, (N, M) in the order of the II-picture; None without.

    Units are those of the file, which are metres.
    """
    path = Path(path)
    check_file(path)
    if not _is_hdf5(path):
        return None
    try:
        with _opened(path) as file:
            found = _dataset(file, DEPTH)
            if found is None or found.ndim != 4 or found.dtype.kind != "f":
                return None
            v, u, y, x = _bounded(path, found.shape, 4)
            depth = np.empty((y, v, x, u), np.float32)
            for a, b in np.ndindex(v, u):
                depth[:, a, :, u - 1 - b] = found[a, b]
    except (OSError, RuntimeError, KeyError, TypeError) as error:
        raise ValueError(f"{path} has a damaged {DEPTH}: {one_line(error)}") from None
    return depth.reshape(y * v, x * u)


@checks.checked(picture=checks.instance(IIPicture), path=checks.path)
def write_array(picture: IIPicture, path: str | os.PathLike[str]) -> Path:
    """Write ``LF[v, u, y, x, c]`` in camera order, with structure and camera: ``.mat`` (version 5), ``.h5``.

    `array_views` restores picture and camera to the bit.

    Raises
    ------
    ValueError
        If the structure is not regular, the type of file unknown, or the picture too large for version 5.
    OSError
        If it cannot be written.
    """
    from ..base.files import json_text

    path = Path(path)
    if path.suffix.lower() not in ARRAYS:
        raise ValueError(f"{path} is no known type of array: known are {', '.join(ARRAYS)}")
    picture.check_regular()
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    shape, structure = (v, u, l, k, 3), json_text(picture.structure_json())
    if path.suffix.lower() == ".mat":
        if picture.pixels.nbytes > MOST_MATLAB:
            raise ValueError(
                f"{path} cannot hold {picture.pixels.nbytes / 1e9:.1f} GB, version 5 of such files holds 2: use .h5"
            )
        stack = np.empty(shape, picture.pixels.dtype, order="F")
        for row, col, view in camera_views(picture):
            stack[row, col] = view
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            matlab.savemat(file, {NAME: stack, STRUCTURE: structure}, do_compression=True)
            file.seek(0)
            file.write(MATLAB_5)  # SciPy's has the time of day
        return path
    with atomic_path(path) as temporary, h5py.File(temporary, "w", track_times=False) as file:
        made = file.create_dataset(
            NAME, shape, picture.pixels.dtype, chunks=(1, 1, *shape[2:]), compression="gzip", compression_opts=4,
            shuffle=picture.pixels.dtype.itemsize > 1, track_times=False,
        )  # fmt: skip
        made.attrs[STRUCTURE] = structure
        for row, col, view in camera_views(picture):
            made[row, col] = view
    return path


def _stored(path: Path) -> Stored:
    check_file(path)
    if _is_hdf5(path):
        return _hdf5(path)
    if path.suffix.lower() != ".mat":
        raise ValueError(f"{path} is no HDF5 file")
    return _matlab(path)


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as file:
        start = file.read(MATLAB_73 + len(HDF5))
    return start.startswith(HDF5) or start[MATLAB_73:] == HDF5


def _opened(path: Path) -> Any:
    """Open HDF5; anything that its library raises on damaged files becomes a ValueError of one line."""
    try:
        return h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path} is no readable HDF5 file: {one_line(error)}") from None


def _dataset(file: Any, name: str) -> Any:
    """Return a dataset of numbers that lies in the file itself; None if there is none of the name.

    Links and datasets that lead to other files are not followed.
    """
    if not isinstance(file.get(name, getlink=True), h5py.HardLink):
        return None
    found = file[name]
    if not isinstance(found, h5py.Dataset) or found.external or found.is_virtual or found.dtype.kind not in "uif":
        return None
    return found


def _check_heaps(path: Path) -> None:
    """Walk the heaps that hold texts as HDF5's library does: an object of no size keeps it there for ever."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        start = -1
        while (start := data.find(HEAP, start + 1)) >= 0:
            at, end = start + 16, start + int.from_bytes(data[start + 8 : start + 16], "little")
            while at + 16 <= min(end, len(data)):
                free = not any(data[at : at + 2])
                size = int.from_bytes(data[at + 8 : at + 16], "little")
                step = size if free else 16 + -(-size // 8) * 8
                if not 16 <= step <= end - at:
                    raise ValueError(f"an object of {size} bytes in the heap of its texts at byte {start}")
                at += step


def _hdf5(path: Path) -> Stored:
    file = _opened(path)
    try:
        names = [NAME] if NAME in file else [n for n in list(file)[:100] if n not in (DEPTH, "GT_DEPTH_MASK")]
        found = [data for name in names if (data := _dataset(file, name)) is not None and data.ndim in (4, 5)]
        if len(found) != 1:
            raise ValueError(f"it holds {len(found)} arrays of four or five axes: one, named {NAME}, is needed")
        data = found[0]
        if STRUCTURE in data.attrs:
            _check_heaps(path)
        text = data.attrs.get(STRUCTURE)
        turned = path.suffix.lower() == ".mat" and text is None
        keys = ("dH", "focalLength", "shift")
        attributes = {key: float(np.ravel(file.attrs[key])[0]) for key in keys if key in file.attrs}
        shape = tuple(data.shape[::-1]) if turned else tuple(data.shape)
    except (
        OSError,
        RuntimeError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        IndexError,
        OverflowError,
    ) as error:
        file.close()
        raise ValueError(f"{path} is no light field: {one_line(error)}") from None

    def view(a: int, b: int) -> NDArray[Any]:
        try:
            if not turned:
                return np.asarray(data[a, b])
            part = np.asarray(data[..., b, a])
        except (OSError, RuntimeError, ValueError, TypeError) as error:
            raise ValueError(f"{path} is damaged at view {a}, {b}: {one_line(error)}") from None
        return part.transpose(tuple(range(part.ndim))[::-1])

    return Stored(shape, data.dtype, view, _structure(path, text), attributes if len(attributes) == 3 else None)


def _matlab(path: Path) -> Stored:
    try:
        listed = matlab5.arrays(path)
        found = [array for array in listed if len(array.shape) in (4, 5) and array.kind != "char"]
        found = [array for array in found if array.name == NAME] or found
        if len(found) == 3 and (planes := _planes(path, found)) is not None:
            return planes
        if len(found) != 1:
            raise ValueError(f"it holds {len(found)} arrays of four or five axes: one, named {NAME}, is needed")
        _bounded(path, found[0].shape, len(found[0].shape))
        data = found[0].read()
        text = next((array.read() for array in listed if array.name == STRUCTURE and array.kind == "char"), None)
    except (ValueError, IndexError, OverflowError) as error:
        raise ValueError(f"{path} is no light field: {one_line(error)}") from None
    data = data if text is not None else _codes(data)
    return Stored(data.shape, data.dtype, lambda a, b: np.asarray(data[a, b]), _structure(path, text))


def _planes(path: Path, found: list[matlab5.Array]) -> Stored | None:
    """Return a light field of arrays ``NAMEr``, ``NAMEg`` and ``NAMEb`` of four axes; None if others are there."""
    by_name = {array.name[-1:]: array for array in found}
    alike = {(array.name[:-1], array.shape, array.kind) for array in found}
    if len(alike) != 1 or set(by_name) != set("rgb") or len(found[0].shape) != 4:
        return None
    _bounded(path, (*found[0].shape, 3), 5)
    data = _codes(np.stack([by_name[colour].read() for colour in "rgb"], axis=-1))
    return Stored(data.shape, data.dtype, lambda a, b: np.asarray(data[a, b]))


def _codes(data: NDArray[Any]) -> NDArray[Any]:
    """Return doubles that are whole numbers beyond 1 as codes, since MATLAB's numbers are doubles unless said."""
    if data.dtype.kind != "f" or not data.size or not 1 < (most := float(data.max())) <= 65535 or data.min() < 0:
        return data
    return data.astype(np.uint8 if most <= 255 else np.uint16) if (data == np.rint(data)).all() else data


def _structure(path: Path, text: Any) -> Any:
    """Return the structure that `write_array` stored."""
    if text is None:
        return None
    if not isinstance(text, str | bytes) or len(text) > MAX_TEXT:
        raise ValueError(f"{path}: its structure is no text of at most {MAX_TEXT >> 20} MiB")
    try:
        return parse_json(text)
    except ValueError as error:
        raise ValueError(f"{path}: its structure is {one_line(error)}") from None


def _bounded(path: Path, shape: tuple[int, ...], axes: int) -> tuple[int, ...]:
    """Return a shape whose array fits into memory; ValueError otherwise."""
    if len(shape) != axes or not all(1 <= n <= MOST_ALONG for n in shape) or 8 * math.prod(shape) > memory_bytes():
        size = "×".join(map(str, shape))
        raise ValueError(
            f"{path} holds an array of {size}: 1 to {MOST_ALONG} along each axis, within memory, is needed"
        )
    return shape


def _check(path: Path, stored: Stored) -> None:
    shape = _bounded(path, stored.shape, len(stored.shape))
    size = "×".join(map(str, shape))
    if len(shape) == 5 and shape[4] not in (1, 3, 4):
        raise ValueError(f"{path} holds {size} values: LF[v, u, y, x, c] with 1, 3 or 4 channels c is needed")
    if shape[0] * shape[1] < 2:
        raise ValueError(f"{path} holds one view: a light field needs at least two")
    if stored.dtype.name not in ("uint8", "uint16", "float32", "float64"):
        raise ValueError(f"{path} holds {stored.dtype} values: uint8, uint16 or numbers from 0 to 1 are needed")
    if len(shape) == 5 and shape[4] == 4:
        middle = np.asarray(stored.view(shape[0] // 2, shape[1] // 2))
        weight = middle[..., 3] if middle.ndim == 3 else np.ones(1)
        if (without := float((weight == 0).mean())) > 0:
            warnings.warn(f"{path}: {without:.1%} of the middle view's pixels have no weight", stacklevel=3)


def _pixels(path: Path, view: NDArray[Any], exact: bool) -> NDArray[Any]:
    """Return a view as (T, S, 3) of uint8, uint16 or, of ours, float32."""
    if view.ndim == 2:
        view = view[..., None]
    view = view[..., :3] if view.shape[2] >= 3 else np.repeat(view[..., :1], 3, axis=2)
    view = view.astype(view.dtype.newbyteorder("="), copy=False)
    if view.dtype.kind != "f" or exact:
        return np.ascontiguousarray(view)
    low, high = float(view.min()), float(view.max())
    if not (low >= 0 and high <= 1):
        raise ValueError(
            f"{path} holds values from {low:.4g} to {high:.4g}: numbers from 0 to 1, or integers, are needed"
        )
    return np.rint(view * 65535).astype(np.uint16)


def _rig(attributes: dict[str, float], shape: tuple[int, ...]) -> Rig | None:
    """Return the cameras of an old file of the HCI, where disparity = dH·focalLength/z − shift, in pixels."""
    step, focal, shift = (attributes[key] for key in ("dH", "focalLength", "shift"))
    try:
        return Rig(
            baseline_mm=1000 * step, focal_mm=focal * PIXEL_MM, sensor_mm=max(shape[2:4]) * PIXEL_MM,
            focus_mm=1000 * step * focal / shift if shift > 0 else None,
        )  # fmt: skip
    except (ValueError, OverflowError, ZeroDivisionError):
        return None
