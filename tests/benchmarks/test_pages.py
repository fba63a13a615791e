"""Tables of peers and of speed ratios."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.coding.coders import LETTERS, offsets, rate_table, shortened, summary, touch
from benchmarks.pages import hero, readme
from benchmarks.records import ROOT
from ii_core import preset
from raytrace_ii import load_scene, render


def test_ranges_have_one_unit_and_start_at_the_least_gain():
    assert readme.percents([-26.4, -50.2, -39.0]) == "−26 to −50 %"
    assert readme.percents([3.4]) == "+3 %"
    assert readme.percents([-26.4, None]) == readme.percents([]) == readme.NONE
    assert readme.factors([123.2, 75.9]) == "76 to 123 ×"
    assert readme.factors([1.4049, 1.3564]) == "1.4 ×"


def test_a_peer_is_shown_where_all_scenes_have_both_curves():
    rows = {(name, scheme): {} for name in readme.SCENES for scheme in ("si-avif", "si-lf")}
    assert list(readme.paired(rows, "si-avif")) == list(readme.SCENES)
    del rows["cuboid", "si-avif"]
    assert readme.paired(rows, "si-avif") == {}


def test_losses_are_claims_too():
    """Every peer has a line for each size of views that was measured, whatever it says."""
    found = [(peer, scale) for peer, scale, _ in readme.meetings()]
    assert found[:4] == [("AV1", 8), ("AV1", 1), ("HEVC", 8), ("HEVC", 4)]
    lines = readme.peers_table()
    kept = [scale for peer, scale in found if scale != readme.SMALL or peer not in readme.PEERS.values()]
    assert sum(": rate" in line for line in lines) == len(kept) + len(readme.ANCHORS) * len(readme.MEASURES)
    assert sum("decoding" in line for line in lines) == 2


# -- the moving picture at the head of the README


def shape(path):
    with Image.open(path) as film:
        return film.size, film.n_frames, film.info["loop"]


@pytest.mark.slow
def test_the_readme_opens_with_a_light_film(tmp_path):
    """The script writes the film from a larger picture; b1dc540 had a still of an eighth of the lenses."""
    assert hero.PATH.stat().st_size < 1e6
    assert f"]({hero.PATH.relative_to(ROOT).as_posix()})" in (ROOT / "README.md").read_text()[:1200]
    picture = render(load_scene("apples"), preset("setup1", scale=16), support=()).picture
    hero.film(picture, tmp_path / "a.webp")
    assert shape(hero.PATH) == shape(tmp_path / "a.webp") == (hero.SIZE, hero.FRAMES, 0)
    first, second = (np.asarray(Image.open(path).convert("RGB"), float) for path in (hero.PATH, tmp_path / "a.webp"))
    # the same place of the same scene: 16 times fewer lenses blur it, another view would be 40 off
    assert np.abs(first - second).mean() < 12


# -- table and chart of coders, also with schemes not measured on every scene


ROWS = [
    {"scene": scene, "scheme": scheme, "bd_rate": rate, "seconds": seconds, "commit": "abcdef0"}
    for scheme, scene, rate, seconds in (
        ("everywhere", "apples", -10.0, 1.0),
        ("everywhere", "car", -30.0, 3.0),
        ("once", "apples", -90.0, 2.0),
        ("undefined", "apples", -80.0, 2.0),
        ("undefined", "car", None, 2.0),
    )
]


def test_the_mean_rate_needs_all_scenes():
    """A scheme with one good scene must not rank before schemes measured on all scenes."""
    found = {row["scheme"]: row for row in summary(ROWS)}
    assert found["everywhere"]["mean"] == pytest.approx(-20) and found["everywhere"]["seconds"] == pytest.approx(2)
    assert found["once"]["mean"] is None and found["undefined"]["mean"] is None
    assert next(iter(found)) == "everywhere"


def test_a_scene_that_was_not_measured_is_a_dash():
    assert "| `once` | -90 | – | – | 2.00 |" in rate_table(ROWS)


def test_the_short_table_has_the_best_setting_of_each_scheme_that_is_no_si_scheme():
    rates = {
        "si-a:best": 10.2,
        "si-a:fast": 30.0,
        "si-a": 10.4,
        "ei-a:best": 40.0,
        "ei-a": 50.0,
        "b:best": None,
        "b": None,
    }
    rows = [
        {"scene": "car", "scheme": name, "bd_rate": rate, "seconds": 1.0, "commit": "abcdef0"}
        for name, rate in rates.items()
    ]
    assert [row["scheme"] for row in shortened(summary(rows))] == ["si-a", "si-a:fast", "ei-a:best", "b"]


def test_labels_of_neighbouring_points_do_not_overlap():
    """Eight points at one position and one far away: no label covers another label or a point."""
    figure = Figure(figsize=(6, 6), dpi=90)
    axes = figure.add_subplot(xscale="log", yscale="log", xlim=(0.1, 10), ylim=(0.1, 10))
    named = [(f"si-coder{i}", (1.0, 1.0), "") for i in range(8)] + [("si-far", (5.0, 5.0), "")]
    found = offsets(named, axes)
    assert found[-1] == (5, 3)  # a free position
    boxes = [(x, y, x + 0.55 * LETTERS * 9, y + 1.1 * LETTERS) for x, y in found[:-1]]
    assert not any(touch(a, b) for a, b in combinations(boxes, 2))
    assert not any(touch(box, (-4, -4, 4, 4)) for box in boxes)
