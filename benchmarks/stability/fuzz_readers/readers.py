"""Cases of the readers of pictures, scenes and tables: each writes its files into a folder and returns the call."""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator

from benchmarks.coding.fuzz import sample
from codec import decode
from codec.container import write
from codec.file_header import values
from ii_core import IIPicture, preset
from ii_core.base.files import write_image
from ii_core.camera.maps import read_maps, write_maps
from ii_core.camera.presets import preset_cameras
from ii_core.formats.find import find_views, picture_of
from ii_core.formats.mosaic import load_mosaic
from ii_core.formats.pfm import read_pfm
from metrics.reports.point_log import read_points
from metrics.reports.study import read_study
from raytrace_ii import load_scene
from raytrace_ii.files.beside import read_texture
from raytrace_ii.files.load import read_model
from raytrace_ii.rendering.render_sets import _claims, _read_manifest
from raytrace_ii.scene.textures import image_texture

from . import seeds
from .containers import bytes_changed, exr_changed, glb, headed, png_changed, text_file
from .trees import json_text, mutated, pick, toml_text

Read = Callable[[], object]
Case = Callable[[Generator, Path], Read]
READERS: dict[str, Case] = {}
CODED = ("jpeg2000", "si-h264", "si-jpeg2000", "jpeg", "si-ffv1")  # quick schemes with different options


def reader(name: str) -> Callable[[Case], Case]:
    """Register the function that makes the cases of a reader."""

    def keep(case: Case) -> Case:
        READERS[name] = case
        return case

    return keep


def _as_file(text: str, rng: Generator) -> bytes:
    """Return text as bytes, sometimes with damaged bytes."""
    data = text.encode("utf-8", "surrogatepass")
    return bytes_changed(data, rng) if rng.random() < 0.08 else data


def _json(tree: Any, rng: Generator, strangers: Any = ()) -> bytes:
    return _as_file(json_text(mutated(tree, rng, strangers)), rng)


@reader("sidecar")
def sidecar(rng: Generator, folder: Path) -> Read:
    """Structure and camera beside a picture."""
    picture = folder / "picture.png"
    picture.write_bytes(seeds.png_files()[0])
    Path(f"{picture}.json").write_bytes(_json(pick(rng, seeds.structures()), rng, seeds.structures()))
    return partial(IIPicture.load, picture)


@reader("camera")
def camera(rng: Generator, folder: Path) -> Read:
    """A camera file, scaled, and a block of its rays."""
    trees = list(seeds.camera_trees().values())
    path = folder / "camera.json"
    path.write_bytes(_json(pick(rng, trees), rng, trees))
    scale = pick(rng, (1, 1, 2, 8))

    def read() -> None:
        for one in preset_cameras(path, scale=scale):
            one.weighted_rays(slice(0, 4), slice(0, 4))

    return read


@lru_cache
def _maps(folder: Path, format: str) -> tuple[Any, dict[str, bytes]]:
    """Sheet and images of a small camera."""
    write_maps([preset("setup1", scale=256)], folder, format=format)
    images = {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix != ".json"}
    return json.loads((folder / "camera.json").read_text("utf-8")), images


@reader("L/D maps")
def maps(rng: Generator, folder: Path) -> Read:
    """Rays stored as pictures, and their sheet."""
    kind = pick(rng, ("png16", "png8", "exr"))
    sheet, images = _maps(folder / f"seed-{kind}", kind)
    damaged = pick(rng, sorted(images)) if rng.random() < 0.3 else ""
    case = folder / "case"
    case.mkdir(exist_ok=True)
    text = json_text(sheet).encode() if damaged else _json(sheet, rng, seeds.structures())
    (case / "camera.json").write_bytes(text)
    for name, data in images.items():
        (case / name).write_bytes(_picture_changed(name, data, rng) if name == damaged else data)

    def read() -> None:
        for one in read_maps(case):
            one.stored_rays(0, slice(0, 4), slice(0, 4))

    return read


def _picture_changed(name: str, data: bytes, rng: Generator) -> bytes:
    """A damaged picture, by its type."""
    if rng.random() < 0.2:
        return bytes_changed(data, rng)
    if name.endswith(".png"):
        return png_changed(data, rng)
    if name.endswith(".exr"):
        return exr_changed(data, rng)
    return headed(data, b"\n\n", rng) if name.endswith(".hdr") else bytes_changed(data, rng)


@lru_cache
def _textures(folder: Path) -> dict[str, tuple[bytes, ...]]:
    """Valid pictures by the ending of their names."""
    folder.mkdir(exist_ok=True)
    found: dict[str, tuple[bytes, ...]] = {".png": seeds.png_files(), ".jpg": (seeds.encoded("JPEG"),)}
    for suffix in (".exr", ".hdr", ".tif"):
        write_image(folder / f"seed{suffix}", seeds.pixels(kind="float32"))
        found[suffix] = ((folder / f"seed{suffix}").read_bytes(),)
    found[".tif"] += tuple(seeds.encoded("TIFF", compression=kind) for kind in (None, "tiff_lzw", "tiff_deflate"))
    return found


@reader("texture")
def texture(rng: Generator, folder: Path) -> Read:
    """A picture as a texture: PNG, EXR, HDR, TIFF, JPEG."""
    known = _textures(folder / "seeds")
    suffix = pick(rng, (".png", ".png", ".exr", ".exr", ".hdr", ".tif", ".jpg"))
    path = folder / f"texture{suffix}"
    path.write_bytes(_picture_changed(path.name, pick(rng, known[suffix]), rng))
    return lambda: image_texture(read_texture(path))


@reader("scene")
def scene(rng: Generator, folder: Path) -> Read:
    """A scene file beside valid meshes and textures."""
    _companions(folder)
    path = folder / "scene.toml"
    path.write_bytes(_as_file(toml_text(mutated(pick(rng, seeds.SCENES), rng, seeds.SCENES)), rng))
    return partial(load_scene, path)


@lru_cache
def _companions(folder: Path) -> None:
    """Files that scenes name."""
    (folder / "part.png").write_bytes(seeds.encoded("PNG"))
    write_image(folder / "part.exr", seeds.pixels(kind="float32"))
    (folder / "part.obj").write_text(seeds.OBJ)
    (folder / "part.mtl").write_text(seeds.MTL)
    tree, chunk = seeds.gltf()
    (folder / "part.glb").write_bytes(_sound_glb(json.dumps(tree).encode(), chunk))


def _sound_glb(text: bytes, chunk: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    total = 28 + len(text) + len(chunk)
    parts = [struct.pack("<4sIIII", b"glTF", 2, total, len(text), 0x4E4F534A), text]
    return b"".join([*parts, struct.pack("<II", len(chunk), 0x004E4942), chunk])


@reader("glTF")
def gltf(rng: Generator, folder: Path) -> Read:
    """A glTF file with its buffer inside."""
    tree, chunk = seeds.gltf()
    data = bytes_changed(chunk, rng) if rng.random() < 0.2 else chunk
    whole = {**tree, "buffers": [{"byteLength": len(data), "uri": seeds.embedded(data)}]}
    path = folder / "case.gltf"
    path.write_bytes(_json(whole, rng, (tree,)))
    return partial(_mesh_alone, path, rng.random() < 0.2)


def _mesh_alone(path: Path, as_scene: bool) -> object:
    """Read a mesh file as a part of a scene, or as a scene."""
    return load_scene(path) if as_scene else read_model(path)


@reader("GLB")
def glb_file(rng: Generator, folder: Path) -> Read:
    """A GLB file."""
    tree, chunk = seeds.gltf()
    if rng.random() < 0.4:
        chunk = bytes_changed(chunk, rng)
        text = json.dumps(tree).encode()
    else:
        text = json_text(mutated(tree, rng, (tree,))).encode("utf-8", "surrogatepass")
    path = folder / "case.glb"
    path.write_bytes(glb(text, chunk, rng))
    return partial(_mesh_alone, path, rng.random() < 0.2)


@reader("OBJ, MTL")
def obj(rng: Generator, folder: Path) -> Read:
    """An OBJ file and its materials."""
    (folder / "part.png").write_bytes(seeds.encoded("PNG"))
    in_materials = rng.random() < 0.4
    rows = (seeds.OBJ + seeds.MTL).splitlines()
    (folder / "part.mtl").write_bytes(text_file(seeds.MTL, rng, rows) if in_materials else seeds.MTL.encode())
    path = folder / "part.obj"
    path.write_bytes(seeds.OBJ.encode() if in_materials else text_file(seeds.OBJ, rng, rows))
    return partial(_mesh_alone, path, rng.random() < 0.2)


@reader("PLY")
def ply(rng: Generator, folder: Path) -> Read:
    """A PLY file, ASCII or binary."""
    data = pick(rng, seeds.ply_files())
    lines = ("element vertex 3", "property list uchar int vertex_indices", "property double x", "element face 0")
    path = folder / "case.ply"
    if b"ascii" in data and rng.random() < 0.7:
        path.write_bytes(text_file(data.decode(), rng, lines))
    else:
        path.write_bytes(headed(data, b"end_header\n", rng, lines))
    return partial(_mesh_alone, path, rng.random() < 0.2)


@reader("STL")
def stl(rng: Generator, folder: Path) -> Read:
    """An STL file, ASCII or binary."""
    binary, text = seeds.stl_files()
    path = folder / "case.stl"
    damaged = bytes_changed(binary, rng) if rng.random() < 0.5 else text_file(text.decode(), rng, ("endsolid",))
    path.write_bytes(damaged)
    return partial(_mesh_alone, path, rng.random() < 0.2)


def _fresh(folder: Path) -> Path:
    """A folder without files."""
    case = folder / "case"
    shutil.rmtree(case, ignore_errors=True)
    case.mkdir()
    return case


ODD_VIEWS = ("view_٣_00", "view_1.5_00", "a" * 200)
QUILTS = (
    "q_qs4x2a1.5",
    "q_qs1x1",
    "q_qs0x0a1",
    "q_qs99999999999x1",
    "q_qs4x2a0",
    "q_qs٤x٢",
    "q",
    f"q_qs{'9' * 200}x1",
)


def _view_names(rng: Generator, form: str) -> list[str]:
    """Names of 3×3 views, some of them changed."""
    names = [form.format(i // 3, i % 3, i) for i in range(9)]
    if rng.random() < 0.6:
        for _ in range(int(rng.integers(1, 4))):
            at = int(rng.integers(len(names)))
            stem = names[at][:-4]
            others = ("", "view_99999999999999999999_00", "view_-1_00", "view", stem + "_7", *ODD_VIEWS)
            changed = pick(rng, others) + pick(rng, (".png", ".png", ".PNG", ".jpg", ".exr", ""))
            names[at : at + 1] = [] if rng.random() < 0.3 else [changed]
    return [name for name in dict.fromkeys(names) if name]


def _put_views(rng: Generator, case: Path, names: list[str]) -> None:
    for name in names:
        if rng.random() < 0.9:
            data = _view_bytes()
        elif rng.random() < 0.5:
            data = pick(rng, seeds.png_files())
        else:
            data = png_changed(_view_bytes(), rng)
        (case / name).write_bytes(data)


@lru_cache
def _view_bytes() -> bytes:
    return seeds.encoded("PNG")


@reader("view folder")
def view_folder(rng: Generator, folder: Path) -> Read:
    """A folder of views, with the structure of the picture that they came from."""
    case = _fresh(folder)
    _put_views(rng, case, _view_names(rng, "view_{0:02}_{1:02}.png"))
    if rng.random() < 0.6:
        structure = {**seeds.structures()[0], "lenses": [16, 8], "ei_pixels": [3, 3]}
        tree = structure if rng.random() < 0.2 else mutated(structure, rng, seeds.structures())
        (case / "structure.json").write_bytes(_as_file(json_text(tree), rng))
    grid = pick(rng, (None, None, (3, 3), (0, 9), (-3, -3), (10**9, 1)))
    return lambda: picture_of(find_views(case, grid=grid))


@reader("HCI folder")
def hci_folder(rng: Generator, folder: Path) -> Read:
    """Views of the HCI layout with parameters.cfg, and a disparity map in PFM."""
    case = _fresh(folder)
    if rng.random() < 0.3:
        data = b"Pf\n8 4\n-1.0\n" + np.linspace(-1, 1, 32, dtype="<f4").tobytes()
        path = case / "map.pfm"
        path.write_bytes(headed(data, b"-1.0\n", rng))
        return partial(read_pfm, path)
    form = "input_Cam{2:03}.png"
    _put_views(rng, case, _view_names(rng, form) if rng.random() < 0.3 else [form.format(0, 0, i) for i in range(9)])
    lines = ("[extrinsics]", "num_cams_x = 0", "num_cams_x")
    (case / "parameters.cfg").write_bytes(text_file(seeds.CONFIG, rng, lines))
    return lambda: picture_of(find_views(case))


@reader("quilt")
def quilt(rng: Generator, folder: Path) -> Read:
    """A quilt, whose name contains its grid of tiles."""
    case = _fresh(folder)
    stem = pick(rng, QUILTS)
    path = case / f"{stem}{pick(rng, ('.png', '.png', '.PNG', '.exr'))}"
    path.write_bytes(pick(rng, seeds.png_files()) if rng.random() < 0.5 else png_changed(_view_bytes(), rng))
    grid = pick(rng, (None, None, (2, 4), (0, 1), (-1, -1), (10**9, 10**9)))
    return lambda: picture_of(find_views(path, grid=grid))


@reader("mosaic")
def mosaic(rng: Generator, folder: Path) -> Read:
    """A lenslet picture, and the pixels under a lens."""
    path = folder / f"mosaic{pick(rng, ('.png', '.png', '.PNG', '.tif'))}"
    path.write_bytes(pick(rng, seeds.png_files()) if rng.random() < 0.3 else png_changed(_view_bytes(), rng))
    lens = pick(rng, ((4, 4), (5, 3), (1, 1), (16, 8), (17, 8), (0, 4), (-4, 4), (10**12, 1)))
    return lambda: load_mosaic(path, lens)


@reader("study")
def study(rng: Generator, folder: Path) -> Read:
    """A rate–distortion study, or the log of points it continues from."""
    if rng.random() < 0.6:
        path = folder / "study.json"
        path.write_bytes(_json(seeds.STUDY, rng, (seeds.POINT,)))
        return partial(read_study, path)
    path = folder / "points.jsonl"
    rows = [json.dumps(seeds.POINT_LINE), json_text(mutated(seeds.POINT_LINE, rng, (seeds.STUDY,)))]
    path.write_bytes(_as_file("\n".join(rows) + pick(rng, ("\n", "")), rng))
    return partial(read_points, path)


@reader("manifest")
def manifest(rng: Generator, folder: Path) -> Read:
    """The manifest of a rendered set."""
    path = folder / "manifest.json"
    path.write_bytes(_json(seeds.MANIFEST, rng, (seeds.PRODUCT,)))
    return lambda: _claims(folder, "reference", 1, _read_manifest(folder, "reference"), False)


@lru_cache
def _coded(scheme: str) -> tuple[list[Any], bytes]:
    """Header and payload of a small picture."""
    coded = sample(scheme)
    return values(coded), coded.payload


@reader(".ii header")
def coded_header(rng: Generator, folder: Path) -> Read:
    """A coded picture with a changed header and a correct checksum."""
    header, payload = _coded(pick(rng, CODED))
    path = folder / "case.ii"
    changed = mutated(header, rng, [_coded(name)[0] for name in CODED])
    try:
        write(path, json.loads(json_text(changed)), payload)
    except (ValueError, OverflowError, RecursionError, TypeError):
        path.write_bytes(b"")  # values that no header can store are no case of this reader
    return partial(decode, path)
