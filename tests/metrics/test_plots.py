"""Charts of qualities and sheets of views."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from ii_core import IICamera, IIPicture, five_viewpoints, view_image
from ii_core.base.files import read_image, write_image
from ii_core.display.figure import save
from ii_core.display.view_sheets import _pair_figure, _views_figure, plot_pair, plot_views
from metrics import PLOTS, angle_axes, depth_rate_chart, plot_all, plot_angle, q_angle, q_depth, rd_chart, time_chart
from metrics.benchmark import ranking_page
from metrics.measures.over_time import TakeQuality
from metrics.observers.subjective import predicted_scores
from metrics.observers.verdict import Judged, Verdict
from metrics.plots.angle_depth import _depth_figure, angle_figure, plot_depth
from metrics.plots.opinion_chart import opinion_chart


def picture(lenses=(12, 8), ei_pixels=(6, 4), seed=0, dtype="uint8"):
    size = lenses[0] * ei_pixels[0], lenses[1] * ei_pixels[1]
    camera = IICamera(pixels=size, lenses=lenses, pixel_pitch_mm=0.1, gap_mm=1.5)
    values = np.random.default_rng(seed).random((size[1], size[0], 3))
    return IIPicture((values * (1 if dtype == "float32" else 255)).astype(dtype), lenses, ei_pixels, camera)


def worse(a, step=2):
    return a.with_pixels((a.pixels.astype(float) + step * (a.pixels < 200)).astype(a.pixels.dtype))


def test_angle_map_lies_where_rays_go():
    a = picture()
    pixels = a.pixels.copy()
    pixels.reshape(8, 4, 12, 6, 3)[:, 3, :, 1] ^= 1
    pixels.reshape(8, 4, 12, 6, 3)[:, 0, :, 5] ^= 4
    b = a.with_pixels(pixels)
    figure = angle_figure(q_angle(a, b))
    (mesh,) = figure.axes[0].collections
    u_deg, v_deg = angle_axes(a.camera)
    at = mesh.get_coordinates()  # corners of the cells
    shown = np.ma.filled(mesh.get_array().reshape(4, 6), np.nan)
    assert np.isfinite(shown).sum() == 2
    for u, v, step in ((1, 3, 1), (5, 0, 4)):
        row, column = np.argwhere(np.isclose(shown, 20 * math.log10(255 / step)))[0]
        assert at[row, column, 0] < u_deg[u] < at[row, column + 1, 0]
        assert at[row, column, 1] < v_deg[v] < at[row + 1, column, 1]
    assert "identical" in figure.axes[0].get_title(loc="left")


def test_angle_axes_without_a_camera_are_pixels_and_identical_pictures_are_no_error():
    a = picture()
    bare = IIPicture(a.pixels, a.lenses, a.ei_pixels)
    axes = angle_figure(q_angle(bare, bare)).axes
    assert len(axes) == 1  # no scale for what has no value
    assert "px" in axes[0].get_xlabel() and axes[0].yaxis_inverted()  # row 0 on top, as in the picture


def test_depth_curve_shows_each_layer_that_has_pixels():
    a = picture()
    depth = np.full(a.pixels.shape[:2], 15.0)
    depth[:, 36:] = 150.0
    b = a.with_pixels(np.where((depth == 150)[..., None], worse(a).pixels, a.pixels))
    q = q_depth(a, b, depth=depth)
    upper, lower = _depth_figure(q).axes
    (points,) = upper.collections
    np.testing.assert_allclose(points.get_offsets(), [[150, q.values[-1]]])
    (same,) = (line for line in upper.lines if line.get_markerfacecolor() == "white")
    np.testing.assert_allclose(same.get_xdata(), [15])
    assert upper.get_title(loc="left").startswith("Q_depth; depth: given")
    assert lower.get_xlabel() == "depth z [mm]" and lower.get_title(loc="right").startswith("0.0% of view pixels")
    half = _depth_figure(q_depth(a, b, depth=depth, layers_mm=[14.0, 15.0, 16.0]))
    assert half.axes[1].get_title(loc="right") == "50.0% of view pixels outside all layers"


@pytest.mark.parametrize("kind", ["identical", "no depth"])
def test_depth_curve_without_values(kind, tmp_path):
    a = picture()
    depth = np.full(a.pixels.shape[:2], 15.0 if kind == "identical" else np.nan)
    plot_depth(q_depth(a, a, depth=depth), tmp_path / "q.png")
    assert (tmp_path / "q.png").stat().st_size > 1000


def test_views_and_their_difference():
    a = picture()
    pixels = a.pixels // 2 + 60
    a = a.with_pixels(pixels)
    b = a.with_pixels(pixels + 3)
    figure = _views_figure(a, b)
    panels = np.array(figure.axes).reshape(3, 5)
    names = [axes.get_title() for axes in panels[0]]
    assert names == list(five_viewpoints(a.camera))
    for name, (top, middle, bottom) in zip(names, panels.T, strict=True):
        expected, _ = view_image(a, five_viewpoints(a.camera)[name])
        np.testing.assert_allclose(top.images[0].get_array(), expected / 255)
        # Views are rounded to codes: half-way between two, a step of 3 may become one of 4 or 2.
        step = middle.images[0].get_array() * 255 - expected
        np.testing.assert_allclose(step, 3, atol=1.001)
        np.testing.assert_allclose(bottom.images[0].get_array(), np.minimum(0.5 + 32 * step / 255, 1), atol=1e-9)
    assert panels[2, 0].get_ylabel() == "difference × 32"
    assert _views_figure(a, a.with_pixels(255 - pixels)).axes[10].get_ylabel() != "difference × 32"


def test_cross_eyed_pair_has_the_right_eye_on_the_left():
    a = picture()
    left, right = _pair_figure(a).axes
    views = five_viewpoints(a.camera)
    for axes, eye in ((left, "right"), (right, "left")):
        expected, _ = view_image(a, (views[eye] + views["front"]) / 2)
        np.testing.assert_allclose(axes.images[0].get_array(), expected / 255)
        assert eye in axes.get_title()


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_all_are_written_and_none_else(dtype, tmp_path):
    a = picture(dtype=dtype)
    b = a.with_pixels(a.pixels // 2 if dtype != "float32" else a.pixels / 2)
    q = q_depth(a, b, depth=np.full(a.pixels.shape[:2], 15.0))
    paths = plot_all(a, b, q, tmp_path)
    assert sorted(paths) == sorted(tmp_path.iterdir())
    assert [p.name for p in paths] == list(PLOTS)
    assert all(min(read_image(p).shape[:2]) > 200 for p in paths)


def test_charts_depend_on_the_known_qualities(tmp_path):
    a = picture()
    bare = IIPicture(a.pixels, a.lenses, a.ei_pixels)
    assert plot_all(bare, bare, None, tmp_path) == [tmp_path / "q_angle.png"]


@pytest.mark.slow
def test_the_command_draws(run, refused, tmp_path):
    a = picture((12, 12))
    a.save(tmp_path / "a.png")
    worse(a).save(tmp_path / "b.png")
    folder, numbers = tmp_path / "plots", tmp_path / "m.json"
    code, out, _ = run("measure", tmp_path / "a.png", tmp_path / "b.png", "--plots", folder, "--json", numbers)
    assert code == 0
    assert "Q_depth" in out and "focus (dissertation)" in out
    assert sorted(p.name for p in folder.iterdir()) == sorted(PLOTS)
    assert all(min(read_image(p).shape[:2]) > 200 for p in folder.iterdir())
    kept = json.loads(numbers.read_text())["q_depth"]
    expected = q_depth(a, worse(a))
    assert kept["counts"] == expected.counts.tolist() and kept["source"] == expected.source
    assert kept["depth_mm"] == expected.depth_mm.tolist()
    refused(run("measure", tmp_path / "a.png", tmp_path / "b.png", "--plots", folder), "is there already")

    write_image(tmp_path / "z.exr", np.full(a.pixels.shape[:2], 15, np.float32))
    code, out, _ = run("measure", tmp_path / "a.png", tmp_path / "b.png", "--depth", tmp_path / "z.exr")
    assert code == 0 and "mean of 1 layers; worst" in out


def test_refusals(tmp_path):
    a = picture()
    for draw in (
        lambda p: plot_angle(a, a, p),
        lambda p: plot_views(a, a, p),
        lambda p: plot_pair(a, p),
        lambda p: plot_depth(q_depth(a, a, depth=np.full(a.pixels.shape[:2], 15.0)), p),
    ):
        with pytest.raises(ValueError, match="no known chart type"):
            draw(tmp_path / "x.gif")
    with pytest.raises(ValueError, match="different structure"):
        plot_views(a, picture(ei_pixels=(4, 6)), tmp_path / "x.png")
    assert not list(tmp_path.iterdir())


NAME = "a_$b^{"


def _studied():
    point = {
        "scheme": NAME, "options": {}, "target_bpp": 0.1, "bpp": 0.1, "nbytes": 10, "q_global": 30.0, "reached": True,
        "q_depth_min": 20.0, "q_depth_mean": 30.0, "q_depth_max": 40.0, "q_depth": [20.0, 40.0],
        "depth_mm": [1.0, 2.0],
    }  # fmt: skip
    points = [{**point, "bpp": bpp, "target_bpp": bpp, "scheme": scheme} for bpp in (0.1, 0.2) for scheme in NAMES]
    return {"picture": {"name": NAME}, "points": points}


NAMES = (NAME, f"{NAME}}}$ in two", f"_{NAME}")


def _opinions():
    stimuli = [
        {"scene": NAME, "name": NAME, "reference": False, "scheme": NAMES[i % 3], "measures": {NAME: float(i)}}
        for i in range(6)
    ]
    scores = [1.0, 1.5, 2.5, 3.5, 4.0, 4.5]
    judged = [Judged(i, score, 0.1, 3) for i, score in enumerate(scores)]
    found = {(NAME, "all"): predicted_scores(range(6), scores)}
    return Verdict({"method": "dsis", "stimuli": stimuli}, judged, found, [], 3, simulated=True)


def _take():
    values = np.linspace(30, 40, 4)
    flicker = values / 100
    return TakeQuality(
        fps=25.0, q_global=values, q_angle=values[:, None, None], flicker=flicker, error_change=flicker
    )


def _ranking():
    point = [{"bpp": bpp, "q_global": 30.0} for bpp in (0.1, 0.2)]
    rows = [{"coder": name, "result": {"pictures": [{"name": NAME, "points": point}]}} for name in NAMES]
    return ranking_page._chart(SimpleNamespace(pictures=[NAME], rank_by="q_global"), rows)


CHARTS = {
    "rd": lambda path: rd_chart(_studied(), path),
    "depth over rate": lambda path: depth_rate_chart(_studied(), path),
    "opinions": lambda path: opinion_chart(_opinions(), path),
    "time": lambda path: time_chart(dict.fromkeys(NAMES, _take()), path),
    "ranking": lambda path: save(_ranking(), path),
}


@pytest.mark.slow
@pytest.mark.parametrize("chart", CHARTS)
def test_names_in_charts_are_drawn_letter_by_letter(chart, tmp_path):
    """A dollar sign began a formula, of which matplotlib could make no sense; a first underscore hid a name."""
    text = CHARTS[chart](tmp_path / "c.svg").read_text(encoding="utf-8")
    for name in [NAME] if chart == "opinions" else NAMES:
        assert name in text
