"""Command line in this process: outputs; one line and exit code 2 for bad input."""

import json
import math
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import codec
import metrics
from codec import encode
from ii_core import IICamera, IIPicture, preset, video_of
from ii_core.base.files import read_channels, read_image
from metrics import PointLog
from metrics.rates.points import FIELDS
from raytrace_ii import load_scene, render


@pytest.fixture(scope="module")
def picture(tmp_path_factory):
    """A small picture on disk: 16×8 lenses of 16×16 px, a smooth random texture."""
    camera = preset("setup1", scale=32)
    width, height = camera.pixels
    y, x = np.mgrid[0:height, 0:width]
    shade = 128 + 60 * np.sin(x / 37) * np.cos(y / 23)
    pixels = np.stack([shade, 255 - shade, 0.5 * shade], axis=-1).astype(np.uint8)
    path = tmp_path_factory.mktemp("picture") / "small.png"
    IIPicture(pixels, camera.lenses, camera.ei_pixels, camera).save(path)
    return path


@pytest.mark.parametrize(
    ("command", "name"),
    [("scenes", "apples"), ("scenes", "cuboid"), ("cameras", "setup2-64"), ("cameras", "pinhole2d")]
    + [("schemes", name) for name in ("si-h264", "ei-h264", "ri-h264", "jpeg2000")],
)
def test_lists(run, command, name):
    code, out, _ = run(command)
    assert code == 0
    assert any(line.split()[0] == name for line in out.splitlines())


def test_from_scene_to_measurement(run, tmp_path):
    shot, depth, flat = (tmp_path / name for name in ("a.png", "depth.exr", "flat.png"))
    code, out, _ = run(
        "render", "apples", "--scale", 32, "-o", shot, "--depth", depth, "--projection", flat, "--noise", 1
    )
    assert code == 0 and "primary" in out
    original = IIPicture.load(shot)
    assert original.lenses == (16, 8) and original.camera == preset("setup1", scale=32)
    z = read_image(depth)[..., 0]
    assert z.shape == original.pixels.shape[:2] and z.dtype == np.float32 and np.nanmin(z) > 0
    assert read_image(flat).shape == (512, 1024, 3)

    coded, decoded, numbers = (tmp_path / name for name in ("a.ii", "b.png", "m.json"))
    code, out, _ = run("encode", shot, "--scheme", "si-h264", "--qp", 20, "-o", coded)
    assert code == 0 and "bpp" in out
    assert run("decode", coded, "-o", decoded)[0] == 0
    code, out, _ = run("measure", shot, decoded, "--json", numbers)
    assert code == 0 and "Q_global" in out
    measured = json.loads(numbers.read_text())
    assert measured["q_global"] > 30  # a quantiser of 20 leaves errors of a few codes
    # a coded file is as good as the picture in it
    assert run("measure", shot, coded, "--json", numbers, "--force")[0] == 0
    assert json.loads(numbers.read_text())["q_global"] == measured["q_global"]


@pytest.mark.slow
def test_study_leaves_chart_numbers_and_a_table(run, picture, tmp_path):
    code, out, _ = run(
        "study",
        picture,
        "--schemes",
        "si-h264:order=row;gop=16,jpeg2000",
        "--rates",
        "0.1,0.5,2",
        "-o",
        tmp_path / "s",
    )
    assert code == 0
    assert "si-h264:order=row,gop=16" in out and "jpeg2000" in out
    study = json.loads((tmp_path / "s" / "small_rd.json").read_text())
    assert [p["target_bpp"] for p in study["points"]] == [0.1, 0.5, 2] * 2
    assert (tmp_path / "s" / "small_rd.csv").read_text().count("\n") == 7
    assert read_image(tmp_path / "s" / "small_rd.png").shape[0] > 300


@pytest.mark.slow
def test_study_of_several_pictures_with_anchor_and_default_rates(run, refused, picture, tmp_path):
    other = tmp_path / "other.png"
    IIPicture.load(picture).with_pixels(IIPicture.load(picture).pixels[:, ::-1].copy()).save(other)
    command = [
        "study",
        picture,
        other,
        "--schemes",
        "jpeg2000,si-h264,jpegxl",
        "--anchor",
        "si-h264",
        "-o",
        tmp_path / "s",
    ]
    code, out, error = run(*command)
    assert code == 0, error
    assert "mean of 2 pictures" in out and "differences against si-h264" in out
    for name in ("small", "other"):
        study = json.loads((tmp_path / "s" / f"{name}_rd.json").read_text())
        assert study["anchor"] == "si-h264"
        assert not [p for p in study["points"] if p["bpp"] > 1.02 * p["target_bpp"]]  # no floor among them
        found = study["differences"]["q_global"]
        assert set(found) == {"jpeg2000", "jpegxl"} and found["jpeg2000"]["rates"] >= 3
    means = json.loads((tmp_path / "s" / "pictures_rd.json").read_text())["differences"]["q_global"]
    gains = [each["gain"] for each in means["jpegxl"]["each"].values()]
    assert means["jpegxl"]["gain"] == pytest.approx(sum(gains) / 2) and len(gains) == 2
    refused(run(*command, "--force", "--anchor", "jpeg"), "anchor is 'jpeg': one of the schemes jpeg2000, si-h264")
    refused(run("study", picture, picture, "-o", tmp_path / "t"), "every picture needs a name of its own")
    refused(run(*command, "--depth", "z.exr", "--force"), "--depth is the map of one picture, 2 are given")
    refused(run("study", picture, "-o", tmp_path / "t", "--dask", "x:1", "--plugin", "my.py"), "--plugin is for this")


@pytest.mark.slow
def test_a_killed_study_continues_where_it_was(run, picture, tmp_path, monkeypatch):
    """On b1dc540 all points of a killed study were lost."""
    arguments = ["study", picture, "--schemes", "si-h264,si-hevc", "--rates", "0.3,0.6,1,2", "-o", tmp_path / "s"]
    log, numbers = (tmp_path / "s" / f"small_rd{end}" for end in (".points.jsonl", ".json"))
    command = [sys.executable, "-m", "raytrace_ii.cli", *map(str, arguments), "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 100
    while (not log.exists() or log.read_text().count("\n") < 2) and time.monotonic() < until:
        time.sleep(0.005)
    process.kill()
    assert process.wait() == -signal.SIGKILL and not numbers.exists()
    kept = [json.loads(line)["point"] for line in log.read_text().splitlines()]
    assert 2 <= len(kept) < 8
    with log.open("a") as file:
        file.write('{"format": "ii-')  # as a kill within a line would leave it

    coded = []
    monkeypatch.setattr(codec, "encode", lambda *a, **o: (coded.append(a), encode(*a, **o))[1])
    code, out, _ = run(*arguments)
    assert code == 0 and f"{len(kept)} points are kept" in out
    assert len(coded) == 8 - len(kept) and not log.exists()
    points = json.loads(numbers.read_text())["points"]
    whole = json.loads(json.dumps(points))
    assert all({**point, "lossless": False} in whole for point in kept)
    assert [point["target_bpp"] for point in points] == [0.3, 0.6, 1, 2] * 2


@pytest.mark.slow
@pytest.mark.parametrize("measures", ["q_global", "q_global,q_angle_min"])
def test_a_study_killed_after_its_numbers_is_drawn_from_them(run, refused, picture, tmp_path, monkeypatch, measures):
    """It refused to go on, and --force measured all again."""
    other = tmp_path / "other.png"
    IIPicture.load(picture).with_pixels(IIPicture.load(picture).pixels[:, ::-1].copy()).save(other)
    folder = tmp_path / "s"
    arguments = ["study", picture, other, "--schemes", "jpeg2000", "--rates", "0.5,1", "-o", folder]
    arguments += ["--measures", measures]
    with monkeypatch.context() as patch:
        patch.setattr(metrics, "rd_chart", stopped)
        assert run(*arguments)[0] == 130  # the first picture has numbers, the second nothing
    numbers = folder / "small_rd.json"
    assert numbers.exists() and not (folder / "small_rd.png").exists()
    before = numbers.read_bytes()
    refused(run(*arguments[:6], "0.5,2", *arguments[7:]), "small_rd.json is there already")  # of another study

    coded = []
    monkeypatch.setattr(codec, "encode", lambda *a, **o: (coded.append(a[0]), encode(*a, **o))[1])
    code, _, err = run(*arguments)
    assert code == 0, err
    assert (
        numbers.read_bytes() == before and len(coded) == 2 and (coded[0].pixels == IIPicture.load(other).pixels).all()
    )
    for stem in ("small", "other"):
        assert all((folder / f"{stem}_rd{end}").stat().st_size for end in (".csv", ".tex", ".png", ".pdf"))
    refused(run(*arguments), "is there already: --force replaces it")


def stopped(*arguments, **options):
    raise KeyboardInterrupt


@pytest.mark.slow
def test_a_measurement_stopped_between_its_outputs_leaves_none(run, picture, tmp_path, monkeypatch):
    """Numbers without charts were left: the same command was refused."""
    command = ("measure", picture, picture, "--layers", "3", "--json", tmp_path / "m.json", "--plots", tmp_path / "p")
    for place in "metrics.plot_all", "ii_core.base.files.write_json":
        with monkeypatch.context() as patch:
            patch.setattr(place, stopped)
            assert run(*command)[0] == 130
        assert not (tmp_path / "m.json").exists() and not (tmp_path / "p").exists()
    assert run(*command)[0] == 0
    assert (tmp_path / "m.json").exists() and len(list((tmp_path / "p").iterdir())) >= 4


def test_points_of_another_picture_or_measure_are_not_taken(tmp_path):
    a = IIPicture(np.zeros((8, 8, 3), np.uint8), (4, 4), (2, 2))
    point = dict.fromkeys(FIELDS, 1.0) | {"scheme": "x", "options": {}, "reached": True, "q_global": math.inf}
    depth = np.ones((4, 4))
    path = tmp_path / "p.jsonl"
    PointLog(path, a, measures=["q_global"], depth=depth).keep(point)
    assert PointLog(path, a, measures=["q_global"], depth=depth).known == {("x", 1.0): point}
    b = a.with_pixels(a.pixels + 1)
    assert not PointLog(path, b, measures=["q_global"], depth=depth).known
    assert not PointLog(path, a, measures=["q_global"], depth=2 * depth).known
    assert not PointLog(path, a, measures=["q_global", "q_view"], depth=depth).known


def test_a_refused_study_writes_nothing(run, refused, picture, tmp_path):
    refused(run("study", picture, "--schemes", "si-h264,si-h26", "-o", tmp_path / "s"), "unknown scheme 'si-h26'")
    refused(run("study", picture, "--rates", "1,two", "-o", tmp_path / "s"), "numbers separated by commas")
    assert not list(tmp_path.iterdir())


def test_a_missed_rate_is_reported(run, picture, tmp_path):
    code, out, _ = run("encode", picture, "--scheme", "ei-h264", "--bpp", 0.01, "-o", tmp_path / "x.ii")
    assert code == 0 and "cannot reach 0.01 bpp" in out


def test_the_scheme_that_is_not_given_is_told(run, tmp_path, monkeypatch):
    import av

    from ii_core import IIPicture

    IIPicture(np.full((8, 8, 3), 90, np.uint8), (4, 4), (2, 2)).save(tmp_path / "a.png")
    code, out, _ = run("encode", tmp_path / "a.png", "--qp", 30, "-o", tmp_path / "a.ii")
    assert code == 0 and "by si-lf, the best general scheme for this picture" in out
    monkeypatch.setattr(av, "codecs_available", av.codecs_available - {"libx265"})
    code, out, _ = run("schemes", "si-hevc")
    assert code == 0 and "NOT INSTALLED: libx265" in " ".join(out.split())


def test_a_picture_of_one_lens_is_upright(run, tmp_path):
    path = tmp_path / "flat.png"
    assert run("render", "apples", "--camera", "pinhole2d", "--scale", 64, "-o", path)[0] == 0
    flat = IIPicture.load(path)
    top, bottom = flat.pixels[:4].reshape(-1, 3).mean(0), flat.pixels[-4:].reshape(-1, 3).mean(0)
    assert flat.erect and top[2] > top[0] and bottom[0] > bottom[2]  # blue sky over a sandy floor


@pytest.mark.parametrize("suffix", [".exr", ".tif"])
def test_other_picture_files(run, tmp_path, suffix):
    assert run("render", "apples", "--scale", 64, "--bits", 16, "-o", tmp_path / f"a{suffix}")[0] == 0
    kind = IIPicture.load(tmp_path / f"a{suffix}").pixels.dtype.name
    assert kind == {".exr": "float32", ".tif": "uint16"}[suffix]


SCENE = """
[material.m]
colour = "#808080"
[[object]]
shape = "sphere"
radius_mm = 5
position_mm = [0, 0, 30]
material = "m"
"""
BAD_SCENES = {
    "a wrong key": (SCENE + "radius = 3\n", "radius"),
    "no geometry": ('[material.m]\ncolour = "#808080"\n', "no geometry"),
    "an unknown material": (SCENE.replace('material = "m"', 'material = "x"'), "unknown material 'x'"),
    "a missing mesh": ('[material.m]\n[[object]]\nmesh = "gone.obj"\nmaterial = "m"\n', "gone.obj does not exist"),
    "a missing texture": ('[texture.t]\nkind = "image"\nfile = "gone.png"\n' + SCENE, "gone.png does not exist"),
    "not a number": (SCENE.replace("[0, 0, 30]", "[0, 0, nan]"), "finite"),
    "no TOML": ("[[[", "bad.toml"),
}


@pytest.mark.parametrize("kind", BAD_SCENES)
def test_bad_scenes_are_one_line(run, refused, tmp_path, kind):
    text, said = BAD_SCENES[kind]
    scene = tmp_path / "bad.toml"
    scene.write_text(text)
    refused(run("render", scene, "--scale", 64, "-o", tmp_path / "out.png"), said)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.toml"]


def test_a_mesh_with_vertices_that_are_not_numbers(run, refused, tmp_path):
    (tmp_path / "bad.obj").write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "s.toml").write_text('[material.m]\n[[object]]\nmesh = "bad.obj"\nmaterial = "m"\n')
    refused(run("render", tmp_path / "s.toml", "-o", tmp_path / "out.png"), "finite")


BAD_RENDERS = {
    "unknown scene 'nope': known are apples": ["nope"],
    "unknown camera 'nope': known are": ["apples", "--camera", "nope"],
    "scale 3 does not divide": ["apples", "--scale", 3],
    "samples is 0": ["apples", "--scale", 64, "--samples", 0],
    "workers is 0": ["apples", "--scale", 64, "--workers", 0],
    "noise sigma is -1": ["apples", "--scale", 64, "--noise", -1],
    "bits is 12": ["apples", "--scale", 64, "--bits", 12],
    "No such option: --nope": ["apples", "--nope", 1],
}


@pytest.mark.parametrize("said", BAD_RENDERS)
def test_bad_render_arguments_are_one_line(run, refused, tmp_path, said):
    refused(run("render", *BAD_RENDERS[said], "-o", tmp_path / "out.png"), said)
    assert not list(tmp_path.iterdir())


def test_outputs_that_cannot_be_written_are_found_before_any_work(run, refused, tmp_path):
    (tmp_path / "file").write_text("")
    refused(run("render", "apples", "-o", tmp_path / "gone" / "a.png"), "is no folder")
    refused(run("render", "apples", "-o", tmp_path / "file" / "a.png"), "is no folder")
    refused(run("render", "apples", "-o", tmp_path / "a.bmp"), "no known picture type")
    refused(run("render", "apples", "-o", tmp_path / "a.png", "--depth", tmp_path / "d.png"), "cannot hold float32")
    refused(run("study", tmp_path / "x.png", "-o", tmp_path / "file" / "s"), "file")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_nothing_is_replaced_without_force(run, refused, tmp_path):
    path = tmp_path / "mine.png"
    path.write_bytes(b"precious")
    refused(run("render", "apples", "--scale", 64, "-o", path), "--force replaces it")
    assert path.read_bytes() == b"precious"
    assert run("render", "apples", "--scale", 64, "-o", path, "--force")[0] == 0
    assert IIPicture.load(path).lenses == (8, 4)


BAD_CODINGS = {
    "unknown scheme 'si-h26': known are": ["--scheme", "si-h26", "--bpp", 1],
    "has no option": ["--scheme", "si-h264:speed=3", "--bpp", 1],
    "bpp is 0": ["--bpp", 0],
    "bpp is -1": ["--bpp", -1],
    "bpp is nan": ["--bpp", "nan"],
    "no bpp or qp or quality is given: exactly one of bpp and qp and quality is needed": [],
    "qp is 99": ["--qp", 99],
}


@pytest.mark.parametrize("said", BAD_CODINGS)
def test_bad_encodings_are_one_line(run, refused, picture, tmp_path, said):
    refused(run("encode", picture, *BAD_CODINGS[said], "-o", tmp_path / "x.ii"), said)
    assert not list(tmp_path.iterdir())


def test_wrong_input_is_named(run, refused, picture, tmp_path):
    """On b1dc540 JSON errors had no reason of ours, and --workers 0 was taken for all cores."""
    (tmp_path / "camera.json").write_text('{"pixels": [1,')
    refused(run("camera", tmp_path / "camera.json"), "camera.json: no JSON, line 1, column 15: Expecting value")
    bare = tmp_path / "bare.png"
    bare.write_bytes(picture.read_bytes())
    (tmp_path / "bare.png.json").write_text("{")
    refused(run("measure", bare, bare), "bare.png.json: no JSON, line 1, column 2")
    refused(run("study", picture, "--rates", 1, "--workers", 0, "-o", tmp_path / "s"), "workers is 0")
    said = "layers are 'x': dissertation, a number, NEAR:FAR:COUNT or px:LOW:HIGH:COUNT is needed\n"
    refused(run("measure", picture, picture, "--depth-from-focus", "--layers", "x"), said)
    refused(run("camera", "--design", "panel=x,pixels=9x9,pitch=1,distance=9"), "panel is 'x'")


def test_pictures_that_do_not_fit_their_structure(run, refused, picture, tmp_path):
    bare = tmp_path / "bare.png"
    bare.write_bytes(picture.read_bytes())
    refused(run("encode", bare, "--bpp", 1, "-o", tmp_path / "x.ii"), "no sidecar")
    structure = json.loads(picture.with_name("small.png.json").read_text())
    structure.update(ei_pixels=[17, 16], camera=None)
    (tmp_path / "bare.png.json").write_text(json.dumps(structure))
    refused(
        run("encode", bare, "--bpp", 1, "-o", tmp_path / "x.ii"),
        "elementary image 17×16 px does not divide picture width 256",
    )


def test_missing_and_foreign_files_are_refused(run, refused, picture, tmp_path):
    coded = tmp_path / "a.ii"
    assert run("encode", picture, "--qp", 30, "-o", coded)[0] == 0
    whole = coded.read_bytes()
    for name, content in {"cut.ii": whole[: len(whole) // 2], "other.ii": b"GIF89a" * 100, "empty.ii": b""}.items():
        (tmp_path / name).write_bytes(content)
        refused(run("decode", tmp_path / name, "-o", tmp_path / "out.png"), name)
        assert not (tmp_path / "out.png").exists()
    refused(run("decode", tmp_path / "gone.ii", "-o", tmp_path / "out.png"), "gone.ii")


def test_pictures_of_different_structure_are_not_measured(run, refused, picture, tmp_path):
    other = IIPicture(IIPicture.load(picture).pixels, (32, 16), (8, 8))
    other.save(tmp_path / "other.png")
    refused(run("measure", picture, tmp_path / "other.png"), "different structure")


def test_help_and_no_command(run, refused):
    code, out, _ = run("--help")
    assert code == 0 and "render" in out
    refused(run("nope"), "No such command 'nope'")


def test_as_a_process(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "raytrace_ii.cli", "render", "nope", "-o", str(tmp_path / "a.png")],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("error: unknown scene 'nope'") and done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("lenses", "camera", "reason"),
    [((8, 6), True, "view images have 8×6 pixels, SSIM needs 11×11"), ((12, 12), False, "the take has no camera")],
)
def test_a_take_without_a_moving_viewer_says_why(run, tmp_path, lenses, camera, reason):
    """The rows were left out in silence; the test of measures over time gave viewpoints itself."""
    size = 4 * lenses[0], 4 * lenses[1]
    known = IICamera(pixels=size, lenses=lenses, pixel_pitch_mm=0.1, gap_mm=0.8) if camera else None
    picture = IIPicture(np.zeros((*size[::-1], 3), np.uint8), lenses, (4, 4), known)
    video_of([picture, picture], fps=5).save(tmp_path / "take")
    code, out, _ = run("measure", tmp_path / "take", tmp_path / "take", "--json", tmp_path / "m.json")
    assert code == 0 and f"not measured: {reason}" in out
    assert json.loads((tmp_path / "m.json").read_text())["missing"]["view_ssim"] == reason


# -- command render: samples, support images, pictures of every type


CAMERA = preset("setup1", scale=128)  # 64×32 px, 4×2 lenses
OBJECTS = ("render", "objects", "--scale", 128)


@pytest.mark.slow
def test_support_images_in_one_file_and_alone(run, tmp_path):
    extra = {"depth": "depth", "ray_length": "ray-length", "disparity": "disparity", "normal": "normal"}
    extra |= {"object_id": "object-id", "shading_normal": "shading-normal"}
    options = [x for name, option in extra.items() for x in (f"--{option}", tmp_path / f"{name}.exr")]
    code, out, _ = run(*OBJECTS, "-o", tmp_path / "p.png", *options)
    assert code == 0 and " rays" in out and "s of CPU time" in out  # the closing line names times at its end
    assert run(*OBJECTS, "-o", tmp_path / "q.png", "--support", tmp_path / "all.exr")[0] == 0
    shot = render(load_scene("objects"), CAMERA, support=tuple(extra))
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "p.png").pixels, shot.picture.pixels)
    for name in extra:
        np.testing.assert_array_equal(read_image(tmp_path / f"{name}.exr").squeeze(), getattr(shot, name))
    stored = read_channels(tmp_path / "all.exr")
    np.testing.assert_array_equal(stored["depth.Z"], shot.depth)
    np.testing.assert_array_equal(stored["disparity"], shot.disparity)
    assert len(stored) == 10
    both = ("--support", tmp_path / "both.exr", "--depth", tmp_path / "z.exr")
    assert run(*OBJECTS, "-o", tmp_path / "r.png", *both)[0] == 0
    stored = read_channels(tmp_path / "both.exr")
    np.testing.assert_array_equal(stored["depth.Z"], shot.depth, "a file of its own does not take it from the other")
    assert len(stored) == 10
    flat = ("render", "objects", "--camera", "pinhole2d", "--scale", 128)
    assert run(*flat, "-o", tmp_path / "f.png", "--support", tmp_path / "f.exr")[0] == 0
    assert "disparity" not in read_channels(tmp_path / "f.exr"), "one lens has no neighbour"


@pytest.mark.slow
def test_adaptive_samples(run, tmp_path):
    code, out, _ = run(*OBJECTS, "-o", tmp_path / "p.png", "--samples", "4..16", "--error", 2, "--seed", 3)
    shot = render(load_scene("objects"), CAMERA, samples=(4, 16), error=2.0, seed=3)
    assert code == 0 and f"({shot.stats.mean_samples:.1f} per pixel)" in out
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "p.png").pixels, shot.picture.pixels)


@pytest.mark.slow
def test_audit(run, refused, tmp_path):
    code, out, _ = run(*OBJECTS, "-o", tmp_path / "p.png", "--audit", 0.1)
    shot = render(load_scene("objects"), CAMERA, audit=0.1)
    assert code == 0 and f"; measured at {shot.stats.audit.pixels} pixels: {shot.stats.audit.wrong} wrong by" in out
    moving = ("render", "objects", "--frames", "0", "-o", tmp_path / "frames", "--audit", 0.1)
    refused(run(*moving), "--audit is of one picture: without --frames and --set")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--samples", "many"), "samples is 'many': a whole number, two like 4..64, or edges is needed"),
        (("--samples", "4.."), "samples is '4..'"),
        (("--samples", "4..48"), "two powers of 2 are needed"),
        (("--samples", "64..4"), "two powers of 2 are needed, at least 4 and the second not less"),
        (("--samples", "4", "--error", "1"), "error is 1, but the number of samples is fixed"),
        (("--samples", "4..8", "--error", "0"), "error is 0.0: a positive number"),
        (("--audit", "2"), "audit is 2.0: a share of the pixels, from 0 to 1, is needed"),
        (("--support", "all.tif"), "only .exr has named channels"),
        (("--support", "gone/all.exr"), "is no folder"),
        (("--camera", "pinhole2d", "--disparity", "d.exr"), "has no neighbouring lenses"),
    ],
)
def test_invalid_values_are_one_line(run, refused, tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    refused(run(*OBJECTS, "-o", "p.png", *options), said)
    assert list(tmp_path.iterdir()) == []
