"""Looking Glass displays by their own calibration."""

import json
import math

import numpy as np
import pytest

from ii_core.base.files import read_image
from ii_core.display.look import display_views
from ii_core.display.looking_glass import CELL, native_picture, read_looking_glass, view_numbers, view_of_native
from ii_core.display.quilt import shown_shares
from tests.ii_core.test_display import directions as numbered

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
