"""Light-field formats: exact round trips, orders of views, refused files."""

import json
import math
import re
import shutil
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.accuracy.moire import measured
from ii_core import Eye, IIPicture, find_views, load_mosaic, picture_of, preset, resampled, sub_images, view_image
from ii_core.base.colour import linear
from ii_core.base.files import read_image, write_image
from ii_core.display.look import display_views
from ii_core.display.looking_glass import (
    CELL,
    native_eye_image,
    native_picture,
    read_looking_glass,
    view_numbers,
    view_of_native,
)
from ii_core.display.quilt import shown_shares
from ii_core.formats.grid import camera_views
from ii_core.formats.hci import view_disparity, write_hci
from ii_core.formats.order import Arrangement, estimate
from ii_core.formats.pfm import read_pfm
from ii_core.formats.quilt import write_quilt
from ii_core.formats.views import write_views
from tests.ii_core.test_display import directions as numbered
from tests.support import pictures

counts = st.integers(1, 5)
structures = st.tuples(counts, counts, counts, counts).filter(lambda s: s[2] * s[3] > 1)


def noise(k, l, u, v, dtype="uint8", erect=False):
    rng = np.random.default_rng(k + 10 * l + 100 * u + 1000 * v)
    pixels = rng.integers(0, np.iinfo(dtype).max + 1, (l * v, k * u, 3), dtype)
    return IIPicture(pixels, (k, l), (u, v), erect=erect)


def same(a, b):
    np.testing.assert_array_equal(a.pixels, b.pixels)
    assert a.pixels.dtype == b.pixels.dtype
    assert (a.lenses, a.ei_pixels, a.erect) == (b.lenses, b.ei_pixels, b.erect)


@pytest.fixture(scope="module")
def shot():
    """A rendered picture with depth; near objects in front of far ones."""
    return pictures.shot(scale=8)


@given(structure=structures, dtype=st.sampled_from(["uint8", "uint16"]), erect=st.booleans())
@settings(max_examples=30)
def test_view_folders_come_back_to_the_bit(tmp_path_factory, structure, dtype, erect):
    folder, picture = tmp_path_factory.mktemp("v"), noise(*structure, dtype, erect)
    assert write_views(picture, folder) == folder
    back, order = picture_of(find_views(folder))
    assert order.basis == "given"
    same(back, picture)
    if min(structure[2:]) == 1:  # without the structure one number varies: the grid must be given
        (folder / "structure.json").unlink()
        with pytest.raises(ValueError, match="do not hold a row and a column number: give the grid"):
            find_views(folder)
        back, _ = picture_of(
            find_views(folder, grid=(structure[2], structure[3])), flip_down=False, flip_across=False
        )
        same(back, IIPicture(in_camera_order(picture), picture.lenses, picture.ei_pixels))


def in_camera_order(picture):
    (k, l), (u, v) = picture.lenses, picture.ei_pixels
    field = picture.pixels.reshape(l, v, k, u, 3)
    return (field[:, ::-1, :, ::-1] if picture.erect else field).reshape(picture.pixels.shape)


@given(structure=structures, erect=st.booleans())
@settings(max_examples=20)
def test_hci_folders_come_back_to_the_bit(tmp_path_factory, structure, erect):
    folder, picture = tmp_path_factory.mktemp("h"), noise(*structure, "uint16", erect)
    write_hci(picture, folder)
    back, _ = picture_of(find_views(folder))
    np.testing.assert_array_equal(back.pixels, in_camera_order(picture))
    assert (back.lenses, back.ei_pixels) == (picture.lenses, picture.ei_pixels)


@given(structure=st.tuples(counts, counts, st.integers(2, 12), st.just(1)))
@settings(max_examples=20)
def test_quilts_come_back_to_the_bit(tmp_path_factory, structure):
    picture = noise(*structure)
    path = write_quilt(picture, tmp_path_factory.mktemp("q") / "shot.png")
    back, _ = picture_of(find_views(path))
    same(back, picture)
    again = write_quilt(back, path.with_name("again.png"))
    np.testing.assert_array_equal(read_image(again), read_image(path))


@given(structure=structures)
@settings(max_examples=10)
def test_mosaics_come_back_to_the_bit(tmp_path_factory, structure):
    picture = noise(*structure)
    path = tmp_path_factory.mktemp("m") / "lenslets.png"
    write_image(path, picture.pixels)
    same(load_mosaic(path, picture.ei_pixels), picture)


def test_floats_go_through_exr(tmp_path):
    pixels = np.random.default_rng(0).random((6, 8, 3), np.float32)
    picture = IIPicture(pixels, (4, 3), (2, 2))
    write_views(picture, tmp_path)
    same(picture_of(find_views(tmp_path))[0], picture)


def test_view_zero_of_a_quilt_is_the_leftmost_and_lies_bottom_left(tmp_path):
    picture = IIPicture(np.repeat(np.arange(6, dtype=np.uint8), 3).reshape(1, 6, 3), (1, 1), (6, 1))
    tiles = read_image(write_quilt(picture, tmp_path / "q.png"))[..., 0]
    assert tiles.tolist() in ([[3, 4, 5], [0, 1, 2]], [[4, 5], [2, 3], [0, 1]])
    same(picture_of(find_views(tmp_path / f"q_qs{tiles.shape[1]}x{tiles.shape[0]}a1.png"))[0], picture)


def test_quilts_are_cropped_at_the_right_and_the_top(tmp_path):
    quilt = np.zeros((5, 7, 3), np.uint8)
    quilt[1:, :6] = 9
    write_image(tmp_path / "q_qs3x2a1.png", quilt)
    picture, _ = picture_of(find_views(tmp_path / "q_qs3x2a1.png"))
    assert picture.ei_pixels == (6, 1) and picture.lenses == (2, 2) and (picture.pixels == 9).all()


@pytest.mark.parametrize(
    "name",
    [
        "view_{a:02}_{b:02}.png",
        "{a}_{b}.png",
        "out_{a:02}_{b:02}_-{b}.5_11{a}.25.png",  # Stanford
        "IMG_0001_{n:03}_{a:02}_{b:02}.png",  # decoded Lytro, serial number before the two
        "s7t{b}f{a}.png",
    ],
)
def test_two_numbers_in_any_name(tmp_path, name):
    picture = noise(4, 3, 5, 2)
    for n, (row, col, view) in enumerate(camera_views(picture)):
        write_image(tmp_path / name.format(a=2 * row + 1, b=col, n=n), view)
    write_image(tmp_path / "thumbnail.png", np.zeros((1, 1, 3), np.uint8))
    second_first = name.startswith("s7")
    back, _ = picture_of(find_views(tmp_path), transposed=second_first, flip_down=False, flip_across=False)
    same(back, picture)


ORDERS = [
    dict(transposed=t, flip_down=d, flip_across=a)
    for t in (False, True)
    for d in (False, True)
    for a in (False, True)
]


@pytest.mark.parametrize("order", ORDERS, ids=str)
def test_the_order_of_a_rendered_picture_is_found(shot, order):
    """Pictures determine the axes and whether their directions agree; one given flip determines the other."""
    stack = sub_images(shot.picture)
    rows, cols = stack.shape[:2]
    arrangement = Arrangement(**order)
    shape = (cols, rows) if order["transposed"] else (rows, cols)

    def read(a, b):
        return stack[arrangement.place(a, b, shape)]

    seen = estimate(read, shape, Arrangement())
    assert seen.transposed == order["transposed"]
    assert not seen.flip_across
    assert seen.flip_down == (order["flip_down"] != order["flip_across"])
    told = estimate(read, shape, Arrangement(flip_across=order["flip_across"]), {"flip_across"})
    assert {key: getattr(told, key) for key in order} == order
    low, high = told.disparity
    assert low < high <= 0  # an II-picture's scene lies behind its lenses
    told = estimate(read, shape, Arrangement(flip_down=order["flip_down"]), {"flip_down"})
    assert {key: getattr(told, key) for key in order} == order


def named_by_places(folder, picture, order, *, upwards, part=slice(5, 9)):
    """Write the middle views as Stanford does; U to the right, V up or down, both of both signs, with jitter."""
    stack = sub_images(picture)[part, part]
    rows, cols = stack.shape[:2]
    shape = (cols, rows) if order["transposed"] else (rows, cols)
    rng = np.random.default_rng(1)
    for a, b in np.ndindex(*shape):
        row, col = Arrangement(**order).place(a, b, shape)
        u, v = 8.6 * (col - 1.3) + rng.normal(0, 0.2), (-8.2 if upwards else 8.2) * (row - 1.6) + rng.normal(0, 0.2)
        write_image(folder / f"out_{a:02}_{b:02}_{v:.6f}_{u:.6f}_.png", stack[row, col])
    return stack


@pytest.mark.parametrize("order", ORDERS, ids=str)
@pytest.mark.parametrize("upwards", [True, False])
def test_places_in_names_settle_order_and_180_degrees(shot, tmp_path, order, upwards):
    """On b1dc540 left to right was assumed: half of these came out rotated by 180°."""
    stack = named_by_places(tmp_path, shot.picture, order, upwards=upwards)
    made, found = picture_of(find_views(tmp_path))
    assert {key: getattr(found, key) for key in order} == order
    np.testing.assert_array_equal(sub_images(made), stack)
    assert found.disparity[1] <= 0  # the scene lies behind the lenses: the true sign
    assert re.search(r"by camera places in names, 8\.\d+×8\.\d+ mm apart; seen: ", found.describe())


@pytest.mark.parametrize("order", ORDERS[::3], ids=str)
def test_places_alone_settle_views_without_detail(tmp_path, order):
    """The views differ by colour, without shifts."""
    pixels = np.random.default_rng(3).integers(0, 256, (16, 16, 3), np.uint8)
    flat = IIPicture(np.tile(pixels, (12, 9, 1)), (9, 12), (16, 16))
    stack = named_by_places(tmp_path, flat, order, upwards=True)
    made, found = picture_of(find_views(tmp_path))
    assert {key: getattr(found, key) for key in order} == order and "upwards is assumed" in found.describe()
    np.testing.assert_array_equal(sub_images(made), stack)
    given = picture_of(find_views(tmp_path), flip_across=not order["flip_across"])[1]
    assert given.flip_across != order["flip_across"]  # given flips take precedence


def test_views_without_detail_have_an_unknown_order_that_is_reported():
    flat = estimate(lambda a, b: np.full((40, 60, 3), 77, np.uint8), (4, 5), Arrangement())
    assert flat == Arrangement() and flat.describe().endswith("then left to right (assumed)")


def test_views_follow_the_viewer_to_the_right(shot):
    """SI_{u+1,v} is what a viewer further to the right sees, by the view image of the same picture."""
    (u, v), camera = shot.picture.ei_pixels, shot.picture.camera
    far = -1e7  # so far away that all lenses show the same direction
    per_pixel = camera.pixel_pitch_mm / camera.gap_mm * (camera.gap_mm - far)
    stack = sub_images(shot.picture)
    for du, dv in ((0, 0), (3, 0), (0, 2), (-4, -5)):
        right, down = (du + 0.5) * per_pixel, (dv + 0.5) * per_pixel
        seen, valid = view_image(shot.picture, (right, -down, far), interpolation="nearest")
        assert valid.all()
        np.testing.assert_array_equal(seen, stack[v // 2 + dv, u // 2 + du])


def test_disparity_takes_the_middle_view_to_its_neighbours(shot, tmp_path):
    write_hci(shot.picture, tmp_path, depth=shot.depth)
    d = read_pfm(tmp_path / "gt_disp_lowres.pfm")
    np.testing.assert_array_equal(d, view_disparity(shot.picture, shot.depth))
    stack, depth = sub_images(shot.picture), shot.depth
    (u, v), (k, _) = shot.picture.ei_pixels, shot.picture.lenses
    assert np.nanmax(d) < 0
    # Where the same point is seen, its depth is the same in the other view at x − d, and its colour nearly so.
    here, there = depth[v // 2 :: v, u // 2 :: u], depth[v // 2 :: v, u // 2 + 1 :: u]
    x = np.rint(np.arange(k) - d)
    inside = np.isfinite(d) & (x < k)
    rows, cols = np.nonzero(inside)
    target = x[inside].astype(int)
    partner = np.abs(there[rows, target] - here[rows, cols]) < 0.01 * here[rows, cols]
    assert partner.mean() > 0.6
    moved = stack[v // 2, u // 2 + 1][rows[partner], target[partner]].astype(float)
    stood = stack[v // 2, u // 2 + 1][rows[partner], cols[partner]].astype(float)
    reference = stack[v // 2, u // 2][rows[partner], cols[partner]]
    assert np.abs(moved - reference).mean() < 0.5 * np.abs(stood - reference).mean()


def test_disparity_by_hand():
    """δP = 0.1, Λ = 2, δL = 0.4: a point at z = 10 moves 0.1·8/(2·0.4) = 1 pixel along with the viewer."""
    from ii_core import IICamera

    camera = IICamera(pixels=(12, 8), lenses=(3, 2), pixel_pitch_mm=0.1, gap_mm=2.0)
    picture = IIPicture(np.zeros((8, 12, 3), np.uint8), (3, 2), (4, 4), camera)
    depth = np.full((8, 12), 10.0)
    depth[2, 2] = np.nan  # lens (0, 0), view (2, 2)
    d = view_disparity(picture, depth)
    assert np.isnan(d[0, 0])
    np.testing.assert_allclose(d.ravel()[1:], -1.0, rtol=1e-6)


def refuse(match, *arguments, **options):
    with pytest.raises(ValueError, match=match):
        picture_of(find_views(*arguments, **options))


@pytest.fixture
def folder(tmp_path):
    write_views(noise(4, 3, 3, 2), tmp_path)
    (tmp_path / "structure.json").unlink()
    return tmp_path


def test_missing_views_are_named(folder):
    (folder / "view_01_02.png").unlink()
    refuse(r"1 of 6 views are missing in .*: \(1, 2\)", folder)


def test_gaps_in_the_numbers(folder):
    for row in (0, 1):
        shutil.move(folder / f"view_0{row}_02.png", folder / f"view_0{row}_03.png")
    refuse("view numbers in .* have gaps: 0, 1, 3", folder)


def test_views_of_another_size(folder):
    write_image(folder / "view_01_01.png", np.zeros((3, 5, 3), np.uint8))
    refuse("view_01_01.png has 5×3 px, view_00_00.png 4×3 px|view_.* has 4×3 px, view_01_01.png 5×3 px", folder)


def test_views_of_another_type(folder):
    write_image(folder / "view_01_01.png", np.zeros((3, 4, 3), np.uint16))
    refuse("all must be of one type", folder)


def test_mixed_file_types(folder):
    shutil.move(folder / "view_01_01.png", folder / "view_01_01.tif")
    refuse("mixed types .png, .tif", folder)


def test_transparent_views(folder):
    write_image(folder / "view_01_01.png", np.zeros((3, 4, 4), np.uint8))
    refuse("view_01_01.png is transparent", folder)


def test_opaque_alpha_and_grey_are_read(folder):
    view = np.full((3, 4, 4), 255, np.uint8)
    write_image(folder / "view_01_01.png", view)
    write_image(folder / "view_01_00.png", view[..., :1])
    picture, _ = picture_of(find_views(folder))
    assert (picture.pixels[1::2, 1::3] == 255).all() and (picture.pixels[1::2, 0::3] == 255).all()


def test_a_broken_view_is_an_os_error(folder):
    (folder / "view_01_01.png").write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    with pytest.raises(OSError, match=r"view_01_01\.png"):
        picture_of(find_views(folder))


def test_one_view_and_none(tmp_path):
    refuse("holds no pictures", tmp_path)
    write_image(tmp_path / "view_0_0.png", np.zeros((3, 4, 3), np.uint8))
    refuse("holds one view", tmp_path)
    write_image(tmp_path / "q.png", np.zeros((3, 4, 3), np.uint8))
    refuse("one view", tmp_path / "q.png", grid=(1, 1))
    refuse("cannot hold 5×1 tiles", tmp_path / "q.png", grid=(5, 1))
    refuse("no folder and its name says no _qsCxRaA", tmp_path / "q.png")


def test_grids_that_do_not_fit(folder):
    refuse("grid is 4×2 views, columns × rows: 6 are there", folder, grid=(4, 2))


def test_hci_without_parameters_needs_a_square(tmp_path):
    write_hci(noise(2, 2, 3, 3), tmp_path)
    (tmp_path / "parameters.cfg").unlink()
    assert find_views(tmp_path).shape == (3, 3)
    (tmp_path / "input_Cam008.png").unlink()
    refuse("holds 8 views, no square", tmp_path)


def test_hci_with_wrong_parameters(tmp_path):
    write_hci(noise(2, 2, 3, 2), tmp_path)
    (tmp_path / "parameters.cfg").write_text("[extrinsics]\nnum_cams_x = 4\nnum_cams_y = 2\n")
    refuse("grid is 4×2 views, columns × rows: 6 are there", tmp_path)
    (tmp_path / "parameters.cfg").write_text("[extrinsics]\nnum_cams_x = many\n")
    refuse("does not say num_cams_x", tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", '{"ei_pixels": 3}'])
def test_invalid_structures_are_refused(folder, text):
    (folder / "structure.json").write_text(text)
    refuse("is no structure of an II-picture", folder)


def test_a_structure_of_another_picture(folder):
    (folder / "structure.json").write_text(json.dumps(noise(4, 3, 2, 2).structure_json()))
    refuse("says 2×2 views, 2×3 are there", folder)


def test_lenses_that_do_not_fit_a_mosaic(tmp_path):
    write_image(tmp_path / "m.png", np.zeros((7, 9, 3), np.uint8))
    with pytest.raises(ValueError, match="lenses of 10×2 px do not fit"):
        load_mosaic(tmp_path / "m.png", (10, 2))
    with pytest.warns(UserWarning, match="1 px at the right and 1 px at the bottom are cut off"):
        assert load_mosaic(tmp_path / "m.png", (4, 3)).lenses == (2, 2)


def test_disparity_needs_a_camera_and_its_own_depth(shot, tmp_path):
    with pytest.raises(ValueError, match="has no camera"):
        write_hci(noise(2, 2, 2, 2), tmp_path, depth=np.zeros((4, 4)))
    with pytest.raises(ValueError, match=r"depth is \(4, 4\)"):
        write_hci(shot.picture, tmp_path, depth=np.zeros((4, 4)))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("camera", "ei_pixels", "hexagonal"),
    [
        ("hexagonal", (16, 14), True),
        pytest.param("hdtv", (24, 17), True, marks=pytest.mark.slow),
        ("setup1", (16, 16), False),
        pytest.param("setup3", (64, 64), False, marks=pytest.mark.slow),
    ],
)
def test_import_warns_of_cropping_and_hexagonal_lenses(tmp_path, camera, ei_pixels, hexagonal):
    made = pictures.shot("twins", camera, {"hdtv": 5, "hexagonal": 8}.get(camera, 16))
    height, width = made.picture.pixels.shape[:2]
    (u, v), source = ei_pixels, tmp_path / "raw.png"
    pixels = np.pad(made.picture.pixels, ((0, -height % v + 3), (0, -width % u + 5), (0, 0)), mode="edge")
    write_image(source, pixels)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        load_mosaic(source, ei_pixels)
    texts = [str(warning.message) for warning in told]
    assert any("5 px at the right and 3 px at the bottom are cut off" in text for text in texts)
    assert any("looks hexagonal" in text for text in texts) == hexagonal
    write_image(source, pixels[:-3, :-5])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        load_mosaic(source, ei_pixels)
    assert not any("cut off" in str(warning.message) for warning in told)


def test_more_digits_than_a_camera_keeps_are_the_same_pitch():
    camera = preset("plenoptic", scale=8)  # 512/37 px a lens
    pixels = np.zeros((*camera.pixels[::-1], 3), np.uint8)
    stated = replace(camera, lens_pitch_mm=13.84 * camera.pixel_pitch_mm * (1 + 1e-12))
    kept = stated.ei_pixels[0]
    for u in (kept, kept * (1 + 3e-12), 13.8400000001):
        assert IIPicture(pixels, stated.lenses, (u, u), stated).ei_pixels == stated.ei_pixels
    with pytest.raises(ValueError, match=r"the camera has .* the picture"):
        IIPicture(pixels, stated.lenses, (13.841, 13.841), stated)


@pytest.mark.slow
def test_deshift_is_on_the_command_line(run, refused, tmp_path):
    made = pictures.shot("twins", "hexagonal", 8).picture
    made.save(tmp_path / "h.png")
    assert run("regular", tmp_path / "h.png", "--deshift", "-o", tmp_path / "r.png")[0] == 0
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "r.png").pixels, resampled(made, deshift=True)[0].pixels)
    command = ("regular", tmp_path / "h.png", "--deshift", "--method", "rectangle", "-o", tmp_path / "s.png")
    refused(run(*command), "deshift is no option of method rectangle")


# -- looking Glass displays by their own calibration


DISPLAY = {  # the form of the maker's file; values of a Portrait
    "configVersion": "3.0", "serial": "LKG-PO0000", "pitch": {"value": 52.6}, "slope": {"value": -7.1},
    "center": {"value": 0.82}, "viewCone": {"value": 40.0}, "invView": {"value": 1.0}, "DPI": {"value": 324.0},
    "screenW": {"value": 48.0}, "screenH": {"value": 64.0}, "flipImageX": {"value": 0.0}, "flipSubp": {"value": 0.0},
}  # fmt: skip


def display(tmp_path, **more):
    (tmp_path / "visual.json").write_text(json.dumps({**DISPLAY, **more}))
    return read_looking_glass(tmp_path / "visual.json")


def by_the_shader(d, x, y, channel, views):
    """View of a subpixel by the maker's formula, one number at a time; y counts from the bottom."""
    u, v = (x + 0.5) / d.size[0], (y + 0.5) / d.size[1]
    u = 1 - u if d.flip_x else u
    pitch = d.pitch * (d.size[0] / d.dpi) * math.cos(math.atan(1 / d.slope))
    tilt = d.size[1] / (d.size[0] * d.slope) * (-1 if d.flip_x else 1)
    a = (u + channel / (3 * d.size[0]) + v * tilt) * pitch - d.centre
    return int(min(max(1 - (a - math.floor(a)), 1e-5), 0.999999) * views)


@pytest.mark.parametrize("flip", [0, 1])
@pytest.mark.parametrize("slope", [-7.1, 5.8])
def test_subpixels_of_a_looking_glass_show_the_views_of_the_makers_formula(tmp_path, slope, flip):
    d = display(tmp_path, slope=slope, pitch=300.0, flipImageX=flip)
    numbers = view_numbers(d, 45)
    for x, y, channel in [(0, 0, 0), (47, 63, 2), (11, 5, 1), (30, 62, 0), (3, 33, 2)]:
        assert numbers[63 - y, x, channel] == by_the_shader(d, x, y, channel, 45)
    assert len(np.unique(numbers)) == 45  # several lenses across


FLIPS = [{}, {"flipImageX": 1}, {"flipImageY": 1.0}, {"flipSubp": {"value": 1}}, {"invView": 0},
    {"subpixelCells": [dict.fromkeys(CELL, 0.2), dict.fromkeys(CELL, -0.4)], "CellPatternMode": 1}]  # fmt: skip


@pytest.mark.parametrize("more", FLIPS)
def test_a_panel_picture_read_back_gives_the_views(tmp_path, more):
    d = display(tmp_path, pitch=300.0, **more)
    picture = numbered()
    panel = native_picture(picture, d, views=9, cone=0.9)
    shares = shown_shares(picture, d.size[0] / d.size[1])
    owned = np.zeros(panel.shape, int)
    for number, view in enumerate(display_views(picture, 9, size=d.size, cone=0.9, shares=shares)):
        back, own = view_of_native(panel, d, number, views=9)
        np.testing.assert_array_equal(back[own], view[own])
        owned += own
    assert (owned == 1).all()


def test_blue_stripes_first_and_views_from_the_right(tmp_path):
    usual = view_numbers(display(tmp_path, pitch=300.0), 45)
    np.testing.assert_array_equal(view_numbers(display(tmp_path, pitch=300.0, flipSubp=1), 45), usual[..., ::-1])
    other_way = view_numbers(display(tmp_path, pitch=300.0, invView=0), 45)
    assert np.abs(other_way.astype(int) + usual - 44).max() <= 1


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"slope": 0}, "slope is 0"),
        ({"pitch": "x"}, "could not convert"),
        ({"screenW": 1e9}, "screenW is 1e\\+09"),
        ({"DPI": None}, "is no calibration"),
        ({"subpixelCells": [{}]}, "ROffsetX missing"),
    ],
)
def test_calibrations_without_sense_are_refused(tmp_path, more, said):
    with pytest.raises(ValueError, match=said):
        display(tmp_path, **more)


def test_display_by_a_calibration_writes_the_panels_picture(run, tmp_path):
    display(tmp_path, pitch=300.0)
    numbered().save(tmp_path / "p.png")
    options = ("display", tmp_path / "p.png", "--calibration", tmp_path / "visual.json")
    assert run(*options, "--as", "lenticular", "-o", tmp_path / "n.png")[0] == 0
    assert read_image(tmp_path / "n.png").shape == (64, 48, 3)
    code, _, error = run(*options, "--as", "lenticular", "--pitch", "3", "-o", tmp_path / "m.png")
    assert code == 2 and "--calibration does not use --pitch" in error


@pytest.mark.slow
def test_an_eye_sees_even_views_without_moire_by_the_displays_own_calibration(tmp_path):
    """The light of every direction is known in closed form; the eye's rays pass lenses, not the shader's formula."""
    assert max(measured("its own")["light"]) < 0.006
    assert min(measured("pitch + 0.1 %")["light"]) > 0.02 and min(measured("slope + 2 %")["light"]) > 0.08
    d, eye = display(tmp_path), Eye(position_mm=(0, 0, -400.0), pupil_mm=4)
    grey = np.full((64, 48, 3), 188, np.uint8)
    seen = native_eye_image(grey, d, eye, size=(4, 4), rays=4096).light[1:-1, 1:-1]
    np.testing.assert_allclose(seen, linear(188 / 255), rtol=0.15)  # two lenses: stripes are left in it
    np.testing.assert_allclose(seen.mean(axis=2), linear(188 / 255), rtol=0.02)
    for wrong, said in (
        ((grey[:9], d, eye), "the panel|uint8"),
        ((grey, replace(d, flip_x=True), eye), "upright stripes are needed"),
        ((grey, d, Eye(position_mm=(0, 0, 1.0))), "not before the panel"),
    ):
        with pytest.raises(ValueError, match=said):
            native_eye_image(*wrong)


def test_the_eye_command_takes_a_panels_picture(run, refused, tmp_path):
    write_image(tmp_path / "panel.png", np.full((64, 48, 3), 188, np.uint8))
    display(tmp_path)
    command = "eye", tmp_path / "panel.png", "--calibration", tmp_path / "visual.json", "-o", tmp_path / "e.png"
    assert run(*command, "--at", "0,0,-400", "--size", "4x4")[0] == 0
    assert read_image(tmp_path / "e.png").shape == (4, 4, 3)
    refused(run(*command, "--force"), "at is missing")
    refused(run(*command, "--at", "0,0,-400", "--turn", "3", "--force"), "--turn")
