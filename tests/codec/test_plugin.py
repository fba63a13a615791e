"""Coders of other packages: the page's example, installed as a package with an entry point."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from codec import register
from codec.coders.jpeg2000 import Jpeg2000
from ii_core import IIPicture

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "coding.md").read_text(encoding="utf-8")
SECTION = PAGE[PAGE.index("## A coder of your own") :]
PIXELS = np.random.default_rng(3).integers(0, 256, (32, 64, 3), np.uint8)


def block(language):
    return re.search(f"```{language}\n(.*?)```", SECTION, re.S)[1]


@pytest.fixture
def package(tmp_path):
    """A folder as a package manager leaves it: a module, and metadata with the entry points of the page."""
    (tmp_path / "deflate_coder.py").write_text(block("python"), encoding="utf-8")
    metadata = tmp_path / "deflate_coder-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: deflate-coder\nVersion: 1.0\n", encoding="utf-8")
    points = block("toml").replace('[project.entry-points."raytrace_ii.coders"]', "[raytrace_ii.coders]")
    (metadata / "entry_points.txt").write_text(points.replace('"', ""), encoding="utf-8")
    return tmp_path


def command(package, *arguments, ok=True):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(package), str(ROOT))), "COLUMNS": "120"}
    line = [sys.executable, "-c", "from raytrace_ii.cli import main; main()", *map(str, arguments)]
    done = subprocess.run(line, env=environment, cwd=package, capture_output=True, text=True)
    assert (done.returncode == 0) == ok, done.stderr
    return done.stdout + done.stderr


def test_the_coder_of_the_page_is_a_scheme_of_every_command(package):
    IIPicture(PIXELS, (16, 8), (4, 4)).save(package / "noise.png")
    assert "deflate" in command(package, "schemes")
    command(package, "encode", "noise.png", "--scheme", "deflate", "--qp", 3, "-o", "noise.ii")
    command(package, "decode", "noise.ii", "-o", "back.png")
    assert (IIPicture.load(package / "back.png").pixels == PIXELS >> 3 << 3).all()
    said = command(package, "encode", "noise.png", "--scheme", "deflate", "--bpp", 12.5, "-o", "half.ii")
    assert (package / "half.ii").stat().st_size < 1.02 * 12.5 * PIXELS.size / 3 / 8, said
    damaged = bytearray((package / "noise.ii").read_bytes())
    damaged[-1] ^= 1
    (package / "noise.ii").write_bytes(damaged)
    assert "damaged" in command(package, "decode", "noise.ii", "-o", "other.png", ok=False)


def test_a_plugin_that_fails_is_a_warning_and_others_go_on(package):
    points = package / "deflate_coder-1.0.dist-info" / "entry_points.txt"
    points.write_text("[raytrace_ii.coders]\nbroken = no_such_module:Coder\ndeflate = deflate_coder:Deflate\n")
    said = command(package, "schemes")
    assert "coder plugin broken (no_such_module:Coder) is not loaded: No module named 'no_such_module'" in said
    assert "deflate" in said.split("known")[0]


def test_only_coders_are_registered():
    with pytest.raises(TypeError, match="needed"):
        register(Jpeg2000)
    with pytest.raises(ValueError, match="'jpeg2000' is registered already"):
        register(Jpeg2000())
