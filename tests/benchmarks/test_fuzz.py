"""Fuzzing script: counts of mutations, death of a worker process."""

import json

import numpy as np
import pytest

from benchmarks import workers
from benchmarks.coding import fuzz
from benchmarks.stability.fuzz_readers import __main__ as readers


def test_mutations_are_counted_and_reproducible(capsys):
    first, second = ([], [])
    for lines in (first, second):
        fuzz.work("si-h264", 7, 0, 60, limit=False)
        lines += [json.loads(line)[:2] for line in capsys.readouterr().out.splitlines()]
    assert first == second
    assert [number for number, _ in first] == list(range(60))
    assert {what for _, what in first} <= {"picture", "refused"}


@pytest.mark.parametrize(("watched", "name"), [(fuzz.watched, "si-h264"), (readers.watched, "PLY")])
def test_a_dead_worker_is_a_finding(watched, name, monkeypatch):
    """A worker that cannot start ends at each of its cases; every such end is a finding."""
    monkeypatch.setattr("sys.executable", "false")
    outcome = watched(name, 0, 3)
    assert [finding["number"] for finding in outcome["findings"]] == [0, 1, 2]
    assert outcome["counts"] == {"died with 1": 3}


def test_cases_of_a_worker_that_dies_once(tmp_path, monkeypatch):
    """The worker dies at case 2 of 4: that case is a finding with its last line, the next worker begins at 3."""
    script = tmp_path / "worker.py"
    script.write_text(
        "import sys\n"
        "first, last = map(int, sys.argv[-2:])\n"
        "for number in range(first, last):\n"
        "    if number == 2:\n"
        "        sys.exit('no more')\n"
        "    print(f'[{number}, \"object\", 0.5, 7.0]', flush=True)\n"
    )
    monkeypatch.setattr(workers, "ROOT", tmp_path)
    dead = workers.Case(2, "died with 1", said="no more")
    good = [workers.Case(number, "object", 0.5, 7.0) for number in range(4)]
    assert list(workers.cases("worker", (), 4)) == [*good[:2], dead, good[3]]


def test_nearly_all_mutations_differ():
    data, rng = bytes(range(256)), np.random.default_rng(0)
    mutants = {fuzz.damaged(data, [b"stranger"], rng) for _ in range(50)}
    assert len(mutants) > 45


@pytest.mark.parametrize("scheme", ["si-h264", "jpeg2000"])
def test_samples_have_a_useful_size(scheme):
    assert 100 < fuzz.sample(scheme).nbytes < 4000
