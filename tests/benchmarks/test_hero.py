"""The moving picture at the head of the README."""

import numpy as np
from PIL import Image

from benchmarks.pages import hero
from benchmarks.records import ROOT
from ii_core import preset
from raytrace_ii import load_scene, render


def shape(path):
    with Image.open(path) as film:
        return film.size, film.n_frames, film.info["loop"]


def test_the_readme_opens_with_a_light_film(tmp_path):
    """The script writes the film from a larger picture; b1dc540 had a still of an eighth of the lenses."""
    assert hero.PATH.stat().st_size < 1e6
    assert f"]({hero.PATH.relative_to(ROOT).as_posix()})" in (ROOT / "README.md").read_text()[:1200]
    picture = render(load_scene("apples"), preset("setup1", scale=16), support=()).picture
    hero.film(picture, tmp_path / "a.webp")
    assert shape(hero.PATH) == shape(tmp_path / "a.webp") == (hero.SIZE, hero.FRAMES, 0)
    first, second = (np.asarray(Image.open(path).convert("RGB"), float) for path in (hero.PATH, tmp_path / "a.webp"))
    # the same place of the same scene: 16 times fewer lenses blur it, another view would be 40 off
    assert np.abs(first - second).mean() < 12
