"""Installation without extras: rendering, coding and measuring, and errors on missing libraries."""

import json
import os
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
