"""Raw pictures of Lytro containers, written by the published description and read back."""

import json
import tarfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.accuracy.calibration import exposed, random_camera, white_image
from benchmarks.stability.fuzz_readers.measurements import lfp_container, lfp_section
from ii_core import IIPicture
from ii_core.base.colour import linear
from ii_core.formats.lfp import read_lfp, read_raw, unpacked
from ii_core.formats.lytro import RawColour, Setting, about_picture
from ii_core.formats.whites import nearest_white, white_pictures


def packed(samples, bits):
    """Samples of 10 or 12 bits without gaps, by bit arithmetic on whole numbers."""
    flat = samples.ravel().astype(int).tolist()
    if bits == 16:
        return samples.astype("<u2").tobytes()
    out = bytearray()
    if bits == 12:
        for a, b in zip(flat[::2], flat[1::2], strict=True):
            out += ((a << 12) | b).to_bytes(3, "big")
    else:
        for i in range(0, len(flat), 4):
            four = flat[i : i + 4]
            out += bytes(value >> 2 for value in four)
            out.append(sum((value & 3) << 2 * j for j, value in enumerate(four)))
    return bytes(out)


def metadata(samples, bits, **more):
    height, width = samples.shape
    return {
        "image": {
            "width": width,
            "height": height,
            "rawDetails": {
                "pixelFormat": {"black": {c: 20 for c in ("r", "gr", "gb", "b")}, "white": {"r": 1000, "b": 1000}},
                "pixelPacking": {"endianness": "big", "bitsPerPixel": bits},
                "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": "b"},
            },
        },
        "devices": {
            "sensor": {"pixelPitch": 1.4e-6},
            "mla": {
                "tiling": "hexUniformRowMajor",
                "lensPitch": 2e-5,
                "rotation": 0.001,
                "sensorOffset": {"z": 3.7e-5},
            },
        },
        **more,
    }


def container(samples, bits, *, second=True):
    about = json.dumps(metadata(samples, bits)).encode()
    return lfp_container(packed(samples, bits), about, second=second)


@given(st.sampled_from((10, 12, 16)), st.integers(0, 2**32 - 1))
def test_packed_samples_come_back(bits, seed):
    samples = np.random.default_rng(seed).integers(0, 2**bits, (6, 8))
    np.testing.assert_array_equal(unpacked(packed(samples, bits), (8, 6), bits), samples)


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("bits", [10, 12])
def test_a_container_holds_samples_mosaic_and_camera(tmp_path, bits, second):
    samples = np.random.default_rng(1).integers(0, 1000, (12, 16))
    (tmp_path / "a.lfp").write_bytes(container(samples, bits, second=second))
    raw = read_lfp(tmp_path / "a.lfp")
    np.testing.assert_array_equal(raw.samples, samples - 20)
    assert (raw.mosaic, raw.full_scale, raw.lattice) == ("bggr", 980, "hexagonal")
    assert (raw.pixel_pitch_mm, raw.lens_pitch_mm, raw.gap_mm) == pytest.approx((0.0014, 0.02, 0.037))


def test_packed_samples_beside_their_json(tmp_path):
    samples = np.random.default_rng(1).integers(0, 1000, (12, 16))
    (tmp_path / "a.raw").write_bytes(packed(samples, 12))
    with pytest.raises(ValueError, match=r"a\.json or \.txt, its metadata, is needed"):
        read_raw(tmp_path / "a.raw")
    (tmp_path / "a.json").write_text(json.dumps(metadata(samples, 12)))
    np.testing.assert_array_equal(read_raw(tmp_path / "a.raw").samples, samples - 20)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda b: b[:-40], "bytes, "),
        (lambda b: b[:3] + b"X" + b[4:], "does not begin"),
        (lambda b: b[:-20] + b"\1\1\1\1" + b[-16:], "does not hold what its name"),
        (lambda b: b[:16], "no table of contents"),
        (lambda b: b[:16] + b"nonsense" * 4, "no section begins at byte 16"),
    ],
)
def test_damaged_containers_are_refused(tmp_path, spoil, said):
    samples = np.random.default_rng(1).integers(0, 1000, (12, 16))
    (tmp_path / "a.lfp").write_bytes(spoil(container(samples, 12)))
    with pytest.raises(ValueError, match="is no raw picture of a Lytro camera") as error:
        read_lfp(tmp_path / "a.lfp")
    assert said in str(error.value)


def test_a_container_is_calibrated_by_the_command(run, tmp_path):
    """A coloured even scene behind a Bayer mosaic: the grid is found, colours come back."""
    rng = np.random.default_rng(6)
    camera = random_camera(rng, (320, 300), 12.4, True)
    share = white_image(camera, 2)
    colour = np.ones((300, 320))
    colour[::2, ::2], colour[1::2, 1::2] = 0.4, 0.8  # bggr: blue, red; green 1
    raw = (exposed(share * colour.astype(np.float32), camera, rng) * 0.42).astype(int)
    white = (exposed(share, camera, rng) * 0.42).astype(int)
    for name, samples in (("raw", raw), ("white", white)):
        (tmp_path / f"{name}.lfr").write_bytes(container(samples, 10))
    code, out, _ = run(
        "calibrate", tmp_path / "raw.lfr", "--white", tmp_path / "white.lfr", "-o", tmp_path / "c"
    )  # fmt: skip
    assert code == 0 and "assumed" not in out
    picture = IIPicture.load(tmp_path / "c/picture.png")
    assert picture.camera.lens_turn_deg == pytest.approx(camera.lens_turn_deg, abs=0.005)
    assert picture.camera.pixel_pitch_mm == pytest.approx(0.0014)

    light = np.median(linear(picture.pixels[100:200, 100:200] / 255), axis=(0, 1))
    np.testing.assert_allclose(light / light[1], (0.8, 1, 0.4), atol=0.06)


@pytest.mark.parametrize("mosaic", [{"tile": "r" * 10**6}, {"tile": "r,gr:gb,b", "upperLeftPixel": "b" * 10**6}])
def test_a_mosaic_of_a_long_name_is_refused_in_a_short_line(tmp_path, mosaic):
    samples = np.zeros((12, 16), int)
    (tmp_path / "a.raw").write_bytes(packed(samples, 12))
    about = metadata(samples, 12)
    about["image"]["rawDetails"]["mosaic"] = mosaic
    (tmp_path / "a.json").write_text(json.dumps(about))
    with pytest.raises(ValueError, match="its mosaic") as error:
        read_raw(tmp_path / "a.raw")
    assert len(str(error.value)) < 1000


def leaves(tree, way=()):
    for key, value in tree.items():
        yield from leaves(value, (*way, key)) if isinstance(value, dict) else [(*way, key)]


@pytest.mark.parametrize("way", list(leaves(metadata(np.zeros((4, 6)), 10))), ids=".".join)
def test_long_values_of_the_metadata_are_shortened_in_messages(tmp_path, way):
    """A rotation of 5000 letters was echoed in full."""
    about = metadata(np.zeros((4, 6)), 10)
    at = about
    for key in way[:-1]:
        at = at[key]
    at[way[-1]] = "x" * 5000
    (tmp_path / "a.raw").write_bytes(bytes(60))
    (tmp_path / "a.json").write_text(json.dumps(about), encoding="utf-8")
    (tmp_path / "a.lfp").write_bytes(lfp_container(bytes(60), json.dumps(about).encode()))
    for name in ("a.raw", "a.lfp"):
        try:
            read_raw(tmp_path / name)
        except ValueError as error:
            assert len(str(error)) < 700 + len(str(tmp_path)) and "\n" not in str(error)


def white_tree(samples, bits, serial, zoom, focus, **tags):
    """Metadata of a white picture, as the calibration data of the second generation have them."""
    about = metadata(samples, bits)
    about["devices"]["lens"] = {"zoomStep": zoom, "focusStep": focus}
    frame = {"metadata": about, "privateMetadata": {"camera": {"serialNumber": serial}}, "imageRef": "unknown"}
    entry = {"frame": frame, "parameters": {"vendorContent": {"com.lytro.tags": tags}}}
    return {"master": {"picture": {"frameArray": [entry]}}}


def white_files(folder):
    """White pictures of two cameras at four settings, a dark frame among them; their levels tell them apart."""
    folder.mkdir()
    shots = [("A1", 100, 5, 400, {}), ("A1", 120, 5, 500, {}), ("A1", 120, 9, 600, {}), ("B2", 101, 5, 700, {})]
    for number, (serial, zoom, focus, level, tags) in enumerate([*shots, ("A1", 110, 7, 420, {"darkFrame": True})]):
        samples = np.full((12, 16), level)
        (folder / f"MOD_{number:04}.RAW").write_bytes(packed(samples, 10))
        tree = white_tree(samples, 10, serial, zoom, focus, **tags)
        (folder / f"MOD_{number:04}.TXT").write_text(json.dumps(tree))
    (folder / "NOTES.TXT").write_text("no JSON")
    return folder


def bundle(folder):
    """The same files as a container of the first generation."""
    sections, entries = b"", []
    for file in sorted(folder.iterdir()):
        section, name = lfp_section(b"C", file.read_bytes())
        sections += section
        entries.append({"name": f"C:\\CALIB\\{file.name}", "dataRef": name})
    listed, _ = lfp_section(b"M", json.dumps({"files": entries}).encode())
    return b"\x89LFP\r\n\x1a\n" + b"\0\0\0\1\0\0\0\0" + listed + sections


@pytest.mark.parametrize("form", ["folder", "tar", "bundle"])
def test_the_white_picture_of_the_camera_nearest_in_zoom_then_focus_is_chosen(tmp_path, form):
    source = white_files(tmp_path / "whites")
    if form == "tar":
        with tarfile.open(tmp_path / "w.tar", "w") as archive:
            archive.add(source, "unitconfig")
        source = tmp_path / "w.tar"
    elif form == "bundle":
        (tmp_path / "data.C.0").write_bytes(bundle(source))
        source = tmp_path / "data.C.0"
    whites = white_pictures(source)
    assert len(whites) == 5
    for setting, level in (
        (Setting("A1", 99, 5), 400),
        (Setting("A1", 119, 6), 500),
        (Setting("A1", 119, 8), 600),
        (Setting("A1", 111, 7), 500),  # the nearest is a dark frame
        (Setting("B2", 500, 5), 700),
        (Setting("", 101, 5), 700),
    ):
        _, picture = nearest_white(whites, setting)
        np.testing.assert_array_equal(picture.samples, level - 20)
    with pytest.raises(ValueError, match="of camera C3, the white pictures of"):
        nearest_white(whites, Setting("C3", 100, 5))
    with pytest.raises(ValueError, match="no zoom and focus"):
        nearest_white(whites, None)


# Values that files of cameras have, of github.com/imageio/imageio-binaries: images/lenslet_whiteimage.TXT (Illum) and
# images/IMG_0001__frame.json (first generation).
ILLUM_COLOUR = {
    "ccmRgbToSrgbArray": [2.48, -1.10, -0.38, -0.37, 1.67, -0.3, -0.19, -0.73, 1.92],
    "gamma": 0.4,
    "whiteBalanceGain": {"r": 1, "gr": 1, "gb": 1, "b": 1},
}


def test_metadata_of_white_pictures_and_of_both_generations_are_read():
    samples = np.zeros((12, 16))
    tree = white_tree(samples, 10, "B5143909630", -1040, -300, modulationFrame=True, darkFrame=False)
    image = tree["master"]["picture"]["frameArray"][0]["frame"]["metadata"]["image"]
    image["color"] = ILLUM_COLOUR
    image["rawDetails"]["mosaic"]["upperLeftPixel"] = "gr"
    image["rawDetails"]["pixelFormat"]["black"] = {"r": 60, "gr": 64, "gb": 66, "b": 70}
    image["rawDetails"]["pixelFormat"]["white"] = dict.fromkeys(("r", "gr", "gb", "b"), 1023)
    about = about_picture(tree)
    assert about.picture.setting == Setting("B5143909630", -1040, -300)
    assert about.picture.mosaic == "grbg" and about.black == (64, 60, 70, 66)
    assert about.picture.full_scale == 953 and about.picture.colour.matrix[0] == (2.48, -1.1, -0.38)
    second = {**metadata(samples, 10), "image": {**image.pop("rawDetails"), **image}}  # an Illum's own picture
    second["image"]["color"] = {
        "ccm": list(range(9)),
        "whiteBalanceGain": {"gr": 1.0, "r": 1.38, "b": 1.15, "gb": 1.1},
    }
    assert about_picture(second).picture.colour == RawColour((1.38, 1.05, 1.15), ((0, 1, 2), (3, 4, 5), (6, 7, 8)))


def test_a_container_becomes_a_regular_picture_with_its_camera_in_one_command(run, tmp_path):
    """Grey and coloured patches seen by a hexagonal camera: the white is chosen, colours and camera come out."""
    rng = np.random.default_rng(6)
    camera = random_camera(rng, (320, 300), 12.4, True)
    share = white_image(camera, 2)
    colour = RawColour((1.5, 1.0, 2.0), ((1.6, -0.5, -0.1), (-0.2, 1.5, -0.3), (0.0, -0.4, 1.4)))
    light = np.array([0.4, 0.3, 0.2])  # of the scene, linear sRGB
    seen = np.linalg.solve(np.array(colour.matrix), light) / colour.gains
    sensor = np.ones((300, 320))
    for phase, channel in enumerate((2, 1, 1, 0)):  # bggr
        sensor[phase // 2 :: 2, phase % 2 :: 2] = seen[channel]
    raw = (20 + 980 * share * sensor).astype(int)
    about = metadata(raw, 10)
    about["devices"]["lens"] = {"zoomStep": 10, "focusStep": 4}
    about["image"]["color"] = {
        "ccmRgbToSrgbArray": np.ravel(colour.matrix).tolist(),
        "whiteBalanceGain": {"r": 1.5, "gr": 1, "gb": 1, "b": 2.0},
    }
    (tmp_path / "shot.lfr").write_bytes(lfp_container(packed(raw, 10), json.dumps(about).encode()))
    (tmp_path / "whites").mkdir()
    white = (20 + 900 * share + rng.normal(0, 4, share.shape)).clip(0, 1000).astype(int)
    (tmp_path / "whites/A.RAW").write_bytes(packed(white, 10))
    (tmp_path / "whites/A.TXT").write_text(json.dumps(white_tree(white, 10, "", 11, 4)))
    code, out, _ = run(
        "import", tmp_path / "shot.lfr", "--whites", tmp_path / "whites", "-o", tmp_path / "field.png"
    )  # fmt: skip
    assert code == 0 and "A.RAW" in out and "gains and colour matrix" in out
    made = IIPicture.load(tmp_path / "field.png")
    assert made.regular and made.camera.pixel_pitch_mm == pytest.approx(
        0.0014 * camera.lens_lattice.pitch[0] / 12, rel=0.01
    )
    middle = made.light_field[5:-5, 5:-5, 5:7, 5:7].reshape(-1, 3)
    seen = np.median(linear(middle / 255), axis=0)
    np.testing.assert_allclose(seen, light, rtol=0.08)  # the white picture's brightest place is 6 % above the typical
    np.testing.assert_allclose(seen / seen[0], light / light[0], rtol=0.03)
