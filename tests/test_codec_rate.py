import pytest

from codec.rate import Run, nearest, nearest_quantiser, nearest_rate, nearest_share, straddling


class Fake:
    """An encoder whose size is a function of what it is asked for."""

    def __init__(self, size_of, coarsest=1, finest=10**6):
        self.size_of, self.limits, self.asked = size_of, (coarsest, finest), []

    def search(self, target):
        def run(size):
            return Run(bytes(round(size)), 0.0)

        def at(ask):
            self.asked.append(ask)
            return run(self.size_of(ask))

        found, runs = nearest_rate(
            at, target, coarsest=lambda: run(self.limits[0]), finest=lambda: run(self.limits[1])
        )
        return len(found.payload), runs


def test_an_obedient_coder_runs_once():
    assert Fake(lambda ask: ask).search(1000) == (1000, 1)


@pytest.mark.parametrize("error", [0.85, 0.97, 1.03, 1.2])
def test_a_proportional_miss_is_corrected_once(error):
    size, runs = Fake(lambda ask: error * ask).search(10_000)
    assert abs(size - 10_000) <= 200
    assert runs == 2


@pytest.mark.parametrize("power", [0.6, 1.6])
def test_a_crooked_coder_is_met_within_the_reruns(power):
    size, runs = Fake(lambda ask: 1.15 * 10_000 * (ask / 10_000) ** power).search(10_000)
    assert abs(size - 10_000) <= 200
    assert runs <= 4


def test_a_floor_is_settled_by_one_run_at_it():
    coder = Fake(lambda ask: max(ask, 5000), coarsest=4900)
    assert coder.search(1000) == (4900, 2)


def test_a_ceiling_close_by_is_noticed_when_asking_more_gives_no_more():
    coder = Fake(lambda ask: min(ask, 900), finest=905)
    assert coder.search(1000) == (905, 3)


def test_a_coder_that_goes_below_its_coarsest_quantiser_is_followed():
    size, runs = Fake(lambda ask: 1.4 * ask, coarsest=5000).search(1000)
    assert abs(size - 1000) <= 20
    assert runs == 3


def test_a_limit_beyond_the_target_does_not_end_the_search():
    size, _ = Fake(lambda ask: 1.5 * ask, coarsest=10).search(10_000)
    assert abs(size - 10_000) <= 200


def test_a_coder_that_never_obeys_is_left_alone_in_time():
    sizes = iter([1100, 950, 1060, 930, 0, 0])
    size, runs = Fake(lambda ask: next(sizes)).search(1000)
    assert size == 950
    assert runs <= 6


def search(size_of, target, *, step=0.05, octave=6.0):
    return nearest_quantiser(
        lambda q: Run(bytes(round(size_of(q))), 0.0), target, low=0, high=51, step=step, octave=octave
    )


@pytest.mark.parametrize("octave", [3.0, 6.0, 14.0])
@pytest.mark.parametrize("target", [400, 10_000, 150_000])
def test_a_quantiser_is_found_whatever_the_slope(octave, target):
    runs = search(lambda q: 1e4 * 2 ** ((30 - q) / octave), target)
    if 1e4 * 2 ** (-21 / octave) <= target <= 1e4 * 2 ** (30 / octave):
        assert len(nearest(runs.values(), target).payload) == pytest.approx(target, rel=0.02)
    assert len(runs) <= 5


def test_a_target_beyond_the_range_takes_the_end_of_it():
    runs = search(lambda q: 1000 * 2 ** ((30 - q) / 6), 1)
    assert min(runs, key=lambda q: len(runs[q].payload)) == 51
    assert len(runs) == 2


def test_steps_are_bridged_by_a_share():
    """The size jumps by a tenth where the quantiser of B pictures is rounded."""
    runs = search(lambda q: 1e4 * 1.1 ** -round(q - 30), 10_500)
    fine, coarse = straddling(runs, 10_500)
    more = nearest_share(
        lambda share: Run(bytes(round(1e4 + 1e3 * share**1.5)), 0.0), 10_500, none=runs[coarse], all_=runs[fine]
    )
    assert len(more[-1].payload) == pytest.approx(10_500, rel=0.02)
    assert len(more) <= 4


def test_no_pair_lies_around_what_is_beyond_all():
    assert straddling({20: Run(bytes(100), 0.0), 30: Run(bytes(50), 0.0)}, 200) is None
