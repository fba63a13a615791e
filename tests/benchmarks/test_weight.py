"""Size of tracked files, and form of the pictures of pages."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.pages.pictures import WIDEST, with_palette, write_picture

ROOT = Path(__file__).parents[2]
FILE, TREE = 1.0, 12.0  # largest sizes in MB
FILES = 800


def tracked():
    run = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if run.returncode:
        pytest.skip("no git work tree: what is tracked is unknown")
    return [path for path in run.stdout.split("\0") if path and (ROOT / path).is_file()]


def heavy(sizes):
    """Return a line for each file that is too large, from sizes in bytes by path."""
    wrong = []
    for path, size in sizes.items():
        if size > FILE * 1e6:
            why = "prune records, or reduce pictures: every clone carries it for ever"
            wrong.append(f"{path} has {size / 1e6:.1f} MB, at most {FILE:g} may be committed: {why}")
    if (total := sum(sizes.values()) / 1e6) > TREE:
        wrong.append(
            f"tracked files have {total:.1f} MB, at most {TREE:g} are wanted in a clone: "
            "write pictures by benchmarks.pages.pictures, build what can be built"
        )
    if len(sizes) > FILES:
        wrong.append(f"{len(sizes)} files are tracked, at most {FILES} are wanted: merge small ones")
    return wrong


def test_tracked_files_are_light():
    """On b1dc540 the tree had 27 MB, a page of the gallery 1.6."""
    assert heavy({path: (ROOT / path).stat().st_size for path in tracked()}) == []


def test_heavy_files_are_named():
    assert heavy({"a.png": 10**6, "benchmarks/results/a.jsonl": 10**6}) == []
    (line,) = heavy({"a.png": 1_200_000})
    assert line.startswith("a.png has 1.2 MB, at most 1 may be committed")
    (line,) = heavy({f"{i}.png": 900_000 for i in range(14)})
    assert line.startswith("tracked files have 12.6 MB, at most 12")
    (line,) = heavy({f"{i}.py": 1 for i in range(FILES + 1)})
    assert line.endswith("merge small ones")


def test_pictures_are_unique_and_not_wider_than_shown():
    """On b1dc540 ten charts stood in benchmarks/results and in docs/images."""
    seen = {}
    for path in tracked():
        if path.startswith(("docs/", "benchmarks/")) and path.endswith((".png", ".webp", ".jpg")):
            data = (ROOT / path).read_bytes()
            if path.startswith("docs/images/cameras/"):  # some cameras have similar pictures
                data += path.encode()
            assert seen.setdefault(data, path) == path, f"{path} is {seen[data]}"
            with Image.open(ROOT / path) as picture:
                assert picture.width <= WIDEST, f"{path} is {picture.width} pixels wide, {WIDEST} are shown"


def test_charts_get_few_colours_if_none_changes_much():
    ramp = np.linspace(0, 255, 256).astype(np.uint8)
    grey = Image.fromarray(np.repeat(np.tile(ramp, (20, 1))[..., None], 3, axis=2))
    assert len(with_palette(grey).getcolors()) == 64
    colours = np.stack(np.meshgrid(*[ramp[::16]] * 3), axis=-1).reshape(64, 64, 3)
    assert len(with_palette(Image.fromarray(colours)).getcolors()) > 64


def test_charts_get_a_palette_and_photographs_keep_their_colours(tmp_path):
    chart = np.full((20, 2000, 4), 255, np.uint8)
    chart[5:15, :, :3] = (255, 0, 0)
    Image.fromarray(chart).save(tmp_path / "chart.png")
    write_picture(tmp_path / "chart.png", tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as picture:
        assert (picture.mode, picture.size) == ("P", (1500, 15))
        assert picture.convert("RGB").getpixel((700, 7)) == (255, 0, 0)
        assert picture.convert("RGB").getpixel((700, 0)) == (255, 255, 255)
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    write_picture(tmp_path / "photo.png", noise)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "photo.png")), noise)
    write_picture(tmp_path / "photo.webp", noise, lossless=True)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "photo.webp")), noise)
    exact = (tmp_path / "photo.webp").stat().st_size
    write_picture(tmp_path / "photo.webp", noise)
    assert (tmp_path / "photo.webp").stat().st_size < exact
    write_picture(tmp_path / "photo.jpg", np.repeat(np.repeat(noise[:4, :4], 16, 0), 16, 1))
    assert Image.open(tmp_path / "photo.jpg").format == "JPEG"
    with pytest.raises(ValueError, match=r"\.png, \.webp or \.jpg, not .*photo\.gif"):
        write_picture(tmp_path / "photo.gif", noise)
