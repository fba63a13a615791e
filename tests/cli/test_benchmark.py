"""Commands benchmark and ranking, and the pixels of the small profile."""

import re

import pytest

from metrics.benchmark.profile import profile
from metrics.study import picture_json
from raytrace_ii.cli.benchmarking import _pictures

TINY = """
name = "tiny"
version = 1
about = "A test."
rates_bpp = [4.0, 8.0]
measures = ["q_global"]
rank_by = "q_global"
anchor = "jpeg2000"
rate_tolerance = 0.02
seconds = 20
[[picture]]
name = "apples"
use = "a test"
scene = "apples"
camera = "setup1"
scale = 64
"""


def test_a_coder_is_run_and_ranked(run, tmp_path):
    (tmp_path / "tiny.toml").write_text(TINY)
    definition = str(tmp_path / "tiny.toml")
    files = []
    for scheme in ("jpeg2000", "si-h264:gop=8"):
        files.append(str(tmp_path / f"{len(files)}.json"))
        code, out, _ = run("benchmark", definition, "--scheme", scheme, "-o", files[-1])
        assert code == 0 and re.search(rf"{re.escape(scheme)} meets \d of 2 targets", out)
    page = tmp_path / "rank.md"
    code, out, _ = run("ranking", definition, *files, "-o", page)
    assert code == 0 and out.splitlines()[0].startswith("1  ") and page.exists() and page.with_suffix(".png").exists()
    assert {line.split()[0] for line in run("benchmark")[1].splitlines()} == {"dissertation", "jpeg-pleno", "small"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("small",), "output is missing"),
        (("small", "-o", "r.json"), "coder is missing: either --scheme or --external"),
        (("small", "-o", "r.json", "--scheme", "h264"), "unknown scheme"),
        (("small", "-o", "r.json", "--external", "python3 {in} {out}", "python3 {in} {out}"), "--name says"),
        (("small", "-o", "r.json", "--name", "x", "--external", "python3 {in}", "python3 {in} {out}"), "no {out}"),
        (("large", "-o", "r.json", "--scheme", "jpeg"), "unknown profile 'large'"),
    ],
)
def test_wrong_calls_are_one_line_before_work(run, monkeypatch, tmp_path, arguments, message):
    monkeypatch.chdir(tmp_path)
    code, _, error = run("benchmark", *arguments)
    assert code == 2 and message in error and len(error.splitlines()) == 1 and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_small_profile_renders_to_the_bit():
    for reference, picture in _pictures(profile("small")):
        assert picture_json(reference.name, picture)["sha256"] == reference.sha256, reference.name
