"""Comparisons with programs of others: commands, what both sides get, what is said without them."""

import os
import shlex
import sys

import numpy as np
import pytest

from benchmarks.coding import jplm
from benchmarks.speed import mitsuba
from ii_core import IIPicture, preset
from raytrace_ii import load_scene, render

# An encoder that stores the views as they are, with its words, and a decoder that writes them.
PROGRAM = """#!{python} -IS
import pathlib, pickle, sys
words = sys.argv[1:]
value = lambda *names: next(words[words.index(name) + 1] for name in names if name in words)
source, target = pathlib.Path(value("-i", "--input")), pathlib.Path(value("-o", "--output"))
if source.is_dir():
    views = {{str(file.relative_to(source)): file.read_bytes() for file in source.rglob("*.pgx")}}
    target.write_bytes(pickle.dumps((words, views)))
else:
    for name, data in pickle.loads(source.read_bytes())[1].items():
        (target / name).write_bytes(data)
"""


@pytest.fixture
def picture():
    """4×6 views of 40×5 pixels: 4 columns, 6 rows."""
    pixels = np.random.default_rng(3).integers(0, 256, (5 * 6, 40 * 4, 3), dtype=np.uint8)
    return IIPicture(pixels, (40, 5), (4, 6))


@pytest.mark.parametrize(
    ("setting", "sizes"), [("whole", [(6, 6), (4, 4), (5, 4), (40, 4)]), ("split", [(3, 1), (2, 1), (5, 4), (32, 4)])]
)
def test_transforms_of_a_setting(picture, setting, sizes):
    names = ["inter_view_vertical", "inter_view_horizontal", "intra_view_vertical", "intra_view_horizontal"]
    assert jplm.transforms(picture, setting) == dict(zip(names, sizes, strict=True))
    words = shlex.split(jplm.encoder(picture, setting, 250))
    options = dict(zip(words[1::2], words[2::2], strict=True))
    for name, (largest, smallest) in zip(names, sizes, strict=True):
        assert options[f"--transform_size_maximum_{name}"] == str(largest)
        assert options[f"--transform_size_minimum_{name}"] == str(smallest)
    assert (options["--lambda"], options["--input"], options["--output"]) == ("250", "{in}", "{out}")


def test_views_reach_the_programs_and_return(tmp_path, monkeypatch, picture):
    for name in ("jpl-encoder-bin", "jpl-decoder-bin"):
        (tmp_path / name).write_text(PROGRAM.format(python=sys.executable))
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr(jplm, "LAMBDAS", (50,))
    (point,) = jplm.measured(picture, "split")["points"]
    assert point["psnr"] == np.inf and point["lambda"] == 50
    assert point["bpp"] > 3 * 16  # two bytes a sample, and the words


def test_a_missing_program_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr("shutil.which", lambda _: None)
    monkeypatch.setattr(sys, "argv", ["jplm", "--again", "all"])
    monkeypatch.setattr(jplm, "pictured", lambda *_: pytest.fail("rendered before the programs were looked for"))
    with pytest.raises(SystemExit) as ended:
        jplm.main()
    assert ended.value.code == 2
    assert "'jpl-encoder-bin' is not found; the programs of JPEG Pleno" in capsys.readouterr().err.splitlines()[-1]


def test_an_unknown_setting_is_refused(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["jplm", "--settings", "half"])
    with pytest.raises(SystemExit):
        jplm.main()
    assert "no setting 'half': known are whole, split" in capsys.readouterr().err


# An encoder whose file has 8·10⁵ / (1000 + λ) bytes: 800 at most.
@pytest.mark.parametrize(("factor", "expected"), [(0.8, "split"), (1.2, "whole")])
def test_the_best_setting_has_the_least_rate(factor, expected):
    curve = [{"bpp": 0.1 * 2**n, "psnr": 30 + 3.0 * n} for n in range(5)]
    other = [{**point, "bpp": factor * point["bpp"]} for point in curve]
    assert jplm.best({"whole": curve, "split": other}) == expected


def test_without_mitsuba_one_line_says_what_to_install(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(mitsuba, "import_module", missing)
    monkeypatch.setattr("sys.argv", ["mitsuba"])
    with pytest.raises(SystemExit, match=r"^Mitsuba is missing: `pip install .*` and PYTHONPATH=FOLDER, .*LLVM.*$"):
        mitsuba.main()


def test_plain_scenes_have_one_light_and_one_grey_and_all_faces():
    scene = load_scene("cuboid")
    plain = mitsuba.plain(scene)
    assert len(plain.lights) == 1 < len(scene.lights)
    assert all(body.material.texture is None for body in plain.bodies)
    assert sum(len(b.faces) for b in plain.bodies) == sum(len(b.faces) for b in scene.bodies)
    picture = render(plain, preset("setup1", scale=128), dtype="float32", support=()).picture.pixels
    assert 0 < picture.max() and (picture == 0).any(), "light and black shadows"
    brightest = max(plain.lights[0].colour) * mitsuba.GREY
    assert picture.max() <= brightest * (1 + 1e-5), "no highlights"


def test_mitsuba_sees_the_same():
    """One pixel in two hundred may differ by a hundredth of white: edges, and shadows at the terminator."""
    installed = pytest.importorskip("mitsuba")
    installed.set_variant("llvm_ad_mono")
    camera = preset("setup1", scale=64)
    scene = mitsuba.plain(load_scene("apples"))
    theirs = mitsuba.prepared(installed, scene, camera)()
    ours = render(scene, camera, dtype="float32", support=()).picture.pixels[..., 0]
    assert (abs(theirs - ours) > mitsuba.SAME).mean() < 0.005
