"""Raw pictures of Lytro containers, written by the published description and read back."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.accuracy.calibration import exposed, random_camera, white_image
from benchmarks.stability.fuzz_readers.measurements import lfp_container
from ii_core import IIPicture
from ii_core.formats.lfp import read_lfp, read_raw, unpacked


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
    with pytest.raises(ValueError, match=r"a\.json, its metadata, is needed"):
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
    from ii_core.base.colour import linear

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
