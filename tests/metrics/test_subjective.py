"""Analysis of observers' scores: closed forms, worked cases, and simulated observers whose truth is known."""

import math

import numpy as np
import pytest
from scipy import stats

from metrics.observers.subjective import (
    opinion_scores,
    pair_scale,
    predicted_scores,
    screened_observers,
    simulated_scores,
    simulated_wins,
)


def test_mean_and_interval_by_hand():
    """Scores 3, 4, 5: mean 4, s = 1, t with two degrees of freedom 4.3027."""
    got = opinion_scores([[3.0, 1.0], [4.0, np.nan], [5.0, np.nan]])
    assert got.mean.tolist() == [4.0, 1.0] and got.given.tolist() == [3, 1]
    assert got.half_width[0] == pytest.approx(4.302653 / math.sqrt(3)) and np.isnan(got.half_width[1])


def test_intervals_of_simulated_observers_hold_the_truth():
    """In 95 of 100 runs for each of 5 stimuli: 500 intervals, whose share has a standard error of 1 %."""
    quality = np.array([1.5, 2.0, 3.0, 4.0, 4.5])
    held = []
    for seed in range(100):
        got = opinion_scores(simulated_scores(quality, 15, seed=seed))
        held.append(np.abs(got.mean - quality) <= got.half_width)
    assert np.mean(held) == pytest.approx(0.95, abs=0.03)


def test_screening_by_hand():
    """Of 24 observers one is far off on both sides, on a quarter of 40 stimuli; another on one side alone."""
    rng = np.random.default_rng(1)
    scores = 3 + 0.3 * np.clip(rng.standard_normal((24, 40)), -1.5, 1.5)
    # scores that are not normal: √20 = 4.47 standard deviations count, and one of 24 scores reaches 23/√24 = 4.69
    scores[3, ::8] += 30
    scores[3, 4::8] -= 30
    scores[5, 1::4] += 30  # a bias, which the rule forgives
    out = screened_observers(scores)
    assert out[3] and not out[5] and out.sum() == 1
    # by the definition, stimulus by stimulus
    spread = scores.std(axis=0, ddof=1)
    kurtosis = stats.kurtosis(scores, fisher=False)
    reach = np.where((kurtosis >= 2) & (kurtosis <= 4), 2, math.sqrt(20))
    above = (scores - scores.mean(axis=0) >= reach * spread).sum(axis=1)
    below = (scores - scores.mean(axis=0) <= -reach * spread).sum(axis=1)
    wanted = ((above + below) / 40 > 0.05) & (abs(above - below) < 0.3 * (above + below))
    np.testing.assert_array_equal(out, wanted)


def test_screening_by_scores_that_are_all_alike():
    """Without a spread nobody is outside, though every score is 0 or more spreads from the mean."""
    scores = np.full((6, 10), 3.0)
    assert not screened_observers(scores).any()
    scores[:, :4] = simulated_scores([2.0, 3.0, 3.5, 4.0], 6, seed=1)
    assert not screened_observers(scores).any()


def test_observers_who_stopped_half_way_count_by_what_they_gave():
    scores = simulated_scores(np.linspace(1, 5, 10), 12, seed=2)
    scores[4, 5:] = np.nan
    got = opinion_scores(scores)
    assert got.given.tolist() == [12] * 5 + [11] * 5
    assert not screened_observers(scores)[4]
    np.testing.assert_array_equal(got.mean[:5], opinion_scores(scores[:, :5]).mean)


def test_two_stimuli_have_a_closed_form():
    """Log odds of 30 to 10, of variance 1/30 + 1/10; by the normal law the quantile of 3/4."""
    got = pair_scale([[0, 30], [10, 0]])
    assert got.scale[0] - got.scale[1] == pytest.approx(math.log(3))
    difference = got.covariance[0, 0] + got.covariance[1, 1] - 2 * got.covariance[0, 1]
    assert difference == pytest.approx(1 / 30 + 1 / 10)
    thurstone = pair_scale([[0, 30], [10, 0]], model="thurstone")
    assert thurstone.scale[0] - thurstone.scale[1] == pytest.approx(stats.norm.ppf(0.75))


def test_the_scale_is_the_fixed_point_of_hunters_algorithm():
    """Hunter 2004, (3), an independent way to the same maximum."""
    wins = simulated_wins([0.0, 0.5, 1.0, 1.8], 30, seed=3).astype(float)
    strength = np.ones(4)
    both = wins + wins.T
    for _ in range(3000):
        strength = wins.sum(axis=1) / (both / (strength[:, None] + strength)).sum(axis=1)
    log = np.log(strength)
    np.testing.assert_allclose(pair_scale(wins).scale, log - log.mean(), atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["bradley-terry", "thurstone"])
def test_simulated_pairs_give_back_the_scale_that_went_in(model):
    """In 95 of 100 runs for each of 6 stimuli: 600 intervals, of standard error 0.9 % if they were independent."""
    true = np.array([-1.0, -0.5, -0.2, 0.2, 0.5, 1.0])
    held = []
    for seed in range(100):
        got = pair_scale(simulated_wins(true, 40, model=model, seed=seed), model=model)
        held.append(np.abs(got.scale - true) <= got.half_width)
    assert np.mean(held) == pytest.approx(0.95, abs=0.03)


def test_a_measure_that_is_a_monotone_function_of_opinion_predicts_it():
    mos = np.linspace(1.2, 4.8, 25)
    measure = 30 + 3 * np.log((mos - 1) / (5 - mos))  # a logistic curve the other way round
    got = predicted_scores(measure, mos, np.full(25, 0.2))
    assert got.plcc == pytest.approx(1) and got.srocc == pytest.approx(1)
    assert got.rmse < 1e-3 and got.outlier_ratio == 0
    lower = predicted_scores(-measure, mos)
    assert lower.plcc == pytest.approx(1) and lower.srocc == pytest.approx(-1) and math.isnan(lower.outlier_ratio)


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 25])
def test_the_error_has_the_degrees_of_freedom_of_the_fit(count):
    """ITU-T P.1401: N − 4 for the logistic function; of noise of known spread, the error is that spread."""
    rng = np.random.default_rng(1)
    measure = np.linspace(-2, 2, count)
    truth = 1.5 + 3 / (1 + np.exp(-2 * measure))
    found = [predicted_scores(measure, truth + rng.normal(0, 0.1, count)) for _ in range(200)]
    assert np.sqrt(np.mean([one.rmse**2 for one in found])) == pytest.approx(0.1, rel=0.07)


def test_a_measure_without_relation_predicts_nothing():
    rng = np.random.default_rng(5)
    got = predicted_scores(rng.random(200), rng.random(200))
    assert abs(got.plcc) < 0.25 and abs(got.srocc) < 0.25


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: opinion_scores(np.full((3, 2), np.nan)), "with none given"),
        (lambda: opinion_scores([[1.0, np.nan], [2.0, np.nan]]), "stimulus 1 has no score"),
        (lambda: opinion_scores([[1.0], [2.0]], confidence=1.0), "confidence is 1"),
        (lambda: screened_observers([1.0, 2.0]), "observers by stimuli"),
        (lambda: pair_scale([[0, 5], [0, 0]]), "infinite or unknown"),
        (lambda: pair_scale([[0, 5, 0], [2, 0, 0], [0, 0, 0]]), "infinite or unknown"),
        (lambda: pair_scale([[0, -1], [1, 0]]), "no count"),
        (lambda: pair_scale([[0, 1, 2], [1, 0, 2]]), "square table"),
        (lambda: pair_scale([[0, 1], [1, 0]], model="elo"), "bradley-terry"),
        (lambda: predicted_scores([1, 2, 3, 4], [1, 2, 3, 4]), "at least 5"),
        (lambda: predicted_scores(np.arange(5.0), np.ones(5)), "the same for all"),
        (lambda: predicted_scores(np.arange(6.0), np.arange(5.0)), "one for each"),
    ],
)
def test_invalid_scores_are_refused(call, said):
    with pytest.raises(ValueError, match=said):
        call()
