"""Disparity from all views: fields in closed form, forms of fields, files of the command depth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from ii_core import (
    IICamera,
    IIPicture,
    Rig,
    depth_of_disparity,
    disparity_of_depth,
    estimate_depth,
    retarget,
    sub_images,
)
from ii_core.base.colour import srgb
from ii_core.base.jit import lean_kernel
from ii_core.camera.optics import Lens
from ii_core.depth.all_views import disparity_of_views
from ii_core.depth.around import half_lines, views_around
from ii_core.depth.disparity_kernels import Views, add_evidence, sample_4x4
from ii_core.depth.estimate import (
    CODES,
    OTHER_SURFACE,
    STEP,
    DepthEstimate,
    costs,
    field_range,
    labels_between,
    nothing_seen,
    other_motion,
    passed_on,
    reached,
    refined,
    spaced,
)
from ii_core.depth.focus import depth_from_focus
from ii_core.depth.highlights import highlights
from ii_core.depth.points import view_points
from ii_core.depth.refocus import focused
from ii_core.picture.assumed import with_assumed_camera
from tests.support.slow import first_fast

RNG = np.random.default_rng(3)
WAVES = RNG.uniform(-0.9, 0.9, (24, 2)), RNG.uniform(0, 6.3, (24, 3)), RNG.uniform(0.3, 1, 24)


def texture(x, y):
    """Light of a smooth random texture at places of the reference view, (…, 3)."""
    waves, phases, sizes = WAVES
    turns = x[..., None] * waves[:, 0] + y[..., None] * waves[:, 1]
    sines, cosines = sizes[:, None] * np.cos(phases), sizes[:, None] * np.sin(phases)
    light = np.sin(turns) @ sines + np.cos(turns) @ cosines
    return np.clip(0.5 + light / 16, 0, 1)


def slanted(views=(5, 5), size=(48, 40), at=0.7, slope=0.01, erect=False, dtype=np.uint8):
    """Field of one textured plane of disparity ``at + slope·x`` in the middle view, and that disparity."""
    (u, v), (k, l) = views, size
    y, x = np.mgrid[:l, :k].astype(float)
    out = np.empty((l, v, k, u, 3))
    for j, i in np.ndindex(v, u):
        down, right = (j - v // 2, i - u // 2) if not erect else (v // 2 - j, u // 2 - i)
        # the plane's point at reference x stands at x − p·d(x) in a view
        place = (x + right * at) / (1 - right * slope)
        out[:, j, :, i] = texture(place, y + down * (at + slope * place))
    pixels = out.reshape(l * v, k * u, 3)
    if dtype != np.float32:
        pixels = np.rint(pixels * np.iinfo(dtype).max)
    return IIPicture(pixels.astype(dtype), size, views, erect=erect), at + slope * np.arange(k) + 0 * y


@pytest.mark.parametrize(
    "form",
    [
        {},
        {"at": -1.3, "slope": -0.01, "dtype": np.uint16},
        {"views": (9, 1), "dtype": np.float32},
        {"views": (1, 7), "size": (40, 48)},
        {"views": (6, 4), "erect": True},
        {"views": (2, 1), "at": 2.2},
    ],
    ids=["5x5", "far-16-bit", "horizontal-float", "vertical", "even-erect", "two"],
)
def test_disparity_of_a_slanted_plane(form):
    """The texture is known between pixels: the truth has no interpolation in it."""
    picture, truth = slanted(**form)
    found = estimate_depth(picture, low=-4.0, high=4.0)
    error = np.abs(found.disparity - truth)[6:-6, 6:-6]
    assert np.median(error) < 0.02 and (error > 0.07).mean() < 0.12
    assert found.view == (picture.ei_pixels[0] // 2, picture.ei_pixels[1] // 2) and found.depth_mm is None
    assert found.disparity.shape == found.confidence.shape == truth.shape


def wall_light(camera, z):
    """Light of a textured wall along the rays of a camera."""
    start, way = camera.rays()
    place = start + (z - start[..., 2:]) / way[..., 2:] * way
    return texture(place[..., 0] / camera.lens_pitch_mm[0], place[..., 1] / camera.lens_pitch_mm[1])


@pytest.mark.parametrize("ei", [(7, 5), (5, 7)], ids=str)
@pytest.mark.parametrize("meeting", [{}, {"viewer_mm": 60.0, "start_mm": 60.0}], ids=["parallel", "meeting"])
def test_lenses_closer_down_than_across_or_farther(ei, meeting):
    """Rays to a textured wall: its depth, also from other views and from focus, and the wall focused."""
    made = IICamera(
        pixels=(48 * ei[0], 40 * ei[1]), lenses=(48, 40), pixel_pitch_mm=0.1, gap_mm=2.0, **meeting,
    )  # fmt: skip
    z, (across, down) = 20.0, made.lens_pitch_mm
    light = wall_light(made, z)
    picture = IIPicture(np.rint(65535 * light).astype(np.uint16), made.lenses, made.ei_pixels, made)
    truth = float(disparity_of_depth(made, z))
    assert abs(truth) > 0.5 and (across > down) == (ei[0] > ei[1])
    found = estimate_depth(picture, low=-4.0, high=4.0)
    error = np.abs(found.disparity - truth)[6:-6, 6:-6]
    assert np.median(error) < 0.02 and (error > 0.07).mean() < 0.12
    square = np.zeros((40, 48))
    square[20:24, 20:24] = 4
    below = disparity_of_views(picture, square, found.view)[found.view[1] + 1, found.view[0]]
    assert np.argwhere(below)[:, 0].mean() == pytest.approx(21.5 - 4 * across / down, abs=0.5)
    own, inner = sub_images(picture)[found.view[1], found.view[0]], (slice(10, -10), slice(10, -10))
    sharp, _ = focused(picture, truth)
    assert np.abs(srgb(sharp) - own / 65535)[inner].max() < 0.02  # between pixels, by cubics
    finer = replace(made, pixels=(2 * made.pixels[0], 2 * made.pixels[1]), pixel_pitch_mm=0.05)
    other = retarget(picture, finer, np.full((ei[1], ei[0], 40, 48), truth, np.float32))
    error = np.abs(other.picture.pixels / 65535 - wall_light(finer, z)).max(axis=2)
    assert (other.mask == 2).mean() > 0.8 and np.quantile(error[other.mask == 2], 0.9) < 0.01
    layers = z + np.array([-8.0, -4.0, 0.0, 4.0, 8.0])
    assert (depth_from_focus(picture, layers_mm=layers, method="robust").layer[inner] == 2).mean() > 0.95


def disc(front, back, size=(72, 60), views=7, radius=17.0):
    """Field of a textured disc before a textured wall, pixels of 2×2 rays, noise of a code; and the disparity."""
    (k, l), half = size, views // 2
    y, x = np.mgrid[:l, :k].astype(float)

    def inside(right, down):
        return np.hypot(right - (k - 1) / 2, down - (l - 1) / 2) < radius

    light = np.zeros((l, views, k, views, 3))
    for j, i, down, right in np.ndindex(views, views, 2, 2):
        at = np.array([x + (right - 0.5) / 2, y + (down - 0.5) / 2])
        near, far = (at + d * np.array([i - half, j - half])[:, None, None] for d in (front, back))
        behind = 0.7 * texture(far[0] + 50, far[1])
        light[:, j, :, i] += np.where(inside(*near)[..., None], texture(*near), behind) / 4
    noisy = 255 * light + np.random.default_rng(0).normal(size=light.shape)
    codes = np.rint(noisy.clip(0, 255)).astype(np.uint8)
    true = np.where(inside(x, y), front, back)
    return IIPicture(codes.reshape(l * views, k * views, 3), size, (views, views)), true


@lean_kernel
def _sampled(pixels, at, row, down, across):
    return sample_4x4(pixels, np.uint64(at), np.uint64(row), down, across)


def test_samples_are_weighted_by_both_ways():
    pixels = RNG.integers(0, 65536, 60, np.uint16)
    down, across = (tuple(RNG.uniform(-0.2, 1, 4).astype(np.float32)) for _ in range(2))
    block = pixels.reshape(6, 10)[1:5, 3:7].astype(float)
    true = np.array(down, float) @ block @ np.array(across, float)
    for function in (_sampled, sample_4x4):
        assert function(pixels, 13, 10, down, across) == pytest.approx(true, rel=1e-5)


@pytest.mark.parametrize("motion", [[[0.5, 0], [0, 0.5]], [[0.5, 0.1], [-0.2, 0.3]]])
def test_evidence_of_a_ramp_is_exact(motion):
    """Cubic interpolation keeps a ramp: a view that is a step s away differs by its slopes times M·s, M the motion.

    The disparity is that of least squares; what it leaves of the differences is told in px of disparity.
    """
    y, x = np.mgrid[:20, :24].astype(float)
    slopes = np.array([[300, -200], [0, 500], [-400, 100]], float)  # down, across
    ramp = 30000 + slopes[:, :1, None] * y + slopes[:, 1:, None] * x
    steps = np.array([[0, 0], [0, 1], [0, -1], [2, 0], [-1, -1]], np.float32)
    guess = np.full((20, 24), 0.25, np.float32)
    moves = (slopes @ np.array(motion) @ steps.T)[:, :, None, None]  # p·D: a point at x stands at x − p·D in a view
    pixels = np.rint(ramp[:, None] + moves).transpose(1, 0, 2, 3).astype(np.uint16)
    views = Views(np.ascontiguousarray(pixels), steps, half_lines(steps))
    evidence, here = nothing_seen(views), np.ones((20, 24), bool)
    limit, smooth = np.float32(1e9), ramp.astype(np.float32)
    add_evidence(views, guess, limit, smooth, here, *evidence, 0, 20)
    inner = (slice(4, -4), slice(4, -4))
    told = np.einsum("ci,nj->cnij", slopes, steps).reshape(-1, 4)  # the difference of a colour in a view, by M
    alone, off = told @ np.eye(2).ravel(), told @ (np.array(motion) - 0.25 * np.eye(2)).ravel()
    step = alone @ off / (alone @ alone)
    weight = sum(n * evidence.slopes[k] * evidence.reach[k] for k, n in enumerate((1, 2, 1)))[inner]
    assert (evidence.push[0] + evidence.push[3])[inner] / weight == pytest.approx(step, abs=1e-4)
    left = np.sqrt(np.square(off - step * alone).sum() / (alone @ alone))
    assert other_motion(evidence).px[9, 11] == pytest.approx(left, rel=0.01, abs=1e-3)
    mean = moves[:, :, 0, 0].mean(axis=1) - 0.25 * (slopes @ steps.T).mean(axis=1)  # the reference included
    assert (evidence.mean - ramp)[(slice(None), *inner)] == pytest.approx(
        np.broadcast_to(mean[:, None, None], (3, 12, 16)), abs=0.2
    )


@pytest.mark.slow
@pytest.mark.parametrize(("front", "back"), [(0.4, -0.4), (1.5, -0.5)])
def test_only_the_outermost_pixels_of_a_body_may_be_lost(front, back):
    picture, truth = disc(front, back)
    found = estimate_depth(picture)
    bad = np.abs(found.disparity - truth) > 0.07
    deep = ndimage.distance_transform_edt(truth == front), ndimage.distance_transform_edt(truth == back)
    border, inner = sum(deep) <= 1, np.zeros_like(bad)
    inner[6:-6, 6:-6] = True
    assert not bad[inner & (truth == back)].any() and not bad[inner & ~border].any()
    assert bad[border & (truth == front)].mean() < 0.4
    sure = inner & (found.confidence >= 0.9)
    assert sure.mean() > 0.6 and bad[sure].mean() < 0.02


def test_range_is_found_and_confidence_is_honest():
    picture, truth = slanted(views=(9, 9), size=(64, 48), at=-1.0)
    low, high = field_range(picture)
    assert low < truth.min() < truth.max() < high and high - low < 2.5
    found = estimate_depth(picture)
    sure = found.confidence >= 0.9
    assert sure.mean() > 0.4 and (np.abs(found.disparity - truth)[sure] > 0.07).mean() <= 0.02


def lit(colour, gloss=0.0, stripes=(0.0, 0.0, 0.0)):
    """View of a lit wall that bends, (3, 96, 96) in 16-bit codes, noise of a code: a highlight in the middle."""
    y, x = np.mgrid[:96, :96] - 47.5
    shade, print_ = 0.7 + 0.2 * np.sin(x / 9), 0.3 * (1 + np.sin((x + y) / 2))
    wall = np.array(colour)[:, None, None] + np.array(stripes)[:, None, None] * print_
    light = wall * shade + gloss * np.exp(-(x**2 + y**2) / 8**2)
    return (65535 * srgb(light) + 257 * np.random.default_rng(0).normal(size=light.shape)).astype(np.float32)


RED, PALE, GREY = (0.5, 0.06, 0.02), (0.3, 0.25, 0.05), (0.2, 0.2, 0.2)


def test_highlights_are_found_on_coloured_surfaces_alone():
    """Shading changes along the colour, print in other directions or hardly whiter; on grey nothing parts them."""
    found = highlights(lit(RED, gloss=0.3))
    away = np.hypot(*(np.mgrid[:96, :96] - 47.5))
    assert found[away < 12].all() and not found[away > 32].any()
    printed = lit(RED, stripes=RED), lit(RED, stripes=(0, 0.3, 0.3)), lit(PALE, stripes=(0.3, 0.25, 0.09))
    for view in (lit(RED), *printed, lit(GREY), lit(GREY, gloss=0.3), np.zeros((3, 96, 96), np.float32)):
        assert not highlights(view).any()


def test_confidence_is_low_at_highlights():
    """A highlight on a plane is at the disparity of a lamp's image, 1 px from the wall's, and views agree on it.

    On coloured walls its colour tells it. On curved ones it moves by another disparity down than across.
    """
    confident = []
    for colour, down in ((RED, 0.5), (GREY, 1.0), (GREY, 0.5)):
        seen = np.empty((40, 9, 48, 9, 3))
        for j, i in np.ndindex(9, 9):
            y, x = np.mgrid[:40, :48] - np.array([20 - down * (j - 4), 24 - 0.5 * (i - 4)])[:, None, None]
            seen[:, j, :, i] = srgb(np.array(colour) + 0.4 * np.exp(-(x**2 + y**2) / 6**2)[..., None])
        picture = IIPicture(np.rint(255 * seen).astype(np.uint8).reshape(360, 432, 3), (48, 40), (9, 9))
        confident.append(estimate_depth(picture, low=-3, high=3).confidence.max())
    assert max(confident[:2]) <= 0.5 < 0.6 < confident[2], confident


@pytest.mark.slow
def test_range_of_large_views_is_found_in_halved_ones():
    picture, truth = slanted(views=(5, 5), size=(300, 240), at=-6.0, slope=0.002)
    low, high = field_range(picture)
    assert low < truth.min() < truth.max() < high and high - low < 5


def test_a_nominal_camera_does_not_limit_the_range():
    """Its lens plane is no bound: a photograph of a Lytro, disparities 0 to 1, was searched from −1 to 0."""
    picture, truth = slanted(views=(5, 5), size=(64, 48), at=1.0)
    low, high = field_range(with_assumed_camera(picture))
    assert low < truth.min() < truth.max() < high


@pytest.mark.parametrize("focus_mm", [None, 400.0])
def test_an_array_of_cameras_sees_near_things_wherever_its_views_agree(focus_mm):
    """27×27 rendered cameras that agree at infinity: things at 3 to 12 m were searched beyond 250 m."""
    camera = Rig(baseline_mm=10, focal_mm=30, sensor_mm=36, focus_mm=focus_mm).camera((5, 5), (64, 48))
    z = 300.0
    picture, truth = slanted(views=(5, 5), size=(64, 48), at=float(disparity_of_depth(camera, z)), slope=0.0)
    found = estimate_depth(replace(picture, camera=camera))
    assert np.median(np.abs(found.disparity - truth)) < 0.02
    assert np.median(found.depth_mm) == pytest.approx(z, rel=0.03)


@pytest.mark.parametrize("viewer_mm", [None, 90.0])
@pytest.mark.parametrize(("optics", "start_mm", "z"), [("pinhole", 40.0, -65.0), ("grin", 0.0, -30.0)])
def test_depth_begins_where_rays_start(optics, start_mm, z, viewer_mm):
    """A wall before a virtual display plane was placed behind it; panels with meeting zones had no layers at all."""
    camera = IICamera(
        pixels=(48 * 7, 40 * 5), lenses=(48, 40), pixel_pitch_mm=0.1, gap_mm=2.0, optics=(optics,),
        start_mm=start_mm, viewer_mm=viewer_mm, origin_mm=(3.0, -2.0, -50.0),
    )  # fmt: skip
    light = np.rint(65535 * wall_light(camera, z)).astype(np.uint16)
    picture = IIPicture(light, camera.lenses, camera.ei_pixels, camera, camera.erect)
    found, focus = estimate_depth(picture), depth_from_focus(picture, method="robust")
    inner = (slice(6, -6), slice(6, -6))
    assert np.median(np.abs(found.depth_mm - z)[inner]) < 0.1
    assert np.median(np.abs(focus.depth_mm - z)[inner]) < 0.2


@pytest.mark.parametrize("lens", [{"both_sides": True}, {"optics": [Lens(z_mm=70.0, focal_mm=50.0)]}])
def test_behind_a_main_lens_disparities_have_both_signs(lens):
    """Raw pictures were searched behind the plane in focus alone: near points got the depth of far ones."""
    picture, truth = slanted(views=(5, 5), size=(64, 48), at=-0.1, slope=0.01)
    camera = IICamera(pixels=picture.size, lenses=picture.lenses, pixel_pitch_mm=0.01, gap_mm=0.2, **lens)
    found = estimate_depth(replace(picture, camera=camera))
    assert np.median(np.abs(found.disparity - truth)) < 0.02
    np.testing.assert_allclose(found.depth_mm, depth_of_disparity(camera, found.disparity))


@pytest.mark.parametrize("at", first_fast([-0.9, 0.0]))
def test_the_range_of_many_small_views_is_that_of_what_is_seen(at):
    """The planes of a stack were those that a camera can see: −48…0 px for disparities of −6…−1."""
    picture, truth = slanted(views=(16, 16), size=(64, 32), at=at, slope=0.002)
    low, high = field_range(picture)
    assert truth.min() - 0.25 < low <= truth.min() + 0.01 and truth.max() - 0.01 <= high < truth.max() + 0.25


def test_unsure_pixels_do_not_widen_the_range(monkeypatch):
    picture, _ = slanted(views=(16, 16), size=(64, 32), at=-0.9)
    disparity, confidence = np.linspace(-2, -1, 64 * 32).reshape(32, 64), np.full((32, 64), 0.9)
    disparity[1::2, ::2], confidence[1::2, ::2] = -30, 0.03
    found = DepthEstimate(disparity, confidence, None, (8, 8))
    monkeypatch.setattr("ii_core.depth.estimate.estimate_depth", lambda *_, **__: found)
    low, high = field_range(picture)
    assert low == pytest.approx(-2 - 1 / 8, abs=0.02) and high == pytest.approx(-1 + 1 / 8, abs=0.02)


def test_any_view_and_any_number_of_threads():
    picture, truth = slanted(views=(5, 5), at=0.7, slope=0.0)
    one = estimate_depth(picture, view=(0, 4), low=-2, high=2, workers=1)
    many = estimate_depth(picture, view=(0, 4), low=-2, high=2, workers=5)
    np.testing.assert_array_equal(one.disparity, many.disparity)
    assert np.median(np.abs(one.disparity - truth)) < 0.03


def test_an_even_picture_has_no_depth():
    picture = IIPicture(np.full((60, 60, 3), 77, np.uint8), (20, 20), (3, 3))
    found = estimate_depth(picture, low=-1, high=1)
    assert np.isnan(found.disparity).all() and not found.confidence.any()


def test_depth_is_that_of_the_camera():
    camera = IICamera(pixels=(144, 120), lenses=(48, 40), pixel_pitch_mm=0.1, gap_mm=1.0, start_mm=30, viewer_mm=30)
    picture, _ = slanted(views=(3, 3))
    picture = IIPicture(picture.pixels, picture.lenses, picture.ei_pixels, camera)
    found = estimate_depth(picture, low=-2, high=2)
    np.testing.assert_allclose(found.depth_mm, depth_of_disparity(camera, found.disparity))
    places, colours = view_points(picture, found.depth_mm, found.view)
    assert len(places) == len(colours) == 48 * 40
    np.testing.assert_allclose(places[:, 2].reshape(40, 48), found.depth_mm, atol=1e-9)


def test_half_lines_take_near_and_far_views():
    steps = np.array([(0, 0), *((0, i) for i in range(1, 10)), (1, 2), (3, 3)], np.float32)
    np.testing.assert_array_equal(half_lines(steps), [-1, 1, 1, -1, 1, -1, -1, -1, -1, 1, -1, 5])
    picture, _ = slanted()
    labels = labels_between(views_around(picture, (2, 2)), -1.0, 1.0)
    assert labels[0] == -1 and labels[-1] == 1 and np.ptp(np.diff(labels)) < 1e-6


def test_labels_are_a_step_apart_in_the_farthest_view_that_sees_the_point():
    """From 8 px on, a point leaves half a view of 128 px within fewer than the 8 steps of the farthest view."""
    views = views_around(IIPicture(np.zeros((64 * 16, 128 * 16, 3), np.uint8), (128, 64), (16, 16)), (8, 8))
    labels = spaced(views, -90.0, 40.0).astype(float)
    assert labels[0] == -90 and abs(labels[-1] - 40) < 1e-4
    middle, gaps = (labels[1:] + labels[:-1]) / 2, np.diff(labels)
    np.testing.assert_allclose(gaps * np.minimum(8, 64 / np.abs(middle)), STEP, rtol=0.02)
    np.testing.assert_allclose(reached(views, reached(views, labels), back=True), labels)


def test_a_step_moves_the_pixels_named_and_no_others():
    """On a plane of disparity 0.7 from 0.6: a step goes to the truth where it is taken."""
    picture, truth = slanted(slope=0.0)
    views = views_around(picture, (2, 2))
    here = np.zeros(truth.shape, bool)
    here[:, :24] = True
    start, evidence = np.full(truth.shape, 0.6, np.float32), nothing_seen(views)
    found, sure = refined(views, start, 0.3, evidence, here, 1)
    np.testing.assert_array_equal(found[:, 24:], np.float32(0.6))
    assert not sure[:, 24:].any() and sure[8:-8, 8:20].min() > 0
    assert np.abs(found - truth)[8:-8, 8:20].max() < 0.01


def test_views_moved_by_disparity_keep_the_nearest():
    """A square of disparity 3 before a wall of 0: it moves, covers, and uncovers a hole that the wall fills."""
    disparity = np.zeros((6, 20), np.float32)
    disparity[2:4, 8:12] = 3.0
    picture = IIPicture(np.zeros((18, 60, 3), np.uint8), (20, 6), (3, 3))
    moved = disparity_of_views(picture, disparity, (1, 1))
    wanted = np.zeros((6, 20), np.float32)
    wanted[2:4, 5:9] = 3.0  # view to the right: x − 3
    np.testing.assert_array_equal(moved[1, 2], wanted)
    holes = disparity_of_views(picture, disparity, (1, 1), filled=False)[1, 2]
    assert np.isnan(holes[2:4, 9:12]).all() and np.isnan(holes).sum() == 6
    np.testing.assert_array_equal(moved[1, 1], disparity)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"view": (5, 0)}, "view is 5,0: columns 0–4 and rows 0–4"),
        ({"low": 1.0, "high": 1.0}, "low < high"),
        ({"workers": 0}, "workers is 0"),
    ],
)
def test_refused(options, said):
    with pytest.raises(ValueError, match=said):
        estimate_depth(slanted()[0], **options)


def test_refused_pictures():
    with pytest.raises(ValueError, match="one view"):
        estimate_depth(IIPicture(np.zeros((16, 16, 3), np.uint8), (16, 16), (1, 1)))
    with pytest.raises(ValueError, match="views are 4×16 px: at least 8×8"):
        estimate_depth(IIPicture(np.zeros((32, 8, 3), np.uint8), (4, 16), (2, 2)))


@pytest.mark.slow
def test_sums_of_the_largest_costs_fit_in_16_bits():
    """Black and white pixels at random: no label fits, every path pays for a leap."""
    pixels = 255 * np.random.default_rng(1).integers(0, 2, (60, 60, 1), np.uint8).repeat(3, axis=2)
    views = views_around(IIPicture(pixels, (12, 12), (5, 5)), (2, 2))
    labels = np.linspace(-4, 4, 40, dtype=np.float32)
    cost = costs(views, labels, 1)
    cost[::2, :, ::2] = OTHER_SURFACE * CODES  # the most that a label costs
    total = passed_on(views, cost, labels, 1)
    wide = passed_on(views, cost.astype(np.float32), labels, 1)
    assert total.dtype == np.uint16 and wide.max() > 32768
    np.testing.assert_allclose(total, wide, atol=5)
