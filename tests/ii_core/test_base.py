"""Installation without extras: rendering, coding and measuring, and errors on missing libraries."""

import gc
import json
import os
import subprocess
import sys
import threading
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.core import event

from ii_core.base import jit
from ii_core.base.extras import EXTRAS
from ii_core.base.parallel import cores, over_rows
from ii_core.base.references import Reference, by_reference

ROOT = Path(__file__).parents[2]
WITHOUT = f"""
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted(EXTRAS)}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""
SCRIPT = """
import contextlib, io, json
from codec import decode, encode
from ii_core import preset
from metrics import q_angle_ssim, q_global, q_view
from raytrace_ii import load_scene, render
from raytrace_ii.cli import main
shot = render(load_scene("apples"), preset("setup1", scale=16)).picture
decoded = decode(encode(shot, "si-h264", qp=30))
works = [q_global(shot, decoded) > 20, 0 < q_view(shot, decoded).mean < 1, q_angle_ssim(shot, decoded).mean > 0]
try:
    encode(shot, "jpegxl", quality=50)
except ImportError as error:
    works.append(str(error))
ends = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["raytrace-ii", *arguments]
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            main()
        except SystemExit as end:
            ends.append([end.code, out.getvalue(), error.getvalue()])
print(json.dumps([works, ends]))
"""
COMMANDS = {
    "matplotlib is not installed: pip install 'raytrace-ii[charts]'": ["study", "a.png", "-o", "s"],
    "dask is not installed: pip install 'raytrace-ii[dask]'": ["render", "apples", "-o", "a.png", "--dask", "x:1"],
}


@pytest.mark.slow
def test_without_extras_pictures_are_rendered_coded_and_measured_and_a_missing_library_is_one_line(tmp_path):
    """In one process, whose imports of extras fail. On b1dc540 the first import failed."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT + SCRIPT, json.dumps(list(COMMANDS.values()))],
        capture_output=True, text=True, timeout=250, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    works, ends = json.loads(done.stdout)
    assert works == [True, True, True, "imagecodecs is not installed: pip install 'raytrace-ii[coders]'"]
    assert ends == [[2, "", f"error: {said}\n"] for said in COMMANDS]
    assert not list(tmp_path.iterdir())


def test_extras_are_those_of_the_package():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra, package in EXTRAS.values():
        assert any(wanted.startswith(package) for wanted in extras[extra]), (extra, package)


# -- work on rows shared among threads: every row once, errors raised, ranges at multiples of a step


@given(rows=st.integers(0, 300), workers=st.integers(-1, 40), step=st.integers(1, 70))
def test_every_row_is_in_one_range_that_starts_at_a_multiple_of_the_step(rows, workers, step):
    ranges = []
    over_rows(lambda first, last: ranges.append((first, last)), rows, workers=workers, step=step)
    ranges.sort()
    assert [row for first, last in ranges for row in range(first, last)] == list(range(rows))
    assert all(first % step == 0 for first, _ in ranges) and len(ranges) <= max(1, workers)


def test_an_error_in_one_range_is_raised():
    def work(first, last):
        if first:
            raise OSError(f"row {first}")

    with pytest.raises(OSError, match="row 5"):
        over_rows(work, 10, workers=2)


def test_one_thread_per_core_and_none_extra_for_one_range():
    meeting, names = threading.Barrier(cores(), timeout=20), set()

    def work(first, last):
        meeting.wait()  # all ranges at once, or the barrier breaks
        names.add(threading.get_ident())

    over_rows(work, 64)
    assert len(names) == cores()
    over_rows(lambda first, last: names.add(threading.get_ident()), 64, workers=1)
    assert threading.get_ident() in names


def test_a_kernel_keeps_its_rounding_and_its_size_whoever_calls_it():
    """Numba hands options that a kernel leaves open down from the kernel that calls it first."""

    @jit.exact_stage_kernel
    def exact(a, b, c):
        return a * b + c

    @jit.part_kernel
    def part(a, b, c):
        return exact(a, b, c)

    @jit.stage_kernel
    def stage(a, b, c):
        return part(a, b, c)

    def first(a, b, c):
        return stage(a, b, c)

    # The product is 1 − 2⁻⁶⁰, which rounds to 1: one rounding of both operations gives −2⁻⁶⁰.
    assert jit.lean_kernel(first)(1 + 2**-30, 1 - 2**-30, -1.0) == 0
    (compiled,) = part.overloads.values()
    assert not compiled.fndesc.inline


@by_reference
class Inner(NamedTuple):
    numbers: Any
    factor: Any
    some: Any


@by_reference
class Outer(NamedTuple):
    inner: Any
    rows: Any


def test_a_part_reads_each_tuple_that_it_gets_by_reference():
    """New tuples in each round stand in the same place of the stack; what is written to arrays is read anew."""

    @jit.part_kernel
    def add(outer, k):
        inner = outer.inner
        if k > 3:  # never: what calls itself is not inlined
            return add(outer, k - 1)
        outer.rows[1, k] += inner.numbers[k] * inner.factor if inner.some else -1
        inner.numbers[k] += 1
        return inner.numbers[k] + 0.0

    @jit.stage_kernel
    def step(outer, k):
        return add(outer, k) + outer.inner.factor

    def sums(outer):
        total = 0.0
        for i in range(3):
            inner = Inner(outer.inner.numbers, outer.inner.factor + i, i != 1)
            for k in range(4):
                total += step(Outer(inner, outer.rows), k)
        return total

    def run(function):
        outer = Outer(Inner(np.arange(4, dtype=np.int16), 0.5, True), np.zeros((2, 4)))
        return function(outer), outer.rows.tolist(), outer.inner.numbers.tolist()

    total, rows, numbers = run(jit.lean_kernel(sums))
    assert (total, rows, numbers) == run(sums)
    assert (total, numbers) == (60.0, [3, 4, 5, 6])
    assert rows == [[0] * 4, [4.0, 7.0, 10.0, 13.0]]
    (arguments,) = add.overloads
    assert isinstance(arguments[0], Reference)


@pytest.mark.parametrize("before", [(700, 10, 10), (0, 10, 10), (100_000, 5, 5)])
def test_garbage_is_looked_for_less_often_while_numba_compiles_alone(before):
    usual, during = gc.get_threshold(), []

    class Listener(event.Listener):
        def on_start(self, event):
            during.append(gc.get_threshold())

        def on_end(self, event):
            pass

    gc.set_threshold(*before)
    try:
        with event.install_listener("numba:compile", Listener()):
            numba.njit(lambda x: 2 * x)(1)
        assert gc.get_threshold() == before
    finally:
        gc.set_threshold(*usual)
    assert during[0][0] == (max(before[0], 20_000) if before[0] else 0)
