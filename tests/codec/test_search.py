"""Search of a setting whose stream has a target size, with coders simulated by formulas."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec import decode, encode, schemes
from codec.contract import find, parse_scheme
from codec.search import Axis, Run, Trial, bracket, meet_rate, meet_size, size_miss, trials
from tests.codec.test_contract import psnr, quick, textured


class Fake:
    """Rate control whose size is a function of its target."""

    def __init__(self, size_of, coarsest=1, finest=10**6):
        self.size_of, self.limits, self.asked = size_of, (coarsest, finest), []

    def search(self, target):
        def run(size):
            return Run(bytes(round(size)), 0.0)

        def at(ask):
            self.asked.append(ask)
            return run(self.size_of(ask))

        found = meet_rate(at, target, coarsest=lambda: run(self.limits[0]), finest=lambda: run(self.limits[1]))
        return len(found.run.payload), found.runs


def test_a_proportional_coder_runs_once():
    assert Fake(lambda ask: ask).search(1000) == (1000, 1)


@pytest.mark.parametrize("error", [0.85, 0.97, 1.03, 1.2])
def test_a_proportional_miss_is_corrected_once(error):
    size, runs = Fake(lambda ask: error * ask).search(10_000)
    assert abs(size - 10_000) <= 200
    assert runs == 2


@pytest.mark.parametrize("power", [0.6, 1.6])
def test_a_nonlinear_coder_meets_the_target_within_the_runs(power):
    size, runs = Fake(lambda ask: 1.15 * 10_000 * (ask / 10_000) ** power).search(10_000)
    assert abs(size - 10_000) <= 200
    assert runs <= 4


def test_a_floor_is_settled_by_one_run_at_it():
    coder = Fake(lambda ask: max(ask, 5000), coarsest=4900)
    assert coder.search(1000) == (4900, 2)


def test_a_ceiling_near_the_target_is_found_in_three_runs():
    coder = Fake(lambda ask: min(ask, 900), finest=905)
    assert coder.search(1000) == (905, 3)


def test_a_coder_that_goes_below_its_coarsest_quantiser_is_followed():
    size, runs = Fake(lambda ask: 1.4 * ask, coarsest=5000).search(1000)
    assert abs(size - 1000) <= 20
    assert runs == 3


def test_a_limit_beyond_the_target_does_not_end_the_search():
    size, _ = Fake(lambda ask: 1.5 * ask, coarsest=10).search(10_000)
    assert abs(size - 10_000) <= 200


def test_an_erratic_coder_ends_the_search_after_its_runs():
    sizes = iter([1100, 950, 1060, 930, 0, 0])
    size, runs = Fake(lambda ask: next(sizes)).search(1000)
    assert size == 950
    assert runs <= 6


def by_quantiser(size_of, target, *, step=0.05, octave=6.0):
    axis = Axis(low=0, high=51, start=30.6, octave=-octave, step=step, overshoot=0, runs=5)
    found = meet_size(lambda q: Run(range(round(size_of(q))), 0.0), target, axis)
    return len(found.run.payload), found.runs


@pytest.mark.parametrize("octave", [3.0, 6.0, 14.0])
@pytest.mark.parametrize("target", [400, 10_000, 150_000])
def test_a_quantiser_is_found_whatever_the_slope(octave, target):
    found, runs = by_quantiser(lambda q: 1e4 * 2 ** ((30 - q) / octave), target)
    if 1e4 * 2 ** (-21 / octave) <= target <= 1e4 * 2 ** (30 / octave):
        assert found == pytest.approx(target, rel=0.02)
    assert runs <= 5


def test_a_target_beyond_the_range_takes_the_end_of_it():
    assert by_quantiser(lambda q: 1000 * 2 ** ((30 - q) / 6), 1) == (round(1000 * 2 ** (-21 / 6)), 2)


def test_a_search_starts_from_known_trials():
    """The share of frames at the finer of two quantisers: its size is known at 0 and at 1."""

    def miss(run):
        return size_miss(run, 10_500)

    ends = [Trial(share, miss(Run(range(size), 0.0)), None) for share, size in ((0.0, 10_000), (1.0, 11_000))]
    axis = Axis(low=0.0, high=1.0, start=0.5, octave=1.0, runs=4)
    more = list(trials(lambda share: Run(range(round(1e4 + 1e3 * share**1.5)), 0.0), miss, axis, known=ends))
    assert len(more[-1].result.payload) == pytest.approx(10_500, rel=0.02)
    assert len(more) == 1  # a tenth between the ends: the first interpolation is within 2 %
    assert 0.4 < more[0].setting < 0.6


def test_no_bracket_where_all_sizes_lie_on_one_side():
    axis = Axis(low=0, high=51, start=30, octave=-6)
    tried = [Trial(20, -1.0, None), Trial(30, -2.0, None)]
    assert bracket(tried, axis) is None
    assert bracket([*tried, Trial(10, 0.5, None)], axis) == (tried[0], Trial(10, 0.5, None))


@pytest.mark.parametrize(("octave", "step"), [(3.0, 0.0), (-3.0, 0.0), (7.0, 1.0), (-7.0, 1.0), (-9.0, 0.25)])
@given(st.floats(100, 1e6), st.floats(0.5, 2.0))
def test_search_over_rising_falling_whole_and_real_settings(octave, step, target, slope):
    """The mirrored axis is searched by the mirrored settings; on a grid the result is one of the two neighbours."""

    def size(setting):
        return round(1e4 * 2 ** (setting / (slope * abs(octave))))

    def settings(sign):
        visited = []

        def run(setting):
            visited.append(sign * setting)
            return Run(range(size(sign * setting)), 0.0)

        low, high = sorted((sign * -64, sign * 64))
        axis = Axis(low=low, high=high, start=0.0, octave=sign * abs(octave), step=step)
        meet_size(run, target, axis)
        return visited

    assert settings(1) == pytest.approx(settings(-1))
    assert all(step == 0 or (setting / step).is_integer() for setting in settings(1))
    best = min(settings(1), key=lambda s: abs(np.log(size(s) / target)))
    ends = size(-64), size(64)
    if ends[0] <= target <= ends[1]:
        met = abs(size(best) / target - 1) <= 0.02
        assert met or (step and abs(np.log2(size(best) / target)) * slope * abs(octave) <= step)


def search(size, target, **kwargs):
    """Return the size found and the number of runs, for a simulated coder of ``size(setting)`` bytes."""
    finest = kwargs.pop("finest", None)
    found = meet_size(lambda setting: Run(range(int(size(setting))), 0.0), target, Axis(**kwargs), finest=finest)
    return len(found.run.payload), found.runs


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
    found, runs = search(lambda q: 100 * 1.1**q, 1000 * 1.05, low=0, high=63, start=40, octave=6, step=1)
    assert found == int(100 * 1.1**25)  # 1083; 24 makes 985
    assert runs <= 6


def test_larger_settings_may_be_coarser():
    found, _ = search(lambda q: 1_000_000 / (1 + q), 20_000, low=0, high=1000, start=500, octave=-100)
    assert abs(found / 20_000 - 1) <= 0.02


@pytest.mark.parametrize(("target", "kept"), [(1, 100), (5e-324, 100), (1e9, 6400), (np.inf, 6400)])
def test_targets_beyond_the_range_take_its_ends(target, kept):
    found, runs = search(lambda db: 100 * 2 ** (db / 10), target, **DB)
    assert found == kept
    assert runs <= 6


def test_lossless_coding_is_tried_beyond_the_finest_setting():
    def best():
        return Run(range(9000), 0.0)

    def size(db):
        return 100 * 2 ** (db / 10)

    assert search(size, 1e6, **DB, finest=best)[0] == 9000
    assert search(size, 8500, **DB, finest=best)[0] == 9000
    assert search(size, 6600, **DB, finest=best)[0] == 6400
    assert search(size, 3200, **DB, finest=lambda: pytest.fail("not needed"))[0] == pytest.approx(3200, rel=0.02)


def test_a_coder_that_jumps_past_the_target_ends_the_search():
    found, runs = search(lambda db: 100 if db < 31.4 else 900, 500, **DB)
    assert found in (100, 900)
    assert runs <= Axis(**DB).runs


SCALED = [
    name for name in sorted(schemes()) if find(name).takes_rate and (find(name).qp_range or find(name).quality_range)
]


def middle_of_scale(scheme):
    """Return goals from coarse to fine around the middle of a scheme's scale."""
    coder = find(scheme)
    name, (low, high) = ("qp", coder.qp_range) if coder.qp_range else ("quality", coder.quality_range)
    step = 1 if isinstance(low, int) else (high - low) / 60
    goals = [{name: type(low)((low + high) // 2 + step * away)} for away in (-2, -1, 0, 1, 2)]
    return goals[::-1] if name == "qp" else goals


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCALED)
def test_a_target_rate_is_as_good_as_the_quantiser(scheme):
    """At equal or fewer bits no setting of the scale is better by more than 0.1 dB; targets between two settings."""
    picture = textured(16, 16, 2, 2) if scheme == "si-lf" else textured(32, 16, 4, 4)
    points = [encode(picture, quick(scheme), **goal) for goal in middle_of_scale(scheme)]
    curve = [(coded.bpp, psnr(picture, decode(coded))) for coded in points]
    for part in (0.3, 0.7):
        coded = encode(picture, quick(scheme), bpp=points[2].bpp ** (1 - part) * points[3].bpp ** part)
        best = max((quality for bpp, quality in curve if bpp <= coded.bpp), default=-np.inf)
        assert psnr(picture, decode(coded)) >= best - 0.1


def test_constant_bit_rate_stays_where_it_is_given():
    """`si-h264` meets a rate by the quantiser; its header says so. With ``rate=cbr`` it is constant bit rate."""
    picture = textured(32, 16, 4, 4)
    alone, given = (encode(picture, scheme, bpp=1.5) for scheme in ("si-h264", "si-h264:rate=cbr"))
    assert (alone.options["rate"], given.options["rate"]) == ("cq", "cbr")
    assert encode(picture, "si-h264", bpp=1.5, rate="cbr").payload == given.payload != alone.payload
    assert psnr(picture, decode(alone)) > psnr(picture, decode(given))
    assert encode(picture, "si-h264:fast", bpp=1.5).options["rate"] == "crf"
    assert encode(picture, "si-h264", qp=30).options == parse_scheme("si-h264")[1]


def test_two_sequences_with_one_more_intra_picture_are_dropped_where_they_are_worse():
    """With libaom and 16 frames one more I picture costs more than the next finer quantiser."""
    picture = textured(32, 16, 4, 4)
    coarse, fine = (encode(picture, "si-avif:fast", qp=qp) for qp in (31, 30))
    coded = encode(picture, "si-avif:fast", bpp=(coarse.bpp * fine.bpp) ** 0.5)
    assert coded.payload in (coarse.payload, fine.payload)
