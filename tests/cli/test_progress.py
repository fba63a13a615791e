"""Output of commands: version, help, completion, progress, closing lines, tables; and ``--quiet``."""

import importlib.util
import os
import re
import subprocess
import sys

import pytest

from codec import decode, encode
from ii_core import preset
from ii_core.base import jit
from raytrace_ii import load_scene, render
from raytrace_ii.cli import app, progress
from raytrace_ii.cli.progress import console
from raytrace_ii.cli.tables import print_table


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    """A small picture on disk: 16×8 lenses of 16×16 px."""
    path = tmp_path_factory.mktemp("picture") / "small.png"
    render(load_scene("apples"), preset("setup1", scale=32)).picture.save(path)
    return path


def test_version_and_bare_command(run):
    """On b1dc540 --version was unknown, and the bare command an error of one line with the whole help."""
    code, out, err = run("--version")
    assert (code, err) == (0, "") and re.fullmatch(r"raytrace-ii \d+\.\d+\.\d+\n", out)
    code, out, err = run()
    assert (code, err) == (0, "") and out.startswith("Usage:") and "\n  render " in out


@pytest.mark.slow
def test_every_command_can_be_quiet(run):
    for command in app.registered_commands:
        code, out, _ = run(command.name or command.callback.__name__, "--help")
        assert code == 0 and "-q, --quiet" in out, command.name


def test_shells_complete_commands_without_waiting_for_large_libraries():
    code = """
import atexit, sys
from raytrace_ii.cli import main
atexit.register(lambda: print({"numba", "numpy", "scipy"} & set(sys.modules), file=sys.stderr))
sys.argv[0] = "raytrace-ii"
main()
"""
    asked = {"_RAYTRACE_II_COMPLETE": "complete_bash", "COMP_WORDS": "raytrace-ii ren", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | asked, capture_output=True, text=True, timeout=120
    )
    assert (done.stdout.split(), done.stderr) == (["render"], "set()\n")


def test_closing_lines_name_wall_and_cpu_time_and_quiet_leaves_nothing(run, picture, tmp_path):
    times = r"; \d+\.\d s, \d+\.\d s of CPU time\n"
    coded, decoded = tmp_path / "a.ii", tmp_path / "a.png"
    code, out, err = run("encode", picture, "--scheme", "si-h264", "--qp", 30, "-o", coded)
    assert code == 0 and re.fullmatch(rf"{re.escape(str(coded))}: \d+ bytes, .* bpp{times}", out)
    assert "━" not in err  # no bar outside a terminal
    code, out, _ = run("decode", coded, "-o", decoded)
    assert code == 0 and re.fullmatch(rf"{re.escape(str(decoded))}: si-h264 at .* bpp{times}", out)
    assert run("decode", coded, "-o", decoded, "--force", "--quiet") == (0, "", "")
    code, out, _ = run("measure", picture, decoded, "--quiet")
    assert code == 0 and out.startswith("Q_global")  # a result, not progress


def test_a_bar_in_a_terminal_shows_counts_and_times(monkeypatch, capsys):
    monkeypatch.setattr(progress, "console", lambda **options: console(**options, force_terminal=True, width=80))
    with progress.progress_bar("render [bold] :smile:") as report:  # no markup
        report(128, 128, "tiles")
    err = capsys.readouterr().err
    assert "render [bold] :smile:" in err and "128/128 tiles, 0:00" in err
    monkeypatch.setattr(progress.running, "quiet", True)
    with progress.progress_bar("render apples") as report:
        report(1, 2, "tiles")
    assert capsys.readouterr().err == ""


def test_time_left_is_that_of_the_run(monkeypatch):
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    state = progress.State()
    assert str(state) == "0:00"
    now = 30.0
    state.update(0, 256, "frames, run 1 of 4")
    state.update(64, 256, "frames, run 1 of 4")  # it compiled
    assert str(state) == "64/256 frames, run 1 of 4, 0:30"
    now = 40.0
    state.update(128, 256, "frames, run 1 of 4")
    assert str(state) == "128/256 frames, run 1 of 4, 0:40, 0:20 left"
    now = 100.0
    state.update(0, 256, "frames, run 2 of 4")
    assert str(state) == "0/256 frames, run 2 of 4, 1:40"
    now = 120.0
    state.update(64, 256, "frames, run 2 of 4")
    now = 130.0  # the bar is drawn between reports, too
    assert str(state) == "64/256 frames, run 2 of 4, 2:10, 0:50 left"


def test_coding_reports_frames_and_runs():
    shot = render(load_scene("apples"), preset("setup1", scale=32)).picture
    told = []
    coded = encode(shot, "si-h264", bpp=1.0, progress=lambda *at: told.append(at))
    runs = [int(re.search(r"run (\d+) of", text)[1]) for _, _, text in told if "run" in text]
    assert max(runs) == coded.runs and runs == sorted(runs)
    assert (256, 256) in {at[:2] for at in told if "frames" in at[2]}
    told.clear()
    decode(coded, progress=lambda *at: told.append(at))
    assert told[-1] == (256, 256, "frames")
    told.clear()
    encode(shot, "jpeg2000", bpp=1.0, progress=lambda *at: told.append(at))
    assert told[0][2].startswith("run 1 of ")


KERNEL = "from ii_core.base.jit import kernel\n@kernel\ndef double(x):\n    return 2 * x\n"


def test_compilation_is_reported_once_and_only_with_a_cold_cache(tmp_path):
    file = tmp_path / "kernels.py"
    file.write_text(KERNEL)
    told = []

    def fresh():
        spec = importlib.util.spec_from_file_location("kernels", file)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.double

    with jit.compilation_told(told.append):
        cold = fresh()
        assert (cold(2), cold(2.5)) == (4, 5.0)  # two compilations
    assert told == [True]
    with jit.compilation_told(told.append):
        assert fresh()(2) == 4  # from the disk, as in a second process
    assert told == [True]


NUMBERS = dict.fromkeys(["0.1", "0.2", "0.5", "1", "2"], "-1.2345e-05 mm") | {"gain": "+12.34 dB at 5 rates"}
ROWS = [{"scheme": name} | NUMBERS for name in ("si-h264:order=row,gop=16", "jpeg2000")]


@pytest.mark.parametrize("width", [60, 80, 200])
def test_tables_fit_the_terminal_and_no_number_is_cut(monkeypatch, capsys, width):
    """On b1dc540 tables were 150 columns wide, and a terminal of 80 broke their lines."""
    monkeypatch.setenv("COLUMNS", str(width))
    print_table("a study", ROWS)
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert max(map(len, lines)) <= width and "…" not in out
    assert out.count("-1.2345e-05 mm") == 10 and out.count("+12.34 dB at 5 rates") == 2
    assert out.count("┏") == {60: 6, 80: 3, 200: 1}[width]
