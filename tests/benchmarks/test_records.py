"""Records of benchmarks: appended row by row; pages equal to the records."""

import gzip
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks import records
from benchmarks.accuracy import povray
from benchmarks.coding import coders, fuzz, rd
from benchmarks.pages import tables
from benchmarks.records import ALL, MISSING, Records, check, commit_of, origin, prune, with_commits
from ii_core import preset
from ii_core.base.json_lines import append_record, lines_of
from raytrace_ii import load_scene, render

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "benchmarks" / "results").glob("*.jsonl"))
TOY = Records("toy", ("benchmarks.records",))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Redirect records that tests write; read existing files from their place."""
    monkeypatch.setattr(records, "RESULTS", tmp_path)


@pytest.fixture
def kept(monkeypatch):
    monkeypatch.setattr(records, "RESULTS", ROOT / "benchmarks" / "results")


def test_tables_of_pages_equal_the_records(kept):
    """Every table between marks, on every page. On b1dc540 no test compared most of them."""
    assert tables.stale() == []


def test_a_changed_figure_and_an_unknown_mark_are_found(kept, tmp_path):
    page = tmp_path / "docs/video.md"
    page.parent.mkdir()
    text = (ROOT / "docs/video.md").read_text()
    page.write_text(
        text.replace("| view-first | 1024.5 | -0.7 |", "| view-first | 1024.5 | -0.8 |") + "<!-- new -->\n"
    )
    (tmp_path / "README.md").write_text("")
    wrong = tables.stale(["benchmarks.coding.takes"], tmp_path)
    assert [line.split(":")[0] for line in wrong] == ["docs/video.md"] * 2
    assert "table takes " in wrong[0] and "no benchmark fills new" in wrong[1]


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_all_record_files_are_valid(path):
    """On b1dc540 no test found the rows of coders.json, coders_full.json and fuzz.json with a false commit."""
    assert check(path) == []


def test_the_stamp_of_one_commit_over_rows_of_another_is_found(tmp_path):
    """As in coders.json on b1dc540: 276 of its rows had the seconds of rows stamped otherwise."""
    first = TOY.measure({"row": 1}, lambda: {"points": [{"codec_seconds": 0.125}, {"codec_seconds": 0.25}]})
    stamped = {**first, "key": {"row": 2}, "git": {"commit": git("rev-parse", "HEAD~1"), "dirty": False}}
    invented = {**first, "key": {"row": 3}, "git": {"commit": "0" * 40, "dirty": False}, "result": {}}
    bare = {name: value for name, value in first.items() if name != "versions"}
    undated = {**first, "when": None}
    for record in (stamped, invented, bare, undated):
        append_record(TOY.path, record)
    wrong = check(TOY.path)
    assert len(wrong) == 4
    for line, says in zip(
        wrong, ("seconds identical to a row of", "is not in this history", "no versions", "when is null"), strict=True
    ):
        assert says in line


def test_committed_rows_must_not_change(tmp_path, monkeypatch):
    """Rows may go if they are measured again, or if their commit is unknown."""
    for command in (["init", "-q"], ["config", "user.email", "a@b.c"], ["config", "user.name", "a"]):
        git(*command, cwd=tmp_path)
    TOY.measure({"row": 1}, lambda: {"value": 1})
    monkeypatch.setattr(records, "ROOT", tmp_path)
    monkeypatch.setattr(records, "exists", lambda commit: True)
    append_record(TOY.path, {**TOY.newest()[0], "key": {"row": 2}, "unsure": "by hand", "git": None})
    git("add", ".", cwd=tmp_path)
    git("commit", "-qm", "rows", cwd=tmp_path)
    lines = TOY.path.read_text().splitlines(keepends=True)
    TOY.path.write_text(lines[0])
    assert check(TOY.path) == []
    TOY.path.write_text(lines[1])
    assert [line.partition(": ")[2] for line in check(TOY.path)] == ["a committed row was changed or removed"]
    append_record(TOY.path, {**json.loads(lines[0]), "when": "2999-01-01", "result": {"value": 2}})
    assert check(TOY.path) == []


def test_pruning_keeps_the_newest_row_of_each_key():
    for value in range(3):
        TOY.measure({"row": value % 2}, lambda value=value: {"value": value})
    append_record(TOY.path, {**TOY.newest()[1], "unsure": "by hand", "git": None})
    append_record(TOY.path, {**TOY.newest()[0], "when": "2020-01-01", "result": {"value": 9}})  # merged in
    before = TOY.rows()
    assert [row["value"] for row in before] == [2, 1]
    assert prune(TOY.path) == 3 and prune(TOY.path) == 0
    assert TOY.rows() == before and len(TOY.path.read_text().splitlines()) == 2


def test_pruning_keeps_each_step_of_the_study_at_each_size(tmp_path):
    path = tmp_path / "study.jsonl.gz"
    rows = [
        {"step": step, "parameters": {"scale": scale}, "run": run}
        for step in "ab"
        for scale in (1, 8)
        for run in (0, 1)
    ]
    path.write_bytes(gzip.compress("".join(json.dumps(row) + "\n" for row in rows).encode()))
    assert prune(path) == 4
    assert [json.loads(line) for line in lines_of(path)] == rows[1::2]


def git(*arguments, cwd=ROOT):
    run = subprocess.run(["git", *arguments], cwd=cwd, capture_output=True, text=True, check=True)
    return run.stdout.strip()


def test_rows_carry_their_own_stamp_and_are_measured_once():
    keys = [{"row": i} for i in range(3)]
    for key in TOY.todo(keys[:2]):
        TOY.measure(key, lambda key=key: {"value": key["row"], "none": float("inf")})
    assert TOY.todo(keys) == [{"row": 2}]
    assert [(row["row"], row["value"], row["none"]) for row in TOY.rows()] == [(0, 0, None), (1, 1, None)]
    for record in TOY.newest():
        assert set(records.FIELDS) <= set(record)
        assert record["git"]["commit"] == git("rev-parse", "HEAD") and record["versions"]["numpy"]
    assert len(TOY.todo(keys, ALL)) == 3


def test_other_code_is_measured_again_and_the_newest_row_counts(monkeypatch):
    TOY.measure({"row": 1}, lambda: {"value": 1})
    hash_now = records.code_hash(TOY.modules)
    TOY.path.write_text(TOY.path.read_text().replace(hash_now, "0" * 64))
    assert TOY.todo([{"row": 1}]) == [{"row": 1}] and TOY.todo([{"row": 1}], MISSING) == []
    TOY.measure({"row": 1}, lambda: {"value": 2})
    assert [row["value"] for row in TOY.rows()] == [2] and len(TOY.path.read_text().splitlines()) == 2


@pytest.mark.slow
def test_a_kill_loses_the_row_in_work_alone():
    script = f"""
import os, signal
from pathlib import Path
from benchmarks import records
from benchmarks.records import Records
records.RESULTS = Path({str(TOY.path.parent)!r})
toy = Records("toy", ("benchmarks.records",))
for key in toy.todo({{"row": i}} for i in range(9)):
    toy.measure(key, lambda: os.kill(os.getpid(), signal.SIGKILL) if key["row"] == 4 else {{"value": key["row"]}})
"""
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT)
    assert run.returncode == -signal.SIGKILL
    assert TOY.todo({"row": i} for i in range(9)) == [{"row": i} for i in range(4, 9)]
    with TOY.path.open("a") as file:
        file.write('{"format": "ii-rec')  # the kill came within a line
    assert len(TOY.rows()) == 4
    TOY.measure({"row": 4}, lambda: {"value": 4})
    assert [row["value"] for row in TOY.rows()] == [0, 1, 2, 3, 4]


def test_a_broken_line_within_a_file_is_named(tmp_path):
    TOY.path.write_text('{"format": "ii-rec\n{}\n')
    with pytest.raises(ValueError, match=r"toy\.jsonl, line 1"):
        TOY.rows()


def test_code_changed_before_a_measurement_makes_no_record(monkeypatch):
    TOY.measure({"row": 1}, lambda: {})
    monkeypatch.setattr(records, "code_hash", lambda modules: "1" * 64)
    with pytest.raises(RuntimeError, match="sources changed on disk"):
        TOY.measure({"row": 2}, lambda: {})


def test_code_changed_during_a_measurement_makes_no_record(monkeypatch):
    TOY.measure({"row": 1}, lambda: {})
    with pytest.raises(RuntimeError, match="sources changed on disk"):
        TOY.measure({"row": 2}, lambda: monkeypatch.setattr(records, "code_hash", lambda modules: "1" * 64) or {})
    assert [row["row"] for row in TOY.rows()] == [1]


def test_tables_have_a_column_of_commits_if_they_differ():
    lines = ["| scene | dB |", "|---|---|", "| car | 1 |", "| twins | 2 |"]
    assert with_commits(lines, [["abc"], ["abc"]]) == lines
    assert with_commits(lines, [["abc"], ["def", "unsure"]]) == [
        "| scene | dB | commit |", "|---|---|---|", "| car | 1 | `abc` |", "| twins | 2 | `def` |"
    ]  # fmt: skip
    assert origin([{"commit": "abc"}, {"commit": "abc"}]) == "Measured by `abc`."
    assert "`abc`; the commits that measured the rows without one are unknown" in origin(
        [{"commit": "abc"}, {"commit": "unsure"}]
    )
    many = origin([{"commit": f"a{i}"} for i in range(9)])
    assert many == "Measured by `a0` and 8 other commits, which the records in `benchmarks/results` name."
    assert commit_of({"git": {"commit": "0123456789", "dirty": True}}) == "0123456+"


def test_a_measured_row_replaces_an_unsure_one_at_any_position():
    measured = TOY.measure({"row": 1}, lambda: {"value": 1})
    append_record(TOY.path, {**measured, "result": {"value": 0}, "git": None, "unsure": "by hand"})
    assert [row["value"] for row in TOY.rows()] == [1]


@pytest.mark.slow
def test_coders_continue_and_take_subsets(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["coders", "--scale", "64", *arguments])
        coders.main()
        return capsys.readouterr().out

    first = run("--scenes", "cuboid", "--schemes", "jpeg2000")
    assert "cuboid: 2 of 2 curves to measure" in first  # with the anchor
    rows = coders.RECORDS.rows()
    assert [(row["scene"], row["scale"], row["scheme"]) for row in rows] == [
        ("cuboid", 64, coders.ANCHOR), ("cuboid", 64, "jpeg2000")
    ]  # fmt: skip
    assert "cuboid: 1 of 3 curves to measure" in run("--scenes", "cuboid", "--schemes", "jpeg2000,si-mpeg2")
    assert len(coders.RECORDS.path.read_text().splitlines()) == 3
    assert {row["scheme"] for row in coders.studied(64)} == {coders.ANCHOR, "jpeg2000", "si-mpeg2"}
    assert "2 of 2: cuboid si-h264:balanced,merange=64" in run(
        "--scenes", "cuboid", "--schemes", "si-h264:balanced;merange=64,si-h264:fast"
    )
    with pytest.raises(SystemExit):
        run("--schemes", "jpg2000")


@pytest.mark.slow
def test_decode_seconds_exclude_the_measure(monkeypatch):
    """A measure that takes half a second: decoding 128×64 px takes a few milliseconds still."""
    picture = render(load_scene("cuboid"), preset("setup1", scale=64), support=()).picture
    monkeypatch.setattr(coders, "qualities", lambda scheme: [{"qp": 30}])
    original = rd.q_global
    monkeypatch.setattr(rd, "q_global", lambda a, b: (spend(0.5), original(a, b))[1])
    _, (point,) = (coders.curve(picture, "si-h264") for _ in range(2))  # the first call compiles kernels
    assert point["decode_seconds"] < 0.3


def spend(seconds):
    """Use so many CPU seconds."""
    until = time.thread_time() + seconds
    while time.thread_time() < until:
        pass


@pytest.mark.slow
def test_fuzz_keeps_a_row_a_scheme_and_continues(monkeypatch):
    monkeypatch.setattr(fuzz, "publish", lambda tables: None)
    for schemes in ("jpeg", "jpeg,si-h264"):
        monkeypatch.setattr("sys.argv", ["fuzz", "--mutations", "4", "--schemes", schemes, "--workers", "1"])
        fuzz.main()
    lines = [json.loads(line) for line in fuzz.RECORDS.path.read_text().splitlines()]
    assert [line["key"]["scheme"] for line in lines] == ["jpeg", "si-h264"]
    assert all(sum(line["result"]["counts"].values()) == 4 for line in lines)


def test_the_version_of_povray_is_parsed():
    """On b1dc540 the record held "povray: cannot open the user configuration file …"."""
    said = (
        "povray: cannot open the user configuration file /root/.povray/3.7/povray.conf: No such file or directory\n"
        "POV-Ray 3.7.0.10.unofficial\n\nThis is an unofficial version compiled by:\n"
    )
    assert povray.stated(said) == "POV-Ray 3.7.0.10.unofficial"
    with pytest.raises(ValueError, match="prints no version"):
        povray.stated("povray: not found")
    for line in (ROOT / "benchmarks/results/povray.jsonl").read_text().splitlines():
        version = json.loads(line)["result"]["povray"]
        assert version is None or version.startswith("POV-Ray 3")
