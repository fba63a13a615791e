"""Golden files: every scheme decodes the streams of earlier versions.

``pytest -n 0 tests/codec/test_golden.py --make-golden`` adds missing files of new schemes to the archive; it replaces
none.
"""

import json
import re
from dataclasses import replace
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
import pytest

from codec import Encoded, decode, encode, schemes
from codec.contract import REMOVED, find
from ii_core import IICamera, IIPicture
from ii_core.base.files import read_image, write_image, write_json

FOLDER = Path(__file__).parents[1] / "golden"
ARCHIVE = FOLDER / "coders.zip"
NAMES = sorted(Path(name).stem for name in ZipFile(ARCHIVE).namelist() if name.endswith(".ii"))
TOTAL_BYTES = 200_000
# Tolerance in codes. The video standards except MPEG-2, and reversible wavelets, define decoding to the bit; inverse
# cosine transforms, floating wavelets and colour conversion inside a library may round differently in another version
# or on another processor.
ROUNDING = {"mpeg2": 2, "jpeg": 2, "jpegxl": 2, "avif": 1, "jp3d": 1, "htj2k": 1, "jpeg2000": 1}
# Mean difference in codes: the libjxl of imagecodecs 2026.10 gives another code for 31 % of the values.
MEAN = {"jpegxl": 0.5}


def original():
    """Return a picture with gradients, an edge and noise; 8×8 lenses of 4×4 px."""
    y, x = np.mgrid[:32, :32]
    shade = 128 + 90 * np.sin(x / 6) * np.cos(y / 9) + np.random.default_rng(2).standard_normal((32, 32))
    pixels = np.stack([shade, 255 - shade, np.where(x > y, shade / 2, 200)], axis=-1)
    camera = IICamera(pixels=(32, 32), lenses=(8, 8), pixel_pitch_mm=0.0061, gap_mm=0.18, name="golden")
    return IIPicture(np.clip(pixels, 0, 255).astype(np.uint8), (8, 8), (4, 4), camera)


def compact():
    """A file of the second version: ray-space images, options not at default, a camera with optics of its own."""
    picture = original()
    camera = replace(picture.camera, optics=("pinhole", {"kind": "lens", "z_mm": 30.5, "focal_mm": 25}))
    return encode(replace(picture, camera=camera), "ri-h264:order=spiral,gop=8,pbratio=1.25", bpp=5.3)


def coded(scheme):
    """Return the picture coded at a quality with visible errors."""
    coder = find(scheme)
    if coder.lossless({key: option.default for key, option in coder.options.items()}):
        return encode(original(), scheme)
    if coder.rate_control:
        return encode(original(), scheme, bpp=4)
    if coder.qp_range:
        return encode(original(), scheme, qp=sum(coder.qp_range) // 2)
    low, high = coder.quality_range
    return encode(original(), scheme, quality=type(low)((low + high) / 2))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the files of the archive."""
    unpacked = tmp_path_factory.mktemp("golden")
    with ZipFile(ARCHIVE) as archive:
        archive.extractall(unpacked)
    return unpacked


def made(path, coded):
    """Write the file of a new scheme and its pixels, and add both to the archive."""
    coded.save(path)
    write_image(path.with_suffix(".png"), decode(path).pixels)
    with ZipFile(ARCHIVE, "a", ZIP_DEFLATED) as archive:
        for file in (path, path.with_suffix(".png")):
            archive.writestr(ZipInfo(file.name), file.read_bytes(), ZIP_DEFLATED)  # without the date of today


def test_one_golden_file_has_the_compact_header(request, folder):
    path = folder / "compact-header.ii"
    if request.config.getoption("--make-golden") and not path.exists():
        made(path, compact())
    coded = Encoded.load(path)
    assert path.read_bytes()[4] == 2
    assert (coded.scheme, coded.dtype, coded.target_bpp) == ("ri-h264", "uint8", 5.3)
    assert {key: coded.options[key] for key in ("order", "gop", "pbratio")} == {
        "order": "spiral", "gop": 8, "pbratio": 1.25
    }  # fmt: skip
    assert coded.structure == compact().structure


@pytest.mark.parametrize("scheme", sorted(schemes()))
def test_every_scheme_has_a_golden_file(scheme, request, folder):
    path = folder / f"{scheme}.ii"
    if request.config.getoption("--make-golden") and not path.exists():
        made(path, coded(scheme))
    assert path.exists(), f"make {path.name} with --make-golden and commit it"


@pytest.mark.parametrize("scheme", sorted(REMOVED))
def test_a_file_of_a_removed_scheme_is_one_line(scheme, folder):
    path = folder / f"{scheme}.ii"
    with pytest.raises(ValueError, match=f"^{re.escape(str(path))}: scheme {scheme} is no longer there: [^\n]*$"):
        decode(path)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in REMOVED])
def test_old_files_decode_to_the_same_pixels(name, folder):
    path = folder / f"{name}.ii"
    picture, expected = decode(path), read_image(path.with_suffix(".png"))
    coder = Encoded.load(path).scheme.rpartition("-")[2]
    off = np.abs(picture.pixels.astype(int) - expected)
    assert off.max() <= ROUNDING.get(coder, 0)
    assert off.mean() < MEAN.get(coder, 0.1)
    assert picture.lenses == (8, 8) and picture.ei_pixels == (4, 4)
    assert picture.camera is not None and picture.camera.name == "golden"


@pytest.mark.parametrize("scheme", sorted(schemes()))
def test_defaults_of_options_stay(scheme, request):
    """Files omit options at their default (`codec.file_header`): another default would decode differently."""
    path = FOLDER / "defaults.json"
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    now = {name: option.default for name, option in find(scheme).options.items()}
    if request.config.getoption("--make-golden"):
        kept[scheme] = now | kept.get(scheme, {})
        write_json(path, dict(sorted(kept.items())))
    assert scheme in kept, "add its defaults with --make-golden and commit them"
    assert now == kept[scheme]


def test_old_ray_space_images_keep_their_order(folder):
    """Files of the first version have the grid transposed; see `codec.file_header`."""
    assert Encoded.load(folder / "ri-h264.ii").options["by"] == "columns"
    assert Encoded.load(folder / "compact-header.ii").options["by"] == "rows"


def test_golden_files_are_small():
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < TOTAL_BYTES
