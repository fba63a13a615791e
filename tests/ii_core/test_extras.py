"""Installation without extras: rendering, coding and measuring, and errors on missing libraries."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from ii_core.base.extras import EXTRAS

ROOT = Path(__file__).parents[2]
WITHOUT = f"""
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted(EXTRAS)}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""
WORKS = """
from codec import decode, encode
from ii_core import preset
from metrics import q_angle_ssim, q_global, q_view
from raytrace_ii import load_scene, render
shot = render(load_scene("apples"), preset("setup1", scale=16)).picture
decoded = decode(encode(shot, "si-h264", qp=30))
print(q_global(shot, decoded) > 20, 0 < q_view(shot, decoded).mean < 1, q_angle_ssim(shot, decoded).mean > 0)
try:
    encode(shot, "jpegxl", quality=50)
except ImportError as error:
    print(error)
"""
FAILS = """
from raytrace_ii.cli import main
sys.argv = ["raytrace-ii", *sys.argv[1:]]
main()
"""


def python(code, *arguments):
    return subprocess.run(
        [sys.executable, "-c", WITHOUT + code, *map(str, arguments)], capture_output=True, text=True, timeout=250
    )


def test_pictures_are_rendered_coded_and_measured_without_extras():
    """On b1dc540 the first import failed."""
    done = python(WORKS)
    assert done.stdout.splitlines() == [
        "True True True",
        "imagecodecs is not installed: pip install 'raytrace-ii[coders]'",
    ], done.stderr


@pytest.mark.parametrize(
    ("said", "arguments"),
    {
        "matplotlib is not installed: pip install 'raytrace-ii[charts]'": ["study", "a.png", "-o", "s"],
        "dask is not installed: pip install 'raytrace-ii[dask]'": [
            "render",
            "apples",
            "-o",
            "a.png",
            "--dask",
            "x:1",
        ],
    }.items(),
)
def test_a_missing_library_is_one_line(tmp_path, monkeypatch, said, arguments):
    monkeypatch.chdir(tmp_path)
    done = python(FAILS, *arguments)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", f"error: {said}\n")
    assert not list(tmp_path.iterdir())


def test_extras_are_those_of_the_package():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra, package in EXTRAS.values():
        assert any(wanted.startswith(package) for wanted in extras[extra]), (extra, package)
