"""Fuzzing of every reader: a short run, and the script."""

import json
import logging
import signal
import subprocess
import sys
import zlib

import numpy as np
import pytest

from benchmarks.stability.fuzz_readers import __main__ as fuzz
from benchmarks.stability.fuzz_readers import containers, seeds, trees
from benchmarks.stability.fuzz_readers.readers import READERS
from raytrace_ii.files.load import read_model

CASES = 100


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_short_run(name, tmp_path):
    """On b1dc540 only the coders were fuzzed (benchmarks.coding.fuzz)."""
    found = {}
    for number in range(CASES):
        end = fuzz.outcome(fuzz.case(name, 1, number, tmp_path))
        if end not in fuzz.GOOD:
            found[number] = end
    assert not found


def test_valid_seeds_are_read(tmp_path):
    """Mutations of a refused seed would test nothing."""
    for name, structure in enumerate(seeds.structures()):
        assert trees.json_text(structure) == json.dumps(structure), name
    tree, chunk = seeds.gltf()
    for suffix, data in {
        "obj": seeds.OBJ.encode(), "ply": seeds.ply_files()[0], "stl": seeds.stl_files()[1],
        "gltf": json.dumps({**tree, "buffers": [{"byteLength": len(chunk), "uri": seeds.embedded(chunk)}]}).encode(),
    }.items():  # fmt: skip
        (tmp_path / f"part.{suffix}").write_bytes(data)
    (tmp_path / "part.mtl").write_text(seeds.MTL)
    (tmp_path / "part.png").write_bytes(seeds.png_files()[0])
    for suffix in ("obj", "ply", "stl", "gltf"):
        assert read_model(tmp_path / f"part.{suffix}").parts


def test_cases_are_reproducible_from_their_number(tmp_path):
    for name in READERS:
        made = []
        for folder in (tmp_path / "a", tmp_path / "b"):
            folder.mkdir(exist_ok=True)
            fuzz.case(name, 3, 41, folder)
            files = sorted(path for path in folder.rglob("*") if path.is_file())
            made.append([(path.relative_to(folder), path.read_bytes()) for path in files])
        assert made[0] == made[1] and made[0], name


def test_outcomes(monkeypatch):
    monkeypatch.setattr(logging.root, "handlers", [])  # pytest sets a handler of logs, a command does not

    def failing(error):
        def read():
            raise error

        return read

    assert fuzz.outcome(lambda: 1) == "object"
    assert fuzz.outcome(failing(ValueError("lenses is 0: 1 is needed"))) == "refused"
    assert fuzz.outcome(failing(OSError("no such file"))) == "refused"
    assert fuzz.outcome(failing(ValueError("two\nlines"))).startswith("wording")
    assert fuzz.outcome(failing(ValueError(""))).startswith("wording")
    assert fuzz.outcome(failing(ValueError("x" * 5000))).startswith("long")
    assert fuzz.outcome(failing(KeyError("point"))).startswith("error: KeyError")
    assert fuzz.outcome(failing(MemoryError())).startswith("error: MemoryError")
    assert fuzz.outcome(lambda: len(3)).startswith("error: TypeError")
    assert fuzz.outcome(lambda: logging.getLogger("stranger").warning("look")).startswith("printed: stranger: look")


@pytest.mark.slow
def test_limits_of_time_and_memory_are_findings():
    """A case that takes too much memory raises MemoryError; the system kills a case that takes too long."""
    script = """
import itertools
from benchmarks.stability.fuzz_readers import __main__ as fuzz
fuzz.MOST_SECONDS = 1
ends = [lambda: None, lambda: None, lambda: bytearray(3 << 30), lambda: all(True for _ in itertools.count())]
fuzz.READERS["toy"] = lambda rng, folder: ends.pop(0)
fuzz.work("toy", 0, 0, 2)
"""
    run = subprocess.run([sys.executable, "-c", script], cwd=fuzz.ROOT, capture_output=True, text=True)
    assert run.returncode == -signal.SIGXCPU, run.stderr
    assert [json.loads(line)[1].partition(" in")[0] for line in run.stdout.splitlines()] == ["error: MemoryError"]


def test_png_keeps_right_checksums():
    right = 0
    for number in range(50):
        data = containers.png_changed(seeds.png_files()[0], np.random.default_rng(number))
        length = int.from_bytes(data[8:12], "big")
        right += data[16 + length : 20 + length] == zlib.crc32(data[12 : 16 + length]).to_bytes(4, "big")
    assert right > 40


def test_keys_stand_twice_and_raw_text_stays():
    tree = {"a": 1, trees.Twin("a"): 2, "b": trees.Raw("NaN")}
    assert trees.json_text(tree) == '{"a": 1, "a": 2, "b": NaN}'
    assert trees.toml_text(tree) == '"a" = 1\n"a" = 2\n"b" = NaN'
