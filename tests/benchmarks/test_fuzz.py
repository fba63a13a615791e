"""Fuzzing script: counts of mutations, death of a worker process."""

import json

import numpy as np
import pytest

from benchmarks.coding import fuzz


def test_every_mutation_is_counted_and_the_same_again(capsys):
    first, second = ([], [])
    for lines in (first, second):
        fuzz.work("si-h264", 7, 0, 60, limit=False)
        lines += [json.loads(line)[:2] for line in capsys.readouterr().out.splitlines()]
    assert first == second
    assert [number for number, _ in first] == list(range(60))
    assert {what for _, what in first} <= {"picture", "refused"}


def test_a_dead_worker_is_a_finding(monkeypatch):
    """A worker that cannot even start dies at its first mutation, again and again, and that is kept."""
    monkeypatch.setattr(fuzz.sys, "executable", "false")
    outcome = fuzz.watched("si-h264", 0, 3)
    assert [finding["number"] for finding in outcome["findings"]] == [0, 1, 2]
    assert outcome["counts"] == {"died with 1": 3}


def test_damage_is_damage():
    data, rng = bytes(range(256)), np.random.default_rng(0)
    mutants = {fuzz.damaged(data, [b"stranger"], rng) for _ in range(50)}
    assert len(mutants) > 45


@pytest.mark.parametrize("scheme", ["si-h264", "jpeg2000"])
def test_samples_hold_something(scheme):
    assert 100 < fuzz.sample(scheme).nbytes < 4000
