"""Model of display and eye: against `view_image` and closed forms, and refused parameters."""

import math
import time
import tracemalloc

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, Rig, five_viewpoints, panel_display, preset, view_image
from ii_core.base.colour import LINEAR, linear
from ii_core.camera.optics import Lenslet
from ii_core.display.eye import Eye, eye_image, see
from ii_core.display.look import focused_view
from ii_core.display.model import DisplayModel
from ii_core.display.quilt import quilt
from ii_core.display.simulate import display_simulation
from ii_core.display.zones import converging_distance, crosstalk, viewing_zone


def camera(k=12, l=8, u=8, **change):
    return IICamera(pixels=(k * u, l * u), lenses=(k, l), pixel_pitch_mm=0.01, gap_mm=0.2, **change)


def noise(camera, dtype=np.uint8, erect=False):
    rng = np.random.default_rng(3)
    shape = (camera.pixels[1], camera.pixels[0], 3)
    pixels = rng.random(shape, np.float32) if dtype == np.float32 else rng.integers(0, np.iinfo(dtype).max, shape)
    return IIPicture(pixels.astype(dtype), camera.lenses, camera.ei_pixels, camera, erect)


def constant(camera, value):
    pixels = np.zeros((camera.pixels[1], camera.pixels[0], 3), np.uint8)
    pixels[:] = value
    return IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)


FRONT, DISTANCE = Eye(position_mm=(0.0, 0.0, -5.0)), 30.0
PLACES = [(0.0, 0.0, -5.0), (0.4, -0.3, -5.0), (3.0, 1.5, -7.0), (-0.9, 0.2, -1.0), (60.0, 0.0, -2.0)]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("erect", [False, True])
def test_point_pupil_and_matched_arrays_give_the_view_image(place, erect):
    """To the bit, in the zone, in side zones, and where no pixel is."""
    made = camera()
    picture = noise(made, erect=erect)
    wanted, valid = view_image(picture, place, interpolation="nearest")
    got = eye_image(picture, DisplayModel(camera=made), Eye(position_mm=place))
    np.testing.assert_array_equal(got.pixels, wanted)
    np.testing.assert_array_equal(got.light, LINEAR[wanted] * valid[..., None])
    np.testing.assert_array_equal(got.seen, valid)


@pytest.mark.parametrize("name", ["setup1", "hpo", "grin", "depth-priority"])
def test_presets_give_the_view_image(name):
    made = preset(name, scale=32)
    picture = noise(made, erect=made.erect)
    for place in five_viewpoints(made).values():
        wanted, valid = view_image(picture, place, interpolation="nearest")
        got = eye_image(picture, DisplayModel(camera=made), Eye(position_mm=tuple(place)))
        np.testing.assert_array_equal(got.pixels[valid], wanted[valid])


RIG = Rig(baseline_mm=4, focal_mm=50, sensor_mm=36, focus_mm=120)
MEETING = {
    "panel": panel_display(size_mm=60, pixels=(160, 96), lens_pitch_mm=2.5, viewer_mm=600).camera,
    "erect": camera(viewer_mm=40.0, optics=({"kind": "grin"},)),
    "lenticular": camera(u=6, viewer_mm=30.0, optics=({"kind": "lenticular"},)),
    "cameras": RIG.camera((5, 5), (24, 16)),
    "row": RIG.camera((7, 1), (24, 16)),
    "grid": RIG.camera((3, 5), (24, 16)),
}


@pytest.mark.parametrize("name", MEETING)
def test_where_viewing_zones_meet_the_view_image_is_seen(name):
    """To the bit wherever a lens shows its own image, and the zone's border is where one no longer does."""
    made = MEETING[name]
    display, picture = DisplayModel(camera=made), noise(made, erect=made.erect)
    for place in five_viewpoints(made).values():
        wanted, valid = view_image(picture, place, interpolation="nearest")
        got = eye_image(picture, display, Eye(position_mm=tuple(place)))
        np.testing.assert_array_equal(got.pixels[valid], wanted[valid])
        assert valid.all() and (got.seen == 1).all()
    np.testing.assert_allclose(converging_distance(display), made.viewer_mm)
    zone = viewing_zone(display, made.viewer_mm)
    assert (zone.size_mm[1] < math.inf) == made.vertical_parallax
    assert zone.size_mm == pytest.approx(zone.period_mm) and zone.centre_mm == pytest.approx((0, 0), abs=1e-6)
    for distance in (made.viewer_mm, 1.01 * made.viewer_mm):
        zone = viewing_zone(display, distance)
        for x in (-0.5, 0.5):
            inside, outside = ((zone.size_mm[0] + 2e-6 * sign * distance) * x for sign in (-1, 1))
            assert own_image_seen(display, inside, distance) and not own_image_seen(display, outside, distance)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_other_types_of_pixels(dtype, monkeypatch):
    made = camera()
    picture = noise(made, dtype)
    wanted, _ = view_image(picture, (0.2, 0.1, -5.0), interpolation="nearest")
    monkeypatch.setattr("ii_core.display.eye.see", see.py_func)  # saves two compilations
    got = eye_image(picture, DisplayModel(camera=made), Eye(position_mm=(0.2, 0.1, -5.0)))
    light = wanted if dtype == np.float32 else linear(wanted / 65535).astype(np.float32)
    np.testing.assert_array_equal(got.light, light)


def test_kernel_without_compilation(monkeypatch):
    made = camera(3, 2, 4)
    display = DisplayModel(camera=made, layout="pentile", fill=0.5, lobe=1.0, black=0.01, crosstalk=0.2, turn_deg=3.0)
    eye = Eye(position_mm=(0.1, 0.0, -2.0), pupil_mm=1.0, focus_mm=3.0)
    compiled = eye_image(noise(made), display, eye, rays=9)
    monkeypatch.setattr("ii_core.display.eye.see", see.py_func)
    plain = eye_image(noise(made), display, eye, rays=9)
    # powers of the lobe come from another library
    np.testing.assert_allclose(compiled.light, plain.light, rtol=1e-6)
    np.testing.assert_array_equal(compiled.seen, plain.seen)


@pytest.mark.parametrize("layout", ["square", "rgb-stripe", "pentile"])
@pytest.mark.parametrize("fill", [1.0, 0.49])
def test_layout_and_fill_keep_the_panels_mean_light(layout, fill):
    """A grey panel through a wide pupil, which averages many sub-pixels, has its own brightness."""
    made = camera(6, 4, 16)
    display = DisplayModel(camera=made, layout=layout, fill=fill)
    eye = Eye(position_mm=(0.0, 0.0, -2.0), pupil_mm=0.4)
    got = eye_image(constant(made, 188), display, eye, rays=4096).light.mean(axis=(0, 1))
    np.testing.assert_allclose(got, LINEAR[188], rtol=0.03)  # 98 000 rays of a set with even gaps


def test_a_point_pupil_sees_one_colour_of_a_stripe():
    """From the middle of every pixel's red third only red is seen, three times as bright: colour moiré."""
    made = camera()
    display = DisplayModel(camera=made, layout="rgb-stripe")
    per_px = made.pixel_pitch_mm * (5.0 + made.gap_mm) / made.gap_mm
    far = IICamera(pixels=(8, 8), lenses=(1, 1), pixel_pitch_mm=0.01, gap_mm=0.2)
    for stripe in range(3):
        # an even number of pixels: straight ahead lies a border between two
        x = (stripe + 0.5) / 3 * per_px
        light = eye_image(
            constant(far, 255), DisplayModel(camera=far, layout="rgb-stripe"), Eye(position_mm=(x, 0.001, -5.0))
        ).light[0, 0]
        np.testing.assert_array_equal(light, np.eye(3)[stripe] * 3)
    shown = eye_image(constant(made, 255), display, FRONT).light
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) == 3  # bands of red, green and blue over the array


def test_brightness_black_level_and_lobe():
    made = camera(1, 1, 8)
    grey = float(LINEAR[100])
    display = DisplayModel(camera=made, brightness=2.0, black=0.1, lobe=3.0)
    eye = Eye(position_mm=(1.0, -0.5, -5.0))
    cosine = 5.2 / math.sqrt(5.2**2 + 1.0 + 0.25)
    got = eye_image(constant(made, 100), display, eye).light
    np.testing.assert_allclose(got, 2 * (0.1 + 0.9 * grey) * cosine**3, rtol=1e-6)


def test_crosstalk_of_neighbouring_pixels():
    """A white column among black ones: itself keeps 1 − c/2 (two white neighbours above and below), beside c/4."""
    made = camera(1, 1, 8)
    picture = constant(made, 0)
    picture.pixels[:, 4] = 255
    display = DisplayModel(camera=made, crosstalk=0.2)
    per_px = made.pixel_pitch_mm * 5.2 / made.gap_mm
    seen = [
        eye_image(picture, display, Eye(position_mm=(x * per_px, 0.1, -5.0))).light[0, 0, 0]
        for x in (-0.5, 0.5, 1.5, 2.5)
    ]
    np.testing.assert_allclose(seen, [0.05, 0.9, 0.05, 0.0], atol=1e-7)


def test_shift_gap_and_pitch_move_what_a_lens_shows():
    """Against the formula p = 2c₀ − q, q = c + (c − e)g/d, lens by lens."""
    made = camera()
    picture = noise(made)
    display = DisplayModel(camera=made, gap_mm=0.23, lens_pitch_mm=0.081, shift_mm=(0.004, -0.006))
    got = eye_image(picture, display, Eye(position_mm=(0.3, 0.2, -5.0))).light
    for k, l in ((2, 3), (6, 4), (11, 0)):
        c0 = np.array([(k + 0.5) * 0.08 - 0.48, 0.32 - (l + 0.5) * 0.08])
        c = np.array([(k + 0.5 - 6) * 0.081 + 0.004, (4 - l - 0.5) * 0.081 - 0.006])
        q = c + (c - [0.3, 0.2]) * 0.23 / 5.2
        p = 2 * c0 - q
        m, n = math.floor((p[0] + 0.48) / 0.01), math.floor((0.32 - p[1]) / 0.01)
        np.testing.assert_array_equal(got[l, k], LINEAR[picture.pixels[n, m]])


def test_a_turned_array_is_the_shift_of_each_lens():
    made = camera()
    picture = noise(made)
    turn = math.radians(2)
    turned = eye_image(picture, DisplayModel(camera=made, turn_deg=2), FRONT)
    k, l = 9, 2  # its centre moves by R c − c; what is looked at is the point where it was
    x, y = (k + 0.5) * 0.08 - 0.48, 0.32 - (l + 0.5) * 0.08
    shift = np.array([[math.cos(turn) - 1, -math.sin(turn)], [math.sin(turn), math.cos(turn) - 1]]) @ [x, y]
    shifted = eye_image(picture, DisplayModel(camera=made, shift_mm=tuple(shift)), FRONT)
    np.testing.assert_array_equal(turned.light[l, k], shifted.light[l, k])


def test_a_thin_lens_focused_on_the_panel_shows_one_pixel_and_off_it_many():
    """Λ = f: all over the lens the eye sees one place of the panel; 1/f = 1/g + 1/d is exact for a near eye."""
    u, gap, d = 8, 0.2, 5.2
    exact = 1 / (1 / gap + 1 / d)
    stripes = np.zeros((8, 8, 3), np.uint8)
    stripes[:, ::2] = 255
    spread = []
    for focal in (exact, 0.1):
        made = IICamera(
            pixels=(u, u), lenses=(1, 1), pixel_pitch_mm=0.01, gap_mm=gap, optics=(Lenslet(focal_mm=focal),)
        )
        picture = IIPicture(stripes, (1, 1), (u, u), made)
        eye = Eye(position_mm=(0.13, 0.0, gap - d))
        light = eye_image(picture, DisplayModel(camera=made), eye, size=(40, 4)).light
        spread.append(light.std())
    assert spread[0] == 0 and spread[1] > 0.4


def test_defocus_of_the_eye_is_the_pupils_geometry():
    """Focused at F, a point of the lens plane at d spreads over D·|1 − d/F|: the blur at the edge of the array."""
    made = camera(64, 32, 4)
    width, d, pupil, focus = made.size_mm[0], 5.2, 1.0, 4.0
    eye = Eye(position_mm=(0.0, 0.0, made.gap_mm - d), pupil_mm=pupil, focus_mm=focus)
    light = eye_image(constant(made, 255), DisplayModel(camera=made), eye, size=(512, 8), rays=1024).seen[3]
    step = width / 512
    # the border lies in the middle of the blur: as far inside as it reaches, something misses the array
    reach = (light < 1 - 1e-6).sum() / 2 * step
    assert reach == pytest.approx(pupil * abs(1 - d / focus) / 2, abs=0.02)


def own_image_seen(display, x, distance=DISTANCE):
    """Return whether all lenses in a row show their own elementary image, whose red is the lens's number, at x."""
    made = display.camera
    pixels = np.zeros((made.pixels[1], made.pixels[0], 3), np.uint8)
    pixels[..., 0] = (np.arange(made.pixels[0]) // made.ei_pixels[0] + 1) * 5
    picture = IIPicture(pixels, made.lenses, made.ei_pixels, made, made.erect)
    eye = Eye(position_mm=(x + made.origin_mm[0], 0.0, made.origin_mm[2] + made.gap_mm - distance))
    got = eye_image(picture, display, eye).light[made.lenses[1] // 2, :, 0]
    return bool((got == LINEAR[(np.arange(made.lenses[0]) + 1) * 5]).all())


DISPLAYS = [{}, {"gap_mm": 0.15}, {"lens_pitch_mm": 0.0796}, {"shift_mm": (0.01, 0.0)}, {"lens_pitch_mm": 0.0803}]


@pytest.mark.parametrize("change", DISPLAYS)
def test_the_viewing_zone_ends_where_closed_form_says(change):
    display = DisplayModel(camera=camera(), **change)
    zone = viewing_zone(display, DISTANCE)
    (x, _), (width, _) = zone.centre_mm, zone.size_mm
    assert width > 0
    for side in (-1, 1):
        assert own_image_seen(display, x + side * (width / 2 - 1e-6))
        assert not own_image_seen(display, x + side * (width / 2 + 1e-6))


def test_zones_converge_where_closed_form_says():
    """At d = g·p/(P − p) every lens's zone is the same: as wide as its period."""
    display = DisplayModel(camera=camera(), lens_pitch_mm=0.0796)
    d = converging_distance(display)[0]
    zone = viewing_zone(display, d)
    assert d == pytest.approx(0.2 * 0.0796 / 0.0004)
    assert zone.size_mm[0] == pytest.approx(zone.period_mm[0]) and zone.centre_mm[0] == pytest.approx(0)
    assert converging_distance(DisplayModel(camera=camera())) == (math.inf, math.inf)
    # matched arrays: the zone is d·δL/Λ less the array
    zone = viewing_zone(DisplayModel(camera=camera()), 30.0)
    assert zone.size_mm[0] == pytest.approx(30 * 0.08 / 0.2 - 11 * 0.08)


@pytest.mark.parametrize("border", [-0.7, -0.2, 0.0, 0.35, 0.99, 1.2])
def test_crosstalk_between_two_views_is_a_segment_of_the_pupil(border):
    """One half of an elementary image is the left eye's, white, the other the right eye's, black."""
    made = camera(1, 1, 8)
    picture = constant(made, 0)
    picture.pixels[:, 4:] = 255  # seen from the right
    eye = Eye(position_mm=(-border, 0.0, -10.0), pupil_mm=2.0)
    got = eye_image(picture, DisplayModel(camera=made), eye, rays=20000).light[0, 0, 0]
    assert got == pytest.approx(crosstalk(2.0, border), abs=3e-3)  # 20000 rays


def test_a_pair_of_eyes_sees_two_views():
    made = camera(u=16)
    picture = noise(made)
    left, right = Eye(position_mm=(0.0, 0.0, -5.0)).pair(apart_mm=1.0)
    assert (left.position_mm[0], right.position_mm[0]) == (-0.5, 0.5)
    for eye in (left, right):
        wanted, _ = view_image(picture, eye.position_mm, interpolation="nearest")
        np.testing.assert_array_equal(eye_image(picture, DisplayModel(camera=made), eye).pixels, wanted)


def test_a_pupil_larger_than_a_lens_and_an_eye_outside_the_zone_are_defined():
    made = camera()
    white = constant(made, 255)
    wide = eye_image(white, DisplayModel(camera=made), Eye(position_mm=(0.0, 0.0, -5.0), pupil_mm=3.0))
    np.testing.assert_allclose(wide.light[..., 0], wide.seen, rtol=1e-6)
    assert (wide.seen > 0).all()
    aside = eye_image(white, DisplayModel(camera=made), Eye(position_mm=(500.0, 0.0, -5.0)))
    assert (aside.light == 0).all() and (aside.seen == 0).all()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"lens_pitch_mm": 0}, "lens_pitch_mm"),
        ({"gap_mm": -1.0}, "gap_mm"),
        ({"gap_mm": math.nan}, "gap_mm"),
        ({"layout": "hex"}, "rgb-stripe"),
        ({"fill": 0.0}, "fill is 0"),
        ({"fill": 1.5}, "fill is 1.5"),
        ({"lobe": -1.0}, "lobe is -1"),
        ({"black": 1.0}, "black is 1"),
        ({"crosstalk": 1.0}, "crosstalk is 1"),
        ({"turn_deg": math.inf}, "turn_deg"),
        ({"brightness": 0.0}, "brightness"),
        ({"camera": preset("hexagonal", scale=8)}, "regular structure"),
        ({"camera": preset("depth-control", scale=32)}, "before its lens array"),
        ({"camera": preset("spherical", scale=8)}, "spherical-lenslet"),
    ],
)
def test_invalid_displays_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        DisplayModel(**{"camera": camera(), **change})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"position_mm": (0, 0)}, "position_mm"),
        ({"position_mm": (0, math.nan, -5)}, "position_mm"),
        ({"pupil_mm": -1.0}, "pupil_mm is -1"),
        ({"focus_mm": 0.0}, "focus_mm"),
    ],
)
def test_invalid_eyes_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        Eye(**{"position_mm": (0.0, 0.0, -5.0), **change})


def test_invalid_views_of_an_eye_are_refused():
    made = camera()
    with pytest.raises(ValueError, match="eye is at z 500 mm, not before the lens plane at 120 mm"):
        eye_image(noise(MEETING["row"]), DisplayModel(camera=MEETING["row"]), Eye(position_mm=(0.0, 0.0, 500.0)))
    with pytest.raises(ValueError, match="not before the lens plane"):
        eye_image(noise(made), DisplayModel(camera=made), Eye(position_mm=(0.0, 0.0, 0.2)))
    with pytest.raises(ValueError, match="the same structure"):
        eye_image(noise(camera(6)), DisplayModel(camera=made), FRONT)
    for rays in (0, 1 << 20):
        with pytest.raises(ValueError, match="rays is"):
            eye_image(noise(made), DisplayModel(camera=made), FRONT, rays=rays)
    with pytest.raises(TypeError, match="rays"):
        eye_image(noise(made), DisplayModel(camera=made), FRONT, rays="many")
    with pytest.raises(ValueError, match="never converge"):
        converging_distance(DisplayModel(camera=made, lens_pitch_mm=0.081))
    with pytest.raises(ValueError, match="pupil_mm"):
        crosstalk(-1.0, 0.0)


@pytest.mark.parametrize(
    "view",
    [
        lambda picture, size: eye_image(picture, DisplayModel(camera=picture.camera), FRONT, size=size),
        lambda picture, size: focused_view(picture, (0, 0, -100), size=size),
        lambda picture, size: quilt(picture, (2, 2), size=size),
        lambda picture, size: display_simulation(picture, (0, 0, -100), size=size),
    ],
)
def test_views_larger_than_memory_are_refused_before_it_is_taken(view):
    """The command's largest size, 65536×65536, took 51 GB; here it would be 12 TB."""
    with pytest.raises(ValueError, match=r"size is 1000000×1000000: at most .* GB of memory of this machine"):
        view(noise(camera()), (10**6, 10**6))


@pytest.mark.slow
def test_64_rays_cost_no_more_than_30_view_images_and_no_memory():
    """At full setup1; the memory is that of the result."""
    made = preset("setup1")
    pixels = np.broadcast_to(np.arange(made.pixels[0], dtype=np.uint8)[:, None], (*made.pixels[::-1], 3)).copy()
    picture = IIPicture(pixels, made.lenses, made.ei_pixels, made)
    display, place = DisplayModel(camera=made), (0.0, 0.0, -280.0)
    eye = Eye(position_mm=place, pupil_mm=4.0)
    eye_image(picture, display, eye, rays=1)  # compiled
    views, eyes = [], []
    for _ in range(3):
        for call, kept in (
            (lambda: view_image(picture, place), views),
            (lambda: eye_image(picture, display, eye), eyes),
        ):
            started = time.process_time()
            call()
            kept.append(time.process_time() - started)
    assert min(eyes) <= 30 * min(views)
    tracemalloc.start()
    eye_image(picture, display, eye)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < pixels.nbytes / 10  # of at most 3 pictures
