"""Full disk: every writer reports it and leaves whole files or none.

A limit on the size of files simulates the full disk. libpng and libtiff report neither of the two; tests that only
interrupted a run did not find this.
"""

import json
import subprocess
import sys

import pytest

from ii_core import IIPicture
from ii_core.base.files import read_image
from tests.support.full_disk import limited

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="RLIMIT_FSIZE is of POSIX")

WRITERS = """
import json, os, resource, shutil, sys
from pathlib import Path
import numpy as np
from codec import Plan, encode, encode_take, extract
from ii_core import (
    IICamera, IIPicture, preset, video_of, write_hci, write_maps, write_quilt, write_view_folders, write_views)
from ii_core.display.film import write_animation
from ii_core.base.files import write_image, write_json
from ii_core.formats.pfm import write_pfm
from ii_core.formats.pleno import write_pleno_views
from ii_core.base.json_lines import append_record
from ii_core.waves.spread import spread_maps
from ii_core.waves.spread_files import write_spread
from metrics import write_csv, write_latex, write_study
from metrics.benchmark.result import write_result
from metrics.observers import Options, Stimulus, read_results, verdict, write_test
from metrics.observers.simulated import write_simulated
from metrics.plots.opinion_chart import opinion_chart
from ii_core.display.viewer import write_viewer
from ii_core.display.figure import new_figure, save
from raytrace_ii import load_scene, render_to
from raytrace_ii.rendering import contact_sheet

rng = np.random.default_rng(1)
noise = rng.integers(0, 256, (96, 160, 3), np.uint8)
camera = IICamera(pixels=(160, 96), lenses=(20, 12), pixel_pitch_mm=0.4, gap_mm=6.0)
picture = IIPicture(noise, camera.lenses, camera.ei_pixels, camera)
floats = picture.with_pixels(noise.astype(np.float32) / 255)
coded, volume = (encode(picture, scheme, bpp=8) for scheme in ("si-h264", "jpeg2000"))
scene, shots = load_scene("cuboid"), preset("setup1", scale=64)
video = video_of([picture, picture])
take = encode_take(video, "si-h264:rate=cq", qp=20, plan=Plan(span=1))
stimuli = [Stimulus(scene="a", name=str(i), picture=picture, reference=i == 0, measures={"q_global": 20.0 + i})
           for i in range(6)]
plan = write_test("test.html", stimuli, Options(show="front", observers=2))
Path("answers").mkdir()
judged = verdict(read_results(write_simulated("answers", plan, [5.0, 4.5, 4.0, 3.0, 2.0, 1.0], 4)))
rows = [{"scheme": f"s{i}", "value": str(i)} for i in range(300)]

def image(dtype):
    pixels = noise if dtype == "uint8" else (noise * 257.0).astype(dtype)
    return lambda path: write_image(path, pixels)

def frames():
    return (rng.integers(0, 256, (64, 64, 3), np.uint8) for _ in range(12))

def chart(path):
    figure = new_figure(4, 3)
    figure.add_subplot().plot(rng.random(3000))
    save(figure, path)

def support(path):
    return render_to(None, scene, shots, support=dict.fromkeys(("depth", "normal"), path))

writers = {
    **{f"{d}{e}": image(d) for d in ("uint8", "uint16") for e in (".png", ".tif")},
    **{f"float32{e}": image("float32") for e in (".tiff", ".exr", ".hdr")},
    "picture.png": picture.save, "picture.tif": picture.save, "picture.exr": floats.save,
    "numbers.json": lambda path: write_json(path, rng.random(3000).tolist()),
    "coded.ii": coded.save, "still.ii": volume.save,
    **{f"stream{e}": lambda path: extract(coded, path) for e in (".mkv", ".mp4", ".h264")},
    **{f"film{e}": lambda path: write_animation(path, frames()) for e in (".mp4", ".gif", ".webp")},
    **{f"maps_{f}": lambda path, f=f: write_maps([camera], path, format=f) for f in ("png16", "png8", "exr", "hdr")},
    "spread": lambda path: (write_maps([camera], path), write_spread([spread_maps(camera, 50.0)], path)),
    "take.ii": take.save, "frames": lambda path: video.save(path),
    "take_coded.ii": lambda path: encode_take(video, "si-h264:rate=cq", qp=20, plan=Plan(span=1), path=path),
    "films": lambda path: write_view_folders(video, path),
    "answers": lambda path: (path.mkdir(), write_simulated(path, plan, [5.0, 4.5, 4.0, 3.0, 2.0, 1.0], 2)),
    "log.jsonl": lambda path: append_record(path, {"values": list(range(300))}),
    "test.html": lambda path: write_test(path, stimuli, Options(show="front", observers=2)),
    "opinions.png": lambda path: opinion_chart(judged, path),
    "result.json": lambda path: write_result(path, {"pictures": [{"name": "x", "points": points}]}),
    "study.json": lambda path: write_study(path, "x", points, picture=picture),
    "views": lambda path: (path.mkdir(), write_views(picture, path)),
    **{f"pleno_{k}": lambda path, k=k: write_pleno_views(picture, path, k) for k in ("ppm", "pgx", "png")},
    "hci": lambda path: (path.mkdir(), write_hci(picture, path, depth=rng.random((96, 160)))),
    "quilt.png": lambda path: write_quilt(picture, path),
    "map.pfm": lambda path: write_pfm(path, rng.random((40, 60)).astype(np.float32)),
    "page.html": lambda path: write_viewer(path, picture),
    **{f"chart{e}": chart for e in (".png", ".pdf", ".svg")},
    "table.csv": lambda path: write_csv(path, [dict(row) for row in points]),
    "table.tex": lambda path: write_latex(path, rows, "caption"),
    "shot.png": lambda path: render_to(path, scene, shots),
    "shot.tif": lambda path: render_to(path, scene, shots, dtype="uint16"),
    "shot.exr": lambda path: render_to(path, scene, shots, dtype="float32"),
    "support.exr": support,
}
points = [
    {"scheme": "a", "target_bpp": 1.0, "bpp": 1.0, "q_global": 30.0, "reached": True, "qp": i, "encode_seconds": 1.0,
     "decode_seconds": 1.0, "nbytes": 10, "options": {}, "coder": "x", "version": "1"} for i in range(300)]
only = sys.argv[1:]
hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
for name, write in writers.items():
    folder = Path(name + "_whole")
    folder.mkdir()
    rng = np.random.default_rng(2)
    write(folder / name)
    whole = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    largest = max(map(len, whole.values()))
    found = []
    for limit in sorted({1, largest // 2, largest - 100, largest - 1}):
        cut = Path(f"{name}_{limit}")
        cut.mkdir()
        rng = np.random.default_rng(2)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            write(cut / name)
            said = None
        except OSError as error:
            said = str(error)
        except Exception as error:
            said = repr(error)
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
        left = [path for path in cut.rglob("*") if path.is_file()]
        broken = [str(path) for path in left if whole.get(path.relative_to(cut)) != path.read_bytes()]
        found.append({"limit": limit, "of": largest, "said": said, "broken": broken})
        shutil.rmtree(cut)
    print(json.dumps({"name": name, "found": found}), flush=True)
"""
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
def outcomes(tmp_path_factory):
    """Return the outcome of each writer at four limits, the last one byte less than its largest file."""
    folder = tmp_path_factory.mktemp("disk")
    done = subprocess.run([sys.executable, "-c", WRITERS], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    return {line["name"]: line["found"] for line in map(json.loads, done.stdout.splitlines())}


def test_every_writer_is_tested(outcomes):
    assert set(outcomes) == set(NAMES)


# Writers that go on where they stopped keep these files; an incomplete last line of a log is not read. The sheet of
# camera maps is whole before point-spread functions are added.
KEPT = {
    "take_coded.ii": ("take_coded.ii.part", "take_coded.ii.part.json"),
    "log.jsonl": ("log.jsonl",),
    "spread": ("camera.json",),
}


@pytest.mark.parametrize("name", NAMES)
def test_a_full_disk_is_reported_and_no_broken_file_is_left(outcomes, name):
    for outcome in outcomes[name]:
        assert [path for path in outcome["broken"] if not path.endswith(KEPT.get(name, ()))] == [], outcome
        assert outcome["said"] and "cannot write" in outcome["said"] and "Error(" not in outcome["said"], outcome


def test_commands_end_with_one_line_and_leave_nothing(tmp_path, run):
    assert run("render", "objects", "--scale", 64, "-o", tmp_path / "p.png")[0] == 0
    assert run("encode", tmp_path / "p.png", "--qp", 20, "-o", tmp_path / "p.ii")[0] == 0
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
        done = limited(4096, *command, cwd=tmp_path)
        assert done.returncode == 2, (command, done.stdout, done.stderr)
        assert "error: cannot write out" in done.stderr and "Traceback" not in done.stderr, (command, done.stderr)
        assert sorted(path.name for path in tmp_path.iterdir()) == before, command


SET = """
import json, resource, sys
from pathlib import Path
from raytrace_ii.rendering import render_sets
from ii_core import preset
render_sets.SETS["reference"] = ("cuboid",)
render_sets.FLAT_PIXELS = 64
if len(sys.argv) > 1:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
render_sets.render_set("reference", Path("."), [preset("setup1", scale=64)], poses=[None])
"""


def test_a_set_renders_broken_files_again(tmp_path):
    done = subprocess.run([sys.executable, "-c", SET, "12000"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 1 and "cannot write" in done.stderr
    assert not list(tmp_path.iterdir())  # nothing is done: the manifest goes too
    done = subprocess.run([sys.executable, "-c", SET], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert read_image(tmp_path / "cuboid_flat.png").shape == (32, 64, 3)
    assert IIPicture.load(tmp_path / "cuboid.png").lenses == (8, 4)
