"""Light fields from elsewhere, in and out: folders of views, the HCI layout, quilts, lenslet mosaics.

A view of a light field is a sub-image here. In camera order, row by row from the top left camera, view (row, column)
is SI_{u,v} with u = column and v = row: seen from before the display, the pixel further to the right under a lens
belongs to the viewer further to the right. In a picture of erect elementary images it is the other way about.

============  ==================================================================================================
layout        what it is
============  ==================================================================================================
views         a folder of pictures with two numbers in their names, any names: ``view_03_12.png``,
              ``out_03_12_-381.9_1103.4.png`` (Stanford), ``IMG_0001_033_04_08.png``. Which number runs across, and
              which way, is found from the pictures (`arrangement`)
HCI           ``input_Cam000.png`` … row by row from the top left camera, the grid in ``parameters.cfg``
quilt         ``name_qsCxRaA.png``: C×R tiles of views along one line, the leftmost at the bottom left, rows upward;
              what does not divide by C and R is cut off at the right and the top
mosaic        the II-picture itself, U×V pixels under each lens
============  ==================================================================================================

References
----------
K. Honauer et al., "A dataset and evaluation methodology for depth estimation on 4D light fields", 2016 (HCI).
"""

from __future__ import annotations

import configparser
import itertools
import math
import os
import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera import Pair
from ..files import atomic_path, check_file, read_image, read_json, read_text, write_image, write_json
from ..picture import IIPicture
from .view_order import Arrangement, Read, estimate

PICTURES = (".png", ".tif", ".tiff", ".exr", ".hdr", ".jpg", ".jpeg", ".ppm", ".pgm", ".bmp", ".webp")
NUMBER = re.compile(r"-?\d+\.\d+|\d+")
HCI_VIEW = re.compile(r"input_Cam(\d+)\.\w+")
QUILT = re.compile(r"_qs(\d+)x(\d+)(?:a(\d+(?:\.\d+)?))?")
STRUCTURE = "structure.json"
WHOLE_ORDER = frozenset(("transposed", "flip_down", "flip_across"))
MAX_CONFIG = 1 << 20  # bytes of a parameters.cfg; those of the benchmark have a thousand
LISTED = 5  # of many missing views, how many a message names


@dataclass(frozen=True, kw_only=True)
class Views:
    """A grid of views as it was found.

    Parameters
    ----------
    shape : (int, int)
        Views along the first and the second number.
    read : callable
        Gives view (a, b) as (T, S, 3), checked against the others.
    known : frozenset of str
        Which parts of an `Arrangement` the layout settles, at their defaults.
    structure : dict, optional
        What `write_views` left of the picture that the views came from.
    """

    shape: tuple[int, int]
    read: Read
    known: frozenset[str] = frozenset()
    structure: dict[str, Any] | None = None


def find_views(source: str | os.PathLike[str], *, grid: Pair | None = None) -> Views:
    """The views of a folder or of a quilt.

    Parameters
    ----------
    source : path
        A folder, or a picture file whose name says ``_qsCxRaA``.
    grid : (rows, columns), optional
        Of views with only one number in their names; of a quilt's tiles, if its name does not say.

    Raises
    ------
    ValueError
        If there are no views, only one, some are missing, numbers have gaps, or file types are mixed.
    OSError
        If it cannot be read.
    """
    path = Path(source)
    if path.is_dir():
        return _folder(path, grid)
    match = QUILT.search(path.stem)
    if match is None and grid is None:
        raise ValueError(f"{path} is no folder and its name says no _qsCxRaA: its grid of tiles is needed")
    rows, cols = grid or (int(match[2]), int(match[1]))  # type: ignore[index]
    return _quilt(path, rows, cols)


def picture_of(
    views: Views, *, transposed: bool | None = None, flip_down: bool | None = None, flip_across: bool | None = None
) -> tuple[IIPicture, Arrangement]:
    """The II-picture whose sub-images are the views, and the order they were found to have.

    Parameters
    ----------
    views : Views
    transposed, flip_down, flip_across : bool, optional
        See `Arrangement`; what is given is not looked for.

    Raises
    ------
    ValueError
        If views differ in size or type.
    OSError
        If one cannot be read.
    """
    given = {"transposed": transposed, "flip_down": flip_down, "flip_across": flip_across}
    chosen: Any = {name: value for name, value in given.items() if value is not None}
    order = estimate(views.read, views.shape, Arrangement(**chosen), views.known | set(chosen))
    first = views.read(0, 0)
    height, width = first.shape[:2]
    rows, cols = order.grid(views.shape)
    pixels = np.empty((height * rows, width * cols, 3), first.dtype)
    for a, b in np.ndindex(*views.shape):
        row, col = order.place(a, b, views.shape)
        pixels[row::rows, col::cols] = views.read(a, b)
    picture = IIPicture(pixels, (width, height), (cols, rows))
    if views.structure is None:
        return picture, order
    known = IIPicture.from_structure_json(pixels, views.structure)
    return (_turned(known) if known.erect else known), order


def load_mosaic(path: str | os.PathLike[str], ei_pixels: Pair) -> IIPicture:
    """A lenslet picture of integer pitch, as it is.

    Warns
    -----
    UserWarning
        If pixels at the right and bottom do not fill a lens and are cut off, or if the micro-images seem to lie in a
        hexagonal lattice; see `looks_hexagonal`.

    Raises
    ------
    ValueError
        If a lens is larger than the picture.
    OSError
        If it cannot be read.
    """
    pixels = read_view(path)
    (u, v), (height, width) = ei_pixels, pixels.shape[:2]
    if not (1 <= u <= width and 1 <= v <= height):
        raise ValueError(f"lenses of {u}×{v} px do not fit {path} of {width}×{height} px")
    k, l = width // u, height // v
    if (k * u, l * v) != (width, height):
        warnings.warn(
            f"{path} has {width}×{height} px, {k}×{l} lenses of {u}×{v} px fill {k * u}×{l * v}: "
            f"{width - k * u} columns at the right and {height - l * v} rows at the bottom are cut off",
            stacklevel=2,
        )
    if looks_hexagonal(pixels, ei_pixels):
        warnings.warn(
            f"{path} looks hexagonal, every other row of micro-images half a lens aside: lenses of {u}×{v} px in "
            "straight rows do not fit it. Give it a camera with a hexagonal lattice, then run `raytrace-ii regular`",
            stacklevel=2,
        )
    return IIPicture(np.ascontiguousarray(pixels[: l * v, : k * u]), (k, l), (u, v))


def looks_hexagonal(pixels: NDArray[Any], ei_pixels: Pair) -> bool:
    """Whether the borders of micro-images repeat as those of a hexagonal lattice of this pitch do.

    The edges of a picture repeat with its lenses. In straight rows of pitch p their spectrum has a peak at (1/p, 0).
    In a hexagonal lattice it has none there but at (1/p, ±1/(√3·p)); likewise with the axes exchanged. The
    lattice counts as hexagonal if its weaker peak is twice the straight one's and stands out of what lies between.
    """
    size = min(1024, *pixels.shape[:2])
    top, left = ((n - size) // 2 for n in pixels.shape[:2])
    grey = pixels[top : top + size, left : left + size].astype(np.float32).mean(axis=2)
    for pitch, image in zip(ei_pixels, (grey, grey.T), strict=True):
        if pitch < 3 or size < 8 * pitch:
            continue
        edges = np.abs(np.diff(image, axis=1, prepend=image[:, :1]))
        window = np.hanning(size).astype(np.float32)
        power = np.abs(np.fft.fft2((edges - edges.mean()) * window * window[:, None]))

        def peak(across: float, down: float, power: NDArray[Any] = power) -> float:
            # A pitch given in whole pixels is off by up to half of one.
            x, y = round(across * size), round(down * size)
            reach = max(2, abs(x) // 30)
            rows, columns = np.arange(y - 2, y + 3), np.arange(x - reach, x + reach + 1)
            return float(power[np.ix_(rows % size, columns % size)].max())

        f, g = 1 / pitch, 1 / (3**0.5 * pitch)
        weaker, straight, between = min(peak(f, g), peak(f, -g)), peak(f, 0), peak(f, g / 2)
        if weaker > 2 * straight and weaker > 3 * between:
            return True
    return False


def read_view(path: str | os.PathLike[str]) -> NDArray[Any]:
    """A picture as (T, S, 3): grey three times, an alpha channel left out if it says nothing.

    Raises
    ------
    ValueError
        If it has another number of channels, or is transparent somewhere.
    OSError
        If it cannot be read.
    """
    pixels = read_image(path)
    channels = pixels.shape[2]
    if channels == 4:
        opaque = 1.0 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
        if (pixels[..., 3] != opaque).any():
            raise ValueError(f"{path} is transparent in places: views must be opaque")
        return pixels[..., :3]
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    if channels != 3:
        raise ValueError(f"{path} has {channels} channels: 1, 3 or 4 are needed")
    return pixels


def _folder(folder: Path, grid: Pair | None) -> Views:
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in PICTURES and path.is_file())
    if not files:
        raise ValueError(f"{folder} holds no pictures: known are {', '.join(PICTURES)}")
    hci = [path for path in files if HCI_VIEW.fullmatch(path.name)]
    if hci:
        return _listed(hci, grid or _hci_grid(folder, len(hci)), known=WHOLE_ORDER)
    families = Counter(NUMBER.sub("#", path.stem) for path in files)
    family = families.most_common(1)[0][0]
    members = [path for path in files if NUMBER.sub("#", path.stem) == family]
    if len(suffixes := sorted({path.suffix.lower() for path in members})) > 1:
        raise ValueError(f"views in {folder} are of mixed types {', '.join(suffixes)}: one is needed")
    if len(members) == 1:
        raise ValueError(f"{folder} holds one view, {members[0].name}: a light field needs at least two")
    return _numbered(folder, members, grid)


def _numbered(folder: Path, members: list[Path], grid: Pair | None) -> Views:
    """Views whose names hold two numbers that make a grid, or one and a grid that is given."""
    fields = list(zip(*(NUMBER.findall(path.stem) for path in members), strict=True))
    whole = [tuple(map(int, field)) for field in fields if all(text.isdigit() for text in field)]
    varying = [field for field in whole if len(set(field)) > 1]
    if grid is not None:
        serial = [field for field in varying if len(set(field)) == len(members)]
        in_order = sorted(zip(serial[0], members, strict=True)) if serial else [(0, path) for path in members]
        return _listed([path for _, path in in_order], grid, known=frozenset(("transposed",)))
    pairs = [
        (len(set(a)) * len(set(b)), a, b)
        for a, b in itertools.combinations(varying, 2)
        if len(set(zip(a, b, strict=True))) == len(members)
    ]
    if not pairs:
        raise ValueError(
            f"the {len(members)} names in {folder} like {members[0].name} do not hold a row and a column number: "
            "give the grid"
        )
    size, a, b = min(pairs, key=lambda pair: pair[0])
    table = dict(zip(zip(a, b, strict=True), members, strict=True))
    first, second = sorted(set(a)), sorted(set(b))
    if size > len(members):
        missing = [place for place in itertools.product(first, second) if place not in table]
        some = ", ".join(map(str, missing[:LISTED])) + (" …" if len(missing) > LISTED else "")
        raise ValueError(f"{len(missing)} of {size} views are missing in {folder}: {some}")
    for numbers in (first, second):
        steps = set(np.diff(numbers).tolist())
        if len(steps) > 1:
            raise ValueError(f"view numbers in {folder} have gaps: {', '.join(map(str, numbers))}")
    shape = len(first), len(second)
    return Views(
        shape=shape,
        read=_checked(lambda i, j: table[first[i], second[j]], read_view),
        **_written(folder, shape),
    )


def _written(folder: Path, shape: tuple[int, int]) -> dict[str, Any]:
    """What `write_views` knows of its own folder: order and structure."""
    path = folder / STRUCTURE
    if not os.path.lexists(path):
        return {}
    try:
        structure = read_json(path)
        u, v = structure["ei_pixels"]
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{path} is no structure of an II-picture: {error!r}") from None
    if (v, u) != shape:
        raise ValueError(f"{path} says {v}×{u} views, {shape[0]}×{shape[1]} are there")
    return {"structure": structure, "known": WHOLE_ORDER}


def _listed(files: list[Path], grid: Pair, known: frozenset[str]) -> Views:
    """Views in the order of a list, row by row."""
    rows, cols = grid
    if rows < 1 or cols < 1 or rows * cols != len(files):
        raise ValueError(f"a grid of {rows}×{cols} views is asked for: {len(files)} are there")
    if len(files) == 1:
        raise ValueError(f"one view, {files[0]}, is no light field: at least two are needed")
    return Views(shape=(rows, cols), read=_checked(lambda i, j: files[i * cols + j], read_view), known=known)


def _hci_grid(folder: Path, count: int) -> Pair:
    """(rows, columns) by the folder's parameters.cfg, or a square."""
    config = configparser.ConfigParser(interpolation=None)
    try:
        if os.path.lexists(folder / "parameters.cfg"):
            config.read_string(read_text(folder / "parameters.cfg", MAX_CONFIG))
        if config.has_section("extrinsics"):
            return config.getint("extrinsics", "num_cams_y"), config.getint("extrinsics", "num_cams_x")
    except (configparser.Error, ValueError) as error:
        raise ValueError(f"{folder / 'parameters.cfg'} does not say num_cams_x and num_cams_y: {error}") from None
    side = math.isqrt(count)
    if side * side != count:
        raise ValueError(f"{folder} holds {count} views, no square, and no parameters.cfg: give the grid")
    return side, side


def _quilt(path: Path, rows: int, cols: int) -> Views:
    pixels = read_view(path)
    height, width = pixels.shape[:2]
    if not (1 <= rows <= height and 1 <= cols <= width):
        raise ValueError(f"{path} of {width}×{height} px cannot hold {cols}×{rows} tiles")
    if rows * cols == 1:
        raise ValueError(f"{path} holds one view: a light field needs at least two")
    tile_height, tile_width = height // rows, width // cols

    def tile(_: int, number: int) -> NDArray[Any]:
        up, right = divmod(number, cols)
        top = height - (up + 1) * tile_height
        return pixels[top : top + tile_height, right * tile_width : (right + 1) * tile_width]

    return Views(shape=(1, rows * cols), read=tile, known=WHOLE_ORDER)


def _checked(path_of: Callable[[int, int], Path], read: Callable[[Path], NDArray[Any]]) -> Read:
    """A reader that holds every view against the first it read."""
    known: list[tuple[Path, tuple[int, ...], np.dtype[Any]]] = []

    def checked(a: int, b: int) -> NDArray[Any]:
        path = path_of(a, b)
        pixels = read(path)
        if not known:
            known.append((path, pixels.shape, pixels.dtype))
        first, shape, dtype = known[0]
        if pixels.shape != shape:
            sizes = [f"{s[1]}×{s[0]} px" for s in (pixels.shape, shape)]
            raise ValueError(f"view {path} has {sizes[0]}, {first.name} {sizes[1]}: all must be of one size")
        if pixels.dtype != dtype:
            raise ValueError(f"view {path} is {pixels.dtype}, {first.name} {dtype}: all must be of one type")
        return pixels

    return checked


def camera_views(picture: IIPicture) -> Iterator[tuple[int, int, NDArray[Any]]]:
    """(row, column, view) in camera order from the top left, each view (L, K, 3).

    Raises
    ------
    ValueError
        If the structure is not regular.
    """
    picture.check_regular()
    u, v = picture.ei_pixels
    for row, col in np.ndindex(v, u):
        below, right = (v - 1 - row, u - 1 - col) if picture.erect else (row, col)
        yield row, col, picture.pixels[below::v, right::u]


def write_views(picture: IIPicture, folder: str | os.PathLike[str]) -> int:
    """Every view as ``view_ROW_COLUMN.png`` (``.exr`` of float pictures), and the structure beside them.

    Returns
    -------
    int
        How many views.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    picture.check_regular()
    folder, count = Path(folder), 0
    suffix = ".exr" if picture.pixels.dtype.kind == "f" else ".png"
    digits = max(2, len(str(max(picture.ei_pixels) - 1)))
    for row, col, view in camera_views(picture):
        write_image(folder / f"view_{row:0{digits}}_{col:0{digits}}{suffix}", view)
        count += 1
    write_json(folder / STRUCTURE, picture.structure_json())
    return count


def write_hci(picture: IIPicture, folder: str | os.PathLike[str], *, depth: NDArray[Any] | None = None) -> int:
    """The layout of the HCI benchmark: ``input_Cam000.png`` …, ``parameters.cfg`` and, with depth, a disparity map.

    ``gt_disp_lowres.pfm`` holds the disparity of the view at row V//2, column U//2; see `view_disparity`.
    ``parameters.cfg`` says what is true of an II-picture: views are parallel projections, without focal length.

    Parameters
    ----------
    picture : IIPicture
        Of 8 or 16 bit.
    depth : ndarray, (N, M), optional
        Scene z of every pixel, mm, NaN where nothing is.

    Returns
    -------
    int
        How many views.

    Raises
    ------
    ValueError
        If the picture is of floats, or depth is given and does not fit or the picture has no camera.
    OSError
        If a file cannot be written.
    """
    picture.check_regular()
    folder = Path(folder)
    disparity = None if depth is None else view_disparity(picture, depth)
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    config = configparser.ConfigParser()
    config["intrinsics"] = {"image_resolution_x_px": str(k), "image_resolution_y_px": str(l)}
    config["extrinsics"] = {"num_cams_x": str(u), "num_cams_y": str(v)}
    if disparity is not None and np.isfinite(disparity).any():
        low, high = float(np.nanmin(disparity)), float(np.nanmax(disparity))
        config["meta"] = {"disp_min": repr(low), "disp_max": repr(high)}
    for row, col, view in camera_views(picture):
        write_image(folder / f"input_Cam{row * u + col:03}.png", view)
    with atomic_path(folder / "parameters.cfg") as temporary, temporary.open("w", encoding="utf-8") as file:
        config.write(file)
    if disparity is not None:
        write_pfm(folder / "gt_disp_lowres.pfm", disparity)
    return u * v


def write_quilt(picture: IIPicture, path: str | os.PathLike[str], *, row: int | None = None) -> Path:
    """One row of views as a quilt, left to right from the bottom left.

    Parameters
    ----------
    path : path
        ``_qsCxRaA`` is put behind its stem unless it is there.
    row : int, optional
        Row of views; the middle one, V//2, if not given.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        If there is no such row.
    OSError
        If it cannot be written.
    """
    picture.check_regular()
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    chosen = v // 2 if row is None else row
    if not 0 <= chosen < v:
        raise ValueError(f"row {row} of views is asked for: there are {v}, from 0")
    tiles = _tiles(u, (k, l))
    quilt = np.empty((l * tiles[1], k * tiles[0], 3), picture.pixels.dtype)
    for at, col, view in camera_views(picture):
        if at == chosen:
            up, right = divmod(col, tiles[0])
            quilt[(tiles[1] - 1 - up) * l : (tiles[1] - up) * l, right * k : (right + 1) * k] = view
    target = quilt_path(path, picture)
    write_image(target, quilt)
    return target


def quilt_path(path: str | os.PathLike[str], picture: IIPicture) -> Path:
    """The name under which `write_quilt` writes: tiles and aspect behind the stem."""
    picture.check_regular()
    path = Path(path)
    (k, l), (u, _) = picture.lenses, picture.ei_pixels
    across, down = _tiles(u, (k, l))
    pitch = picture.camera.lens_pitch_mm if picture.camera else (1.0, 1.0)
    stem = QUILT.sub("", path.stem)
    return path.with_name(f"{stem}_qs{across}x{down}a{k * pitch[0] / (l * pitch[1]):.4g}{path.suffix}")


def _tiles(views: int, size: Pair) -> Pair:
    """(columns, rows) of so many tiles that make the quilt as nearly square as can be."""
    divisors = [n for n in range(1, views + 1) if views % n == 0]
    down = min(divisors, key=lambda n: abs(math.log(views / n * size[0] / (n * size[1]))))
    return views // down, down


def view_disparity(picture: IIPicture, depth: NDArray[Any]) -> NDArray[np.float32]:
    """Disparity of the view at row V//2, column U//2 of a rendered picture, pixels per step between views.

    d = −δP·(z − Λ) / (Λ·δL): a point on the lens plane stays where it is in all views; what lies behind, and in an
    II-picture all does, moves along with the viewer, hence the sign. Into the next view to the right a point at
    column x goes to x − d. NaN where nothing is hit.

    Parameters
    ----------
    picture : IIPicture
        With its camera.
    depth : ndarray, (N, M)
        Scene z of every pixel, mm.

    Returns
    -------
    ndarray of float32, (L, K)

    Raises
    ------
    ValueError
        If the depth map is of another size, the picture has no camera, or something stands before its lenses, which
        bends rays so that no such formula holds.
    """
    camera = picture.camera
    if camera is None or camera.front:
        what = "has no camera" if camera is None else "was taken through a lens before the array"
        raise ValueError(f"the picture {what}: its disparity does not follow from depth")
    if depth.shape != picture.pixels.shape[:2]:
        raise ValueError(f"depth is {depth.shape}: {picture.pixels.shape[:2]} is needed")
    u, v = picture.ei_pixels
    row, col = v // 2, u // 2
    below, right = (v - 1 - row, u - 1 - col) if picture.erect else (row, col)
    z = depth[below::v, right::u].astype(np.float64) - camera.origin_mm[2]
    step = camera.pixel_pitch_mm / (camera.gap_mm * camera.lens_pitch_mm[0])
    return (-(z - camera.gap_mm) * step).astype(np.float32)


def write_pfm(path: str | os.PathLike[str], values: NDArray[np.float32]) -> None:
    """Write (T, S) as a little-endian portable float map, bottom row first."""
    rows, cols = values.shape
    with atomic_path(path) as temporary:
        temporary.write_bytes(
            b"Pf\n%d %d\n-1.0\n" % (cols, rows) + np.ascontiguousarray(values[::-1], "<f4").tobytes()
        )


def read_pfm(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """Read a grey portable float map as (T, S), top row first.

    Raises
    ------
    ValueError
        If it is none, or not whole.
    """
    check_file(path)
    match = re.match(rb"Pf\s+(\d{1,6})\s+(\d{1,6})\s+(-?[\d.]+)\s", data := Path(path).read_bytes())
    if not match or len(data) - match.end() != 4 * int(match[1]) * int(match[2]):
        raise ValueError(f"{path} is no whole grey portable float map")
    values = np.frombuffer(data, "<f4" if float(match[3]) < 0 else ">f4", offset=match.end())
    return values.reshape(int(match[2]), int(match[1]))[::-1].astype(np.float32)


def _turned(picture: IIPicture) -> IIPicture:
    """Pixels that lie in camera order put as a picture of erect elementary images has them."""
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    field = picture.pixels.reshape(l, v, k, u, 3)[:, ::-1, :, ::-1]
    return picture.with_pixels(np.ascontiguousarray(field).reshape(picture.pixels.shape))
