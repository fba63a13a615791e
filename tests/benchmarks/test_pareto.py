"""Bookkeeping of the Pareto fronts of speed and accuracy."""

import numpy as np
import pytest

from benchmarks.pages import coding_docs
from benchmarks.speed import commits, pareto, tessellation
from ii_core import preset
from raytrace_ii import load_scene
from raytrace_ii.tracing.packing import packed


def row(seconds, psnr, **more):
    return {"seconds": seconds, "psnr": psnr, "samples": 1, "depth": 0, "error": None, "cut": 1.0, **more}


def test_pareto_front_by_hand():
    rows = [row(3, 40), row(1, 20), row(2, 30), row(2.5, 29), row(1, 19), row(4, 40)]
    assert pareto.front(rows) == [1, 2, 0]


def test_times_at_equal_psnr_of_fronts_that_overlap_in_part():
    """Twice as fast everywhere; settings off the front and PSNR that one alone reaches do not count."""
    earlier = [row(1, 30), row(4, 38), row(9, 33)]
    now = [row(seconds / 2, psnr) for seconds, psnr in ((1, 30), (4, 38), (64, 54))]
    assert commits.times_at_equal_psnr(earlier, now) == pytest.approx(2)


def test_recommended_is_the_fastest_setting_below_sensor_noise_or_within_1_db():
    good = [row(1, 20), row(2, 48, samples=4), row(9, 60)]
    assert pareto.recommended(good)["seconds"] == 2
    assert pareto.recommended(good)["setting"] == "4 samples"
    assert pareto.recommended([row(1, 20), row(2, 39.5, depth=2), row(9, 40)])["setting"] == "1 sample, depth 2"


def test_tessellation_scales_by_the_factor():
    """Twice the segments, and cells half as large: four times the faces, a body's outline where it was."""
    coarse, fine = tessellation.cut_scene("apples", 0.5), tessellation.cut_scene("apples", 1)
    faces = [sum(len(b.faces) for b in scene.bodies) for scene in (coarse, fine)]
    assert faces[1] == pytest.approx(4 * faces[0], rel=0.1)
    np.testing.assert_allclose(coarse.bounds_mm, fine.bounds_mm, atol=0.5)
    assert [b.name for b in coarse.bodies] == [b.name for b in fine.bodies]
    assert not tessellation.sizes(tessellation.scene_text("cuboid"))


def test_another_depth_shares_the_tree():
    scene = load_scene("objects")
    assert packed(tessellation.at_depth(scene, 2)) is packed(scene) and tessellation.at_depth(scene, 2).max_depth == 2


def test_one_setting_of_coding_is_recommended():
    assert sum("**" in line for line in coding_docs.front_table(coding_docs.studied(4))) == 1


def test_a_band_is_the_middle_rows_of_lenses():
    """Its rays are those of the whole camera's rows, to rounding of the shifted origin (1e-12 of 50 mm)."""
    whole = preset("setup1", scale=4)
    band = pareto.band(whole)
    assert band.lenses == (128, pareto.BAND) and band.ei_pixels == whole.ei_pixels
    top = (64 - pareto.BAND) // 2 * 16
    for found, expected in zip(band.rays(), whole.rays(rows=slice(top, top + pareto.BAND * 16)), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-10)
    small = preset("setup1", scale=32)
    assert pareto.band(small) is small


def studied(before, now):
    earlier = {"recommended": {**before, "setting": "9 samples"}}
    return {"before": earlier, "rows": now, "front": pareto.front(now), "commit": "abc1234"}


def test_speedup_is_the_ratio_of_times_at_the_earlier_recommended_psnr():
    one = studied(row(6, 41), [row(1, 30), row(2, 41), row(8, 45), row(2.5, 40)])
    assert pareto.speedup(one) == pytest.approx(3)
    assert pareto.speedup(studied(row(6, 43), one["rows"])) == pytest.approx(6 / 4), "the middle of 2 and 8 seconds"
    assert pareto.speedup(studied(row(6, 20), one["rows"])) == pytest.approx(6)
    assert np.isnan(pareto.speedup(studied(row(6, 46), one["rows"])))
    coarse = {"apples": one, "car": studied(row(24, 41), one["rows"])}
    lines = pareto.fronts_table(coarse, {})
    assert lines[-3:] == [
        "| apples | 41.0 dB | 3.00 |",
        "| car | 41.0 dB | 12.00 |",
        "| geometric mean | | 6.00 |",
    ]
    fine = {"apples": studied(row(4, 41), one["rows"]), "car": studied(row(6, 46), one["rows"])}
    lines = pareto.fronts_table(coarse, fine)
    assert lines[-5:-2] == [
        "| apples | 41.0 dB | 3.00 | 2.00 |",
        "| car | 41.0 dB | 12.00 | not reached |",
        "| geometric mean | | 6.00 | not reached |",
    ]
    assert lines[-1].endswith("middle 8 rows of lenses (2048×128). Measured by `abc1234`.")
    assert len(pareto.fronts_table({"apples": {"rows": one["rows"]}}, {})) == 1, "nothing of the earlier code"


def test_each_setting_is_rendered_by_both_codes_in_turn_after_their_references():
    """The earlier study ran before the present one: what else the machine did changed the ratios."""
    calls = []

    def code(name, seconds):
        def shoot(**setting):
            calls.append((name, setting["options"]))
            return seconds, 30.0 + setting["options"].get("error", 0)

        return shoot

    facts = {"faces": {"1.0": 12}, "max_depth": 6}
    now, before = pareto.study("cuboid", facts, (code("now", 1.0), code("before", 2.0)))
    assert [options["samples"] for _, options in calls[:4]] == [pareto.TRUE["samples"]] * 2 + [64] * 2
    assert [name for name, options in calls if options["samples"] == "edges"] == ["now"] * len(pareto.EDGE_ERRORS)
    calls = [(name, options) for name, options in calls if options["samples"] != "edges"]
    assert [name for name, _ in calls] == ["now", "before"] * (len(calls) // 2)
    assert all(one == other for (_, one), (_, other) in zip(calls[::2], calls[1::2], strict=True))
    assert len(now["rows"]) == len(pareto.SAMPLES) + len(pareto.ERRORS + pareto.EDGE_ERRORS), (
        "nothing mirrors, one tessellation"
    )
    assert before["recommended"]["setting"] == "4 to 16 samples, error 8"
    assert {row["seconds"] for row in now["rows"]} == {1.0} and {row["seconds"] for row in before["rows"]} == {2.0}
