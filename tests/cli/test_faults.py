"""Command line with bad input, interrupts and full disks: one line, exit code 2, no file lost."""

import http.client
import json
import os
import pkgutil
import signal
import struct
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest

from codec import encode_take
from ii_core import IICamera, IIPicture, video_of
from ii_core.base.files import MAX_TEXT, write_image
from ii_core.camera.camera import MOST_ALONG
from ii_core.picture.picture import sidecar
from tests.support.processes import hear_interrupts, in_one_process

SMALL = ("render", "objects", "--scale", 128)
COMMAND = [sys.executable, "-m", "raytrace_ii.cli"]


@pytest.fixture
def picture(tmp_path):
    """64×32 px, 8×4 lenses."""
    path = tmp_path / "p.png"
    pixels = np.random.default_rng(0).integers(0, 256, (32, 64, 3), np.uint8)
    IIPicture(pixels, (8, 4), (8, 8)).save(path)
    return path


def state(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# Outputs


@pytest.mark.parametrize(
    ("mine", "command"),
    [
        ("out.png.json", (*SMALL, "-o", "out.png")),
        ("out.png.json", ("decode", "p.ii", "-o", "out.png")),
        ("out.png.json", ("regular", "p.png", "-o", "out.png")),
        ("out.png.json", ("import", "p.png", "--ei-pixels", "8x8", "-o", "out.png")),
        ("cam/L.png", ("camera", "setup1", "--scale", 128, "-o", "cam")),
        ("cam/D.png", ("camera", "setup1", "--scale", 128, "-o", "cam")),
        ("cam/W_1_0.png", ("camera", "moving-lenslets", "--scale", 32, "-o", "cam")),
        ("set/apples.png.json", ("render", "--set", "reference", "--scale", 128, "-o", "set")),
    ],
)
def test_nothing_of_the_user_is_replaced(run, refused, picture, tmp_path, monkeypatch, mine, command):
    """The old test of this name checked only the picture, not its sidecar and support images."""
    monkeypatch.chdir(tmp_path)
    if "p.ii" in command:
        assert run("encode", picture, "--qp", 40, "-o", "p.ii")[0] == 0
    (tmp_path / mine).parent.mkdir(exist_ok=True)
    (tmp_path / mine).write_text("precious")
    before = state(tmp_path)
    refused(run(*command), "--force replaces it")
    assert state(tmp_path) == before


@pytest.mark.parametrize(
    "options",
    [
        ("-o", "q.exr", "--depth", "q.exr"),
        ("-o", "q.exr", "--support", "./q.exr"),
        ("-o", "r.png", "--projection", "r.png"),
        ("-o", "r.png", "--projection", "link/r.png"),
        ("-o", "r.png", "--depth", "d.exr", "--projection", "r.png", "--force"),
    ],
)
def test_two_outputs_of_one_name_are_refused(run, refused, tmp_path, monkeypatch, options):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "link").symlink_to(".")
    refused(run(*SMALL, *options), "is to be written twice")
    assert [path.name for path in tmp_path.iterdir()] == ["link"]


def test_a_file_is_no_folder_of_other_outputs(run, refused, picture, tmp_path):
    """The plots were made, and a folder under the name of the numbers, before the error came."""
    name = tmp_path / "m.json"
    refused(run("measure", picture, picture, "--json", name, "--plots", name), "is to be a file and a folder")
    assert not name.exists()


def test_outputs_are_checked_before_a_report_is_printed(run, refused, tmp_path):
    (tmp_path / "file").touch()
    refused(run("camera", "setup1", "--scale", 64, "--report", "-o", tmp_path / "file"), "cannot write")
    (tmp_path / "L.png").touch()
    refused(run("camera", "setup1", "--scale", 64, "--report", "-o", tmp_path), "--force replaces it")


def test_a_coded_file_takes_no_name_of_a_picture(run, refused, picture):
    """With --force the coded file replaced the picture that it was made of."""
    before = picture.read_bytes()
    refused(run("encode", picture, "--bpp", 1, "-o", picture, "--force"), "is a picture's name: .ii is needed")
    assert picture.read_bytes() == before


def test_support_images_may_share_a_file(run, tmp_path):
    both = ("--depth", tmp_path / "both.exr", "--normal", tmp_path / "both.exr")
    assert run(*SMALL, "-o", tmp_path / "p.png", *both)[0] == 0


def test_components_and_their_sheet_have_different_names(run, refused, picture, tmp_path):
    command = ("components", picture, "-o", tmp_path / "c", "--sheet", tmp_path / "c" / "si_0_0.png")
    refused(run(*command), "is to be written twice")
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_devices_pipes_and_folders_are_never_replaced(run, refused, picture, tmp_path, force):
    pipe, link, folder = tmp_path / "pipe.ii", tmp_path / "null.ii", tmp_path / "folder.ii"
    os.mkfifo(pipe)
    link.symlink_to("/dev/null")
    folder.mkdir()
    for path in (pipe, link, folder):
        refused(run("encode", picture, "--qp", 40, "-o", path, *force), "cannot write")
    assert pipe.is_fifo() and link.is_symlink() and folder.is_dir() and not os.path.isfile("/dev/null")
    for command in (("decode", pipe), ("extract", pipe), ("components", pipe)):
        refused(run(*command, "-o", tmp_path / "out.png"), "a regular file is needed")


# Sizes


def bomb(path, width, height):
    """Return a small PNG whose header states a large size."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    filling = chunk(b"fiLl", bytes(8 << 20))  # OpenImageIO refuses headers that a file cannot live up to
    pixels = chunk(b"IDAT", zlib.compress(bytes(1000)))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + header + filling + pixels + chunk(b"IEND", b""))


LIMITED = """
import resource
import numba, codec, metrics, ii_core.picture.picture  # what they need is there before the limit is set
used = int(next(line for line in open("/proc/self/status") if line.startswith("VmData")).split()[1]) * 1024
resource.setrlimit(resource.RLIMIT_DATA, (used + (1 << 29),) * 2)
"""


@pytest.mark.slow
def test_sizes_in_headers_are_checked_before_decoding(picture, refused, tmp_path):
    bomb(picture, 40000, 40000)
    IIPicture(np.zeros((32, 64, 3), np.uint8), (8, 4), (8, 8)).save(tmp_path / "good.png")
    bomb(tmp_path / "bare.png", 40000, 40000)
    good = tmp_path / "good.png"
    said = {
        ("encode", picture, "--qp", 30, "-o", tmp_path / "x.ii"): "this one has 40000×40000",
        ("measure", good, tmp_path / "bare.png"): "40000×40000 px of 3 channels",
        ("measure", good, good, "--mask", tmp_path / "bare.png"): "64×32 are needed",
    }
    for result, words in zip(in_one_process(*said, before=LIMITED), said.values(), strict=True):
        refused(result, words)


def test_pictures_larger_than_the_memory_are_refused(run, refused, tmp_path):
    bomb(tmp_path / "m.png", 2_000_000, 2_000_000)
    command = ("import", tmp_path / "m.png", "--ei-pixels", "8x8", "-o", tmp_path / "o.png")
    code, _, err = run(*command)
    assert code == 2 and err.count("\n") == 1  # OpenImageIO may refuse first
    bomb(tmp_path / "m.png", 100_000, 100_000)
    code, _, err = run(*command)
    assert code == 2 and err.count("\n") == 1, err


@pytest.mark.parametrize("pixels", [[3_000_000_000, 1], [1 << 19, 1 << 19]])
def test_cameras_have_a_largest_size(run, refused, tmp_path, pixels):
    path = tmp_path / "c.json"
    path.write_text(json.dumps({"pixels": pixels, "lenses": [1, 1], "pixel_pitch_mm": 0.1, "gap_mm": 3}))
    refused(run("camera", path, "-o", tmp_path / "maps"), f"at most {MOST_ALONG} a side")
    assert not (tmp_path / "maps").exists()


def test_text_files_are_read_up_to_a_limit(run, refused, picture, tmp_path):
    views = tmp_path / "views"
    views.mkdir()
    for i in range(4):
        write_image(views / f"input_Cam{i:03}.png", np.full((8, 8, 3), i, np.uint8))
    command = ("import", views, "-o", tmp_path / "o.png")
    (views / "parameters.cfg").symlink_to("/dev/zero")
    refused(run(*command), "a regular file is needed")
    (views / "parameters.cfg").unlink()
    (views / "parameters.cfg").write_bytes(b"[extrinsics]\n" + b"# more\n" * 200_000)
    refused(run(*command), "longer than 1 MiB")
    code = ("encode", picture, "--qp", 30, "-o", tmp_path / "x.ii")
    known = json.loads(sidecar(picture).read_text())
    for text, words in {
        "[" * 200_000: "nested too deeply",
        " " * (MAX_TEXT + 1): "longer than 16 MiB",
        json.dumps({**known, "lenses": [8, 10**400]}): "a number of 401 digits",
        json.dumps({**known, "camera": {"pixels": "64"}}): "p.png.json",
        json.dumps([]): "no II-picture structure",
    }.items():
        sidecar(picture).write_text(text)
        refused(run(*code), words)


# Tracebacks


def test_an_irregular_picture_is_no_quilt(run, refused, tmp_path):
    camera = IICamera(pixels=(100, 131), lenses=(8, 10), pixel_pitch_mm=0.4, gap_mm=11.7, lattice="hexagonal")
    path = tmp_path / "hexagonal.png"
    IIPicture(np.zeros((131, 100, 3), np.uint8), camera.lenses, camera.ei_pixels, camera).save(path)
    for to in ("quilt", "views", "hci"):
        refused(run("export", path, "--to", to, "-o", tmp_path / "out"), "the structure is not regular")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"format": "ii-picture-set", "set": "reference", "scenes": null}',
        '{"format": "ii-picture-set", "set": "reference", "scenes": {"apples": 3}}',
        '{"format": "ii-picture-set", "set": "reference", "scenes": {"car": {"products": {"flat": {"key": "x"}}}}}',
        '{"format": "ii-picture-set", "set": "reference", "claims": 7}',
        '{"format": "ii-picture-set", "set": "reference", "contact.png": []}',
    ],
)
def test_a_damaged_manifest_is_one_line(run, refused, tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    refused(run("render", "--set", "reference", "--scale", 128, "-o", tmp_path), "manifest.json")


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("view", "p.png", "--serve", "--port", -1), "port is -1"),
        (("view", "p.png", "--serve", "--port", 65536), "port is 65536"),
        (("display", "p.png", "-o", "f.png", "--as", "simulation", "--size", "8x0"), "size is '8x0'"),
        (("display", "p.png", "-o", "f.png", "--as", "quilt", "--tiles", "-1x4"), "tiles is '-1x4'"),
        (("display", "p.png", "-o", "f.png", "--as", "simulation", "--size", "8x99999999"), "from 1 to 65536"),
        ((*SMALL, "-o", "x.png", "--dask", "tls://127.0.0.1:9"), "no dask scheduler answers at tls://127.0.0.1:9"),
        ((*SMALL, "-o", "x.png", "--dask", "nothing://x"), "no dask scheduler answers at nothing://x"),
    ],
)
def test_strange_options_are_one_line(run, refused, picture, tmp_path, monkeypatch, command, said):
    monkeypatch.chdir(tmp_path)
    refused(run(*command), said)


UNUSED = {
    ("display", "p.png", "-o", "f.mp4"): ["--pitch inf", "--slope 1", "--centre 0", "--tiles 8x6", "--at 1,2,3"],
    ("display", "p.png", "-o", "f.png", "--as", "quilt"): ["--fps 25", "--frames 0", "--pitch 5", "--fill 1"],
    ("display", "p.png", "-o", "f.png", "--as", "lenticular"): ["--tiles 0x0", "--fps 25", "--at x"],
    ("display", "p.png", "-o", "f.png", "--as", "simulation"): ["--cone nan", "--plane inf", "--tiles 8x6"],
    ("video", "take", "-o", "out"): ["--whole", "--tiles 8x6"],
    ("video", "take", "-o", "out", "--to", "views"): ["--cone nan", "--size 0x0", "--plane nan", "--for go"],
    ("measure", "p.png", "p.png"): ["--method 1,2", "--layers 5"],
    ("measure", "p.png", "p.png", "--depth", "d.exr"): ["--method robust", "--depth-from-focus"],
    ("measure", "take", "take"): ["--depth-from-focus", "--ssim", "--method robust"],
    ("encode", "p.png", "--qp", "30", "-o", "x.ii"): ["--walk x", "--span 8", "--strip 4", "--rate-over take"],
    ("study", "p.png", "-o", "s"): ["--method robust", "--layers 5", "--depth d.exr"],
    ("study", "p.png", "-o", "s", "--orders"): ["--schemes x", "--rates 1", "--workers 0", "--measures q_view"],
    ("camera", "--solve", "pitch=0.39,gap=0.73,pixel=0.0061"): ["--scale 3", "--report", "-o cam"],
}  # fmt: skip


@pytest.mark.parametrize(("command", "option"), [(c, o) for c, several in UNUSED.items() for o in several])
def test_options_that_the_mode_does_not_use_are_refused(
    run, refused, picture, tmp_path, monkeypatch, command, option
):
    """They were accepted in silence, whatever their value."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "take").mkdir()
    name = "--output" if option.startswith("-o ") else option.split()[0]
    refused(run(*command, *option.split()), f"{name}")
    assert {path.name for path in tmp_path.iterdir()} == {"p.png", "p.png.json", "take"}


WRITERS = {
    ("video", "--to", "views"): "ii_core.write_view_folders",
    ("video", "--to", "frames"): "ii_core.IIVideo.save",
    ("export", "--to", "views"): "ii_core.write_views",
    ("export", "--to", "hci"): "ii_core.write_hci",
    ("components",): "ii_core.base.files.write_image",
}


@pytest.mark.parametrize("command", WRITERS, ids=" ".join)
def test_a_stopped_command_leaves_no_partial_folder(run, picture, tmp_path, monkeypatch, command):
    """A partial folder had the final name, and the same command refused to go on."""
    out, (name, *options) = tmp_path / "out", command
    source = tmp_path / "take" if name == "video" else picture
    if name == "video":
        video_of([IIPicture.load(picture)] * 2, fps=25).save(source)
    module, _, function = WRITERS[command].rpartition(".")
    whole = getattr(pkgutil.resolve_name(module), function)

    def stopped(*arguments, **more):
        whole(*arguments, **more)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(WRITERS[command], stopped)
        assert run(name, source, *options, "-o", out)[0] == 130
    assert not out.exists()
    code, _, err = run(name, source, *options, "-o", out)
    assert code == 0 and any(out.iterdir()), err
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.mark.slow
def test_brackets_in_names_are_printed_unchanged(run, picture, tmp_path, monkeypatch):
    """The library of bars and tables interprets brackets as markup."""
    monkeypatch.chdir(tmp_path)  # a long path would be cut at the terminal's width
    for name in ("[bold]", "[red] x", "a[1]", ":smile:"):
        coded = tmp_path / f"{name}.ii"
        IIPicture.load(picture).save(tmp_path / f"{name}.png")
        code, out, err = run("encode", tmp_path / f"{name}.png", "--qp", 40, "-o", coded)
        assert code == 0 and f"{name}.ii" in out, err
        done = run("components", coded.name, "-o", f"{name}_views")
        assert done[0] == 0 and f"{name}_views: " in done[1]
        assert run("study", tmp_path / f"{name}.png", "--orders", "-o", tmp_path / "s")[0] == 0


@pytest.mark.slow
def test_a_name_that_is_no_utf8_is_one_line(picture, tmp_path):
    strange = os.fsencode(tmp_path) + b"/\xff.png"
    os.rename(picture, strange)
    commands = ("encode", strange, "--qp", 30, "-o", "x.ii"), (*SMALL, "-o", strange + b"2.png")
    for code, _, err in in_one_process(*commands, cwd=tmp_path):
        assert code == 2 and err.count("\n") == 1, err
        assert "is no UTF-8 name" in err and "udcff" in err


def test_messages_carry_no_terminal_escapes(run, refused, picture, tmp_path):
    code, out, err = run("encode", tmp_path / "\x1b[31mred\x07.png", "--qp", 30, "-o", tmp_path / "x.ii")
    assert code == 2 and "\x1b" not in err and "\x07" not in err and "\\x1b[31mred\\x07" in err
    code, out, _ = run("encode", picture, "--qp", 40, "-o", tmp_path / "\x1b]0;title\x07.ii")
    assert code == 0 and "\x1b" not in out and "\\x1b]0;title" in out


@pytest.mark.slow
def test_a_terminal_of_ascii():
    commands = ("cameras",), ("camera", "setup1"), ("encode", "a×b.png", "-o", "c")
    found = in_one_process(*commands, PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert [code for code, *_ in found] == [0, 0, 2]
    for _, out, err in found:
        assert "Traceback" not in err and (out + err).isascii()
    assert "axb.png" in found[2][2]


# Ends


def wait_for(condition, seconds=120):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, "it does not come"
        time.sleep(0.05)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_run_within_two_seconds(tmp_path, number, code):
    """A block of 65536 pixels with 4096 samples takes minutes, and the main thread waits for its end."""
    command = ("render", "apples", "--scale", "8", "--samples", "4096", "-o", "p.png")
    with subprocess.Popen(
        [*COMMAND, *command], cwd=tmp_path, stderr=subprocess.PIPE, text=True, preexec_fn=hear_interrupts
    ) as running:
        try:
            wait_for(lambda: list(tmp_path.glob(".p*")))
            time.sleep(3)  # the scene is loaded, and threads trace
            started = time.monotonic()
            running.send_signal(number)
            assert running.wait(60) == code
            seconds = time.monotonic() - started
            said = running.stderr.read()
        finally:
            running.kill()
    assert seconds < 4, "1.5 s of grace, and what a loaded machine adds; the block would take minutes"
    assert "interrupted" in said and "Traceback" not in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_ctrl_c_ends_depth_and_leaves_no_file(tmp_path):
    """The costs of 289 views of 256×256 px take one thread ten seconds; the signal comes among them."""
    tile = np.random.default_rng(0).integers(0, 256, (256, 256, 3), np.uint8)
    IIPicture(np.tile(tile, (17, 17, 1)), (256, 256), (17, 17)).save(tmp_path / "field.png")
    command = ("depth", "field.png", "--disparity", "--range", "-9,9", "--workers", "1", "--preview", "p.png")
    with subprocess.Popen(
        [*COMMAND, *command, "-o", "d.exr"], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        preexec_fn=hear_interrupts,
    ) as running:  # fmt: skip
        try:
            time.sleep(6)
            assert running.poll() is None
            started = time.monotonic()
            running.send_signal(signal.SIGINT)
            assert running.wait(60) == 130
            seconds = time.monotonic() - started
            said = running.stderr.read()
        finally:
            running.kill()
    assert seconds < 4 and "interrupted" in said and "Traceback" not in said
    assert {file.name for file in tmp_path.iterdir()} <= {"field.png", "field.png.json"}


@pytest.fixture
def served(picture, tmp_path):
    """A served page: its process, port and folder."""
    environment = {**os.environ, "TMPDIR": str(tmp_path / "tmp")}
    (tmp_path / "tmp").mkdir()
    command = [*COMMAND, "view", str(picture), "--serve"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        port = int(process.stdout.readline().split("/")[2].split(":")[1])
        yield process, port, tmp_path / "tmp"
        process.kill()


def asked(port, path, host):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.putrequest("GET", path, skip_host=True)
    if host is not None:
        connection.putheader("Host", host)
    connection.endheaders()
    return connection.getresponse().status


@pytest.mark.slow
def test_only_this_machines_own_names_are_served(served):
    """A site whose name resolves to 127.0.0.1 could read the picture (DNS rebinding)."""
    process, port, folder = served
    for host in (f"127.0.0.1:{port}", f"localhost:{port}", f"LOCALHOST:{port}"):
        assert asked(port, "/", host) == 200
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", "", None):
        assert asked(port, "/", host) == 421, host
    for path in ("/%00", "/a%00b", "/index.html%00.png"):
        assert asked(port, path, f"localhost:{port}") == 400
    assert asked(port, "/../../etc/passwd", f"localhost:{port}") == 404
    assert asked(port, "/", f"localhost:{port}") == 200, "it still serves"
    assert list(folder.iterdir())
    process.terminate()
    assert process.wait(20) == 143
    assert process.stderr.read().count("Traceback") == 0
    assert list(folder.iterdir()) == []


@pytest.mark.slow
def test_addresses_of_no_scheduler_are_one_line_to_the_end_of_the_process(picture, refused):
    """Only a separate process shows the nine lines that a client printed at its end."""
    addresses = "tls://", "tls://127.0.0.1:9", "nothing://x"
    command = ("study", picture, "-o", picture.parent / "study", "--rates", "1", "--dask")
    for address, result in zip(addresses, in_one_process(*((*command, a) for a in addresses)), strict=True):
        refused(result, f"no dask scheduler answers at {address}: ")


# -- commands that write into folders: a refused one leaves the disk as it was


TAKE = ("render", "apples", "--scale", 128, "-o", "out/take", "--frames")
SET = ("render", "--set", "reference", "--scale", 128, "-o", "out/set")
STUDY = ("study", "p.png", "-o", "out/study")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A picture, one of hexagonal lenses, an even one, a take, and a coded take that is damaged."""
    folder = tmp_path_factory.mktemp("files")
    pixels = np.random.default_rng(0).integers(0, 256, (32, 64, 3), np.uint8)
    picture = IIPicture(pixels, (8, 4), (8, 8))
    picture.save(folder / "p.png")
    lengths = {"pixels": (64, 32), "lenses": (8, 4), "pixel_pitch_mm": 0.1, "gap_mm": 1.5}
    hexagonal = IICamera(**lengths, lattice="hexagonal")
    IIPicture(pixels, hexagonal.lenses, hexagonal.ei_pixels, hexagonal).save(folder / "hex.png")
    write_image(folder / "even.png", np.full((64, 64, 3), 9, np.uint8))
    video = video_of([picture])
    video.save(folder / "take")
    encode_take(video, "si-h264", qp=40, path=folder / "t.ii")
    (folder / "damaged.ii").write_bytes((folder / "t.ii").read_bytes()[:-1] + b"?")
    return folder


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("camera", "none", "-o", "out/cam"), "unknown camera"),
        (("calibrate", "none.png", "-o", "out/cam"), "none.png does not exist"),
        (("calibrate", "even.png", "-o", "out/cam"), "the picture is even"),
        ((*TAKE, "5..2"), "FIRST..LAST with 0 <= FIRST <= LAST <= 47, the last frame, is needed"),
        ((*TAKE, "48"), "FIRST..LAST with 0 <= FIRST <= LAST <= 47, the last frame, is needed"),
        ((*TAKE, "0", "--samples", "0"), "samples is 0"),
        ((*TAKE, "0", "--samples", "1..4"), "two powers of 2 are needed"),
        ((*TAKE, "0", "--depth", "d.png"), ".png takes uint8, uint16"),
        ((*TAKE, "0", "--at", "1e300,0,0"), "at_mm is [1e+300, 0.0, 0.0]: coordinates up to 1e+09 mm are needed"),
        ((*SET, "--samples", "0"), "samples is 0"),
        ((*SET, "--noise", "-1"), "noise sigma is -1"),
        (("components", "hex.png", "-o", "out/si"), "is not regular"),
        (("export", "hex.png", "--to", "views", "-o", "out/views"), "is not regular"),
        (("export", "hex.png", "--to", "hci", "-o", "out/hci"), "is not regular"),
        (("display", "hex.png", "--as", "quilt", "--size", "64x8", "-o", "q.png"), "is not regular"),
        (("measure", "p.png", "none.png", "--plots", "out/plots"), "none.png does not exist"),
        (("measure", "take", "none", "--plots", "out/plots"), "none is no folder of frames"),
        ((*STUDY, "--rates", "-1"), "positive rates are needed"),
        ((*STUDY, "--rates", "1", "--schemes", "jpeg2000", "--workers", "0"), "workers is 0"),
        (("study", "hex.png", "--orders", "-o", "out/study"), "is not regular"),
        (("video", "take", "--to", "frames", "--fps", "0", "-o", "out/frames"), "fps is 0"),
        (("video", "t.ii", "--to", "views", "--fps", "-1", "-o", "out/views"), "fps is -1"),
        (("video", "damaged.ii", "--to", "films", "-o", "out/films"), "is damaged"),
        (("decode", "t.ii", "--max-pixels", "1", "-o", "out/frames"), "raise max_pixels"),
    ],
    ids=lambda value: "-".join(map(str, value)).replace("/", "_") if isinstance(value, tuple) else "",
)
def test_a_refused_command_leaves_nothing(run, refused, files, monkeypatch, command, said):
    monkeypatch.chdir(files)
    before = {*files.rglob("*")}
    refused(run(*command), said)
    assert {*files.rglob("*")} == before


def test_a_coded_take_is_one_by_any_name(run, refused, files, tmp_path):
    coded = tmp_path / "take.coded"
    coded.write_bytes((files / "t.ii").read_bytes())
    assert run("video", coded, "--to", "frames", "-o", tmp_path / "frames")[0] == 0
    assert "Q_global" in run("measure", tmp_path / "frames", coded)[1]
    refused(run("look", coded, "-o", tmp_path / "view.png"), "is a take: raytrace-ii decode")


def test_an_existing_folder_is_kept(run, refused, files, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    refused(run("calibrate", files / "even.png", "-o", "empty/cam/deep"), "the picture is even")
    assert [path.name for path in tmp_path.rglob("*")] == ["empty"]


def test_an_interrupted_command_leaves_no_empty_folder(run, files, tmp_path, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("ii_core.write_views", interrupted)
    assert run("export", files / "p.png", "-o", tmp_path / "views")[0] == 130
    assert not (tmp_path / "views").exists()
