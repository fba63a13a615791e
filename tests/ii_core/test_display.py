"""Displays: focused views, quilts, lenticular panels, simulations, films."""

import av
import numpy as np
import pytest
from PIL import Image

from ii_core import IICamera, IIPicture, five_viewpoints, preset, view_image
from ii_core.display.devices import DEVICES, device
from ii_core.display.film import write_animation
from ii_core.display.lenticular import lenticular
from ii_core.display.look import focused_view, held, look, viewpoints_across, viewpoints_around, zone_half_deg
from ii_core.display.quilt import cone_share, quilt
from ii_core.display.simulate import display_simulation
from ii_core.formats.quilt import quilt_name
from ii_core.picture.assumed import with_assumed_camera
from raytrace_ii import load_scene, render


@pytest.fixture(scope="module")
def apples():
    return render(load_scene("apples"), preset("setup1", scale=16), support=()).picture


def directions(u=12, k=16, l=8):
    """Return a picture whose sub-images are uniform: red is the pixel's column, green its row."""
    camera = IICamera(pixels=(k * u, l * u), lenses=(k, l), pixel_pitch_mm=0.01, gap_mm=0.3)
    pixels = np.zeros((l, u, k, u, 3), np.uint8)
    pixels[..., 0] = 20 * np.arange(u)
    pixels[..., 1] = 20 * np.arange(u)[:, None, None]
    return IIPicture(pixels.reshape(l * u, k * u, 3), (k, l), (u, u), camera)


@pytest.mark.parametrize("erect", [False, True])
def test_a_view_with_one_pixel_a_lens_is_the_view_image(apples, erect):
    picture = IIPicture(apples.pixels, apples.lenses, apples.ei_pixels, apples.camera, erect)
    for place in five_viewpoints(picture.camera).values():
        wanted, valid = view_image(picture, place)
        got = focused_view(picture, place).astype(int)
        assert np.abs(got - wanted)[valid].max() <= 1  # halves are rounded up here, to even there


def test_the_plane_in_focus_is_sharp():
    """Stripes on a plane: focused there a wide aperture changes nothing, focused elsewhere it blurs."""
    k, l, u, shift = 64, 4, 5, 2
    camera = IICamera(pixels=(k * u, l * u), lenses=(k, l), pixel_pitch_mm=0.01, gap_mm=0.2)
    depth = camera.gap_mm * (1 + shift * camera.lens_pitch_mm[0] / camera.pixel_pitch_mm)
    field = np.zeros((l, u, k, u, 3), np.uint8)
    for i in range(u):
        field[..., i, :] = (np.where((np.arange(k) - shift * i) // 4 % 2, 200, 40))[:, None]
    picture = IIPicture(field.reshape(l * u, k * u, 3), (k, l), (u, u), camera)
    place = five_viewpoints(camera)["front"]
    sharp = focused_view(picture, place, depth_mm=depth)[:, 8:-8]
    wide = focused_view(picture, place, depth_mm=depth, aperture_px=2.5)[:, 8:-8]
    off = focused_view(picture, place, aperture_px=2.5)[:, 8:-8]
    assert set(np.unique(sharp)) >= {40, 200}
    np.testing.assert_allclose(wide.astype(int), sharp, atol=40)  # between lenses the stripe's edge is interpolated
    assert wide.std() > 0.95 * sharp.std() and off.std() < 0.8 * sharp.std()


def test_kernel_without_compilation(apples):
    field = np.random.default_rng(0).integers(0, 256, (3, 4, 2, 5, 3), np.uint8)
    arguments = [np.linspace(-1, 4, 7), np.linspace(0, 3, 6), np.linspace(-1, 6, 7), np.linspace(-0.4, 2, 6)]
    results = []
    for kernel in (look, look.py_func):
        out = np.zeros((6, 7, 3), np.uint8)
        kernel(field, *arguments, np.array([0.7, -0.4]), np.array([1.8, 1.0]), out)
        results.append(out)
    np.testing.assert_array_equal(*results)


@pytest.mark.parametrize("aspect", [0.5625, 1.0, 2.0, 3.2])
@pytest.mark.parametrize("whole", [False, True])
def test_a_circle_stays_one_on_a_display_of_any_aspect(aspect, whole):
    """A disc painted on the lens array, through a tile whose pixels the display stretches to its own aspect."""
    camera = preset("setup1", scale=8)  # 64×32 lenses, 2:1
    k, l = camera.lenses
    y, x = np.mgrid[:l, :k]
    disc = (np.hypot(x - (k - 1) / 2, y - (l - 1) / 2) < 8).astype(np.uint8) * 255
    pixels = np.repeat(np.repeat(disc, 16, 0), 16, 1)[..., None].repeat(3, axis=2)
    picture = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    made = quilt(picture, (1, 1), size=(200, 200), aspect=aspect, whole=whole)[..., 0] > 127
    rows, columns = np.flatnonzero(made.any(axis=1)), np.flatnonzero(made.any(axis=0))
    across, down = np.ptp(columns) / 200 * aspect, np.ptp(rows) / 200  # in heights of the display
    assert across == pytest.approx(down, rel=0.06)
    all_rows = (aspect <= k / l) != whole  # the display is as high as the array, otherwise as wide
    assert down == pytest.approx(16 / l if all_rows else 16 * aspect / k, rel=0.08)


@pytest.mark.parametrize("name", DEVICES)
def test_quilts_of_devices_have_their_makers_sizes(name):
    """Tiles fill the quilt up to less than a pixel of each."""
    one = device(name)
    for tile, tiles, side in zip(one.tile, one.tiles, one.quilt, strict=True):
        assert 0 <= side - tile * tiles < tiles
    assert quilt_name("a.png", one.tiles, one.aspect).stem.startswith(f"a_qs{one.tiles[0]}x{one.tiles[1]}a")


def test_the_cone_of_a_display_is_a_share_of_the_zone(apples):
    half = zone_half_deg(apples)
    assert cone_share(apples, half) == pytest.approx(0.5) and cone_share(apples, 3 * half) == 1.0


def test_quilt_has_the_leftmost_view_at_the_bottom_left(apples):
    made = quilt(apples, (3, 2), size=(32, 16), depth_mm=30)
    places = viewpoints_across(apples, 6)
    assert places[0][0] < 0 < places[-1][0]
    for number, place in enumerate(places):
        column, row = number % 3, 1 - number // 3
        tile = made[row * 16 : (row + 1) * 16, column * 32 : (column + 1) * 32]
        np.testing.assert_array_equal(tile, focused_view(apples, place, size=(32, 16), depth_mm=30))


def test_lenticular_shows_the_right_the_left_of_each_lens():
    """A viewer on the right sees the subpixel on the left of a lens: it must show the rightmost view."""
    picture = directions()
    views = [focused_view(picture, place, size=(40, 4)) for place in viewpoints_across(picture, 8)]
    made = lenticular(picture, size=(40, 4), pitch_px=8, centre_px=-1 / 3, views=8)
    # at column 0 red is at the lens's left border, t = 0; a pixel on, t is 1/8 more
    for column in range(40):
        np.testing.assert_array_equal(made[:, column, 0], views[7 - column % 8][:, column, 0])


def test_lenticular_lenses_lean_to_the_left():
    picture = directions()
    made = lenticular(picture, size=(64, 9), pitch_px=8, slope=0.5, views=8)[..., 0].astype(int)
    straight = lenticular(picture, size=(64, 9), pitch_px=8, views=8)[..., 0].astype(int)
    # four rows down a lens's border lies two pixels further left; the parallax of two columns is small beside it
    np.testing.assert_allclose(made[4, 20:30], straight[4, 22:32], atol=12)
    assert np.abs(made[4, 20:30] - straight[4, 20:30]).max() > 60


def test_simulation_shows_lenses_and_side_zones():
    picture = directions()
    camera = picture.camera
    front = five_viewpoints(camera)["front"]
    seen = display_simulation(picture, front, size=(160, 80))
    expected, _ = view_image(picture, front, interpolation="nearest")
    np.testing.assert_array_equal(seen.reshape(8, 10, 16, 10, 3)[:, 5, :, 5], expected)  # every lens a patch
    # far to the right, lenses show their right neighbours' pixels; the last of them has no neighbour
    aside = front + np.array([camera.lens_pitch_mm[0] * abs(front[2]) / camera.gap_mm, 0, 0])
    shown, valid = view_image(picture, aside, interpolation="nearest")
    assert not valid.all() and valid.any()
    patch = display_simulation(picture, aside, size=(640, 320))
    middle = patch[160, 320]
    assert middle.tolist() in shown[3:5, 7:9].reshape(-1, 3).tolist()
    lit = (patch.max(axis=2) > 0).sum(axis=0)
    assert lit[lit > 0].argmax() > len(lit[lit > 0]) // 2  # the right edge is nearer, and taller


def test_simulation_masks_between_lenses():
    picture = directions()
    picture = picture.with_pixels(np.full_like(picture.pixels, 200))
    seen = display_simulation(picture, five_viewpoints(picture.camera)["front"], size=(640, 320), fill=0.8)
    assert (seen[..., 0] > 0).mean() == pytest.approx(np.pi / 4 * 0.64, abs=0.02)


def test_a_picture_without_camera_can_be_shown_as_if_it_had_one():
    bare = IIPicture(np.zeros((8, 12, 3), np.uint8), (3, 2), (4, 4))
    assert with_assumed_camera(bare).camera.view_angle_deg == pytest.approx(20)
    with pytest.raises(ValueError, match="has no camera"):
        focused_view(bare, (0, 0, -100))


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.webp"])
def test_animation_holds_its_frames(tmp_path, apples, name):
    frames = [focused_view(apples, place, size=(64, 32)) for place in viewpoints_around(apples, 6)]
    assert write_animation(tmp_path / name, frames, fps=10) == tmp_path / name
    if name.endswith("mp4"):
        with av.open(str(tmp_path / name)) as film:
            read = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    else:
        read = []
        with Image.open(tmp_path / name) as image:
            assert image.n_frames == 6
            for i in range(6):
                image.seek(i)
                read.append(np.array(image.convert("RGB")))
    assert len(read) == 6
    for a, b in zip(read, frames, strict=True):
        assert 10 * np.log10(255**2 / np.mean((a.astype(float) - b) ** 2)) > 20  # a GIF has 256 colours, MP4 4:2:0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--as", "hologram", "-o", "a.png"], "unknown kind 'hologram'"),
        (["-o", "a.avi"], "no known film type"),
        (["-o", "a.mp4", "--fps", "0"], "fps is 0"),
        (["-o", "a.mp4", "--frames", "0"], "at least 1"),
        (["-o", "a.mp4", "--size", "big"], "two whole numbers"),
        (["--as", "lenticular", "-o", "a.png", "--pitch", "0"], "pitch_px"),
        (["--as", "quilt", "-o", "a.png", "--tiles", "0x2"], "tiles"),
        (["--as", "quilt", "-o", "a.png", "--for", "visor"], "unknown device 'visor': known are go, portrait, 16"),
        (["--as", "quilt", "-o", "a.png", "--for", "go", "--tiles", "8x6"], "those of the display go"),
        (
            ["--as", "lenticular", "-o", "a.png", "--whole"],
            "--as lenticular without --calibration does not use --whole",
        ),
        (["--as", "simulation", "-o", "a.png", "--at", "0,0,5"], "before the lens plane"),
        (["--as", "simulation", "-o", "a.png", "--fill", "2"], "fill is 2"),
    ],
)
def test_command_refuses(run, refused, apples, tmp_path, arguments, said):
    apples.save(tmp_path / "p.png")
    arguments = [tmp_path / a if a.startswith("a.") else a for a in arguments]
    refused(run("display", tmp_path / "p.png", *arguments), said)
    assert not list(tmp_path.glob("a*"))


def test_the_focus_falls_to_0_at_both_borders_of_the_array():
    """Half a lens beyond the outermost lens is the border."""
    for lens, room in ((-0.5, 0), (0, 0.5), (2, 2.5), (6, 1.5), (7.5, 0), (8, 0)):
        assert (held(9, lens, 8), held(-9, lens, 8)) == (room, -room)
    assert held(0.2, 3, 8) == 0.2


@pytest.mark.slow
def test_the_command_writes_displays(run, apples, tmp_path):
    apples.save(tmp_path / "p.png")
    for kind in ("quilt", "lenticular", "simulation"):
        assert (
            run("display", tmp_path / "p.png", "--as", kind, "-o", tmp_path / f"{kind}.png", "--size", "80x40")[0]
            == 0
        )
    assert run("display", tmp_path / "p.png", "-o", tmp_path / "p.webp", "--frames", "3", "--size", "80x40")[0] == 0
    words = ("--as", "quilt", "--for", "portrait", "-o", tmp_path / "q.png")
    code, out, err = run("display", tmp_path / "p.png", *words)
    assert code == 0 and "38% of the width and 100% of the height" in out + err
    for name, size in (("quilt_qs8x6a2.png", (640, 240)), ("q_qs8x6a0.75.png", (3360, 3360))):
        with Image.open(tmp_path / name) as quilt:
            assert quilt.size == size
