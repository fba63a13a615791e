"""Analysis of tests with observers: screening, opinion scores, scales from pairs, and how measures predict them."""

from __future__ import annotations

import math
import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core.base.checks import checked, number, number_from, numbers, numbers_in_a_row, one_of, whole_from

Floats = NDArray[np.float64]
MODELS = ("bradley-terry", "thurstone")
LOGISTIC, LINE = 4, 2  # parameters of the fits


class OpinionScores(NamedTuple):
    """Mean opinion scores of stimuli.

    Attributes
    ----------
    mean, half_width : ndarray, (stimuli,)
        MOS, and half of its confidence interval; NaN with a single score.
    given : ndarray of int, (stimuli,)
        Scores of each.
    """

    mean: Floats
    half_width: Floats
    given: NDArray[np.int64]


class PairScale(NamedTuple):
    """Quality of stimuli on a scale from comparisons of pairs.

    Attributes
    ----------
    scale : ndarray, (stimuli,)
        Of mean 0. Differences are log odds of winning (Bradley and Terry), or standard deviations of the difference
        of two stimuli (Thurstone, case V).
    half_width : ndarray, (stimuli,)
        Half of the confidence intervals.
    covariance : ndarray, (stimuli, stimuli)
        Of ``scale``, for intervals of differences.
    """

    scale: Floats
    half_width: Floats
    covariance: Floats


class Prediction(NamedTuple):
    """Accuracy of a measure as a predictor of opinion scores.

    Attributes
    ----------
    plcc, rmse, outlier_ratio : float
        After the monotone fit: Pearson's correlation, root mean square error over N − d degrees of freedom (N
        stimuli, d parameters of the fit), and the share of stimuli off by more than the half width of their interval
        (NaN without intervals).
    srocc : float
        Spearman's rank correlation, before the fit.
    fitted : ndarray, (stimuli,)
        Opinion scores as the measure predicts them.
    """

    plcc: float
    srocc: float
    rmse: float
    outlier_ratio: float
    fitted: Floats


@checked(scores=numbers, confidence=number)
def opinion_scores(scores: ArrayLike, *, confidence: float = 0.95) -> OpinionScores:
    """Mean opinion scores with confidence intervals by Student's t.

    Parameters
    ----------
    scores : array_like, (observers, stimuli)
        NaN where an observer gave none.
    confidence : float
        Between 0 and 1.

    Raises
    ------
    ValueError
        If there are no scores at all, a stimulus has none, or the confidence is out of range.
    """
    from scipy.stats import t

    table = _table(scores)
    if not 0 < confidence < 1:
        raise ValueError(f"confidence is {confidence:g}: a share between 0 and 1 is needed")
    count = np.isfinite(table).sum(axis=0)
    if not count.all():
        raise ValueError(f"stimulus {int(np.flatnonzero(count == 0)[0])} has no score: at least one is needed")
    several = count > 1
    spread = np.full(table.shape[1], np.nan)
    spread[several] = np.nanstd(table[:, several], axis=0, ddof=1) / np.sqrt(count[several])
    quantile = t.ppf((1 + confidence) / 2, np.maximum(count - 1, 1))
    return OpinionScores(np.nanmean(table, axis=0), quantile * spread, count)


@checked(scores=numbers)
def screened_observers(scores: ArrayLike) -> NDArray[np.bool_]:
    """Observers to leave out, by ITU-R BT.500-14, annex 1 to part 1.

    A score lies outside if it is two standard deviations from its stimulus's mean, or √20 where the scores are not
    normal, with a kurtosis outside [2, 4]. An observer is left out with more than 5 % of the scores outside that
    lie on both sides: |P − Q| < 0.3·(P + Q), P above and Q below.

    Parameters
    ----------
    scores : array_like, (observers, stimuli)
        NaN where an observer gave none.

    Returns
    -------
    ndarray of bool, (observers,)

    Raises
    ------
    ValueError
        If there are no scores at all.
    """
    table = _table(scores)
    count = np.maximum(np.isfinite(table).sum(axis=0), 1)
    off = table - np.nansum(table, axis=0) / count
    square = np.nansum(off**2, axis=0)
    spread = np.sqrt(square / np.maximum(count - 1, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        kurtosis = np.nansum(off**4, axis=0) / count / (square / count) ** 2
    reach = np.where((kurtosis >= 2) & (kurtosis <= 4), 2.0, math.sqrt(20)) * spread
    with np.errstate(invalid="ignore"):
        above, below = ((side * off >= reach) & (reach > 0) for side in (1, -1))
    p, q = above.sum(axis=1), below.sum(axis=1)
    given = np.maximum(np.isfinite(table).sum(axis=1), 1)
    return ((p + q) / given > 0.05) & (abs(p - q) < 0.3 * (p + q))


@checked(wins=numbers, model=one_of(*MODELS), confidence=number)
def pair_scale(wins: ArrayLike, *, model: str = "bradley-terry", confidence: float = 0.95) -> PairScale:
    """Scale of stimuli from comparisons of pairs, by maximum likelihood.

    Parameters
    ----------
    wins : array_like, (stimuli, stimuli)
        Times that the stimulus of the row was preferred to that of the column; a tie is half a win for each.
    model : {"bradley-terry", "thurstone"}
        Logistic or normal distribution of differences.
    confidence : float
        Of the intervals, which are those of the normal limit.

    Raises
    ------
    ValueError
        If the table is no square of counts, or some stimuli never lost to the others: their distance is infinite.

    References
    ----------
    Bradley and Terry 1952; Thurstone 1927; Ford 1957 on when the maximum exists.
    """
    table = np.array(wins, np.float64)
    if table.ndim != 2 or table.shape[0] != table.shape[1] or len(table) < 2:
        raise ValueError(f"wins are {table.shape}: a square table of at least two stimuli is needed")
    if not (np.isfinite(table).all() and (table >= 0).all()):
        raise ValueError("wins hold a number that is no count: finite counts, 0 or more, are needed")
    if not 0 < confidence < 1:
        raise ValueError(f"confidence is {confidence:g}: a share between 0 and 1 is needed")
    np.fill_diagonal(table, 0)
    _check_beaten(table)
    law = _law(model)
    scale = np.zeros(len(table))
    for _ in range(100):  # Newton's method on a concave likelihood
        gradient, information = _likelihood(table, scale, law)
        step = np.linalg.pinv(information) @ gradient
        scale += step * min(1.0, 1.0 / np.abs(step).max(initial=1e-300))
        if np.abs(step).max() < 1e-10:
            break
    _, information = _likelihood(table, scale, law)
    covariance = np.asarray(np.linalg.pinv(information), np.float64)
    width = _law("thurstone").ppf((1 + confidence) / 2) * np.sqrt(np.diag(covariance))
    return PairScale(scale - scale.mean(), width, covariance)


@checked(measure=numbers, mos=numbers, half_width=numbers)
def predicted_scores(measure: ArrayLike, mos: ArrayLike, half_width: ArrayLike | None = None) -> Prediction:
    """Return the accuracy of a measure as a predictor of opinion scores, after a monotone fit.

    The fit is the logistic function of four parameters of the Video Quality Experts Group; where it does not
    converge, a straight line. The root mean square error has N − d in its denominator, as ITU-T P.1401 has: d is 4
    for the logistic function and 2 for a straight line.

    Parameters
    ----------
    measure, mos : array_like, (stimuli,)
        Values of the measure and mean opinion scores.
    half_width : array_like, (stimuli,), optional
        Of the scores' confidence intervals.

    Raises
    ------
    ValueError
        If the lengths differ, fewer than five stimuli are given, or a value is not finite.

    References
    ----------
    ITU-T P.1401; VQEG 2003, final report of phase II.
    """
    from scipy.stats import spearmanr

    x, y = np.asarray(measure, np.float64), np.asarray(mos, np.float64)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError(f"measure has {x.shape} values, mos {y.shape}: one for each stimulus is needed")
    if len(x) < 5:
        raise ValueError(f"{len(x)} stimuli: at least 5 are needed for a fit of four parameters")
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("measure or mos holds a value that is not finite: leave the stimulus out")
    if np.ptp(x) == 0 or np.ptp(y) == 0:
        raise ValueError("measure or mos is the same for all stimuli: nothing can be correlated")
    if half_width is not None and np.shape(half_width) != x.shape:
        raise ValueError(f"half_width has {np.shape(half_width)} values, mos {y.shape}: one for each is needed")
    fitted, parameters = _monotone(x, y)
    off = np.abs(fitted - y)
    widths = np.full(len(x), np.nan) if half_width is None else np.asarray(half_width, np.float64)
    outside = float(np.mean(off > widths)) if half_width is not None else math.nan
    plcc = float(np.corrcoef(fitted, y)[0, 1]) if np.ptp(fitted) > 0 else 0.0
    rmse = float(np.sqrt(np.sum(off**2) / (len(x) - parameters)))
    return Prediction(plcc, float(spearmanr(x, y)[0]), rmse, outside, fitted)


@checked(
    quality=numbers_in_a_row,
    observers=whole_from(1, 1 << 20),
    bias=number_from(0, 1e9),
    spread=number_from(0, 1e9),
    seed=whole_from(0, 2**63 - 1),
)
def simulated_scores(
    quality: ArrayLike, observers: int, *, bias: float = 0.5, spread: float = 0.7, seed: int = 0
) -> Floats:
    """Scores of SIMULATED observers, (observers, stimuli): quality, a bias of each observer, and noise of each score.

    ``bias`` and ``spread`` are standard deviations. Nobody has seen anything: for tests of an analysis alone.
    """
    generator, true = np.random.default_rng(seed), np.asarray(quality, np.float64)
    own = generator.normal(0, bias, (observers, 1))
    return true + own + generator.normal(0, spread, (observers, len(true)))


@checked(
    scale=numbers_in_a_row, comparisons=whole_from(0, 1 << 31), model=one_of(*MODELS), seed=whole_from(0, 2**63 - 1)
)
def simulated_wins(
    scale: ArrayLike, comparisons: int, *, model: str = "bradley-terry", seed: int = 0
) -> NDArray[np.int64]:
    """Wins by SIMULATED observers, (stimuli, stimuli), of so many comparisons of each pair; see `pair_scale`."""
    generator, true = np.random.default_rng(seed), np.asarray(scale, np.float64)
    if not np.isfinite(true).all():
        raise ValueError("scale holds a number that is not finite: finite ones are needed")
    law = _law(model)
    wins = np.zeros((len(true), len(true)), np.int64)
    for i in range(len(true)):
        for j in range(i):
            wins[i, j] = generator.binomial(comparisons, law.cdf(true[i] - true[j]))
            wins[j, i] = comparisons - wins[i, j]
    return wins


def _table(scores: ArrayLike) -> Floats:
    table = np.asarray(scores, np.float64)
    if table.ndim != 2 or not np.isfinite(table).any():
        raise ValueError(f"scores are {table.shape}, with none given: a table of observers by stimuli is needed")
    return np.where(np.isfinite(table), table, np.nan)


def _law(model: str) -> Any:
    """Distribution of a difference of two stimuli."""
    from scipy.stats import logistic, norm

    return logistic if model == "bradley-terry" else norm


def _check_beaten(wins: Floats) -> None:
    """Raise unless a chain of wins leads from every stimulus to every other: else the scale is infinite."""
    from scipy.sparse.csgraph import connected_components

    groups, label = connected_components(wins > 0, connection="strong")
    if groups > 1:
        apart = np.flatnonzero(label == label[0])
        raise ValueError(
            f"stimuli {', '.join(map(str, apart))} and the rest were not each beaten by the other side: "
            "their distance is infinite or unknown, more comparisons are needed"
        )


def _likelihood(wins: Floats, scale: Floats, law: Any) -> tuple[Floats, Floats]:
    """Gradient and information (expected, by Fisher) of the log likelihood."""
    apart = scale[:, None] - scale
    chance, density = law.cdf(apart), law.pdf(apart)
    each = wins * density / np.maximum(chance, 1e-300)
    gradient = each.sum(axis=1) - each.sum(axis=0)
    weight = (wins + wins.T) * density**2 / np.maximum(chance * (1 - chance), 1e-300)
    np.fill_diagonal(weight, 0)
    return gradient, np.diag(weight.sum(axis=1)) - weight


def _monotone(x: Floats, y: Floats) -> tuple[Floats, int]:
    """Return the logistic fit of y over x, or a straight line, and its number of parameters."""
    from scipy.optimize import OptimizeWarning, curve_fit

    unit = (x - x.mean()) / x.std()

    def curve(t: Floats, low: float, high: float, middle: float, slope: float) -> Floats:
        return low + (high - low) / (1 + np.exp(-np.clip((t - middle) * slope, -500, 500)))

    sign = 1.0 if np.corrcoef(unit, y)[0, 1] >= 0 else -1.0
    straight = np.polyval(np.polyfit(unit, y, 1), unit)
    try:
        with warnings.catch_warnings():  # a perfect fit has no covariance, which nobody reads
            warnings.simplefilter("ignore", OptimizeWarning)
            found, _ = curve_fit(curve, unit, y, (y.min(), y.max(), 0.0, 2 * sign), maxfev=5000)
    except RuntimeError:
        return straight, LINE
    fitted = curve(unit, *found)
    return (fitted, LOGISTIC) if np.square(fitted - y).sum() <= np.square(straight - y).sum() else (straight, LINE)
