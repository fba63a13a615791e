"""Rate–distortion points, Bjøntegaard differences, tables and charts."""

import csv
import json
import math
import re
import subprocess
import threading
import time
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ii_core import IIPicture
from ii_core.base.identity import LIBRARIES, library_versions
from metrics import (
    bd_psnr,
    bd_rate,
    provenance,
    q_global,
    rate_distortion,
    rd_chart,
    read_study,
    summary_table,
    write_csv,
)
from metrics import write_study as _write_study
from metrics.plots.rd_chart import draw
from metrics.rates import rd

RATES = np.array([0.02, 0.05, 0.1, 0.35, 1.0])


def curve(rates):
    x = np.log10(rates)
    return 35 + 9 * x - 1.2 * x**2


# The interpolant of a shifted curve is the shifted interpolant: both closed forms hold to rounding of logarithms.
def test_one_db_better_everywhere():
    assert bd_psnr(RATES, curve(RATES), RATES, curve(RATES) + 1) == pytest.approx(1, abs=1e-12)
    assert bd_psnr(RATES, curve(RATES), RATES, curve(RATES) - 2) == pytest.approx(-2, abs=1e-12)


def test_half_the_rate_everywhere():
    assert bd_rate(RATES, curve(RATES), RATES / 2, curve(RATES)) == pytest.approx(-50, abs=1e-10)
    assert bd_rate(RATES, curve(RATES), RATES * 3, curve(RATES)) == pytest.approx(200, abs=1e-10)


def test_equal_curves_in_any_order_and_length():
    assert bd_rate(RATES[::-1], curve(RATES)[::-1], RATES, curve(RATES)) == 0
    shuffled = np.array([2, 0, 4, 1, 3])
    assert bd_psnr(RATES[shuffled], curve(RATES)[shuffled], RATES, curve(RATES)) == 0
    # Straight over log rate: every interpolation of it is the line itself, whatever the points.
    other = np.array([0.03, 0.08, 0.2, 0.4])
    line = lambda r: 30 + 10 * np.log10(r)  # noqa: E731
    assert bd_psnr(RATES, line(RATES), other, line(other) + 0.5) == pytest.approx(0.5, abs=1e-12)
    assert bd_rate(RATES, line(RATES), other, line(other) + 10) == pytest.approx(-90, abs=1e-10)


def test_partial_overlap_is_averaged_over_the_overlap_only():
    # 5 dB of 15 shared in quality; b needs a tenth of the rate there, and extrapolation would not change the line.
    a, b = np.geomspace(0.01, 0.1, 4), np.geomspace(0.01, 0.1, 4)
    assert bd_rate(a, 30 + 15 * np.log10(a), b, 40 + 15 * np.log10(b)) == pytest.approx(
        100 * (10 ** (-10 / 15) - 1), abs=1e-10
    )


def test_little_overlap_is_refused_with_both_intervals():
    a = np.geomspace(0.01, 0.1, 4)
    with pytest.raises(ValueError, match=r"quality of curve a runs from 10 to 20, of curve b from 18 to 28: .*20%"):
        bd_rate(a, 30 + 10 * np.log10(a), a, 38 + 10 * np.log10(a))
    with pytest.raises(ValueError, match=r"rate of curve a runs from 0.01 to 0.1, of curve b from 0.2 to 2: .* 0%"):
        bd_psnr(a, curve(a), a * 20, curve(a))
    bd_psnr(a, curve(a), a * 10**0.7499, curve(a))
    with pytest.raises(ValueError, match="25%"):
        bd_psnr(a, curve(a), a * 10**0.76, curve(a))


def test_a_quarter_of_overlap_is_enough():
    """Whole numbers, so that the share is 1/4 to the bit: one of four dB, one of four decades."""
    line = np.array([0.0, 1.0, 2.0, 4.0])
    assert bd_rate(10**line, line, 10**line, line + 3) == pytest.approx(-99.9)
    decades = 10.0 ** np.array([0, 1, 2, 4])
    assert np.log10(decades * 1000).tolist() == [3, 4, 5, 7]
    assert bd_psnr(decades, line, decades * 1000, line) == pytest.approx(-3)
    for less in (3.001, 3.5):
        with pytest.raises(rd.UndefinedDifference, match="of the shorter, at least 25% are needed"):
            bd_rate(10**line, line, 10**line, line + less)


def test_a_short_curve_within_a_long_one_is_whole_overlap():
    """The share is of the shorter curve: a tenth of the long one here."""
    short, long = np.linspace(4.5, 5.5, 4), np.linspace(0.0, 10.0, 5)
    assert bd_rate(10**long, long, 2 * 10**short, short) == pytest.approx(100)
    assert bd_psnr(10**long, long, 10**short, short + 1) == pytest.approx(1)


@pytest.mark.parametrize(
    ("rates", "quality", "message"),
    [
        ([1, 2, 3], [1, 2, 3], "curve b has 3 points: at least 4"),
        ([1, 2, 3, 4], [1, 2, 3], r"rates_b are \(4,\), quality_b \(3,\)"),
        ([1, 2, 3, math.nan], [1, 2, 3, 4], r"rates_b\[3\] is nan"),
        ([1, 2, 3, 4], [1, 2, 3, math.inf], r"quality_b\[3\] is inf"),
        ([0, 2, 3, 4], [1, 2, 3, 4], "rates_b hold 0"),
        ([1, 2, 2, 4], [1, 2, 3, 4], "rates_b hold 2 more than once"),
    ],
)
@pytest.mark.parametrize("function", [bd_rate, bd_psnr])
def test_invalid_curves_are_refused(function, rates, quality, message):
    with pytest.raises(ValueError, match=message):
        function([1, 2, 3, 4], [1, 2, 3, 4], rates, quality)


def test_falling_quality_has_no_bd_rate_but_a_bd_psnr():
    with pytest.raises(ValueError, match=r"quality_b goes from 3 to 2\.5 between rates 3 and 4"):
        bd_rate([1, 2, 3, 4], [1, 2, 3, 4], [1, 2, 3, 4], [1, 2, 3, 2.5])
    with pytest.raises(rd.UndefinedDifference, match="quality_a goes from 2 to 2 between rates 2 and 3") as level:
        bd_rate([1, 2, 3, 4], [1, 2, 2, 4], [1, 2, 3, 4], [1, 2, 3, 4])  # rate over quality has no value at 2
    assert level.value.short == "quality falls"
    assert math.isfinite(bd_psnr([1, 2, 3, 4], [1, 2, 3, 4], [1, 2, 3, 4], [1, 2, 3, 2.5]))


# A coder of our own: keeps as many bits of each value as the rate allows; "coarse" cannot keep less than 3.
def picture(seed=0):
    pixels = np.random.default_rng(seed).integers(0, 256, (12, 20, 3), dtype=np.uint8)
    return IIPicture(pixels, (5, 4), (4, 3))


def encode(source, scheme, *, bpp):
    floor = 3 if scheme.startswith("coarse") else 1
    bits = max(floor, min(8, int(bpp / 3)))
    time.sleep(0.002 * bits)  # later points finish earlier, too
    step = 2 ** (8 - bits)
    coded = source.pixels // step * step + step // 2
    real = 3 * bits
    nbytes = 12 * 20 * real // 8
    return SimpleNamespace(
        bpp=real,
        nbytes=nbytes,
        encode_seconds=0.5,
        target_bpp=bpp,
        reached=real <= bpp,
        scheme=scheme,
        picture=source.with_pixels(coded.astype(np.uint8)),
    )


def decode(coded):
    return coded.picture


SCHEMES, TARGETS = ["fine", "coarse:order=spiral,gop=32"], [18, 3, 6, 9, 24]


def measure(**options):
    return rate_distortion(picture(), SCHEMES, TARGETS, encode=encode, decode=decode, **options)


def test_records_hold_every_point_in_the_given_order():
    told = []
    records = measure(progress=lambda *args: told.append(args))
    assert [(r["scheme"], r["target_bpp"]) for r in records] == [(s, t) for s in SCHEMES for t in TARGETS]
    assert records[0]["options"] == {} and records[5]["options"] == {"order": "spiral", "gop": "32"}
    for record in records:
        coded = encode(picture(), record["scheme"], bpp=record["target_bpp"])
        assert record["q_global"] == q_global(picture(), coded.picture)
        assert (record["bpp"], record["nbytes"], record["reached"]) == (coded.bpp, coded.nbytes, coded.reached)
        assert record["encode_seconds"] == 0.5 and record["decode_seconds"] >= 0
    assert [r["reached"] for r in records[5:]] == [True, False, False, True, True]
    assert records[6]["bpp"] == records[7]["bpp"] == 9
    assert records[4]["q_global"] == math.inf
    assert [(done, total) for done, total, _ in told] == [(i + 1, 10) for i in range(10)]
    assert any("coarse:order=spiral,gop=32 9 bpp" in text and "target 3 not reached" in text for *_, text in told)


@pytest.mark.slow
def test_seconds_to_decode_are_cpu_time_of_the_decoder_alone():
    """Neither waiting in the decoder nor measuring counts; on b1dc540 waiting did."""

    def slow(coded):
        time.sleep(0.2)
        return coded.picture

    def work(decoded):
        until = time.thread_time() + 0.2
        while time.thread_time() < until:
            pass
        return {}

    def once(decode):
        (record,) = rate_distortion(picture(), ["fine"], [9], encode=encode, decode=decode, measure=work)
        return record

    assert once(slow)["decode_seconds"] < 0.1
    stated = once(lambda coded: SimpleNamespace(picture=coded.picture, seconds=7.0))
    assert stated["decode_seconds"] == 7.0 and stated["q_global"] == once(slow)["q_global"]


def test_options_of_a_name_keep_its_preset():
    assert rd._options("si-hevc:best,gop=32") == {"preset": "best", "gop": "32"}
    assert rd._options("si-hevc:best, preset=slow") == {"preset": "best+slow"}
    assert rd._options("si-hevc") == rd._options("si-hevc:") == {}


def test_versions_are_those_of_all_that_results_depend_on():
    """On b1dc540 an upgrade of embreex or imagecodecs repeated no step; glymur is not used.

    Results of anchors alone depend on their extra; they hold its versions beside the command.
    """
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    files = {"all", "anchors", "arrays", "browser", "dev", "docs", "notebooks"}  # h5py reads and writes to the bit
    optional = [line for extra in set(extras) - files for line in extras[extra]]
    needed = {re.match(r"[\w-]+", line)[0] for line in [*project["dependencies"], *optional]}
    assert set(LIBRARIES) == needed - {"matplotlib", "pydantic", "typer", "rich", "dask"}
    assert set(LIBRARIES) <= set(library_versions()) and "python" in provenance()["versions"]


def test_the_commit_is_that_of_the_start_though_the_checkout_moves_on(monkeypatch):
    """Earlier, a long study recorded the commit at its end, after the checkout had changed."""
    before = provenance()["git"]
    moved = subprocess.CompletedProcess([], 0, stdout="f" * 40)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: moved)
    assert provenance()["git"] == before


def test_same_records_whatever_the_workers():
    timeless = [[{**r, "decode_seconds": 0} for r in measure(workers=n)] for n in (1, 2, 5)]
    assert timeless[0] == timeless[1] == timeless[2]


def test_no_more_points_at_a_time_than_workers():
    now, most, lock = 0, 0, threading.Lock()

    def counted(*args, **options):
        nonlocal now, most
        with lock:
            now += 1
            most = max(most, now)
        coded = encode(*args, **options)
        with lock:
            now -= 1
        return coded

    rate_distortion(picture(), SCHEMES, TARGETS, encode=counted, decode=decode, workers=2)
    assert most == 2


def test_a_failing_coder_is_named_and_stops_the_study():
    begun = []

    def failing(source, scheme, *, bpp):
        begun.append(bpp)
        raise RuntimeError("no such frame size")

    with pytest.raises(RuntimeError, match="no such frame size") as caught:
        rate_distortion(picture(), ["x"], range(1, 100), encode=failing, decode=decode, workers=1)
    assert any("while measuring x at" in note for note in caught.value.__notes__)
    assert len(begun) < 99


@pytest.mark.parametrize(
    ("schemes", "rates", "workers", "message"),
    [
        ([], [1], 1, "schemes are"),
        (["a", "a"], [1], 1, "schemes are"),
        (["a"], [], 1, "rates are"),
        (["a"], [0.1, 0], 1, "rates hold 0"),
        (["a"], [math.nan], 1, "rates hold nan"),
        (["a"], [1], 0, "workers is 0"),
    ],
)
def test_nonsense_is_refused_before_coding(schemes, rates, workers, message):
    with pytest.raises(ValueError, match=message):
        rate_distortion(picture(), schemes, rates, encode=len, decode=len, workers=workers)


def write_study(path, records, **options):
    _write_study(path, "Apples", records, picture=picture(), **options)


def test_study_round_trip(tmp_path):
    records = measure()
    write_study(tmp_path / "s.json", records, extra={"note": "two at a time"})
    text = (tmp_path / "s.json").read_text()
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    study = read_study(tmp_path / "s.json")
    assert study["points"] == records
    assert study["picture"]["name"] == "Apples"
    assert study["picture"]["lenses"] == [5, 4] and study["picture"]["ei_pixels"] == [4, 3]
    assert study["pooling"] == "pooled MSE over R, G and B"
    assert study["extra"] == {"note": "two at a time"}
    assert study["machine"]["cpus"] >= 1 and {"python", "numpy"} <= set(study["versions"])
    assert study["git"] is None or set(study["git"]) == {"commit", "dirty"}
    other = tmp_path / "other.json"
    _write_study(other, "Apples", records, picture=picture(seed=1))
    assert read_study(other)["picture"]["sha256"] != study["picture"]["sha256"]


def test_invalid_studies_are_refused(tmp_path):
    path = tmp_path / "s.json"
    for text, message in [
        ("{", "s.json: "),
        ("[]", "not a study"),
        ('{"format": "ii-rd-study", "version": 2}', '"version": 1'),
        ('{"format": "ii-rd-study", "version": 1}', "picture, points missing"),
        ('{"format": "ii-rd-study", "version": 1, "picture": {}, "points": [{}]}', r"points\[0\] has no bpp"),
    ]:
        path.write_text(text)
        with pytest.raises(ValueError, match=message):
            read_study(path)
    with pytest.raises(FileNotFoundError):
        read_study(tmp_path / "none.json")


GOOD = {
    "scheme": "a", "options": {}, "target_bpp": 1, "bpp": 1, "reached": True, "q_global": 30, "encode_seconds": 1,
    "decode_seconds": 1, "nbytes": 9,
}  # fmt: skip


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([1], r"points\[0\] of the records is 1: an object is needed"),
        ([[]], r"points\[0\] of the records is \[\]: an object"),
        ({}, "points a list"),
        (5, "points a list"),
        ([{**GOOD, "bpp": "1"}], r"points\[0\]: bpp is '1': a positive number"),
        ([{**GOOD, "bpp": 10**400}], "a number of 401 digits"),
        ([{**GOOD, "target_bpp": 0}], "target_bpp is 0: a positive number"),
        ([{**GOOD, "scheme": 3}], "scheme is 3: a name"),
        ([{**GOOD, "options": []}], r"options is \[\]: an object"),
        ([{**GOOD, "reached": "no"}], "reached is 'no': true or false"),
        ([{**GOOD, "q_global": "high"}], "q_global is 'high': a number"),
        ([{**GOOD, "q_global": {}}], r"q_global is \{\}: a number"),
        ([{**GOOD, "q_global": 10**400}], "a number of 401 digits"),
        ([{**GOOD, "q_global": True}], "q_global is True: a number"),
    ],
)
def test_points_of_other_kinds_are_named(tmp_path, points, message):
    """``points: [1]`` and most of these were tracebacks on b1dc540: TypeError, OverflowError, AttributeError."""
    path = tmp_path / "s.json"
    study = {"format": "ii-rd-study", "version": 1, "picture": {}, "points": points}
    path.write_text(json.dumps(study))
    with pytest.raises(ValueError, match=rf"s\.json: .*{message}"):
        read_study(path)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\xff\xfe{}", r"s\.json: no UTF-8 text"),
        (b"[" * 100_000, "s.json: nested too deeply"),
        (b'{"format": "ii-rd-study", "version": 1, "picture": 3, "points": []}', "picture is to be an object"),
    ],
)
def test_foreign_bytes_are_named(tmp_path, data, message):
    path = tmp_path / "s.json"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=message):
        read_study(path)


def test_unwritable_outputs_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"points\[0\] has no bpp"):
        write_study(tmp_path / "t.json", [{"scheme": "x"}])
    assert not (tmp_path / "t.json").exists()


def test_csv_has_a_row_a_point(tmp_path):
    records = measure()
    write_csv(tmp_path / "s.csv", records)
    with (tmp_path / "s.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["q_global"]) for row in rows] == [record["q_global"] for record in records]
    assert rows[5]["options"] == "order=spiral gop=32"
    assert [row["reached"] for row in rows] == [str(record["reached"]) for record in records]


def made_up(shift=0.0):
    records = []
    for scheme, gain, floor in (("si-h264", 12 + shift, 0), ("ei-h264", 6, 0.31), ("jpeg2000", 0, 0)):
        for target in RATES:
            bpp = max(float(target), floor)
            records.append(
                {
                    "scheme": scheme,
                    "options": {},
                    "target_bpp": float(target),
                    "bpp": bpp,
                    "reached": bool(bpp <= target),
                    "q_global": float(curve(bpp) + gain),
                    "encode_seconds": 1.0,
                    "decode_seconds": 0.5,
                    "nbytes": 1000,
                }
            )
    return records


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".png", ".pdf"])
def test_chart_comes_from_the_file_alone_and_shows_its_data(tmp_path, suffix):
    import OpenImageIO as oiio

    files = []
    for i, shift in enumerate((0.0, 0.0, 3.0)):
        write_study(tmp_path / f"{i}.json", made_up(shift))
        files.append(tmp_path / f"{i}{suffix}")
        rd_chart(read_study(tmp_path / f"{i}.json"), files[-1])
    if suffix == ".png":  # a PDF carries its time of writing
        images = [oiio.ImageInput.open(str(file)).read_image() for file in files]
        assert images[0].shape[0] > 500 and np.array_equal(images[0], images[1])
        assert not np.array_equal(images[0], images[2])
    else:
        assert files[0].read_bytes()[:5] == b"%PDF-"


def test_chart_joins_targets_met_and_shows_the_floor_apart(tmp_path):
    write_study(tmp_path / "s.json", made_up())
    axes = draw(read_study(tmp_path / "s.json")).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    met = lines["ei-h264  (not below 0.31 bpp)"]
    assert met.get_xdata().tolist() == [0.35, 1.0] and met.get_linestyle() == "-"
    assert lines["si-h264"].get_xdata().tolist() == RATES.tolist()
    assert met.get_color() != lines["si-h264"].get_color() and met.get_marker() != lines["si-h264"].get_marker()
    (hollow,) = (line for line in axes.lines if line.get_linestyle() == "None" and len(line.get_xdata()))
    assert hollow.get_xdata().tolist() == [0.31] and hollow.get_color() == met.get_color()
    assert hollow.get_ydata()[0] == pytest.approx(curve(0.31) + 6, rel=1e-15)  # the very number
    assert hollow.get_markerfacecolor() == "white"
    (floor,) = (line for line in axes.lines if line.get_linestyle() == ":" and len(line.get_xdata()) == 2)
    assert list(floor.get_xdata()) == [0.31, 0.31]
    assert axes.get_xscale() == "log"


def test_chart_of_one_point_of_lossless_only_and_of_many_schemes(tmp_path):
    one = made_up()[0]
    many = [{**one, "scheme": f"s{i}", "q_global": 20.0 + i} for i in range(20)]
    for i, records in enumerate(([one], [{**one, "q_global": math.inf}], many)):
        write_study(tmp_path / "s.json", records)
        rd_chart(read_study(tmp_path / "s.json"), tmp_path / f"{i}.png")
        assert (tmp_path / f"{i}.png").stat().st_size > 0


def test_chart_refusals(tmp_path):
    write_study(tmp_path / "s.json", [])
    study = read_study(tmp_path / "s.json")
    with pytest.raises(ValueError, match="no points"):
        rd_chart(study, tmp_path / "s.png")
    with pytest.raises(ValueError, match=r"known are \.png, \.pdf"):
        rd_chart(study, tmp_path / "s.bmp")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s.json"]


def test_table():
    rows = {row["scheme"]: row for row in summary_table({"points": made_up()})}
    assert list(rows) == ["si-h264", "ei-h264", "jpeg2000"]
    si, ei, jpeg = rows.values()
    assert si["gain"] == si["BD-rate"] == si["BD-PSNR"] == "anchor"  # the first scheme
    assert ei["gain"] == "-6.00 dB at 2 rates" and jpeg["gain"] == "-12.00 dB at 5 rates"
    rows = {row["scheme"]: row for row in summary_table({"points": made_up()}, anchor="jpeg2000")}
    assert rows == {row["scheme"]: row for row in summary_table({"points": made_up(), "anchor": "jpeg2000"})}
    si, ei, anchor = rows.values()
    assert list(si) == list(ei) == ["scheme", "0.02", "0.05", "0.1", "0.35", "1", "gain", "BD-rate", "BD-PSNR"]
    assert si["1"] == "47.00" and ei["0.1"] == "– (floor 0.31)"
    assert si["gain"] == "+12.00 dB at 5 rates" and ei["gain"] == "+6.00 dB at 2 rates"
    assert si["BD-PSNR"] == "+12.0 dB" and si["BD-rate"].endswith(" %")
    assert ei["BD-rate"] == "– (3 points)"
    assert anchor["gain"] == anchor["BD-rate"] == "anchor"
    (row,) = summary_table({"points": made_up()[:5]}, anchor="jpeg2000")
    assert row["gain"] == "– (no jpeg2000)"


def test_table_of_a_ceiling_and_of_missing_points():
    records = made_up()
    records[4] |= {"reached": False, "bpp": 0.8}
    del records[3]
    row = summary_table({"points": records}, anchor="jpeg2000")[0]
    assert row["1"] == "– (ceiling 0.8)" and row["0.35"] == "" and row["gain"] == "+12.00 dB at 3 rates"


def missed_in_the_middle():
    """A coder with coarse steps: the target 0.35 is missed by 0.39, and its rates go on below and above."""
    records = made_up()
    records[3] |= {"reached": False, "bpp": 0.39, "q_global": float(curve(0.39) + 12)}
    return records


def test_a_missed_rate_is_no_floor_where_the_scheme_goes_below_it():
    row, ei, _ = summary_table({"points": missed_in_the_middle()}, anchor="jpeg2000")
    quality = curve(0.39) + 12
    assert row["0.35"] == f"{quality:.2f} (nearest 0.39)" and ei["0.1"] == "– (floor 0.31)"
    labels = [line.get_label() for line in draw({"points": missed_in_the_middle()}).axes[0].lines]
    assert "si-h264" in labels and "ei-h264  (not below 0.31 bpp)" in labels
    records = missed_in_the_middle()
    records[3] |= {"bpp": 0.31}
    assert "(nearest 0.31)" in summary_table({"points": records})[0]["0.35"]  # below its target: no ceiling


def test_a_missed_rate_counts_in_the_gain_at_the_interpolated_quality():
    row = summary_table({"points": missed_in_the_middle()}, anchor="jpeg2000")[0]
    between = np.interp(np.log(0.35), np.log([0.1, 0.39]), [curve(0.1), curve(0.39)]) - curve(0.35)
    assert row["gain"] == f"{12 + between / 5:+.2f} dB at 5 rates"
    records = missed_in_the_middle()
    records[3] |= {"bpp": 0.6}
    assert summary_table({"points": records}, anchor="jpeg2000")[0]["gain"].endswith("at 4 rates")


def test_importing_metrics_is_light():
    import subprocess
    import sys

    code = "import sys, metrics; print([m for m in ('matplotlib', 'skimage', 'bjontegaard') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
