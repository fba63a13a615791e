"""Registry and command line of the benchmarks."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import __main__ as command
from benchmarks import age
from benchmarks.registry import BENCHMARKS, CLOSED, KEPT, entry, newest

ROOT = Path(__file__).parents[2]
# Modules with a ``main`` that others start: a process of `ratios`.
HELPERS = {"benchmarks.__main__"}


def test_every_program_is_registered_once():
    programs = {
        path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        for path in (ROOT / "benchmarks").rglob("*.py")
        if "\ndef main(" in path.read_text(encoding="utf-8")
    }
    assert {entry(one.module) for one in BENCHMARKS.values()} == programs - HELPERS
    for one in BENCHMARKS.values():
        assert callable(importlib.import_module(entry(one.module)).main) and one.summary()


def test_every_file_of_results_and_every_picture_has_one_owner():
    for folder, endings in (
        ("benchmarks/results", {".json", ".jsonl", ".gz"}),
        ("docs", {".png", ".jpg", ".webp", ".svg"}),
    ):
        owned = [
            path.relative_to(ROOT).as_posix()
            for one in BENCHMARKS.values()
            for pattern in (*one.outputs, f"benchmarks/results/{one.pattern}")
            if pattern.startswith(folder)
            for path in ROOT.glob(pattern)
            if path.suffix in endings
        ]
        if folder == "docs":
            owned += KEPT
        there = [
            path.relative_to(ROOT).as_posix()
            for path in (ROOT / folder).rglob("*")
            if path.suffix in endings and not (path.parent / "LICENSE.txt").exists()  # pictures of third parties
        ]
        assert sorted(owned) == sorted(there)


@pytest.mark.parametrize("last", CLOSED)
def test_scripts_of_closed_experiments_are_in_git(last):
    if subprocess.run(["git", "cat-file", "-e", last], cwd=ROOT, capture_output=True).returncode:
        pytest.skip("no history, or a shallow one")
    there = subprocess.run(["git", "ls-tree", "-r", "--name-only", last], cwd=ROOT, capture_output=True, text=True)
    paths = [f"benchmarks/{name}.py" for name in CLOSED[last]]
    assert set(paths) <= set(there.stdout.splitlines())
    assert not any((ROOT / path).exists() for path in paths)


@pytest.mark.parametrize("one", [one for one in BENCHMARKS.values() if one.tables], ids=lambda one: one.name)
def test_pages_are_those_of_the_tables(one):
    pages = {page for page, _ in importlib.import_module(one.tables).tables()}
    assert pages == set(one.fills)


def test_cost_is_that_of_the_newest_records(monkeypatch, tmp_path):
    monkeypatch.setattr("benchmarks.registry.RESULTS", tmp_path)
    rows = [
        {"key": {"row": 1}, "cpu_seconds": 999.0, "result": {}},
        {"key": {"row": 1}, "seconds": 99.0, "cpu_seconds": 30.0, "result": {}},
        {"key": {"row": 2}, "seconds": 60.0, "result": {}},
    ]
    (tmp_path / "takes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert len(newest(tmp_path / "takes.jsonl")) == 2
    assert BENCHMARKS["takes"].minutes() == (1.5, False)
    rows.append({"key": {"row": 3}, "seconds": None, "result": {"encode_seconds": 30.0}})
    (tmp_path / "takes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert BENCHMARKS["takes"].minutes() == (2.0, True)
    assert "at least 2.0 min" in command.description(BENCHMARKS["takes"])


def test_list_names_all_benchmarks_without_importing_them():
    script = "import sys, benchmarks.__main__ as m; m.main(['list']); sys.exit('matplotlib' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0
    heads = [line.split(" (")[0] for line in run.stdout.splitlines() if not line.startswith(" ")]
    assert heads == list(BENCHMARKS)


def test_prune_removes_older_records_of_a_benchmark(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("benchmarks.registry.RESULTS", tmp_path)
    (tmp_path / "takes.jsonl").write_text('{"key": 1, "run": 0}\n{"key": 1, "run": 1}\n')
    command.main(["prune", "takes"])
    assert capsys.readouterr().out == "takes.jsonl: 1 older records removed\n"
    assert (tmp_path / "takes.jsonl").read_text() == '{"key": 1, "run": 1}\n'


def test_run_passes_options_to_the_benchmark(monkeypatch):
    seen = []
    monkeypatch.setattr("benchmarks.coding.takes.main", lambda: seen.append(sys.argv))
    monkeypatch.setattr("benchmarks.stability.__main__.main", lambda: seen.append(sys.argv))
    command.main(["run", "takes", "--scale", "8"])
    command.main(["run", "stability", "--", "bd_dents"])
    command.main(["run", "takes", "stability"])
    assert [words[1:] for words in seen] == [["--scale", "8"], ["bd_dents"], [], []]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run", "coder"], "no benchmark 'coder'"),
        (["run"], "run needs a name"),
        (["run", "takes", "coders", "--scale", "8"], "need a single name"),
        (["list", "takes", "--scale"], "list takes names alone"),
    ],
)
def test_wrong_arguments_are_named(words, says, capsys):
    with pytest.raises(SystemExit) as stop:
        command.main(words)
    assert stop.value.code == 2 and says in capsys.readouterr().err


def test_code_is_the_same_without_words_and_imports():
    code = age.code_hash(b'"""Text."""\nimport numpy\n\ndef f(x):\n    """Text."""\n    return x + 1  # why\n')
    assert code == age.code_hash(b"from os import path\ndef f(x):\n    return x + 1\n")
    assert code != age.code_hash(b"def f(x):\n    return x - 1\n")


def test_a_benchmark_needs_what_its_names_come_from():
    names = {str(path.relative_to(age.ROOT)) for path in age.imported("benchmarks.accuracy.sample_places")}
    assert "raytrace_ii/sampling/sample_places.py" in names
    assert not any(name.startswith(("codec/", "ii_core/calibration/", "benchmarks/pages/")) for name in names)
    # a name of a package's front, and one imported inside a function
    assert age._home("ii_core", "view_image") == "ii_core.picture.view"
    assert age._home("raytrace_ii", "render") == "raytrace_ii.rendering.render"
