"""Cases of the readers of captured fields and displays: white pictures, arrays, colour profiles, visual.json."""

from __future__ import annotations

import io
import json
import tarfile
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from PIL import Image, ImageCms

from ii_core import IIPicture, preset
from ii_core.calibration.multi_focus import virtual_depths
from ii_core.display.looking_glass import native_picture, read_looking_glass, view_numbers
from ii_core.formats.arrays import MATLAB_5, array_depth, write_array
from ii_core.formats.find import find_views, picture_of
from ii_core.formats.grid import read_view
from ii_core.formats.lytro import Setting
from ii_core.formats.whites import nearest_white, white_pictures

from . import seeds
from .containers import bytes_changed, text_file
from .measurements import ABOUT, lfp_section
from .readers import Read, _fresh, _json, reader
from .trees import json_text, mutated, pick

COLOUR = {
    "whiteBalanceGain": {"r": 1.4, "gr": 1.0, "gb": 1.0, "b": 1.2},
    "ccm": [2, -1, 0, -0.4, 1.7, -0.3, 0, -1, 2],
}
METADATA = {
    **ABOUT,
    "image": {**ABOUT["image"], "color": COLOUR},
    "devices": {**ABOUT["devices"], "lens": {"zoomStep": 981, "focusStep": 582}},
}
FRAME = {"metadata": METADATA, "privateMetadata": {"camera": {"serialNumber": "A1"}}}
TAGS = {"vendorContent": {"com.lytro.tags": {"darkFrame": False}}}
WHITE = {"master": {"picture": {"frameArray": [{"frame": FRAME, "parameters": TAGS}]}}}
CELL = dict.fromkeys(("ROffsetX", "ROffsetY", "GOffsetX", "GOffsetY", "BOffsetX", "BOffsetY"), 0.1)
VALUES = {
    "pitch": 52.6, "slope": -7.1, "center": 0.8, "viewCone": 40.0, "invView": 1.0, "DPI": 324.0, "screenW": 24.0,
    "screenH": 32.0, "flipImageX": 0.0, "flipImageY": 0.0, "flipSubp": 0.0,
}  # fmt: skip
TYPE = """<lens_type id="{0}">
<depth_range units="virtual_depth">
<min> {1}.5 </min>
<max> {2}.2 </max>
</depth_range>
</lens_type>"""
RAYTRIX = "\n".join(
    (
        '<RayCalibData version="1.0">',
        '<diameter units="pix"> 23.2 </diameter>',
        *(TYPE.format(i, i + 1, i + 3) for i in range(3)),
        "</RayCalibData>",
    )
)
DISPLAY = {name: {"value": value} for name, value in VALUES.items()} | {"subpixelCells": [CELL], "CellPatternMode": 1}


@lru_cache
def _samples() -> bytes:
    return (np.random.default_rng(0).integers(128, 256, 72)).astype(np.uint8).tobytes()


def _whites(rng: Generator) -> dict[str, bytes]:
    """Files of two white pictures, one of them changed."""
    files = {"MOD_0000.RAW": _samples(), "MOD_0000.TXT": json.dumps(WHITE).encode()}
    told = _json(pick(rng, (WHITE, METADATA)), rng, (METADATA, COLOUR, DISPLAY))
    return files | {"MOD_0001.RAW": _samples()[: int(rng.integers(60, 73))], "MOD_0001.TXT": told}


def _tar(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, data in files.items():
            member = tarfile.TarInfo(f"unitconfig/{name}")
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return out.getvalue()


def _bundle(files: dict[str, bytes], rng: Generator) -> bytes:
    parts = {name: lfp_section(b"C", data) for name, data in files.items()}
    table: Any = {"files": [{"name": f"C:\\CALIB\\{name}", "dataRef": part[1]} for name, part in parts.items()]}
    changed = mutated(table, rng) if rng.random() < 0.5 else table
    listed, _ = lfp_section(b"M", json_text(changed).encode("utf-8", "surrogatepass"))
    return b"\x89LFP\r\n\x1a\n" + b"\0\0\0\1\0\0\0\0" + listed + b"".join(part[0] for part in parts.values())


@reader("white pictures")
def white(rng: Generator, folder: Path) -> Read:
    """Calibration data of a camera: a folder, a tar, a bundle."""
    case, files, form = _fresh(folder), _whites(rng), rng.integers(3)
    if form == 0:
        source = case
        for name, data in files.items():
            (case / name).write_bytes(data)
    else:
        source = case / ("w.tar" if form == 1 else "data.C.0")
        data = _tar(files) if form == 1 else _bundle(files, rng)
        source.write_bytes(bytes_changed(data, rng) if rng.random() < 0.5 else data)
    wanted = pick(rng, (Setting("A1", 981, 582), Setting("", 0, 0)))

    def read() -> None:
        found = white_pictures(source)
        nearest_white(found, wanted)
        for one in found:
            one.read()

    return read


@lru_cache
def _arrays(folder: Path) -> dict[str, tuple[bytes, ...]]:
    """Valid files of arrays by the ending of their names."""
    import h5py
    import scipy.io

    folder.mkdir(exist_ok=True)
    camera = preset("setup1", scale=256)
    pixels = np.random.default_rng(0).integers(0, 256, (*camera.pixels[::-1], 3), np.uint8)
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    field = pixels.reshape(-1)[: 2 * 3 * 4 * 5 * 4].reshape(2, 3, 4, 5, 4)
    for name, data in (("plain", field), ("float", field / 255.0)):
        with (folder / f"{name}.mat").open("wb") as file:
            scipy.io.savemat(file, {"LF": data, "Meta": {"a": 1.0}}, do_compression=name == "plain")
            file.seek(0)
            file.write(MATLAB_5)  # SciPy's has the time of day, of which cases must not depend
    with h5py.File(folder / "turned.mat", "w", userblock_size=512) as file:
        file["LF"] = field.T
    with h5py.File(folder / "hci.h5", "w") as file:
        file.create_dataset("LF", data=field[..., :3], chunks=(1, 1, 4, 5, 3), compression="gzip")
        file["GT_DEPTH"] = np.ones(field.shape[:4], "f4")
        file.attrs.update({"dH": 0.05, "focalLength": 700.0, "shift": 5.0})
    for suffix in (".mat", ".h5"):
        write_array(picture, folder / f"ours{suffix}")
    return {suffix: tuple(p.read_bytes() for p in sorted(folder.glob(f"*{suffix}"))) for suffix in (".mat", ".h5")}


def _array(rng: Generator, folder: Path, hdf5: bool) -> Read:
    known = _arrays(folder / "seeds")
    kept = [(s, data) for s in known for data in known[s] if (b"\x89HDF" in data[:600]) == hdf5]
    suffix, data = kept[int(rng.integers(len(kept)))]
    path = folder / f"case{suffix}"
    path.write_bytes(bytes_changed(data, rng))

    def read() -> None:
        picture_of(find_views(path))
        array_depth(path)

    return read


@reader("HDF5")
def hdf5(rng: Generator, folder: Path) -> Read:
    """A light field in HDF5 or in MATLAB's version 7.3."""
    return _array(rng, folder, True)


@reader("MATLAB 5")
def matlab5(rng: Generator, folder: Path) -> Read:
    """A light field in MATLAB's version 5."""
    return _array(rng, folder, False)


@lru_cache
def _profile() -> bytes:
    return bytes(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())


@reader("colour profile")
def colour_profile(rng: Generator, folder: Path) -> Read:
    """A picture with an ICC profile and an orientation."""
    exif = Image.Exif()
    exif[0x0112] = pick(rng, (1, 6, 0, 99, 65535))
    path = folder / f"case.{pick(rng, ('png', 'tif', 'jpg'))}"
    pixels = Image.fromarray(seeds.pixels()[:8, :8, :3].astype(np.uint8))
    pixels.save(path, icc_profile=bytes_changed(_profile(), rng), exif=exif)
    return partial(read_view, path)


@lru_cache
def _shown() -> IIPicture:
    camera = preset("setup1", scale=256)
    return IIPicture(np.zeros((*camera.pixels[::-1], 3), np.uint8), camera.lenses, camera.ei_pixels, camera)


@reader("visual.json")
def visual(rng: Generator, folder: Path) -> Read:
    """The calibration of a Looking Glass, and its panel's picture if it is small."""
    path = folder / "visual.json"
    path.write_bytes(_json(DISPLAY, rng, (DISPLAY,)))

    def read() -> None:
        display = read_looking_glass(path)
        if display.size[0] * display.size[1] < 10_000:
            view_numbers(display, 8)
            native_picture(_shown(), display, views=3)

    return read


@reader("Raytrix XML")
def raytrix(rng: Generator, folder: Path) -> Read:
    """The depth ranges of lens types."""
    path = folder / "calibration.xml"
    path.write_bytes(text_file(RAYTRIX, rng, ('<!DOCTYPE a [<!ENTITY b "c">]>', "<min>nan</min>", "<min>&b;</min>")))
    return partial(virtual_depths, path)
