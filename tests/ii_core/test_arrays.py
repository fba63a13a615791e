"""Light fields in MATLAB's files and HDF5, written by their libraries and by us."""

import numpy as np
import pytest
import scipy.io

from ii_core import IIPicture, picture_of, preset
from ii_core.base.files import read_depth
from ii_core.formats.arrays import array_depth, array_views, write_array
from ii_core.formats.find import find_views

h5py = pytest.importorskip("h5py")


def field(dtype="uint8", channels=3, shape=(3, 4, 6, 5)):
    """LF[v, u, y, x, c] of random values."""
    rng = np.random.default_rng(0)
    values = rng.random((*shape, channels))
    if dtype.startswith("float"):
        return values.astype(dtype)
    return (values * np.iinfo(dtype).max).astype(dtype)


def stored(path, values, version="5"):
    """Write LF as MATLAB does: version 7.3 is HDF5 with its axes in opposite order behind 512 bytes of text."""
    if version == "5":
        scipy.io.savemat(path, {"LF": values, "Other": {"a": 1}, "Names": np.array(["x"], object)})
        return path
    with h5py.File(path, "w", userblock_size=512) as file:
        file["LF"] = values.transpose()
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    return path


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float64"])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_views_of_matlab_are_those_of_the_array(tmp_path, version, dtype, channels):
    values = field(dtype, channels)
    views = find_views(stored(tmp_path / "a.mat", values, version))
    assert views.shape == (3, 4)
    wanted = values if dtype != "float64" else np.rint(values * 65535).astype(np.uint16)
    wanted = np.repeat(wanted, 3, axis=-1) if channels == 1 else wanted[..., :3]
    for a, b in np.ndindex(3, 4):
        np.testing.assert_array_equal(views.read(a, b), wanted[a, b])


def test_pixels_without_weight_are_told(tmp_path):
    values = field(channels=4)
    values[..., 3] = 1
    values[1, 2, :3, :, 3] = 0
    with pytest.warns(UserWarning, match="50.0% of the middle view's pixels have no weight"):
        array_views(stored(tmp_path / "a.mat", values))


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("suffix", [".mat", ".h5"])
def test_a_picture_comes_back_to_the_bit_with_its_camera(tmp_path, suffix, dtype):
    camera = preset("setup1", scale=128)
    (k, l), (u, v) = camera.lenses, camera.ei_pixels
    pixels = field(dtype, 3, (v, u, l, k)).transpose(2, 0, 3, 1, 4).reshape(l * v, k * u, 3) * np.array(1, dtype)
    for erect in (False, True):
        picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera, erect)
        made, _ = picture_of(find_views(write_array(picture, tmp_path / f"{erect}{suffix}")))
        np.testing.assert_array_equal(made.pixels, pixels)
        assert (made.camera, made.erect, made.pixels.dtype) == (camera, erect, pixels.dtype)


def test_export_and_import_by_the_command(run, tmp_path):
    camera = preset("setup1", scale=128)
    pixels = np.random.default_rng(0).integers(0, 256, (*camera.pixels[::-1], 3), np.uint8)
    IIPicture(pixels, camera.lenses, camera.ei_pixels, camera).save(tmp_path / "p.png")
    for kind in ("mat", "h5"):
        assert run("export", tmp_path / "p.png", "--to", kind, "-o", tmp_path / f"f.{kind}")[0] == 0
        assert run("import", tmp_path / f"f.{kind}", "-o", tmp_path / f"{kind}.png")[0] == 0
        assert (tmp_path / f"{kind}.png.json").read_bytes() == (tmp_path / "p.png.json").read_bytes()
    code, _, error = run("export", tmp_path / "p.png", "--to", "mat", "-o", tmp_path / "f.h5")
    assert code == 2 and "does not end in .mat" in error


def test_the_old_files_of_the_hci_have_depth_and_cameras(run, refused, tmp_path):
    """Views from right to left, dH·f/z − shift the disparity in pixels."""
    values = field(shape=(3, 3, 6, 5))
    depth = np.random.default_rng(1).uniform(5, 9, (3, 3, 6, 5)).astype("<f4")
    with h5py.File(tmp_path / "buddha.h5", "w") as file:
        file["LF"], file["GT_DEPTH"] = values, depth
        file.attrs.update({"dH": 0.05, "dV": 0.05, "focalLength": 700.0, "shift": 5.0})
    picture, _ = picture_of(find_views(tmp_path / "buddha.h5"))
    np.testing.assert_array_equal(picture.pixels[1::3, 0::3], values[1, 2])
    np.testing.assert_array_equal(array_depth(tmp_path / "buddha.h5")[1::3, 0::3], depth[1, 2])
    rig = array_views(tmp_path / "buddha.h5").rig
    per_mm = rig.baseline_mm * rig.focal_mm / (rig.sensor_mm / 6)
    assert per_mm / 8000 - per_mm / rig.focus_mm == pytest.approx(0.05 * 700 / 8 - 5)

    given = ("import", tmp_path / "buddha.h5", "-o", tmp_path / "p.png", "--depth", tmp_path / "z.exr")
    refused(run(*given, "--middle", "1x1"), "leave out --ei-pixels, --grid, --middle")
    assert run(*given)[0] == 0
    np.testing.assert_array_equal(read_depth(tmp_path / "z.exr")[1::3, 0::3], 1000 * depth[1, 2])
    with h5py.File(tmp_path / "buddha.h5", "a") as file:
        del file["GT_DEPTH"]
    refused(run(*given, "--force"), "has no GT_DEPTH")


@pytest.mark.parametrize("kind", ["external", "soft", "virtual", "raw", "object", "two", "none", "wide", "range"])
def test_what_leads_out_of_the_file_or_is_no_light_field_is_refused(tmp_path, kind):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["LF"] = field()
    (tmp_path / "secret").write_bytes(bytes(10_000))
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        if kind == "external":
            file["LF"] = h5py.ExternalLink("other.h5", "/LF")
        elif kind == "soft":
            file["LF"] = h5py.SoftLink("/nowhere")
        elif kind == "virtual":
            layout = h5py.VirtualLayout(field().shape, "u1")
            layout[...] = h5py.VirtualSource("other.h5", "LF", field().shape)
            file.create_virtual_dataset("LF", layout)
        elif kind == "raw":
            file.create_dataset("LF", (3, 4, 6, 5, 3), "u1", external=[("secret", 0, 10_000)])
        elif kind == "object":
            file.create_dataset("LF", (2, 2, 2, 2), h5py.string_dtype())
        elif kind == "two":
            file["A"] = file["B"] = field()
        elif kind == "wide":
            file.create_dataset("LF", (60_000, 60_000, 60_000, 60_000, 3), "u1", chunks=(1, 1, 8, 8, 3))
        elif kind == "range":
            file["LF"] = field("float32") * 255
    with pytest.raises(ValueError, match=r"a\.h5") as error:
        picture_of(find_views(path))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("size", [0, 8, 1 << 40, (1 << 64) - 16])
@pytest.mark.parametrize("number", [0, 7])
def test_a_heap_of_texts_that_hdf5_would_not_leave_is_told(tmp_path, number, size):
    """Its library steps over a heap's objects by their sizes: sizes of 0 keep it at one of them for ever."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["LF"] = field()
        file["LF"].attrs["structure"] = "{}"
    data = bytearray(path.read_bytes())
    free = data.index(b"GCOL") + 16 + 16 + 8  # behind the heap's head, the head of its one object and the padded text
    data[free : free + 2] = number.to_bytes(2, "little")
    data[free + 8 : free + 16] = size.to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"a\.h5 is no light field: an object of \d+ bytes in the heap"):
        find_views(path)


def test_a_pickle_in_a_matlab_file_is_not_loaded(tmp_path):
    """Objects and functions of MATLAB are listed, never made."""
    scipy.io.savemat(tmp_path / "a.mat", {"LF": np.array([{"a": 1}], object).reshape(1, 1, 1, 1)})
    with pytest.raises(ValueError, match="0 arrays of four or five axes"):
        find_views(tmp_path / "a.mat")
    (tmp_path / "b.mat").write_bytes(b"\x80\x04cos\nsystem\n.")
    with pytest.raises(ValueError, match="is no light field"):
        find_views(tmp_path / "b.mat")


def test_three_arrays_of_colours_and_doubles_of_whole_numbers(tmp_path):
    """As in antipa/light-fields: ``lfr``, ``lfg`` and ``lfb``, whose doubles are codes."""
    codes = np.random.default_rng(5).integers(0, 225, (2, 3, 5, 7, 3))
    path = tmp_path / "field.mat"
    scipy.io.savemat(path, {f"lf{c}": codes[..., i].astype(float) for i, c in enumerate("rgb")})
    views = array_views(path)
    assert views.shape == (2, 3)
    view = views.read(1, 2)
    np.testing.assert_array_equal(view, codes[1, 2])
    assert view.dtype == np.uint8
    scipy.io.savemat(path, {"LF": codes * 256.0})
    assert array_views(path).read(0, 0).dtype == np.uint16
    red = codes[..., 0].astype(float)
    for wrong in ({"lfr": red, "lfg": red}, dict.fromkeys(("lfr", "lfg", "lfx"), red)):
        scipy.io.savemat(path, wrong)
        with pytest.raises(ValueError, match=r"it holds [23] arrays of four or five axes"):
            array_views(path)
