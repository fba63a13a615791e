"""Differences to an anchor, rates that all schemes reach, and points on any executor."""

import json
import math
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context
from types import SimpleNamespace

import numpy as np
import pytest

from codec import encode, timed_decode
from ii_core import IIPicture
from metrics import (
    Measure,
    bd_psnr,
    bd_rate,
    default_rates,
    differences,
    mean_differences,
    measuring,
    rate_distortion,
    read_study,
    write_study,
)
from metrics.rates.rd import RATES, rates_above

PICTURE = IIPicture(np.random.default_rng(1).integers(90, 120, (32, 64, 3), np.uint8), (8, 4), (8, 8))
RATES_TRIED = [0.5, 1.0, 2.0, 4.0]


def point(scheme, rate, quality, *, reached=True):
    more = {"encode_seconds": 1.0, "decode_seconds": 1.0, "nbytes": 9, "options": {}}
    return {"scheme": scheme, "target_bpp": rate, "bpp": rate, "reached": reached, "q_global": quality, **more}


def curve(scheme, offset, rates=RATES_TRIED):
    return [point(scheme, rate, 30 + 6 * math.log2(rate) + offset) for rate in rates]


def test_a_study_file_holds_gain_and_bjontegaard_differences(tmp_path):
    """On b1dc540 only the table had them, against JPEG 2000, whose qualities do not overlap the others."""
    records = curve("a", 0) + curve("b", 3) + curve("far", 100)
    write_study(tmp_path / "s.json", "x", records, picture=PICTURE)
    study = read_study(tmp_path / "s.json")
    assert study["anchor"] == "a"
    found = json.loads((tmp_path / "s.json").read_text())["differences"]["q_global"]
    assert found == differences(study) and set(found) == {"b", "far"}
    # Closed form: 6 dB an octave, so that 3 dB are half an octave of rate.
    assert found["b"]["gain"] == pytest.approx(3) and found["b"]["bd_quality"] == pytest.approx(3)
    assert found["b"]["bd_rate_percent"] == pytest.approx(100 * (2**-0.5 - 1)) and found["b"]["rates"] == 4
    assert found["far"]["bd_rate_percent"] is None and found["far"]["why"] == {"bd_rate_percent": "0% overlap"}
    assert differences(study, anchor="b")["a"]["gain"] == pytest.approx(-3)
    write_study(tmp_path / "t.json", "x", records, picture=PICTURE, anchor="b")
    assert set(differences(read_study(tmp_path / "t.json"))) == {"a", "far"}


def test_where_lower_is_better_rates_compare_alike():
    """A curve of errors that falls with rate has the same BD-rate as its negative."""
    kind = Measure(name="e", compute=None, text="", higher_is_better=False)
    errors = {name: [(r, 40 - 6 * math.log2(r) - up) for r in RATES_TRIED] for name, up in (("a", 0), ("b", 3))}
    from metrics.rates.against_anchor import _growing

    a, b = (_growing(points, kind) for points in errors.values())
    assert bd_rate(*zip(*a, strict=True), *zip(*b, strict=True)) == pytest.approx(100 * (2**-0.5 - 1))
    assert bd_psnr(*zip(*a, strict=True), *zip(*b, strict=True)) == pytest.approx(3)


def test_means_over_pictures_count_those_that_have_a_value():
    one = {"picture": {"name": "one"}, "points": curve("a", 0) + curve("b", 3)}
    two = {"picture": {"name": "two"}, "points": curve("a", 0) + curve("b", 50)}
    found = mean_differences([one, two])["b"]
    assert found["gain"] == pytest.approx((3 + 50) / 2) and found["pictures"]["gain"] == 2
    assert (
        found["bd_rate_percent"] == pytest.approx(100 * (2**-0.5 - 1)) and found["pictures"]["bd_rate_percent"] == 1
    )
    assert found["each"]["two"]["why"] == {"bd_rate_percent": "0% overlap"}


@pytest.mark.parametrize("floor", [0.0, 0.02, 0.021, 0.34, 0.999, 1.7, 30.0])
def test_rates_begin_above_the_floor_and_grow(floor):
    rates = rates_above(floor)
    assert len(rates) == 5 and rates == sorted(set(rates)) and rates[0] > 0 and rates[-1] >= 1
    assert rates == list(RATES) if floor <= 0.02 else floor * 1.1 <= rates[0] <= 1.2 * floor
    assert all(rate == float(f"{rate:.2g}") for rate in rates)


def test_rates_that_are_found_are_reached_by_all():
    """On b1dc540 the lowest default rates were below the floors of most schemes."""

    def coded(picture, scheme, *, bpp):
        rate = max(bpp, {"low": 0.001, "high": 0.33}[scheme])
        return SimpleNamespace(bpp=rate, nbytes=1, encode_seconds=0.0, reached=rate == bpp)

    means = {"encode": coded, "decode": lambda coded: PICTURE}
    assert default_rates(PICTURE, ["low"], **means)[0] == list(RATES)
    kept = []
    rates, known = default_rates(PICTURE, ["low", "high"], keep=kept.append, **means)
    assert all(r["reached"] for r in rate_distortion(PICTURE, ["low", "high"], rates, **means))
    assert len(kept) == 2 and known["high", 0.02]["bpp"] == 0.33


def timeless(records):
    return [{**record, "encode_seconds": 0, "decode_seconds": 0} for record in records]


def study_of(**where):
    means = {"encode": encode, "decode": timed_decode, "measure": measuring(PICTURE, ["q_angle_mean"])}
    return timeless(rate_distortion(PICTURE, ["jpeg2000", "jpegxl"], [1.0, 2.0], **means, **where))


@pytest.mark.parametrize(
    "executor",
    [
        ThreadPoolExecutor,
        pytest.param(partial(ProcessPoolExecutor, mp_context=get_context("forkserver")), marks=pytest.mark.slow),
    ],
    ids=["threads", "processes"],
)
def test_points_are_the_same_on_every_executor(executor, monkeypatch):
    with executor(2) as pool:
        submit, points = pool.submit, []
        monkeypatch.setattr(pool, "submit", lambda *call, **more: points.append(call) or submit(*call, **more))
        assert study_of(executor=pool) == study_of(workers=1) and len(points) == 4
    with pytest.raises(ValueError, match="workers is 2: an executor has its own"):
        study_of(executor=pool, workers=2)


def test_points_of_a_cluster():
    distributed = pytest.importorskip("distributed")
    local = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(**local, silence_logs=50) as cluster, distributed.Client(cluster) as client:
        assert study_of(executor=client) == study_of(workers=1)


def test_points_that_are_done_are_kept_when_a_later_one_fails():
    """Points are stored in the order of completion, since an earlier point may take very long."""

    def failing(picture, scheme, *, bpp):
        if bpp == 1.0:
            while not kept:
                pass
            raise RuntimeError("no more")
        return encode(picture, scheme, bpp=bpp)

    kept = []
    with pytest.raises(RuntimeError, match="no more"):
        rate_distortion(
            PICTURE, ["jpeg2000"], [1.0, 2.0], encode=failing, decode=timed_decode, keep=kept.append, workers=2
        )
    assert [record["target_bpp"] for record in kept] == [2.0]
