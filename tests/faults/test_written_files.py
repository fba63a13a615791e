"""Files as units: picture and sidecar, equal bytes, remains of dead processes, pipes and devices."""

import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from benchmarks.records import ROOT
from codec import encode
from codec.inspect.extract import extract
from ii_core import IIPicture, preset
from ii_core.base.atomic import atomic_paths
from ii_core.base.files import atomic_path, image_header, pixel_digest, read_image, read_json, write_image, write_json
from ii_core.camera.maps import write_maps
from ii_core.display.view_sheets import plot_pair, plot_views
from ii_core.formats.arrays import write_array
from ii_core.picture.picture import sidecar
from metrics import rd_chart, read_study, write_csv, write_latex, write_study
from raytrace_ii import load_scene, render
from raytrace_ii.cli.ending import ends_soon

RNG = np.random.default_rng(5)


def picture(lenses=(8, 4), value=None):
    pixels = RNG.integers(0, 256, (32, 64, 3), np.uint8) if value is None else np.full((32, 64, 3), value, np.uint8)
    return IIPicture(pixels, lenses, (64 // lenses[0], 32 // lenses[1]))


@pytest.mark.parametrize("end", [".png", ".tif", ".exr", ".hdr"])
def test_picture_and_sidecar_are_bound(tmp_path, end):
    path = tmp_path / f"p{end}"
    one = picture() if end in (".png", ".tif") else picture().with_pixels(np.zeros((32, 64, 3), np.float32) + 0.3)
    one.save(path)
    loaded = IIPicture.load(path)
    assert loaded.lenses == (8, 4)
    assert json.loads(sidecar(path).read_text())["pixels_blake2b"] == pixel_digest(loaded.pixels)


def test_a_sidecar_of_other_pixels_is_refused(tmp_path, run, refused):
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    picture().save(a)
    picture((16, 8)).save(b)
    sidecar(b).replace(sidecar(a))
    with pytest.raises(ValueError, match=r"a\.png and a\.png\.json do not belong together"):
        IIPicture.load(a)
    refused(run("encode", a, "--qp", 30, "-o", tmp_path / "a.ii"), "do not belong together")
    assert IIPicture.load(a, lenses=(8, 4), ei_pixels=(8, 8)).lenses == (8, 4)
    # a pair written before there was a binding, or by another program, has none
    old = json.loads(sidecar(a).read_text())
    del old["pixels_blake2b"]
    sidecar(a).write_text(json.dumps(old))
    assert IIPicture.load(a).lenses == (16, 8)


def test_the_same_pixels_in_another_coding_keep_their_sidecar(tmp_path):
    path = tmp_path / "p.png"
    picture().save(path)
    before = path.read_bytes()
    write_image(path, np.ascontiguousarray(read_image(path)))
    from PIL import Image

    Image.open(path).save(path, compress_level=9)  # as an optimiser of PNG does
    assert path.read_bytes() != before
    assert IIPicture.load(path).lenses == (8, 4)


KILLED = """
import os, sys
from ii_core import IIPicture, IICamera, preset
from raytrace_ii import load_scene, render_to
import numpy as np
after, how = int(sys.argv[1]), sys.argv[2]
replace, calls = os.replace, []
def dies(*names):
    replace(*names)
    calls.extend(name for name in names if os.path.basename(name).startswith("p.png"))  # numba has files, too
    if len(calls) == after:
        os._exit(9)
os.replace = dies
if how == "save":
    IIPicture(np.full((32, 64, 3), 7, np.uint8), (16, 8), (4, 4)).save("p.png")
else:
    camera = IICamera(pixels=(64, 32), lenses=(16, 8), pixel_pitch_mm=1.0, gap_mm=9.0)
    render_to("p.png", load_scene("cuboid"), camera)
"""


@pytest.mark.slow
@pytest.mark.parametrize("how", ["save", "render_to"])
@pytest.mark.parametrize("bound", [True, False])
def test_a_kill_between_the_two_never_leaves_a_pair_that_loads_wrongly(tmp_path, how, bound):
    """Before, the new picture stood first beside the old sidecar, and loaded with the old structure."""
    path = tmp_path / "p.png"
    picture().save(path)
    if not bound:
        data = json.loads(sidecar(path).read_text())
        del data["pixels_blake2b"]
        sidecar(path).write_text(json.dumps(data))
    before = read_image(path)
    done = subprocess.run([sys.executable, "-c", KILLED, "1", how], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 9, done.stderr
    np.testing.assert_array_equal(read_image(path), before)
    with pytest.raises(ValueError, match="do not belong together"):
        IIPicture.load(path)


def test_two_writers_of_one_name_leave_a_pair_or_nothing_that_loads(tmp_path):
    path, pictures = tmp_path / "p.png", {(8, 4): picture((8, 4), 1), (16, 8): picture((16, 8), 2)}
    for first, second in (((8, 4), (16, 8)), ((16, 8), (8, 4))):
        pictures[first].save(path)
        left = sidecar(path).read_bytes()
        pictures[second].save(path)
        sidecar(path).write_bytes(left)  # the first writer's came last
        with pytest.raises(ValueError, match="do not belong together"):
            IIPicture.load(path)


def test_outputs_appear_together_or_not_at_all(tmp_path):
    names = [tmp_path / "a", tmp_path / "b"]
    with pytest.raises(OSError, match="no"), atomic_paths(names) as temporaries:
        temporaries[0].write_text("x")
        raise OSError("no")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="is to be written twice"), atomic_paths([names[0], tmp_path / "." / "a"]):
        pass


def content(name):
    kinds = {".exr": "float32", ".tif": "uint16", ".png": "uint8"}
    return np.arange(90).reshape(5, 6, 3).astype(kinds[name[-4:]])


@pytest.mark.slow
def test_equal_content_makes_equal_files(tmp_path):
    """EXR, TIFF and MATLAB's files had the time of day in them, Matroska random numbers."""
    field = picture()
    coded = encode(field, "si-h264", qp=30)
    made = []
    for folder in ("one", "two"):
        time.sleep(1.1 * bool(made))  # dates are of seconds
        (tmp_path / folder).mkdir()
        for name in ("a.exr", "a.tif", "a.png"):
            write_image(tmp_path / folder / name, content(name))
        for name in ("a.mkv", "a.mp4"):
            extract(coded, tmp_path / folder / name)
        for name in ("a.mat", "a.h5"):
            write_array(field, tmp_path / folder / name)
        made.append({path.name: path.read_bytes() for path in (tmp_path / folder).iterdir()})
    assert len(made[0]) == 7
    for name, data in made[0].items():
        assert data == made[1][name], name
        assert not re.search(rb"20\d\d:\d\d:\d\d", data), name


DIES = """
import os, sys, signal
from pathlib import Path
from ii_core.base.atomic import atomic_path, folder_beside
with atomic_path(sys.argv[1]) as temporary, folder_beside(Path(sys.argv[1])) as folder:
    temporary.write_text("half")
    (folder / "light.exr").write_text("half")
    print(temporary.name, flush=True)
    os.kill(os.getpid(), signal.SIGKILL) if sys.argv[2] == "dies" else sys.stdin.read()
"""
NEXT = "import sys; from ii_core.base.files import write_json; write_json(sys.argv[1], 1)"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc to tell the dead from the living")
def test_only_temporary_files_of_dead_processes_are_removed(tmp_path):
    mine = tmp_path / ".mine.ii-tmp-notes.txt"
    mine.write_text("a user's")
    dead = subprocess.run([sys.executable, "-c", DIES, tmp_path / "a.txt", "dies"], capture_output=True, text=True)
    assert dead.returncode == -signal.SIGKILL and (tmp_path / dead.stdout.strip()).exists()
    (left,) = (path for path in tmp_path.iterdir() if path.is_dir())  # `render --spread` works in such a folder
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", DIES, tmp_path / "b.txt", "lives"], text=True, **pipes) as alive:
        held = tmp_path / alive.stdout.readline().strip()
        other = held.with_name(re.sub(r"ii-tmp-[0-9a-f]{8}", "ii-tmp-00000000", dead.stdout.strip()))
        other.write_text("of another machine, whose processes nobody here can see")
        subprocess.run([sys.executable, "-c", NEXT, tmp_path / "c.json"], check=True)
        assert not (tmp_path / dead.stdout.strip()).exists() and not left.exists()
        assert held.exists() and mine.exists() and other.exists()
        assert any(path.is_dir() for path in tmp_path.iterdir())  # that of the living process
        alive.communicate("")
    assert not any(path.is_dir() for path in tmp_path.iterdir())
    assert (tmp_path / "b.txt").read_text() == "half"


@pytest.mark.parametrize("name", ["close", "unlink"])
def test_an_interrupt_at_any_instruction_leaves_no_temporary_file(tmp_path, monkeypatch, name):
    """Right after the file is there, and in the cleanup itself: the end of the command removes what is left."""
    real = getattr(os, name)

    def interrupted(*arguments, **options):
        monkeypatch.setattr(os, name, real)
        if name == "close":
            real(*arguments, **options)
        raise KeyboardInterrupt

    def write():
        monkeypatch.setattr(os, name, interrupted)
        with atomic_path(tmp_path / "picture.png"):
            raise ValueError("the block fails")

    with pytest.raises(KeyboardInterrupt), ends_soon():
        write()
    assert not list(tmp_path.iterdir())


def test_devices_and_pipes_are_neither_written_nor_read(tmp_path):
    pipe = tmp_path / "pipe.json"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match=r"pipe\.json: it is a device, pipe or socket"):
        write_json(pipe, 1)
    with pytest.raises(OSError, match="a regular file is needed"):
        read_json(pipe)
    os.mkfifo(tmp_path / "p.png")
    for read in (read_image, image_header, IIPicture.load):
        with pytest.raises(OSError, match="a regular file is needed"):
            read(tmp_path / "p.png")
    (tmp_path / "link").symlink_to("/dev/null")
    with pytest.raises(OSError, match="it is a device"), atomic_path(tmp_path / "link"):
        pass
    assert pipe.is_fifo() and (tmp_path / "link").is_symlink()


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real.json").write_text("0")
    (tmp_path / "link.json").symlink_to("real.json")
    write_json(tmp_path / "link.json", 5)
    assert (tmp_path / "link.json").is_symlink() and read_json(tmp_path / "real.json") == 5


@pytest.mark.slow
def test_parallel_calls_give_the_same_results():
    camera = preset("setup1", scale=128)
    names = ("objects", "cuboid", "apples", "objects")

    def made(name):
        shot = render(load_scene(name), camera, samples=2, workers=2).picture
        return shot.pixels, encode(shot, "si-h264", qp=30).payload

    alone = {name: made(name) for name in set(names)}
    with ThreadPoolExecutor(4) as pool:
        for name, (pixels, payload) in zip(names, pool.map(made, names), strict=True):
            np.testing.assert_array_equal(pixels, alone[name][0])
            assert payload == alone[name][1]


def test_every_writer_returns_the_path_it_wrote(tmp_path):
    grey, camera = picture(value=90), preset("setup1", scale=32)
    rendered = IIPicture(np.zeros((*camera.pixels[::-1], 3), np.uint8), camera.lenses, camera.ei_pixels, camera)
    coded = encode(grey, "jpeg", quality=50)
    fields = {"options": {}, "target_bpp": 1.0, "reached": True, "nbytes": 9}
    times = {"encode_seconds": 0.1, "decode_seconds": 0.1}
    points = [{"scheme": "jpeg", "bpp": bpp, "q_global": 30.0 + bpp, **fields, **times} for bpp in (0.5, 1.0)]
    writers = {
        "p.png": lambda path: grey.save(path),
        "a.png": lambda path: write_image(path, grey.pixels),
        "a.json": lambda path: write_json(path, [1]),
        "a.ii": lambda path: coded.save(path),
        "maps": lambda path: write_maps([camera], path),
        "v.png": lambda path: plot_views(rendered, rendered, path),
        "s.png": lambda path: plot_pair(rendered, path),
        "study.json": lambda path: write_study(path, "grey", points, picture=grey),
        "study.csv": lambda path: write_csv(path, points),
        "table.tex": lambda path: write_latex(path, [{"scheme": "jpeg"}]),
        "chart.png": lambda path: rd_chart(read_study(tmp_path / "study.json"), path),
    }
    for name, write in writers.items():
        assert write(str(tmp_path / name)) == tmp_path / name
        assert (tmp_path / name).exists()


# -- ctrl-C while the library works: control returns within two seconds, even from compiled code


SCRIPT = """
import os, signal, sys, threading, time
import numpy as np
from codec import encode
from ii_core import IIPicture, preset
from raytrace_ii import load_scene, render
from raytrace_ii.cli.ending import ends_soon

signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's & makes ignored
scene, camera = load_scene("cuboid"), preset("setup1", scale=8)
picture = IIPicture(np.random.default_rng(0).integers(0, 256, (1024, 1024, 3), np.uint8), (64, 64), (16, 16))
small = IIPicture(picture.pixels[:64, :64].copy(), (4, 4), (16, 16))
started = []

def interrupt():
    started.append(time.monotonic())
    os.kill(os.getpid(), signal.SIGINT)

def work():
    {work}

{warm}
threading.Timer(1.5, interrupt).start()
try:
    work()
    print("finished")
except KeyboardInterrupt:
    print(time.monotonic() - started[0], flush=True)
"""
WORKS = {
    # A block of 65536 pixels with 4096 samples takes minutes, during which threads do not return to Python.
    "render": ("render(scene, camera, samples=4096)", "render(scene, preset('setup1', scale=128))"),
    # One call of a library that takes many seconds.
    "encode": ("encode(picture, 'jpegxl:effort=9', bpp=2.0)", "encode(small, 'jpegxl', bpp=2.0)"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WORKS)
def test_ctrl_c_returns_within_two_seconds(name):
    """On b1dc540 render waited for the blocks of its threads, and encode for the library's call."""
    work, warm = WORKS[name]
    script = textwrap.dedent(SCRIPT).format(work=work, warm=warm)
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert run.stdout and run.stdout != "finished\n", run.stderr
    assert float(run.stdout) < 2.0
    assert "Traceback" not in run.stderr
