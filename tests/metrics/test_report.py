"""Report of `measure` for all kinds of pictures: a quality, or the reason why it is missing."""

import json
import math

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, five_viewpoints, resampled, view_image
from ii_core.base.files import read_image, write_image
from metrics import DepthQuality, error_map, q_angle, q_depth, q_global, q_view, report
from metrics.plots.error_maps import _error_layers_figure, error_views_figure, layer_groups

PEAKS = {"uint8": 255, "uint16": 65535, "float32": 1.0}


def picture(lenses=(14, 12), ei_pixels=(4, 4), dtype="uint8", seed=0, camera=True, **more):
    size = lenses[0] * ei_pixels[0], lenses[1] * ei_pixels[1]
    values = np.random.default_rng(seed).random((size[1], size[0], 3)) * PEAKS[dtype]
    camera = IICamera(pixels=size, lenses=lenses, pixel_pitch_mm=0.1, gap_mm=1.5, **more) if camera else None
    return IIPicture(values.astype(dtype), lenses, ei_pixels, camera)


def worse(a):
    other = np.random.default_rng(9).random(a.pixels.shape) * PEAKS[a.pixels.dtype.name]
    return a.with_pixels((0.9 * a.pixels + 0.1 * other).astype(a.pixels.dtype))


def test_all_numbers_are_those_of_the_functions():
    a, b = picture(), worse(picture())
    depth = np.full(a.pixels.shape[:2], 15.0)
    made = report(a, b, ssim=True, over_depth=True, depth=depth)
    n = made.numbers
    assert n["q_global"] == q_global(a, b)
    assert n["q_angle"]["values"] == q_angle(a, b).values.tolist() and n["q_angle"]["mean"] == q_angle(a, b).mean
    view = q_view(a, b)
    assert n["q_view"]["mean"] == view.mean and n["q_view"]["worst_view"] == view.worst_view
    assert n["q_view_psnr"]["pooled"] == view.pooled_psnr and n["q_view_psnr"]["mean"] == view.mean_psnr
    layers = q_depth(a, b, depth=depth)
    assert n["q_depth"]["counts"] == layers.counts.tolist() and n["q_depth"]["mean"] == layers.mean
    assert list(n["missing"]) == ["ms_ssim"]  # it needs 176 lenses
    assert list(made.rows)[:3] == ["Q_global", "Q_angle", "YCbCr 6:1:1"]
    assert "±" in made.rows["Q_angle"] and made.rows["MS-SSIM"].startswith("– needs at least 176×176 lenses")


def test_pictures_of_other_tools_have_the_measures_that_apply():
    bare = picture(camera=False)
    made = report(bare, worse(bare), over_depth=True)
    assert set(made.numbers["missing"]) == {"q_view", "q_depth"} and made.depth is None
    assert made.rows["Q_view"].startswith("– the picture has no camera: gap and pixel pitch")
    assert math.isfinite(made.numbers["q_global"]) and "ycbcr" in made.numbers
    few = picture((6, 6))
    assert report(few, few).rows["Q_view"] == "– needs at least 11×11 lenses, the picture has 6×6"
    bent = picture(optics=("pinhole", {"kind": "lens", "z_mm": 30, "focal_mm": 25}))
    assert "lens before the lenses bends" in report(bent, bent, over_depth=True).rows["Q_depth"]
    assert report(bent, bent, over_depth=True, depth=np.full((48, 56), 9.0)).depth is not None


def test_a_hexagonal_picture_and_what_becomes_of_it():
    camera = IICamera(pixels=(120, 100), lenses=(13, 12), pixel_pitch_mm=0.1, gap_mm=1.5, lattice="hexagonal")
    pixels = np.random.default_rng(0).integers(0, 256, (100, 120, 3), np.uint8)
    a = IIPicture(pixels, camera.lenses, camera.ei_pixels, camera)
    made = report(a, worse(a))
    assert set(made.numbers["missing"]) == {"q_angle", "ycbcr", "q_view"}
    assert "raytrace-ii regular" in made.rows["Q_angle"]
    (one, owned), (other, _) = resampled(a), resampled(worse(a))
    made = report(one, other, mask=owned)
    assert set(made.numbers["missing"]) == {"ycbcr"} and made.numbers["q_global"] == q_global(one, other, mask=owned)


PLAIN = {
    "identical": lambda a: a,
    "constant": lambda a: a.with_pixels(np.full_like(a.pixels, PEAKS[a.pixels.dtype.name] / 2)),
    "all black": lambda a: a.with_pixels(np.zeros_like(a.pixels)),
}


@pytest.mark.parametrize("dtype", PEAKS)
@pytest.mark.parametrize("kind", PLAIN)
def test_plain_pictures(kind, dtype):
    a = picture(dtype=dtype)
    plain = PLAIN[kind](a)
    made = report(plain, plain, ssim=True, over_depth=True)
    assert made.numbers["q_global"] == made.numbers["q_view_psnr"]["pooled"] == "inf"
    assert made.numbers["q_view"]["mean"] == made.numbers["ssim"]["mean"] == 1
    assert (made.depth.counts.sum() > 0) == (kind == "identical")  # nothing tells even layers apart
    judged = report(a, plain, ssim=True, over_depth=True).numbers
    assert (judged["q_global"] == "inf") == (kind == "identical")
    if kind != "identical":
        assert 0 < judged["q_global"] < 15 and judged["q_view"]["mean"] < 0.1


@pytest.mark.parametrize(
    ("lenses", "ei"), [((14, 12), (1, 1)), ((1, 1), (16, 16)), ((1, 1), (1, 1)), ((1, 12), (5, 1))]
)
@pytest.mark.parametrize("method", ["dissertation", "robust"])
def test_the_smallest_structures(lenses, ei, method):
    a = picture(lenses, ei)
    made = report(a, worse(a), over_depth=True, method=method)
    assert math.isfinite(made.numbers["q_global"])
    assert ("q_view" in made.numbers) == (lenses == (14, 12))
    counts = made.depth.counts.sum()
    assert (counts == 0) == (method == "robust" or lenses == (1, 1)), (
        counts
    )  # one pixel a lens has no parallax to go by
    given = report(a, worse(a), over_depth=True, depth=np.full(a.pixels.shape[:2], 30.0)).depth
    assert given.counts.sum() == given.layer.size


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_pixels_that_are_not_finite_are_named(bad):
    a = picture(dtype="float32")
    pixels = a.pixels.copy()
    pixels[3, 7, 2] = bad
    for pair in ((a, a.with_pixels(pixels)), (a.with_pixels(pixels), a)):
        with pytest.raises(ValueError, match=r"pixel \(7, 3\) is .*: finite values are needed"):
            report(*pair, over_depth=True)


def test_layers_outside_the_scene_are_empty():
    a = picture()
    made = report(a, worse(a), over_depth=True, depth=np.full((48, 56), 20.0), layers_mm=[100.0, 110.0])
    assert made.rows["Q_depth"].startswith("no depth found") and made.numbers["q_depth"]["outside"] == 14 * 12
    assert np.isnan(made.depth.values).all() and made.numbers["q_depth"]["mean"] is None  # null in JSON


def test_error_map_by_hand():
    a, b = picture(), worse(picture())
    at = five_viewpoints(a.camera)["left"]
    (x, _), (y, _) = (view_image(p, at) for p in (a, b))
    expected = np.sqrt(np.square(x.astype(float) - y).mean(axis=2)) / 255
    np.testing.assert_allclose(error_map(a, b, at), expected, rtol=1e-12)
    aside = error_map(a, b, (-300, 0, -200))
    assert np.isnan(aside).any() and (np.isnan(aside) == ~view_image(a, (-300, 0, -200))[1]).all()


def test_sheets_of_errors_show_every_view_and_every_pixel_once():
    a, b = picture(), worse(picture())
    depth = 6 + np.arange(48 * 56).reshape(48, 56) % 300.0
    q = q_depth(a, b, depth=depth)
    maps = {name: error_map(a, b, at) for name, at in five_viewpoints(a.camera).items()}
    views = [axes for axes in error_views_figure(maps).axes if axes.images]
    assert len(views) >= 5
    panels = [axes for axes in _error_layers_figure(a, q).axes if len(axes.images) == 2]
    assert 2 <= len(panels) <= 12
    drawn = sum(np.isfinite(np.ma.filled(axes.images[1].get_array(), np.nan)).astype(int) for axes in panels)
    np.testing.assert_array_equal(drawn, (q.layer >= 0).astype(int))
    nothing = DepthQuality(q.depth_mm, q.values * np.nan, q.counts * 0, 0, "given", q.layer * 0 - 1, q.error)
    assert any("no pixel has a depth" in text.get_text() for text in _error_layers_figure(a, nothing).axes[0].texts)
    with pytest.raises(ValueError, match=r"that of a view of \(12, 14\)"):
        _error_layers_figure(picture((6, 6)), q)


def test_groups_of_layers_hold_all_that_have_pixels():
    counts = np.zeros(250, np.int64)
    counts[[3, 5, 9]] = 7, 1, 900
    assert layer_groups(counts) == [(3, 3), (5, 5), (9, 9)] and layer_groups(counts * 0) == []
    counts = np.random.default_rng(0).integers(0, 50, 250)
    groups = layer_groups(counts)
    held = np.concatenate([np.arange(a, b + 1) for a, b in groups])
    assert len(groups) == 12 and set(np.flatnonzero(counts)) <= set(held) and len(set(held)) == len(held)
    sizes = [counts[a : b + 1].sum() for a, b in groups]
    assert max(sizes) - min(sizes) <= 2 * 50  # a layer more or less at either end


def test_the_command_names_missing_measures_and_accepts_bare_pictures(run, refused, tmp_path):
    a = picture()
    a.save(tmp_path / "a.png")
    write_image(tmp_path / "b.png", worse(a).pixels)  # no sidecar
    code, out, told = run("measure", tmp_path / "a.png", tmp_path / "b.png", "--json", tmp_path / "m.json", "--ssim")
    assert code == 0 and "MS-SSIM" in out
    assert told.endswith("b.png has no sidecar: the structure of the reference is taken\n")
    kept = json.loads((tmp_path / "m.json").read_text())
    assert kept["q_global"] == q_global(a, worse(a)) and "ms_ssim" in kept["missing"]
    a.save(tmp_path / "upper.PNG")
    code, out, told = run("measure", tmp_path / "a.png", tmp_path / "upper.PNG")
    assert code == 0 and not told
    (tmp_path / "x.csv").write_text("1,2")
    refused(run("measure", tmp_path / "a.png", tmp_path / "x.csv"), "names of pictures end in .png, .tif")
    write_image(tmp_path / "c.png", worse(a).pixels[4:])
    refused(run("measure", tmp_path / "a.png", tmp_path / "c.png"), "c.png has no sidecar c.png.json, and 56×44 px")

    write_image(tmp_path / "z.exr", np.full(a.pixels.shape[:2], 15, np.float32))
    options = ["--depth", tmp_path / "z.exr", "--layers", "5:45:3", "--json", tmp_path / "m.json", "--force"]
    code, out, _ = run("measure", tmp_path / "a.png", tmp_path / "b.png", *options)
    assert code == 0 and json.loads((tmp_path / "m.json").read_text())["q_depth"]["counts"] == [0, 168, 0]
    both = ("measure", tmp_path / "a.png", tmp_path / "b.png", "--depth-from-focus")
    refused(run(*both, "--layers", "5:4"), "layers are '5:4'")
    refused(run(*both, "--layers", "-3"), "-3 layers: at least 1")
    refused(
        run("measure", tmp_path / "a.png", tmp_path / "b.png", "--depth-from-focus", "--method", "guess"), "known are"
    )

    half = np.zeros((48, 56, 3), np.uint8)
    half[:24] = 255
    write_image(tmp_path / "mask.png", half)
    code, out, _ = run("measure", tmp_path / "a.png", tmp_path / "b.png", "--mask", tmp_path / "mask.png")
    expected = q_global(a, worse(a), mask=half[..., 0] > 0)
    assert code == 0 and f"{expected:.2f} dB" in out and "a mask leaves some out" in out
    assert read_image(tmp_path / "mask.png").shape == (48, 56, 3)
