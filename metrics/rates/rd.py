"""Rate–distortion points of schemes, and Bjøntegaard differences between curves."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ii_core import IIPicture, IIVideo
from ii_core.base import checks
from ii_core.base.executors import as_they_come, check_executor, lost
from ii_core.base.extras import load
from ii_core.base.identity import library_versions, source_hash
from ii_core.base.progress import reporter

from ..measures.global_angle import q_global
from ..measures.over_time import measure_take

PACKAGES = ("ii_core", "codec", "metrics")  # what a point depends on
RATES = (0.02, 0.05, 0.15, 0.4, 1.0)  # bpp, of studies whose schemes reach them all
# Lowest rate over the highest floor: rate control near a floor misses by up to a tenth. Highest over lowest rate.
ABOVE, SPAN = 1.1, 4.0
WORKERS = 2  # points at a time, if not given
MIN_POINTS = 4
# Share of the shorter curve's extent that both must cover: below it the mean is about a corner of the curves.
MIN_OVERLAP = 0.25
# The interpolation that its package's authors recommend as the closest to densely measured curves (Herglotz et
# al. 2022 and 2023); the cubic of VCEG-M33 swings between points far apart.
METHOD = "akima"


class UndefinedDifference(ValueError):
    """Two curves have no Bjøntegaard difference; ``short`` is the reason in a few words, for a table."""

    def __init__(self, message: str, short: str) -> None:
        super().__init__(message)
        self.short = short


Curve = tuple[NDArray[np.float64], NDArray[np.float64]]


@checks.checked(rates_a=checks.numbers, quality_a=checks.numbers, rates_b=checks.numbers, quality_b=checks.numbers)
def bd_rate(rates_a: ArrayLike, quality_a: ArrayLike, rates_b: ArrayLike, quality_b: ArrayLike) -> float:
    """Mean difference in rate at equal quality of curve b against curve a.

    The logarithm of the rate, interpolated over quality (Akima), is averaged over the qualities that both
    curves reach; nothing is extrapolated.

    Parameters
    ----------
    rates_a, quality_a : array_like, (n,)
        The anchor: rates in any unit, quality by any measure, at least four points in any order.
    rates_b, quality_b : array_like, (m,)
        The curve under test.

    Returns
    -------
    float
        Percent; negative where b needs less rate.

    Raises
    ------
    ValueError
        (Its subclass `UndefinedDifference` where the curves are sound but have no difference.)
        If a curve has fewer than four points, values that are not finite, rates that are not positive and
        different, quality that does not grow with rate, or the curves share less than a quarter of the shorter
        one's range of quality.

    References
    ----------
    Bjøntegaard, VCEG-M33, 2001.
    """
    a, b = _curve("a", rates_a, quality_a), _curve("b", rates_b, quality_b)
    for name, (rates, quality) in (("a", a), ("b", b)):
        falls = np.flatnonzero(np.diff(quality) <= 0)
        if falls.size:
            i = falls[0]
            raise UndefinedDifference(
                f"quality_{name} goes from {quality[i]:g} to {quality[i + 1]:g} between rates {rates[i]:g} and "
                f"{rates[i + 1]:g}: quality that grows with rate is needed",
                "quality falls",
            )
    _check_overlap("quality", a[1], b[1])
    bjontegaard = load("bjontegaard")
    # Its own notion of overlap, a share of the union, only warns; ours has been checked.
    return float(bjontegaard.bd_rate(*a, *b, method=METHOD, require_matching_points=False, min_overlap=0))


@checks.checked(rates_a=checks.numbers, quality_a=checks.numbers, rates_b=checks.numbers, quality_b=checks.numbers)
def bd_psnr(rates_a: ArrayLike, quality_a: ArrayLike, rates_b: ArrayLike, quality_b: ArrayLike) -> float:
    """Mean difference in quality at equal rate of curve b against curve a.

    Quality, interpolated over the logarithm of the rate (Akima), is averaged over the rates that both curves
    reach; nothing is extrapolated.

    Parameters
    ----------
    rates_a, quality_a, rates_b, quality_b : array_like
        As for `bd_rate`.

    Returns
    -------
    float
        In the quality's unit; positive where b is better.

    Raises
    ------
    ValueError
        As `bd_rate`, but quality may fall, and what must overlap are the rates, on their logarithmic scale.

    References
    ----------
    Bjøntegaard, VCEG-M33, 2001.
    """
    a, b = _curve("a", rates_a, quality_a), _curve("b", rates_b, quality_b)
    _check_overlap("rate", a[0], b[0], np.log10)
    bjontegaard = load("bjontegaard")
    return float(bjontegaard.bd_psnr(*a, *b, method=METHOD, require_matching_points=False, min_overlap=0))


def _curve(name: str, rates: ArrayLike, quality: ArrayLike) -> Curve:
    """A curve sorted by rate, or a ValueError."""
    r, q = np.asarray(rates, dtype=np.float64), np.asarray(quality, dtype=np.float64)
    if r.ndim != 1 or r.shape != q.shape:
        raise ValueError(f"rates_{name} are {r.shape}, quality_{name} {q.shape}: two rows of equal length are needed")
    if r.size < MIN_POINTS:
        raise UndefinedDifference(
            f"curve {name} has {r.size} points: at least {MIN_POINTS} are needed", f"{r.size} points"
        )
    for what, values in (("rates", r), ("quality", q)):
        if not np.isfinite(values).all():
            i = np.flatnonzero(~np.isfinite(values))[0]
            raise ValueError(f"{what}_{name}[{i}] is {values[i]}: finite values are needed")
    order = np.argsort(r)
    r, q = r[order], q[order]
    if not r[0] > 0:
        raise ValueError(f"rates_{name} hold {r[0]:g}: positive rates are needed")
    same = np.flatnonzero(np.diff(r) <= 0)
    if same.size:
        raise UndefinedDifference(
            f"rates_{name} hold {r[same[0]]:g} more than once: different rates are needed", "repeated rates"
        )
    return r, q


def _check_overlap(
    what: str,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    scale: Callable[[Any], Any] = lambda value: value,
) -> None:
    low, high = max(a.min(), b.min()), min(a.max(), b.max())
    shorter = min(scale(a.max()) - scale(a.min()), scale(b.max()) - scale(b.min()))
    share = max(0.0, scale(high) - scale(low)) / shorter if shorter > 0 else 0.0
    if share < MIN_OVERLAP:
        raise UndefinedDifference(
            f"{what} of curve a runs from {a.min():.4g} to {a.max():.4g}, of curve b from {b.min():.4g} to "
            f"{b.max():.4g}: they share {share:.0%} of the shorter, at least "
            f"{MIN_OVERLAP:.0%} are needed",
            f"{share:.0%} overlap",
        )


@checks.checked(
    picture=checks.instance(IIPicture, IIVideo),
    schemes=checks.list_of(str),
    rates=checks.numbers_in_a_row,
    encode=checks.callable_,
    decode=checks.callable_,
    workers=checks.whole,
    progress=checks.progress,
    measure=checks.callable_,
    known=checks.mapping,
    keep=checks.callable_,
)
def rate_distortion(
    picture: IIPicture | IIVideo,
    schemes: Sequence[str],
    rates: Sequence[float],
    *,
    encode: Callable[..., Any],
    decode: Callable[[Any], Any],
    progress: Callable[[int, int, str], None] | bool | None = None,
    workers: int | None = None,
    executor: Any = None,
    measure: Callable[..., Mapping[str, Any]] | None = None,
    known: Mapping[tuple[str, float], dict[str, Any]] | None = None,
    keep: Callable[[dict[str, Any]], None] | None = None,
) -> list[dict[str, Any]]:
    """Code a picture or a video by every scheme at every rate and measure what comes back.

    Parameters
    ----------
    picture : IIPicture or IIVideo
        Of a video, rates are per pixel of all frames, Q_global is of the squared errors of all frames, and ``encode``
        and ``decode`` are those of takes, as `codec.encode_take` and `codec.open_take`.
    schemes : sequence of str
        Scheme names, options after a colon: ``"si-h264:order=spiral,gop=32"``.
    rates : sequence of float
        Target rates, bits per pixel.
    encode : callable
        ``encode(picture, scheme, bpp=rate)`` gives an object with ``bpp``, ``nbytes``, ``encode_seconds`` and
        ``reached``: whether the scheme could meet the target.
    decode : callable
        ``decode(coded)`` gives the picture back, or an object with ``picture`` and ``seconds``, as
        `codec.timed_decode` does, and perhaps ``codes``, which ``measure`` then gets as a keyword, and
        ``more``, a mapping of further numbers to keep.
    progress : callable or bool, optional
        ``progress(done, total, text)`` after every point, in the calling thread; True prints a line.
    workers : int, optional
        Points measured at a time, in threads; 2 if not given. Everything but the seconds is the same for any number.
    executor : optional
        Any `concurrent.futures.Executor` or dask client, instead of ``workers``, as for `raytrace_ii.render`. To
        other processes the picture is sent once; ``encode``, ``decode`` and ``measure`` must be picklable, as
        `codec.encode`, `codec.timed_decode` and that of `measuring` are. Workers need the same code and libraries.
    measure : callable, optional
        ``measure(decoded)`` gives what else to keep of each point, as that of `measuring` does. Q_global always is.
    known : mapping, optional
        Records by scheme and target, as those of a `PointLog`: they are not measured again.
    keep : callable, optional
        ``keep(record)`` as soon as a point is measured, in the calling thread.

    Returns
    -------
    list of dict
        Scheme by scheme, rate by rate, as given: scheme, options, target_bpp, bpp, reached, q_global (dB),
        encode_seconds, decode_seconds, nbytes. Options are those of the scheme's name, its preset under ``preset``
        (``best+slow`` if the encoder's own is given, too). Seconds are CPU seconds: those that ``encode`` and
        ``decode`` state, else those of the calling thread within ``decode``. A target that a scheme cannot meet is a
        record with ``reached`` False and what the scheme gave instead.

    Raises
    ------
    ValueError
        If schemes or rates are empty, repeated or out of range. What a coder raises comes through, with a note that
        says which point it was; points not yet begun are dropped.
    """
    schemes, rates = list(schemes), [float(rate) for rate in rates]
    for what, given in (("schemes", schemes), ("rates", rates)):
        if not given or len(set(given)) != len(given):
            raise ValueError(f"{what} are {given}: at least one, each once, is needed")
    if bad := [rate for rate in rates if not 0 < rate < float("inf")]:
        raise ValueError(f"rates hold {bad[0]:g} bpp: positive rates are needed")
    check_executor(executor, workers)
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}: at least 1 is needed")

    points = [(scheme, rate) for scheme in schemes for rate in rates]
    records: list[dict[str, Any]] = [dict((known or {}).get(point, {})) for point in points]
    missing = [i for i, record in enumerate(records) if not record]
    report = reporter(progress, "study")
    work = _Point(picture, encode, decode, measure)
    threads = (WORKERS if workers is None else workers) if executor is None else None
    try:
        came = as_they_come(work, [points[i] for i in missing], identity=identity, workers=threads, executor=executor)
        with closing(came) as results:
            for done, (number, record) in enumerate(results, 1 + len(points) - len(missing)):
                records[missing[number]] = record
                if keep is not None:
                    keep(record)
                if report is not None:
                    report(done, len(points), _told(record))
    except Exception as error:
        if (reason := lost(error, executor)) is not None:
            raise OSError(f"{reason} while it measured: the study is not finished") from error
        raise
    return records


@checks.checked(picture=checks.instance(IIPicture), schemes=checks.list_of(str))
def default_rates(
    picture: IIPicture, schemes: Sequence[str], **options: Any
) -> tuple[list[float], dict[tuple[str, float], dict[str, Any]]]:
    """Return five rates for a study, none below what a scheme reaches, and the points measured to find them.

    Every scheme is coded at the lowest of `RATES`. If all reach it, the rates are `RATES`. Otherwise they are a
    geometric series that starts at the greatest of the rates that came instead.

    Parameters
    ----------
    picture, schemes
        As for `rate_distortion`.
    **options
        Those of `rate_distortion`.

    Returns
    -------
    rates : list of float
        Bits per pixel.
    points : dict
        As ``known`` of `rate_distortion`.

    Raises
    ------
    ValueError, OSError
        As `rate_distortion`.
    """
    lowest = RATES[0]
    tried = rate_distortion(picture, schemes, [lowest], **options)
    floor = max((r["bpp"] for r in tried if not r["reached"] and r["bpp"] > lowest), default=0.0)
    return rates_above(floor), {(record["scheme"], lowest): record for record in tried}


def rates_above(floor: float) -> list[float]:
    """Return `RATES`, or as many rates of two digits from above a floor on."""
    if floor <= RATES[0]:
        return list(RATES)
    first = _two_digits(ABOVE * floor, math.ceil)
    ratio = (max(RATES[-1], SPAN * first) / first) ** (1 / (len(RATES) - 1))
    return [first, *(_two_digits(first * ratio**i, round) for i in range(1, len(RATES)))]


def _two_digits(value: float, rounding: Callable[[float], int]) -> float:
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{rounding(value / unit) * unit:.6g}")


@lru_cache(maxsize=1)
def identity() -> dict[str, str]:
    """Return the hash of the code of this process, and the versions of the libraries that points depend on."""
    return {"code": source_hash(PACKAGES)[:12], **library_versions()}


@dataclass(frozen=True)
class _Point:
    """Coding of one picture at one point, and what comes of it; other processes can be sent it."""

    picture: IIPicture | IIVideo
    encode: Callable[..., Any]
    decode: Callable[[Any], Any]
    measure: Callable[..., Mapping[str, Any]] | None

    def __call__(self, scheme: str, rate: float) -> dict[str, Any]:
        return _measure(self.picture, scheme, rate, self.encode, self.decode, self.measure)


def _measure(
    picture: IIPicture | IIVideo,
    scheme: str,
    rate: float,
    encode: Callable[..., Any],
    decode: Callable[[Any], Any],
    measure: Callable[..., Mapping[str, Any]] | None,
) -> dict[str, Any]:
    try:
        coded = encode(picture, scheme, bpp=rate)
        start = time.thread_time()
        answer = decode(coded)
        spent = time.thread_time() - start
        decoded, seconds = getattr(answer, "picture", answer), getattr(answer, "seconds", spent)
        codes = getattr(answer, "codes", None)
        more = {} if measure is None else measure(decoded) if codes is None else measure(decoded, codes=codes)
        quality = {"q_global": _quality(picture, decoded), **more, **getattr(answer, "more", {})}
    except Exception as error:
        error.add_note(f"while measuring {scheme} at {rate:g} bpp")
        raise
    return {
        "scheme": scheme,
        "options": _options(scheme),
        "target_bpp": rate,
        "bpp": float(coded.bpp),
        "reached": bool(coded.reached),
        **quality,
        "encode_seconds": float(coded.encode_seconds),
        "decode_seconds": float(seconds),
        "nbytes": int(coded.nbytes),
    }


def _quality(original: IIPicture | IIVideo, decoded: Any) -> float:
    """Return the PSNR of all pixels, of a video those of all frames."""
    if isinstance(original, IIPicture):
        return q_global(original, decoded)
    if len(decoded) != len(original):
        raise ValueError(f"decoded has {len(decoded)} frames: {len(original)} are needed")
    return measure_take(original, decoded).pooled_psnr


def _options(scheme: str) -> dict[str, str]:
    """Return the options after the colon of a scheme's name; a preset, which has no key, gets the key ``preset``."""
    found: dict[str, str] = {}
    for item in scheme.partition(":")[2].split(","):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not equals:
            key, value = "preset", key
        if value:
            found[key] = f"{found[key]}+{value}" if key in found else value
    return found


def _told(record: dict[str, Any]) -> str:
    missed = "" if record["reached"] else f", target {record['target_bpp']:g} not reached"
    return f"{record['scheme']} {record['bpp']:.3g} bpp: {record['q_global']:.2f} dB{missed}"
