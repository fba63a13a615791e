"""Coders and measures of other packages: the example of the documentation, by ``--plugin`` and by an entry point."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from codec import Coder, CodingResult, Run, contract, encode, register, schemes
from codec.coders.jpeg2000 import Jpeg2000
from codec.contract import _CODERS
from ii_core import IIPicture
from metrics import read_study
from metrics.measures import measure
from raytrace_ii.cli import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "own.md").read_text(encoding="utf-8")
PIXELS = np.random.default_rng(3).integers(0, 256, (32, 64, 3), np.uint8)


def block(language):
    return re.search(f"```{language}\n(.*?)```", PAGE, re.S)[1]


@pytest.fixture
def package(tmp_path):
    """A folder as a package manager leaves it: a module, and metadata with the entry points of the page."""
    (tmp_path / "my.py").write_text(block("py"), encoding="utf-8")
    metadata = tmp_path / "my-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my\nVersion: 1.0\n", encoding="utf-8")
    points = re.sub(r'project.entry-points."(.*?)"', r"\1", block("toml")).replace('"', "")
    (metadata / "entry_points.txt").write_text(points, encoding="utf-8")
    IIPicture(PIXELS, (16, 8), (4, 4)).save(tmp_path / "noise.png")
    return tmp_path


@pytest.fixture
def command(package, run, monkeypatch):
    """Run a command as a new process would: without the coders and measures that one before has registered."""
    monkeypatch.syspath_prepend(str(package))
    monkeypatch.chdir(package)
    coders, measures = dict(contract._CODERS), dict(measure.MEASURES)

    def forget():
        for module in "my", "plugin_mine":
            sys.modules.pop(module, None)
        contract._load_plugins.cache_clear()
        measure._load_plugins.cache_clear()

    def call(*arguments, ok=True):
        monkeypatch.setattr(contract, "_CODERS", dict(coders))
        monkeypatch.setattr(measure, "MEASURES", dict(measures))
        forget()
        code, out, err = run(*arguments)
        assert (code == 0) == ok, err
        return out + err

    yield call
    forget()


def test_the_coder_of_the_page_is_a_scheme_of_every_command(command, package):
    assert "deflate" in command("schemes")
    command("encode", "noise.png", "--scheme", "deflate", "--qp", 3, "-o", "noise.ii")
    command("decode", "noise.ii", "-o", "back.png")
    assert (IIPicture.load(package / "back.png").pixels == PIXELS >> 3 << 3).all()
    said = command("encode", "noise.png", "--scheme", "deflate", "--bpp", 12.5, "-o", "half.ii")
    assert (package / "half.ii").stat().st_size < 1.02 * 12.5 * PIXELS.size / 3 / 8, said
    damaged = bytearray((package / "noise.ii").read_bytes())
    damaged[-1] ^= 1
    (package / "noise.ii").write_bytes(damaged)
    assert "damaged" in command("decode", "noise.ii", "-o", "other.png", ok=False)


@pytest.mark.slow
def test_a_plugin_that_fails_is_a_warning_and_others_go_on(package):
    """In a process of its own, whose warnings go to its error output."""
    points = package / "my-1.0.dist-info" / "entry_points.txt"
    points.write_text("[raytrace_ii.coders]\nbroken = no_such_module:Coder\nmy = my\n")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(package), str(ROOT))), "COLUMNS": "120"}
    line = [sys.executable, "-c", "from raytrace_ii.cli import main; main()", "schemes"]
    done = subprocess.run(line, env=environment, cwd=package, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = done.stdout + done.stderr
    assert "coder plugin broken (no_such_module:Coder) is not loaded: No module named 'no_such_module'" in said
    assert "deflate" in said.split("known")[0]


@pytest.fixture
def file(package):
    """The page's file, which no package installs."""
    shutil.rmtree(package / "my-1.0.dist-info")
    (package / "my.py").rename(package / "mine.py")  # not to be found by its module's name
    return package


@pytest.mark.slow
def test_the_file_of_the_page_is_known_to_every_command_that_it_is_given_to(file, command):
    assert "unknown scheme 'deflate'" in command("encode", "noise.png", "--scheme", "deflate", "-o", "a.ii", ok=False)
    plugin = ("--plugin", "mine.py")
    assert "deflate" in command("schemes", *plugin)
    assert "largest error of a pixel in codes, lower is better" in command("measures", *plugin)
    command("encode", "noise.png", "--scheme", "deflate", "--bpp", 12.5, "-o", "a.ii", *plugin)
    for words in (
        ["decode", "a.ii", "-o", "b.png"],
        ["components", "a.ii", "-o", "c"],
        ["export", "a.ii", "-o", "d"],
    ):
        command(*words, *plugin)
    error = abs(IIPicture.load(file / "b.png").pixels.astype(int) - PIXELS).max()
    said = command("measure", "noise.png", "a.ii", *plugin)
    assert f"{error}.00 codes, largest error of a pixel, lower is better" in said
    words = ["--schemes", "deflate,jpeg2000", "--rates", "12.5", "--measures", "q_worst", "-o", "s"]
    command("study", "noise.png", *words, *plugin)
    point = read_study(file / "s" / "noise_rd.json")["points"][0]
    assert point["q_worst"] == error > 0


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("x = 1", "bad.py registers nothing: codec.register(coder) or metrics.register_measure(measure) is needed"),
        ("\nx = y", "bad.py, line 2: NameError: name 'y' is not defined"),
        ("x = (\n", "bad.py, line 1: SyntaxError"),
        (None, "bad.py"),
    ],
)
def test_a_file_without_a_plugin_is_one_line(code, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if code is not None:
        Path("bad.py").write_text(code, encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["raytrace-ii", "schemes", "--plugin", "bad.py"])
    with pytest.raises(SystemExit) as end:
        main()
    error = capsys.readouterr().err
    assert end.value.code == 2 and said in error and error.count("\n") == 1


class Steps(Coder):
    """Keeps every n-th code value by a quality from 0 to 1; sizes grow by steps of the quality."""

    name, about, versions = "steps", "for this test", {}
    rate_control, quality_range = False, (0.0, 1.0)

    def check(self, picture, options):
        pass

    def encode(self, picture, options, goal):
        assert goal.bpp is None and 0 <= goal.quality <= 1
        size = 40 * 2 ** (6 * goal.quality)
        return CodingResult(run=Run(bytes(round(size)), 0.0))

    def decode(self, payload, blank, options):
        raise NotImplementedError


def test_a_rate_is_searched_on_the_scale_of_a_coder_without_rate_control():
    known = schemes()
    register(Steps())
    try:
        picture = IIPicture(PIXELS, (16, 8), (4, 4))
        coded = encode(picture, "steps", bpp=2.0)
        assert coded.reached and abs(coded.bpp / 2.0 - 1) <= 0.02 and coded.target_bpp == 2.0 and coded.runs > 1
        floor = encode(picture, "steps", bpp=0.01)
        assert not floor.reached and len(floor.payload) == 40
        assert len(encode(picture, "steps", quality=1).payload) == 40 * 2**6
    finally:
        del _CODERS["steps"]
    assert schemes() == known


def test_only_coders_are_registered():
    with pytest.raises(TypeError, match="needed"):
        register(Jpeg2000)
    with pytest.raises(ValueError, match="'jpeg2000' is registered already"):
        register(Jpeg2000())
