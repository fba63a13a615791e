"""II-pictures: structure, files and sidecars, sensor noise."""

import json
import os
import re

import numpy as np
import OpenImageIO as oiio
import pytest

from ii_core import IICamera, IIPicture, add_sensor_noise
from ii_core.base.files import json_text, read_image, write_image, write_json

PEAKS = {"uint8": 255, "uint16": 65535, "float32": 1.0}
HELD = [
    (".png", "uint8"),
    (".png", "uint16"),
    (".PNG", "uint8"),
    (".exr", "float32"),
    *((suffix, dtype) for suffix in (".tif", ".tiff") for dtype in PEAKS),
]


def picture(dtype="uint8", seed=0, camera=True):
    values = np.random.default_rng(seed).random((12, 20, 3)) * PEAKS[dtype]
    known = (
        IICamera(pixels=(20, 12), lenses=(5, 4), pixel_pitch_mm=0.1, gap_mm=1 / 3, name="näher") if camera else None
    )
    return IIPicture(values.astype(dtype), (5, 4), (4, 3), known)


def flat(dtype="uint8", value=128.0, size=200):
    return IIPicture(np.full((size, size, 3), value, dtype), (size, size), (1, 1))


@pytest.mark.parametrize(("suffix", "dtype"), HELD)
def test_files_hold_everything(tmp_path, suffix, dtype):
    for source in (picture(dtype), IIPicture(picture(dtype).pixels, (10, 2), (2, 6), None, True)):
        source.save(tmp_path / f"p{suffix}")
        back = IIPicture.load(tmp_path / f"p{suffix}")
        assert back.pixels.dtype == source.pixels.dtype
        np.testing.assert_array_equal(back.pixels, source.pixels)
        assert (back.lenses, back.ei_pixels, back.camera, back.erect) == (
            source.lenses,
            source.ei_pixels,
            source.camera,
            source.erect,
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"p{suffix}", f"p{suffix}.json"]


@pytest.mark.parametrize("suffix", [".exr", ".tif"])
def test_floats_of_every_kind_survive(tmp_path, suffix):
    source = picture("float32")
    source.pixels[0, :6, 0] = [np.nan, np.inf, -np.inf, -1, 1e-40, 3e38]
    source.save(tmp_path / f"p{suffix}")
    np.testing.assert_array_equal(IIPicture.load(tmp_path / f"p{suffix}").pixels, source.pixels)


def test_pixels_in_any_memory_order_are_written(tmp_path):
    source = picture()
    source.with_pixels(np.asfortranarray(source.pixels)).save(tmp_path / "p.png")
    np.testing.assert_array_equal(read_image(tmp_path / "p.png"), source.pixels)


@pytest.mark.parametrize(
    ("suffix", "dtype", "message"),
    [
        (".png", "float32", "p.png cannot hold float32 pixels: .png takes uint8, uint16"),
        (".exr", "uint8", "p.exr cannot hold uint8 pixels: .exr takes float32"),
        (".jpg", "uint8", "is no known picture type: known are .png, .tif, .tiff, .exr"),
        ("", "uint8", "is no known picture type"),
    ],
)
def test_lossy_pixel_types_are_refused(tmp_path, suffix, dtype, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        picture(dtype).save(tmp_path / f"p{suffix}")
    assert not list(tmp_path.iterdir())


def test_bare_picture_needs_a_structure(tmp_path):
    path = tmp_path / "p.png"
    write_image(path, picture().pixels)
    with pytest.raises(ValueError, match=r"p\.png has no sidecar p\.png\.json .*: give lenses and ei_pixels"):
        IIPicture.load(path)
    bare = IIPicture.load(path, lenses=(10, 2), ei_pixels=(2, 6))
    assert bare.lenses == (10, 2) and bare.camera is None
    with pytest.raises(ValueError, match="3×3 px does not divide picture width 20"):
        IIPicture.load(path, lenses=(5, 4), ei_pixels=(3, 3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "Expecting property name"),
        ("[]", '"format": "ii-picture"'),
        ('{"format": "ii-picture", "version": 2}', '"version": 1'),
        ('{"format": "ii-picture", "version": 1}', "ei_pixels, lenses missing"),
        ('{"format": "ii-picture", "version": 1, "lenses": [5, 4], "ei_pixels": [4, 4]}', "need a picture of 20×16"),
        ('{"format": "ii-picture", "version": 1, "lenses": 5, "ei_pixels": [4, 3]}', "lenses is 5"),
        ('{"format": "ii-picture", "version": 1, "lenses": [5, 4], "ei_pixels": [4, 3], "camera": 1}', "camera"),
        ('{"width": 20}', "no II-picture structure"),
        (b"\xff\xfe\x00", "no UTF-8 text"),
    ],
)
def test_broken_and_foreign_sidecars_are_named(tmp_path, text, message):
    picture().save(tmp_path / "p.png")
    (tmp_path / "p.png.json").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=r"p\.png\.json: ") as caught:
        IIPicture.load(tmp_path / "p.png")
    assert message in str(caught.value)


def test_unreadable_pictures(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.png does not exist"):
        IIPicture.load(tmp_path / "none.png")
    with pytest.raises(ValueError, match="no known picture type"):
        IIPicture.load(tmp_path / "none.txt")
    picture().save(tmp_path / "p.png")
    whole = (tmp_path / "p.png").read_bytes()
    for broken in (b"no picture", whole[: len(whole) // 2], b""):
        (tmp_path / "p.png").write_bytes(broken)
        with pytest.raises(OSError, match="cannot read"):
            IIPicture.load(tmp_path / "p.png")


def test_unwritable_targets_leave_nothing(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder.png").mkdir()
    for target in (tmp_path / "file" / "p.png", tmp_path / "missing" / "p.png", tmp_path / "folder.png"):
        with pytest.raises(OSError, match=re.escape(f"cannot write {target}")):
            picture().save(target)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.png"]
    assert not list((tmp_path / "folder.png").iterdir())


def test_unwritable_sidecar_leaves_no_picture_either(tmp_path):
    (tmp_path / "p.png.json").mkdir()
    with pytest.raises(OSError, match=r"p\.png\.json"):
        picture().save(tmp_path / "p.png")
    assert [path.name for path in tmp_path.iterdir()] == ["p.png.json"]


class FailingOutput:
    """An output that opens, writes a part, then fails like a full disk."""

    def open(self, path, spec):
        self.path = path
        return True

    def write_scanlines(self, top, bottom, z, pixels):
        with open(self.path, "wb") as file:
            file.write(b"half a picture")
        return False

    def close(self):
        return True

    def geterror(self):
        return "no space left"


def test_failure_while_writing_leaves_the_old_files(tmp_path, monkeypatch):
    old = picture()
    old.save(tmp_path / "p.png")
    monkeypatch.setattr("ii_core.base.files.oiio.ImageOutput", type("", (), {"create": lambda path: FailingOutput()}))
    with pytest.raises(OSError, match=r"p\.png: no space left"):
        picture(seed=1).save(tmp_path / "p.png")
    monkeypatch.undo()
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "p.png").pixels, old.pixels)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.png", "p.png.json"]


def test_json_that_cannot_be_written_leaves_the_old(tmp_path):
    write_json(tmp_path / "a.json", {"x": [1.5, float("nan"), (float("inf"),)]})
    with pytest.raises(TypeError):
        write_json(tmp_path / "a.json", {"x": object()})
    assert json.loads((tmp_path / "a.json").read_text()) == {"x": [1.5, None, [None]]}
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.skipif(os.name != "posix", reason="file modes")
def test_files_have_the_users_usual_mode(tmp_path):
    before = os.umask(0o027)
    try:
        picture().save(tmp_path / "p.png")
    finally:
        os.umask(before)
    assert (tmp_path / "p.png").stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize(
    ("pixels", "lenses", "ei_pixels", "message"),
    [
        (np.zeros((4096, 8192, 3), np.uint8), (481, 256), (17, 16), "17×16 px does not divide picture width 8192"),
        (np.zeros((10, 8, 3), np.uint8), (2, 3), (4, 3), "4×3 px does not divide picture height 10"),
        (np.zeros((10, 8, 3), np.uint8), (3, 2), (4, 5), "3×2 lenses of 4×5 px need a picture of 12×10 px, this one"),
        (np.zeros((10, 8), np.uint8), (2, 2), (4, 5), "pixels are (10, 8): an array of shape (N, M, 3)"),
        (np.zeros((10, 8, 4), np.uint8), (2, 2), (4, 5), "pixels are (10, 8, 4)"),
        ([[1]], (1, 1), (1, 1), "pixels are list"),
        (np.zeros((10, 8, 3)), (2, 2), (4, 5), "pixels are float64: one of uint8, uint16, float32"),
        (np.zeros((10, 8, 3), np.int16), (2, 2), (4, 5), "pixels are int16"),
        (np.zeros((10, 8, 3), np.uint8), (0, 2), (4, 5), "lenses is 0×2"),
        (np.zeros((10, 8, 3), np.uint8), (2, 2), (4.5, 5), "ei_pixels is 4.5×5"),
    ],
)
def test_structures_that_do_not_fit(pixels, lenses, ei_pixels, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        IIPicture(pixels, lenses, ei_pixels)


def test_camera_of_another_structure():
    source = picture()
    with pytest.raises(ValueError, match=r"the camera has \(5, 4\) lenses of \(4, 3\) px, the picture \(10, 2\)"):
        IIPicture(source.pixels, (10, 2), (2, 6), source.camera)


def test_same_structure():
    a = picture()
    a.check_same_structure(picture(seed=1, camera=False))
    for other, message in [
        (IIPicture(a.pixels, (10, 4), (2, 3)), r"lenses \(5, 4\) against \(10, 4\)"),
        (IIPicture(np.zeros((24, 20, 3), np.uint8), (5, 4), (4, 6)), r"ei_pixels \(4, 3\) against \(4, 6\)"),
        (IIPicture(a.pixels, (5, 4), (4, 3), erect=True), "erect False against True"),
        (picture("uint16"), "uint8 against uint16"),
    ]:
        with pytest.raises(ValueError, match=message):
            a.check_same_structure(other)


def test_with_pixels_keeps_structure_and_camera():
    a = picture("float32")
    b = a.with_pixels(a.pixels * 0)
    assert (b.lenses, b.ei_pixels, b.camera, b.size) == (a.lenses, a.ei_pixels, a.camera, (20, 12))
    with pytest.raises(ValueError, match="does not divide"):
        a.with_pixels(a.pixels[:-1])


@pytest.mark.parametrize(("dtype", "value"), [("uint8", 128), ("uint16", 30000), ("float32", 0.5)])
@pytest.mark.parametrize("sigma", [1.0, 2.5])
def test_noise_is_normal_with_the_given_sigma(dtype, value, sigma):
    code = PEAKS[dtype] / 255
    noise = (add_sensor_noise(flat(dtype, value), sigma).pixels[..., 0].astype(np.float64) - value) / code
    expected = np.sqrt(sigma**2 + (1 / 12 if dtype == "uint8" else 0))  # rounding to whole codes adds 1/12
    # 40 000 samples: the mean wanders by σ/200, the deviation by σ/283; five of those.
    assert abs(noise.mean()) < 5 * expected / 200
    assert noise.std() == pytest.approx(expected, abs=5 * expected / 283)
    # The fourth moment is a normal's 3σ⁴, not a uniform's 1.8σ⁴; its own standard error is 5/200 of σ⁴.
    assert (noise**4).mean() / noise.std() ** 4 == pytest.approx(3, abs=5 * 5 / 200)
    neighbours = np.corrcoef(noise[:, :-1].ravel(), noise[:, 1:].ravel())[0, 1]
    assert abs(neighbours) < 5 / 200 and abs(np.corrcoef(noise[:-1].ravel(), noise[1:].ravel())[0, 1]) < 5 / 200


@pytest.mark.parametrize(("dtype", "values"), [("uint8", (20, 101, 230)), ("uint16", (4000, 33001, 60003))])
def test_noise_is_the_same_in_red_green_and_blue(dtype, values):
    source = flat(dtype)
    source.pixels[...] = values
    noise = add_sensor_noise(source, 2.0).pixels.astype(int) - values
    assert (noise == noise[..., :1]).all() and noise.any()


def test_noise_is_seeded_and_leaves_the_source_alone():
    source = flat()
    before = source.pixels.copy()
    first, again, other = (add_sensor_noise(source, seed=seed).pixels for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    np.testing.assert_array_equal(source.pixels, before)


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_noise_is_clipped_not_wrapped(dtype):
    peak = PEAKS[dtype]
    for value in (0, peak):
        noisy = add_sensor_noise(flat(dtype, value), 3.0).pixels.astype(int)
        assert abs(noisy - value).max() < 20 * peak / 255  # wrapped values would be a whole range away
        assert 0.4 < (noisy == value).mean() < 0.65  # half of it clipped, and what rounds there


def test_noise_of_zero_and_nonsense():
    source = flat()
    assert add_sensor_noise(source, 0) is source
    for sigma in (-1, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"noise sigma is {sigma}"):
            add_sensor_noise(source, sigma)


def test_sixteen_bit_png_is_stored_with_sixteen_bits(tmp_path):
    picture("uint16").save(tmp_path / "p.png")
    assert str(oiio.ImageInput.open(str(tmp_path / "p.png")).spec().format) == "uint16"


@pytest.mark.parametrize("suffix", [".exr", ".tif"])
def test_an_array_of_two_axes_comes_back_as_one_channel(tmp_path, suffix):
    # 512×1024 is large enough that reading past its end, as OpenImageIO does with two axes, would crash
    depth = np.random.default_rng(0).random((512, 1024), np.float32)
    depth[:100] = np.nan
    write_image(tmp_path / f"depth{suffix}", depth)
    np.testing.assert_array_equal(read_image(tmp_path / f"depth{suffix}")[..., 0], depth)


def test_json_holds_lists_of_numbers_on_one_line():
    data = {"a": [1, -2.5, 3e-9, None], "b": [[1, 2], [3]], "c": "[\n 1 ]", "d": [], "e": [*range(2000), "text"]}
    text = json_text(data)
    assert json.loads(text) == data
    assert '"a": [1, -2.5, 3e-09, null]' in text and "[1, 2],\n" in text


def test_a_png_of_views_that_alternate_is_smaller_than_with_filters(tmp_path):
    """The filters of PNG take a pixel's neighbours for alike; those of an elementary image are of other views."""
    rng = np.random.default_rng(3)
    views = rng.integers(0, 250, (4, 4, 3))
    pixels = (np.tile(views, (16, 16, 1)) + rng.integers(0, 3, (64, 64, 3))).astype(np.uint8)
    IIPicture(pixels, (16, 16), (4, 4)).save(tmp_path / "views.png")
    write_image(tmp_path / "filtered.png", pixels)
    np.testing.assert_array_equal(read_image(tmp_path / "views.png"), pixels)
    assert (tmp_path / "views.png").stat().st_size < (tmp_path / "filtered.png").stat().st_size
