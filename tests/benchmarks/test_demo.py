"""Demo, the example of the README, and that of an external coder, run as a user runs them."""

import json
import os
import re
import sys
from pathlib import Path

import pytest

from examples import demo, jplm_encoder
from ii_core import IIPicture, preset
from ii_core.base.files import read_image
from ii_core.picture.disparity import disparity_of_depth

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_demo_writes_all_its_files(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["demo", "--scale", "16", "--scenes", "apples", "-o", str(tmp_path)])
    demo.main()
    assert "apples" in capsys.readouterr().out
    picture = IIPicture.load(tmp_path / "apples.png")
    assert picture.lenses == (32, 16) and picture.ei_pixels == (16, 16)
    views = [f"view_{name}" for name in ("front", "up", "down", "left", "right")]
    for name in ("depth", "detail", "sub_images", "projection", "rd", *views):
        assert read_image(tmp_path / f"apples_{name}.png").std() > 1, name
    points = json.loads((tmp_path / "apples_rd.json").read_text())["points"]
    assert [(p["scheme"], p["target_bpp"]) for p in points] == [(s, r) for s in demo.SCHEMES for r in demo.RATES]
    # elementary images cost ten bytes of headers per frame: 10·8/256 bpp
    floored = [p for p in points if p["scheme"] == "ei-h264" and p["target_bpp"] < 0.3]
    assert floored and not any(p["reached"] for p in floored)
    best = {s: max(p["q_global"] for p in points if p["scheme"] == s) for s in demo.SCHEMES}
    assert best["si-h264"] > best["jpeg2000"] + 3  # several dB, even with so few lenses


@pytest.mark.slow
def test_the_readme_example_runs(tmp_path, monkeypatch, capsys):
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert code is not None
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(code[1], "README.md", "exec"), names)
    assert re.search(r"bpp: \d\d\.\d dB", capsys.readouterr().out)
    assert names["L"].shape == names["D"].shape == (16, 64, 3)
    assert names["shot"].depth.shape == names["shot"].object_id.shape == names["shot"].picture.pixels.shape[:2]
    assert names["shot"].normal.shape == names["shot"].picture.pixels.shape
    assert names["vi"].shape == (32, 64, 3) and names["valid"].all()
    assert names["decoded"].pixels.shape == names["shot"].picture.pixels.shape


def test_disparity_between_sub_images():
    camera = preset("setup1", scale=1)
    # by hand: 10 mm behind the lenses, 2·tan(α/2)/(U·δL) = 0.342 px per mm
    assert abs(disparity_of_depth(camera, 10 + camera.gap_mm) + 3.42) < 0.01  # the hand has three figures


SIZED = """#!{python} -IS
import pathlib, sys
words = sys.argv[1:]
value = lambda name: words[words.index(name) + 1]
assert (value("--number_of_rows"), value("--transform_size_maximum_intra_view_horizontal")) == ("6", "40")
pathlib.Path(value("-o")).write_bytes(bytes(int(8e5 / (1000 + float(value("--lambda"))))))
"""


@pytest.mark.parametrize("limit", [100, 250, 799, 2000])
def test_the_example_meets_a_target(tmp_path, monkeypatch, limit):
    (tmp_path / "jpl-encoder-bin").write_text(SIZED.format(python=sys.executable))
    (tmp_path / "jpl-encoder-bin").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    file = tmp_path / "coded"
    words = ["jplm_encoder.py", str(tmp_path), str(file), str(limit), "6", "4", "40", "5"]
    monkeypatch.setattr(sys, "argv", words)
    jplm_encoder.main()
    assert 0.98 * min(limit, 800) < file.stat().st_size <= limit
