"""Orientation and colour profiles of picture files, against Pillow and its colour management."""

import struct

import numpy as np
import pytest
from PIL import Image, ImageCms, ImageOps

from ii_core.base.colour import srgb
from ii_core.base.files import write_image
from ii_core.formats.grid import read_view
from ii_core.formats.profiles import parse_profile

PHOTO = np.random.default_rng(0).integers(0, 256, (9, 14, 3), np.uint8)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".png"])
def test_pictures_are_turned_as_exif_says(tmp_path, suffix, orientation):
    image = Image.fromarray(np.kron(PHOTO, np.ones((8, 8, 1), np.uint8)))
    exif = Image.Exif()
    exif[0x0112] = orientation
    path = tmp_path / f"a{suffix}"
    image.save(path, exif=exif, **({"quality": 95, "subsampling": 0} if suffix == ".jpg" else {}))
    with Image.open(path) as opened:
        wanted = np.asarray(ImageOps.exif_transpose(opened)).astype(int)
    found = read_view(path).astype(int)
    assert found.shape == wanted.shape and np.abs(found - wanted).mean() < 1


def profile(primaries, curves, tags=()):
    """An ICC profile of primaries in the D50 of profiles and encoded curves."""
    parts = {name: b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(65536 * x) for x in xyz))
             for name, xyz in zip((b"rXYZ", b"gXYZ", b"bXYZ"), primaries, strict=True)}  # fmt: skip
    parts |= dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curves)
    parts |= {b"wtpt": b"XYZ \0\0\0\0" + struct.pack(">3i", 63190, 65536, 54061)}
    parts |= {b"desc": b"desc\0\0\0\0" + struct.pack(">I", 5) + b"test\0" + bytes(79)}
    parts |= {b"cprt": b"text\0\0\0\0none\0"} | dict(tags)
    table, data, at = b"", b"", 132 + 12 * len(parts)
    for name, part in parts.items():
        part += bytes(-len(part) % 4)
        table += name + struct.pack(">II", at + len(data), len(part))
        data += part
    head = struct.pack(">I4sI4s4s4s", at + len(data), b"lcms", 0x02400000, b"mntr", b"RGB ", b"XYZ ")
    head += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp" + bytes(28) + struct.pack(">3i", 63190, 65536, 54061)
    return head.ljust(128, b"\0") + struct.pack(">I", len(parts)) + table + data


ADOBE = ((0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457))
SRGB = ((0.43607, 0.22249, 0.01392), (0.38515, 0.71687, 0.09708), (0.14307, 0.06061, 0.7141))
GAMMA = b"curv\0\0\0\0" + struct.pack(">IH", 1, round(2.2 * 256))
LINEAR = b"curv\0\0\0\0" + struct.pack(">I", 0)
TABLE = b"curv\0\0\0\0" + struct.pack(">I17H", 17, *(round(65535 * (i / 16) ** 1.8) for i in range(17)))
PARAMETRIC = b"para\0\0\0\0" + struct.pack(
    ">HH5i", 3, 0, *(round(65536 * x) for x in (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045))
)


@pytest.mark.parametrize("curve", [GAMMA, LINEAR, TABLE, PARAMETRIC], ids=["gamma", "linear", "table", "parametric"])
@pytest.mark.parametrize("primaries", [ADOBE, SRGB], ids=["wide", "srgb"])
def test_profiles_are_converted_as_colour_management_does(tmp_path, primaries, curve):
    icc = profile(primaries, curve)
    image = Image.fromarray(PHOTO)
    image.save(tmp_path / "a.png", icc_profile=icc)
    image.save(tmp_path / "a.tif", icc_profile=icc)
    (tmp_path / "a.icc").write_bytes(icc)
    wanted = ImageCms.profileToProfile(
        image, str(tmp_path / "a.icc"), ImageCms.createProfile("sRGB"), ImageCms.Intent.RELATIVE_COLORIMETRIC
    )
    for name in ("a.png", "a.tif"):
        apart = np.abs(read_view(tmp_path / name).astype(int) - np.asarray(wanted).astype(int))
        assert apart.max() <= (4 if curve is LINEAR else 2)  # 8 linear bits are coarse in the dark


def test_profiles_of_srgb_change_nothing(tmp_path):
    icc = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(PHOTO).save(tmp_path / "a.png", icc_profile=icc)
    np.testing.assert_array_equal(read_view(tmp_path / "a.png"), PHOTO)


def test_linear_tiff_of_16_bit_becomes_srgb(tmp_path):
    """As raw converters write it: codes are light. Ours, without a profile, stay as they are."""
    light = np.random.default_rng(1).integers(0, 65536, (6, 7, 3), np.uint16)
    write_image(tmp_path / "a.tif", light)
    np.testing.assert_array_equal(read_view(tmp_path / "a.tif"), light)
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(7, 6, 3, "uint16")
    icc = np.frombuffer(profile(SRGB, LINEAR), np.uint8)
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(icc)}]"), icc)
    out = oiio.ImageOutput.create(str(tmp_path / "b.tif"))
    out.open(str(tmp_path / "b.tif"), spec)
    out.write_image(light)
    out.close()
    apart = read_view(tmp_path / "b.tif").astype(int) - 65535 * srgb(light / 65535)
    assert np.abs(apart).max() < 12  # fifteen digits of primaries in a profile's sixteen bits


@pytest.mark.parametrize(
    ("icc", "said"),
    [
        (b"nothing" * 30, "does not begin as profiles do"),
        (profile(ADOBE, GAMMA).replace(b"RGB XYZ", b"CMYKLab"), "it converts 'CMYK' to 'Lab'"),
        (profile(ADOBE, GAMMA, {b"A2B0": b"mft2"}), "it is a table"),
        (profile(ADOBE, b"sampled1"), "curves are of the kind 'samp'"),
    ],
)
def test_other_profiles_are_refused_in_one_line(tmp_path, icc, said):
    Image.fromarray(PHOTO).save(tmp_path / "a.tif", icc_profile=icc)
    with pytest.raises(ValueError, match=said) as error:
        read_view(tmp_path / "a.tif")
    assert "convert it to sRGB first" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.slow
def test_damaged_profiles_are_refused():
    whole = profile(ADOBE, PARAMETRIC)
    rng = np.random.default_rng(0)
    for _ in range(2000):
        data = bytearray(whole[: int(rng.integers(0, len(whole) + 1))])
        for at in rng.integers(0, max(len(data), 1), 4):
            if data:
                data[at] = rng.integers(0, 256)
        try:
            curves, matrix = parse_profile(bytes(data))
        except (ValueError, struct.error, IndexError, OverflowError):
            continue
        assert np.isfinite(matrix).all() and all(np.isfinite(curve).all() for curve in curves)
