"""Full disk: every writer reports it and leaves whole files or none.

A limit on the size of files simulates the full disk. libpng and libtiff report neither of the two; tests that only
interrupted a run did not find this.
"""

import shutil
import sys

import numpy as np
import pytest

from codec import Plan, encode, encode_take, extract
from ii_core import (
    IICamera,
    IIPicture,
    preset,
    video_of,
    write_hci,
    write_maps,
    write_quilt,
    write_view_folders,
    write_views,
)
from ii_core.base.files import read_image, write_image, write_json
from ii_core.base.json_lines import append_record
from ii_core.display.figure import new_figure, save
from ii_core.display.film import write_animation
from ii_core.display.viewer import write_viewer
from ii_core.formats.pfm import write_pfm
from ii_core.formats.pleno import write_pleno_views
from ii_core.waves.spread import spread_maps
from ii_core.waves.spread_files import write_spread
from metrics import write_csv, write_latex, write_study
from metrics.benchmark.result import write_result
from metrics.observers import Options, Stimulus, read_results, verdict, write_test
from metrics.observers.simulated import write_simulated
from metrics.plots.opinion_chart import opinion_chart
from raytrace_ii import load_scene, render_to
from raytrace_ii.rendering import render_sets
from tests.support.processes import full_disk
from tests.support.slow import first_fast

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="RLIMIT_FSIZE is of POSIX")

CAMERA = IICamera(pixels=(160, 96), lenses=(20, 12), pixel_pitch_mm=0.4, gap_mm=6.0)
SHOTS = preset("setup1", scale=64)
POINTS = [
    {"scheme": "a", "target_bpp": 1.0, "bpp": 1.0, "q_global": 30.0, "reached": True, "qp": i, "encode_seconds": 1.0,
     "decode_seconds": 1.0, "nbytes": 10, "options": {}, "coder": "x", "version": "1"} for i in range(300)
]  # fmt: skip
SCORES = [5.0, 4.5, 4.0, 3.0, 2.0, 1.0]


def random():
    return np.random.default_rng(2)


def frames():
    rng = random()
    return (rng.integers(0, 256, (64, 64, 3), np.uint8) for _ in range(12))


def chart(path):
    figure = new_figure(4, 3)
    figure.add_subplot().plot(random().random(1000))
    save(figure, path)


def of_pixels(picture):
    """Writers of pictures, views, films, maps and coded files, by the name of the file or folder."""
    noise = picture.pixels
    floats = picture.with_pixels(noise.astype(np.float32) / 255)
    coded, volume = (encode(picture, scheme, bpp=8) for scheme in ("si-h264", "jpeg2000"))
    video = video_of([picture, picture])

    def image(dtype):
        pixels = noise if dtype == "uint8" else (noise * 257.0).astype(dtype)
        return lambda path: write_image(path, pixels)

    def take(path=None):
        return encode_take(video, "si-h264:rate=cq", qp=20, plan=Plan(span=1), path=path)

    whole = take()
    return {
        **{f"{d}{e}": image(d) for d in ("uint8", "uint16") for e in (".png", ".tif")},
        **{f"float32{e}": image("float32") for e in (".tiff", ".exr", ".hdr")},
        **{f"picture{e}": picture.save for e in (".png", ".tif")},
        "picture.exr": floats.save,
        "coded.ii": coded.save,
        "still.ii": volume.save,
        **{f"stream{e}": lambda path: extract(coded, path) for e in (".mkv", ".mp4", ".h264")},
        **{f"film{e}": lambda path: write_animation(path, frames()) for e in (".mp4", ".gif", ".webp")},
        **{
            f"maps_{f}": lambda path, f=f: write_maps([CAMERA], path, format=f)
            for f in ("png16", "png8", "exr", "hdr")
        },
        "spread": lambda path: (write_maps([CAMERA], path), write_spread([spread_maps(CAMERA, 50.0)], path)),
        "take.ii": whole.save,
        "take_coded.ii": take,
        "frames": video.save,
        "films": lambda path: write_view_folders(video, path),
        "views": lambda path: (path.mkdir(), write_views(picture, path)),
        **{f"pleno_{k}": lambda path, k=k: write_pleno_views(picture, path, k) for k in ("ppm", "pgx", "png")},
        "hci": lambda path: (path.mkdir(), write_hci(picture, path, depth=random().random((96, 160)))),
        "quilt.png": lambda path: write_quilt(picture, path),
        "map.pfm": lambda path: write_pfm(path, random().random((40, 60)).astype(np.float32)),
        "page.html": lambda path: write_viewer(path, picture),
    }


def of_scenes():
    """Writers of rendered pictures."""
    scene = load_scene("cuboid")
    return {
        "shot.png": lambda path: render_to(path, scene, SHOTS),
        "shot.tif": lambda path: render_to(path, scene, SHOTS, dtype="uint16"),
        "shot.exr": lambda path: render_to(path, scene, SHOTS, dtype="float32"),
        "support.exr": lambda path: render_to(None, scene, SHOTS, support=dict.fromkeys(("depth", "normal"), path)),
    }


def of_numbers(picture, folder):
    """Writers of numbers, tables, charts and tests with observers."""
    stimuli = [
        Stimulus(scene="a", name=str(i), picture=picture, reference=i == 0, measures={"q_global": 20.0 + i})
        for i in range(6)
    ]
    options = Options(show="front", observers=2)
    plan = write_test(folder / "test.html", stimuli, options)
    judged = verdict(read_results(write_simulated(folder, plan, SCORES, 4)))
    rows = [{"scheme": f"s{i}", "value": str(i)} for i in range(300)]
    return {
        "numbers.json": lambda path: write_json(path, random().random(3000).tolist()),
        "log.jsonl": lambda path: append_record(path, {"values": list(range(300))}),
        "test.html": lambda path: write_test(path, stimuli, options),
        "answers": lambda path: (path.mkdir(), write_simulated(path, plan, SCORES, 2)),
        "opinions.png": lambda path: opinion_chart(judged, path),
        "result.json": lambda path: write_result(path, {"pictures": [{"name": "x", "points": POINTS}]}),
        "study.json": lambda path: write_study(path, "x", POINTS, picture=picture),
        **{f"chart{e}": chart for e in (".png", ".pdf", ".svg")},
        "table.csv": lambda path: write_csv(path, [dict(row) for row in POINTS]),
        "table.tex": lambda path: write_latex(path, rows, "caption"),
    }


NAMES = [
    "uint8.png", "uint8.tif", "uint16.png", "uint16.tif", "float32.tiff", "float32.exr", "float32.hdr",
    "picture.png", "picture.tif", "picture.exr", "numbers.json", "coded.ii", "still.ii",
    "stream.mkv", "stream.mp4", "stream.h264", "film.mp4", "film.gif", "film.webp",
    "maps_png16", "maps_png8", "maps_exr", "maps_hdr", "views", "hci", "quilt.png", "map.pfm", "page.html",
    "chart.png", "chart.pdf", "chart.svg", "table.csv", "table.tex",
    "pleno_ppm", "pleno_pgx", "pleno_png",
    "spread", "take.ii", "frames", "take_coded.ii", "films", "test.html", "opinions.png", "answers", "result.json",
    "study.json", "log.jsonl",
    "shot.png", "shot.tif", "shot.exr", "support.exr",
]  # fmt: skip


@pytest.fixture(scope="module")
def writers(tmp_path_factory):
    """Writers by the name of the file or folder that each writes."""
    noise = np.random.default_rng(1).integers(0, 256, (96, 160, 3), np.uint8)
    picture = IIPicture(noise, CAMERA.lenses, CAMERA.ei_pixels, CAMERA)
    return {**of_pixels(picture), **of_scenes(), **of_numbers(picture, tmp_path_factory.mktemp("test"))}


def test_every_writer_is_tested(writers):
    assert set(writers) == set(NAMES)


# Writers that go on where they stopped keep these files; an incomplete last line of a log is not read. The sheet of
# camera maps is whole before point-spread functions are added.
KEPT = {
    "take_coded.ii": ("take_coded.ii.part", "take_coded.ii.part.json"),
    "log.jsonl": ("log.jsonl",),
    "spread": ("camera.json",),
}


@pytest.mark.parametrize("name", first_fast(NAMES, 12))
def test_a_full_disk_is_reported_and_no_broken_file_is_left(writers, name, tmp_path):
    """At four limits, the last one byte less than the largest file."""

    def written(folder, limit=None):
        folder.mkdir()
        if limit is None:
            writers[name](folder / name)
        else:
            with pytest.raises(OSError, match="cannot write") as said, full_disk(limit):
                writers[name](folder / name)
            assert "Error(" not in str(said.value)
        return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    whole = written(tmp_path / "whole")
    largest = max(map(len, whole.values()))
    for limit in sorted({1, largest // 2, largest - 100, largest - 1}):
        left = written(tmp_path / "cut", limit)
        broken = [str(path) for path, data in left.items() if whole.get(path) != data]
        assert [path for path in broken if not path.endswith(KEPT.get(name, ()))] == [], (limit, largest)
        shutil.rmtree(tmp_path / "cut")


@pytest.mark.slow
def test_commands_end_with_one_line_and_leave_nothing(tmp_path, monkeypatch, run):
    monkeypatch.chdir(tmp_path)
    assert run("render", "objects", "--scale", 64, "-o", "p.png")[0] == 0
    assert run("encode", "p.png", "--qp", 20, "-o", "p.ii")[0] == 0
    commands = [
        ("render", "objects", "--scale", 64, "-o", "out.png"),
        ("render", "objects", "--scale", 64, "-o", "out.tif", "--depth", "out.exr"),
        ("decode", "p.ii", "-o", "out.png"),
        ("decode", "p.ii", "-o", "out.tif"),
        ("regular", "p.png", "-o", "out.png"),
        ("export", "p.png", "--to", "mosaic", "-o", "out.png"),
        ("import", "p.png", "--ei-pixels", "16x16", "-o", "out.png"),
    ]
    before = sorted(path.name for path in tmp_path.iterdir())
    for command in commands:
        with full_disk(4096):
            code, out, err = run(*command)
        assert code == 2, (command, out, err)
        assert "error: cannot write out" in err and "Traceback" not in err, (command, err)
        assert sorted(path.name for path in tmp_path.iterdir()) == before, command


@pytest.mark.slow
def test_a_set_renders_broken_files_again(tmp_path, monkeypatch):
    monkeypatch.setitem(render_sets.SETS, "reference", ("cuboid",))
    monkeypatch.setattr(render_sets, "FLAT_PIXELS", 64)
    with pytest.raises(OSError, match="cannot write"), full_disk(12000):
        render_sets.render_set("reference", tmp_path, [SHOTS], poses=[None])
    assert not list(tmp_path.iterdir())  # nothing is done: the manifest goes too
    render_sets.render_set("reference", tmp_path, [SHOTS], poses=[None])
    assert read_image(tmp_path / "cuboid_flat.png").shape == (32, 64, 3)
    assert IIPicture.load(tmp_path / "cuboid.png").lenses == (8, 4)
