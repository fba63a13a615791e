"""Study: steps, records, reproducibility, comparison with the dissertation."""

import gzip
import json
import math

import numpy as np
import pytest

from benchmarks.pages.pictures import STRIP
from benchmarks.pages.tables import filled
from benchmarks.study import beside, claims, theirs
from benchmarks.study.__main__ import all_steps, main
from benchmarks.study.page import PAGE, largest, publish, tables
from benchmarks.study.runner import Step, code_of, known, perform, records, timeless
from benchmarks.study.views import towards
from ii_core.base.files import read_image, write_image

calls = []


def counted(folder, *, value, drift=0):
    """Return a step that counts its runs; its time differs, and optionally a number and a picture."""
    calls.append(value)
    run = len(calls) * drift
    write_image(folder / "toy.png", np.full((2, 2, 3), value + run, np.uint8))
    return {"number": value + run, "pair": (1, math.inf), "nothing": math.nan, "encode_seconds": len(calls)}


def toy(**parameters):
    return Step(name="toy", shows="Figure 0", run=counted, parameters=parameters)


def test_a_step_runs_once_and_keeps_all_records(tmp_path):
    calls.clear()
    (first,) = perform([toy(value=1)], tmp_path)
    assert first["result"] == {"number": 1, "pair": [1, "inf"], "nothing": None, "encode_seconds": 1}
    assert {"git", "machine", "versions", "code", "parameters", "seconds", "when"} <= first.keys()
    assert perform([toy(value=1)], tmp_path) == [] and calls == [1]
    perform([toy(value=2)], tmp_path)  # other parameters: the step runs, and the older picture is removed
    assert [r["parameters"]["value"] for r in records(tmp_path, "toy")] == [1, 2]
    assert known(toy(value=2), tmp_path) and not known(toy(value=1), tmp_path)
    (tmp_path / "toy.png").unlink()
    assert len(perform([toy(value=2)], tmp_path)) == 1
    assert len((tmp_path / "toy.jsonl").read_text().splitlines()) == 3


def test_a_forced_run_reports_whether_results_are_equal(tmp_path):
    calls.clear()
    perform([toy(value=1)], tmp_path)
    (again,) = perform([toy(value=1)], tmp_path, force=True)
    assert again["repeats"] is True and again["result"]["encode_seconds"] == 2
    perform([toy(value=1, drift=1)], tmp_path)
    (other,) = perform([toy(value=1, drift=1)], tmp_path, force=True)
    assert other["repeats"] is False


def test_other_code_is_another_step(tmp_path):
    step = toy(value=1)
    perform([step], tmp_path)
    path = tmp_path / "toy.jsonl"
    path.write_text(path.read_text().replace(code_of(step), "0" * 64))
    assert known(step, tmp_path) is None


@pytest.mark.parametrize("line", ["{", "[]", '{"format": "other"}'])
def test_files_without_records_are_named(tmp_path, line):
    (tmp_path / "toy.jsonl").write_text(line + "\n")
    with pytest.raises(ValueError, match=r"toy\.jsonl, line 1"):
        perform([toy(value=1)], tmp_path)


def test_findings_exclude_times():
    assert timeless({"a": [{"codec_seconds": 1, "b": 2}]}) == {"a": [{"b": 2}]}


@pytest.mark.slow
def test_a_small_study_resumes_repeats_and_fills_the_page(tmp_path, capsys):
    only = ["--scale", "16", "--only", "artefacts-setup1,floors", "--out", str(tmp_path / "out")]
    main(only)
    main(only)
    assert "0 of 2 steps" in capsys.readouterr().out
    main([*only, "--force"])
    assert capsys.readouterr().out.count("the same to the bit") == 2
    differences = read_image(tmp_path / "out" / "artefacts-setup1_differences.png")
    assert differences.std() > 1
    assert (differences[STRIP : STRIP + 10, :20] == 255).all()  # the uncoded view, by itself
    assert (differences[:STRIP, :70] < 128).any()  # under its name
    page = tmp_path / "study.md"
    page.write_text(
        "".join(f"<!-- {mark} -->\n<!-- /{mark} -->\n" for mark in [mark for _, mark in tables(tmp_path / "kept.gz")])
        + "![views](images/study/artefacts-setup1_views.webp)"
    )
    for _ in range(2):  # publishing twice adds no record twice
        publish(tmp_path / "out", page=page, images=tmp_path / "images", kept=tmp_path / "kept.gz")
        lines = gzip.decompress((tmp_path / "kept.gz").read_bytes()).splitlines()
        lines = [line for line in lines if json.loads(line)["step"] == "floors"]
        assert [json.loads(line).get("repeats") for line in lines] == [None, True]
    assert (tmp_path / "images" / "artefacts-setup1_views.webp").exists()
    assert "Lowest rate of a black picture, bpp, by EI-PVS: 0.63 · 0.31." in page.read_text()


def test_a_small_study_does_not_replace_a_large_one():
    some = [{"parameters": {"scale": scale}, "when": when} for when, scale in enumerate((2, 1, 1, 16))]
    assert largest(some)["when"] == 2
    assert largest([{"parameters": {}, "when": 0}, {"parameters": {}, "when": 1}])["when"] == 1


def test_the_page_has_a_place_for_every_table():
    text = PAGE.read_text(encoding="utf-8")
    for _, mark in tables():
        assert filled(text, mark, ["| new |"]).count("| new |") == 1


def test_steps_have_names_of_their_own_and_code_that_is_there():
    for scale in (1, 2, 4, 8, 16):
        steps = all_steps(scale)
        assert len({step.name for step in steps}) == len(steps)
    for step in {(step.run.__module__, step.uses): step for step in all_steps(1)}.values():
        assert len(code_of(step)) == 64


@pytest.mark.parametrize(
    ("arguments", "said"), [(["--only", "rate"], "no step 'rate'"), (["--scale", "3"], "scale is 3")]
)
def test_wrong_arguments_are_named(arguments, said, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2 and said in capsys.readouterr().err


def test_agreement_is_counted():
    numbers = {"a": 4.0, "b": -1.0, "c": 0.0, "d": 2.0}
    same = theirs.compare(numbers, numbers)
    assert (same.sign, same.order, same.size) == ((3, 3), (6, 6), (3, 3))
    other = theirs.compare(numbers, {"a": 1.9, "b": 1.0, "c": 0.5, "d": None})
    assert other.sign == (1, 3) and other.size == (0, 3)
    assert other.order == (2, 6)  # a over b and a over c; b is no longer below c, nothing can be said of d
    ranks = theirs.compare({"x": 0.0, "y": 0.0, "z": -1.0}, {"x": 0.90, "y": 0.91, "z": 0.5}, only="order", even=0.02)
    assert ranks.order == (3, 3) and ranks.sign == (0, 0)
    assert [theirs.said(*pair) for pair in ((0, 0), (0, 2), (1, 2), (2, 2))] == ["", "no", "1 of 2", "yes"]


def points(scheme, first, rates=(0.125, 0.25, 0.5, 1.0)):
    """3 dB for every doubling of the rate."""
    return [
        {"scheme": scheme, "target_bpp": r, "bpp": r, "reached": True, "q_global": first + 3 * math.log2(r / 0.125)}
        for r in rates
    ]


def test_gain_and_rate_ratio_of_straight_curves():
    both = [*points("a", 29.0), *points("b", 23.0)]  # 6 dB apart: a quarter of the rate
    assert claims.gain(both, "a", "b") == pytest.approx(6)
    assert claims.gain(both, "a", "nothing") is None
    assert claims.rate_ratio(both, "a", "b", 30.0) == pytest.approx(4)
    assert claims.rate_ratio(both, "a", "b", None) == pytest.approx(4)  # at b's 32 dB
    assert claims.rate_ratio(both, "a", "b", 60.0) is None
    # if the worst point of the better scheme is still better, its rate is a bound
    assert claims.rate_ratio([*points("a", 40.0), *points("b", 23.0)], "a", "b", None) == pytest.approx(8)


def test_unmet_targets_are_no_gain():
    missed = points("b", 23.0)
    missed[0] = {**missed[0], "reached": False, "q_global": 99.0}
    assert claims.gain([*points("a", 29.0), *missed], "a", "b") == pytest.approx(6)


def test_the_lower_rate_wins_without_a_common_rate():
    def duel(gain, si, ei):
        return {"ei": {"gain_db": gain, "lowest": {"si": si, "ei": ei}}}

    assert claims.advantage(duel(2.5, 0.1, 0.4)) == 2.5
    assert claims.advantage(duel(None, 0.1, None)) == 1 and claims.words(duel(None, 0.1, None)) == "SI alone"
    assert claims.advantage(duel(None, None, 0.05)) == -1
    assert claims.advantage(duel(None, None, None)) is None


def test_a_cell_holds_their_number_and_ours():
    four = [
        claims.claim("5.10", "lead", {"car": 4.0, "apples": 5.0}, {"car": value}, "+.1f") for value in (3.0, None)
    ]
    assert beside.cell("car", *four) == "+4.0 · +3.0 · –" and beside.cell("apples", *four) == ""
    assert beside.rates(four) == [
        "|  | apples | twins | car | cuboid |", "|---|---|---|---|---|", "| lead |  |  | +4.0 · +3.0 · – |  |"
    ]  # fmt: skip
    signs = claims.ranked("5.23", "mean", {"car": 1.0}, {"car": -2.0}, "+.1f", scene="car", only="sign")
    assert signs.verdict.sign == (0, 1) and beside.by_what([signs]) == ["|  | mean |", "|---|---|", "| car | −2.0 |"]
    assert all(not lines for lines in beside.tables([]).values())


def test_decline_and_fluctuation_over_depth():
    values, pixels = np.array([40.0, 40.0, np.nan, 30.0, 30.0]), np.array([10, 10, 0, 10, 10])
    assert claims.decline(values, pixels) == pytest.approx(10)
    assert claims.fluctuation(values, pixels) == pytest.approx(5)
    assert claims.decline(np.full(5, 33.0), pixels) == pytest.approx(0)


def test_the_search_for_a_quality_interpolates_over_log_rate():
    line = [(0.1, 20.0), (0.4, 26.0)]
    assert towards(line, 23.0) == pytest.approx(0.2)
    assert towards(line[:1], 23.0) == pytest.approx(0.2)  # 3 dB for a doubling, to begin with
    assert towards(line, 32.0) == pytest.approx(1.6)


def test_a_lead_is_measured_at_the_rates_of_the_other_scheme():
    """A line of 3 dB per octave is 6 dB above another at all rates of that; rates beyond its ends do not count."""
    mine = [{"scheme": "a", "bpp": rate, "q_global": 30 + 3 * math.log2(rate)} for rate in (0.1, 0.4, 1.6)]
    its = [{"scheme": "b", "bpp": rate, "q_global": 24 + 3 * math.log2(rate)} for rate in (0.15, 0.7, 1.3)]
    beyond = [{"scheme": "b", "bpp": rate, "q_global": -99} for rate in (0.09, 1.7)]
    assert claims.lead(mine, "a", [*its, *beyond], "b") == pytest.approx(6)
    assert claims.lead(mine, "a", beyond, "b") is None
