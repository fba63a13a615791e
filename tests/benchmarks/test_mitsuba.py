"""Comparison with Mitsuba: what both render, and what is said without it."""

import pytest

from benchmarks.speed import mitsuba
from ii_core import preset
from raytrace_ii import load_scene, render


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
