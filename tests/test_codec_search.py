"""Meeting a rate by trying settings, on coders that are formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.rate import Run
from codec.search import MAX_RUNS, nearest_setting


def search(size, target, **kwargs):
    """The size found and the runs it took, for a coder that makes ``size(setting)`` bytes (none are really there)."""
    run, runs = nearest_setting(lambda setting: Run(range(int(size(setting))), 0.0), target, **kwargs)
    return len(run.payload), runs


DB = {"low": 0.0, "high": 60.0, "start": 33.0, "octave": 3.0}


@given(st.floats(1.5, 8.0), st.floats(0.6, 1.6), st.floats(2000, 200_000))
def test_smooth_coders_are_met_in_a_few_runs(octave, bend, target):
    def size(db):
        return 500 * 2 ** (60 / octave * (db / 60) ** bend)

    found, runs = search(size, target, **DB)
    if size(60) > target:
        assert abs(found / target - 1) <= 0.02
        assert runs <= 10
    else:
        assert found == int(size(60)) or abs(found / target - 1) <= 0.02


def test_whole_settings_end_at_the_nearest():
    found, runs = search(lambda q: 100 * 1.1**q, 1000 * 1.05, low=0, high=63, start=40, octave=6, whole=True)
    assert found == int(100 * 1.1**25)  # 1083; 24 makes 985
    assert runs <= 6


def test_larger_settings_may_be_coarser():
    found, _ = search(lambda q: 1_000_000 / (1 + q), 20_000, low=0, high=1000, start=500, octave=-100)
    assert abs(found / 20_000 - 1) <= 0.02


@pytest.mark.parametrize(("target", "kept"), [(1, 100), (5e-324, 100), (1e9, 6400), (np.inf, 6400)])
def test_ends_are_kept_for_what_lies_beyond(target, kept):
    found, runs = search(lambda db: 100 * 2 ** (db / 10), target, **DB)
    assert found == kept
    assert runs <= 6


def test_what_is_finer_than_the_finest_setting_is_tried_where_it_may_help():
    def best():
        return Run(range(9000), 0.0)

    def size(db):
        return 100 * 2 ** (db / 10)

    assert search(size, 1e6, **DB, finest=best)[0] == 9000
    assert search(size, 8500, **DB, finest=best)[0] == 9000
    assert search(size, 6600, **DB, finest=best)[0] == 6400
    assert search(size, 3200, **DB, finest=lambda: pytest.fail("not needed"))[0] == pytest.approx(3200, rel=0.02)


def test_a_coder_that_jumps_past_the_target_is_left_alone_in_time():
    found, runs = search(lambda db: 100 if db < 31.4 else 900, 500, **DB)
    assert found in (100, 900)
    assert runs <= MAX_RUNS
