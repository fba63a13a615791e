"""Notebooks and programs of ``examples/``: they run, and notebooks show objects small and correctly."""

import ast
import io
import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from codec import encode, register, schemes
from codec.contract import _CODERS
from ii_core import IIPicture, embed_viewer, five_viewpoints, preset, view_image, write_views
from metrics import MEASURES, read_study, write_study
from metrics.measures import measure as measure_module
from raytrace_ii import load_scene, render

EXAMPLES = Path(__file__).parents[2] / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


@pytest.fixture
def registries(monkeypatch):
    """What a notebook registers ends with its test."""
    monkeypatch.setattr("codec.contract._CODERS", dict(_CODERS))
    monkeypatch.setattr(measure_module, "MEASURES", MEASURES.copy())


def run_cell(code, names):
    """Run a cell as a notebook does, of a smaller picture: the value of a last expression is shown."""
    tree = ast.parse(code.replace("scale = 8", "scale = 32"))
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path, monkeypatch, registries):
    monkeypatch.chdir(tmp_path)
    names, shown = {"__name__": "notebook"}, []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            shown.append(run_cell("".join(cell["source"]), names))
            stored = [output for output in cell["outputs"] if output["output_type"] == "execute_result"]
            assert len(stored) == (shown[-1] is not None), "python -m benchmarks run notebooks"
    assert len(shown) >= 5 and path.stat().st_size < 120_000
    for value in shown:
        assert len(repr(value)) < 800
        if hasattr(value, "_repr_html_"):
            assert value._repr_html_().startswith("<")


def test_there_are_three_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["first_picture", "own_camera", "own_coder"]


@pytest.fixture(scope="module")
def shot():
    return render(load_scene("apples"), preset("setup1", scale=32))


def program(name, monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")


def test_the_loop_over_rates(monkeypatch, capsys):
    program("rates", monkeypatch, "--scale", 32, "--scheme", "jpegxl", "--rates", "0.3,0.6")
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
    assert [row[0] for row in rows] == ["0.3", "0.6"] and float(rows[0][2]) < float(rows[1][2])


def test_import_and_compare(shot, monkeypatch, capsys, tmp_path):
    (tmp_path / "views").mkdir()
    write_views(shot.picture, tmp_path / "views")
    words = ("--schemes", "jpeg2000,jpegxl", "-o", tmp_path / "c.html")
    program("import_compare", monkeypatch, tmp_path / "views", *words)
    said = capsys.readouterr().out
    assert "16×8 lenses of 16×16 px" in said and said.count(" dB") == 2
    assert (tmp_path / "c.html").stat().st_size > 50_000


def test_the_film_of_quilts(monkeypatch, capsys, tmp_path):
    words = ("--scale", 32, "--frames", 3, "--tiles", "3x2", "--size", "32x16", "-o", tmp_path / "f.gif")
    program("quilt_film", monkeypatch, *words)
    with Image.open(tmp_path / "f.gif") as film:
        assert film.size == (96, 32) and film.n_frames == 3


# --- what notebooks show


def test_reprs_are_one_line(shot, tmp_path):
    """On b1dc540 the repr of a scene was 35 kB of arrays."""
    picture = shot.picture
    assert repr(picture) == "IIPicture(16×8 lenses of 16×16 px, uint8, camera setup1)"
    assert repr(IIPicture(picture.pixels, (16, 8), (16, 16))).endswith("uint8, no camera)")
    scene = load_scene("apples")
    for value in (shot, scene, scene.bodies[0], encode(picture, "jpegxl", bpp=0.5)):
        assert len(repr(value)) < 150 and "\n" not in repr(value)
    assert f"{len(scene.bodies)} bodies" in repr(scene)
    missed = encode(picture, "ei-h264", bpp=0.01)
    assert "0.01 bpp not reached" in repr(missed) and f"{missed.nbytes} bytes" in repr(missed)


def test_a_picture_is_shown_as_its_view_from_the_front(shot):
    with Image.open(io.BytesIO(shot.picture._repr_png_())) as image:
        pixels = np.asarray(image)
    front, _ = view_image(shot.picture, five_viewpoints(shot.picture.camera)["front"])
    np.testing.assert_array_equal(pixels, front.repeat(32, axis=0).repeat(32, axis=1))
    assert "16×8 lenses of 16×16 px, uint8, camera setup1</figcaption>" in shot.picture._repr_html_()
    for odd in (preset("hexagonal", scale=8), preset("pinhole2d", scale=128)):
        assert IIPicture(np.zeros((*odd.pixels[::-1], 3), np.uint8), odd.lenses, odd.ei_pixels, odd)._repr_png_()


def test_a_study_is_shown_as_table_and_chart(shot, tmp_path):
    point = {"options": {}, "encode_seconds": 1.0, "decode_seconds": 1.0, "nbytes": 9, "reached": True}
    records = [
        point | {"scheme": scheme, "target_bpp": rate, "bpp": rate, "q_global": 30.0 + rate + gain}
        for scheme, gain in (("a", 0), ("<b>", 3))
        for rate in (1.0, 2.0, 3.0, 4.0)
    ]
    write_study(tmp_path / "s.json", "x", records, picture=shot.picture)
    study = read_study(tmp_path / "s.json")
    assert repr(study) == "Study(x: 8 points of a, <b>)" and isinstance(study, dict)
    shown = study._repr_html_()
    assert "<td>+3.00 dB at 4 rates</td>" in shown and "&lt;b&gt;" in shown and "<b>" not in shown
    with Image.open(io.BytesIO(study._repr_png_())) as image:
        assert min(image.size) > 300


def test_the_viewer_is_embedded_whole(shot):
    shown = embed_viewer(shot.picture, depth=shot.depth, height=400)
    html = shown._repr_html_()
    assert html.startswith("<iframe srcdoc=") and "height:400px" in html and "<script" not in html  # all is escaped
    assert "ii.done()" in shown.page and len(repr(shown)) < 50


def test_progress_may_be_true(capsys):
    render(load_scene("objects"), preset("setup1", scale=64), progress=True)
    said = capsys.readouterr().err
    assert (said.startswith("\rrender ") and said.endswith("\n") and "s left" in said) or "/" in said
    with pytest.raises(TypeError, match="progress is 3: True, or a function"):
        render(load_scene("objects"), preset("setup1", scale=64), progress=3)


def test_names_of_schemes_are_as_before():
    """Notebooks unregister their coders."""
    assert "coarse" not in schemes()
    with pytest.raises(TypeError):
        register(object())
