"""Commands benchmark and ranking, and the pixels of the small profile."""

import json
import re
import shlex

import numpy as np
import pytest

import codec
from ii_core import IIPicture, open_video
from ii_core.base.files import write_image
from ii_core.formats.pleno import write_pleno_views
from metrics import measure_take
from metrics.benchmark.profile import profile
from metrics.benchmark.subject import identity
from metrics.reports.study import picture_json
from raytrace_ii.cli.benchmark_pictures import rendered

TINY = """
name = "tiny"
version = 1
about = "A test."
rates_bpp = [4.0, 8.0]
measures = ["q_global"]
rank_by = "q_global"
anchor = "jpeg2000"
rate_tolerance = 0.02
seconds = 20
[[picture]]
name = "apples"
use = "a test"
scene = "apples"
camera = "setup1"
scale = 64
"""


VIDEO = TINY + "frames = 2\n"


@pytest.mark.slow
def test_a_coder_is_run_and_ranked(run, tmp_path):
    (tmp_path / "tiny.toml").write_text(TINY)
    definition = str(tmp_path / "tiny.toml")
    files = []
    for scheme in ("jpeg2000", "si-h264:gop=8"):
        files.append(str(tmp_path / f"{len(files)}.json"))
        code, out, _ = run("benchmark", definition, "--scheme", scheme, "-o", files[-1])
        assert code == 0 and re.search(rf"{re.escape(scheme)} meets \d of 2 targets", out)
    page = tmp_path / "rank.md"
    code, out, _ = run("ranking", definition, *files, "-o", page)
    assert code == 0 and out.splitlines()[0].startswith("1  ") and page.exists() and page.with_suffix(".svg").exists()
    assert {line.split()[0] for line in run("benchmark")[1].splitlines()} == {
        "dissertation", "jpeg-pleno", "photographs", "photographs-small", "small", "takes"
    }  # fmt: skip


@pytest.mark.slow
def test_some_pictures_are_run_and_ranked_among_themselves(run, tmp_path):
    definition, cuboid = tmp_path / "tiny.toml", TINY[TINY.index("[[picture]]") :].replace("apples", "cuboid")
    definition.write_text(TINY + cuboid)
    for name, *how in (
        ("a", "jpeg2000", "--only", "cuboid"), ("b", "jpeg", "--only", "cuboid"), ("c", "jpegxl"),
    ):  # fmt: skip
        assert run("benchmark", definition, "--scheme", *how, "-o", tmp_path / f"{name}.json")[0] == 0
    a, b, c = (tmp_path / f"{name}.json" for name in "abc")
    assert [row["name"] for row in json.loads(a.read_text())["pictures"]] == ["cuboid"]
    assert run("ranking", definition, a, b, "-o", tmp_path / "rank.md")[0] == 0
    assert "only 1 of its 2 pictures" in (tmp_path / "rank.md").read_text()
    code, _, error = run("ranking", definition, a, c, "-o", tmp_path / "mixed.md")
    assert code == 2 and f"{c} has other pictures than {a}" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("small",), "output is missing"),
        (("small", "-o", "r.json", "--scheme", "jpeg", "--only", "apples,pears"), "small has no picture 'pears'"),
        (("small", "-o", "r.json"), "coder is missing: either --scheme, --anchor, --external"),
        (("small", "-o", "r.json", "--scheme", "h264"), "unknown scheme"),
        (("small", "-o", "r.json", "--scheme", "jpeg", "--workers", "0"), "workers is 0"),
        (
            ("small", "-o", "r.json", "--scheme", "jpeg", "--workers", "2", "--dask", "x:1"),
            "leave it out with --dask",
        ),
        (("small", "-o", "r.json", "--external", "python3 {in} {out}", "python3 {in} {out}"), "--name gives"),
        (("small", "-o", "r.json", "--name", "x", "--external", "python3 {in}", "python3 {in} {out}"), "no {out}"),
        (("large", "-o", "r.json", "--scheme", "jpeg"), "unknown profile 'large'"),
    ],
)
def test_wrong_calls_are_one_line_before_work(run, monkeypatch, tmp_path, arguments, message):
    monkeypatch.chdir(tmp_path)
    code, _, error = run("benchmark", *arguments)
    assert code == 2 and message in error and len(error.splitlines()) == 1 and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_set_is_rendered_checked_and_used(run, tmp_path):
    made = tmp_path / "tiny.toml"
    made.write_text(TINY + f'sha256 = "{"0" * 64}"\n')
    data = tmp_path / "data"
    code, out, _ = run("render", "--set", f"benchmark:{made}", "-o", data)
    picture = IIPicture.load(data / "tiny" / "apples.png")
    found = picture_json("", picture)["sha256"]
    assert code == 0 and f"tiny/apples  {found}" in out and "not the pixels of the definition: apples" in out
    card = (data / "tiny" / "README.md").read_text()
    assert "**Not the pixels of the definition:** apples." in card and "| a test | apples |" in card
    when = (data / "tiny" / "apples.png").stat().st_mtime_ns

    made.write_text(TINY + f'sha256 = "{found}"\n')
    code, out, _ = run("render", "--set", f"benchmark:{made}", "-o", data)
    assert code == 0 and "1 of 1 fixed hashes met" in out and "not the pixels" not in out
    assert (data / "tiny" / "apples.png").stat().st_mtime_ns == when  # not rendered again
    assert "All fixed hashes are met." in (data / "tiny" / "README.md").read_text()

    taken = ("benchmark", made, "--scheme", "jpeg2000", "--pictures", data)
    assert run(*taken, "-o", tmp_path / "a.json")[0] == 0
    assert json.loads((tmp_path / "a.json").read_text())["pictures"][0]["as_defined"] is True
    picture.with_pixels(np.zeros_like(picture.pixels)).save(data / "tiny" / "apples.png")
    code, _, error = run(*taken, "-o", tmp_path / "b.json")
    assert code == 2 and "apples.png has other pixels than its manifest says" in error
    assert run("render", "--set", f"benchmark:{made}", "-o", data)[0] == 0  # made again, as it was
    assert picture_json("", IIPicture.load(data / "tiny" / "apples.png"))["sha256"] == found


PHOTOGRAPH = (
    TINY.partition("[[picture]]")[0]
    + """
[[picture]]
name = "ramp"
use = "a test"
views = [3, 2]
view_pixels = [8, 4]
sha256 = "{sha256}"
[picture.source]
camera = "made up"
repository = "https://example.org/ramp"
commit = "0123456789012345678901234567890123456789"
path = "views"
licence = "CC0"
options = "--grid 3x2 --no-flip-down --no-flip-across"
"""
)


def test_photographs_are_found_by_their_pixels(run, tmp_path):
    ramp = np.add.outer(np.arange(8) * 3, np.arange(24) * 9).astype(np.uint8)[..., None].repeat(3, axis=2)
    picture = IIPicture(ramp, (8, 4), (3, 2))
    definition = tmp_path / "ramp.toml"
    definition.write_text(PHOTOGRAPH.format(sha256=picture_json("", picture)["sha256"]))
    taken = ("benchmark", definition, "--scheme", "jpeg2000", "--pictures", tmp_path)
    code, _, error = run(*taken, "-o", tmp_path / "r.json")
    assert code == 2 and f"{tmp_path} has no picture ramp" in error and "--list" in error
    code, out, _ = run("benchmark", definition, "--list", "--pictures", tmp_path)
    assert code == 0 and "has no picture ramp" in out and "https://example.org/ramp at 0123456789" in out
    assert "licence: CC0" in out and "made up, 3×2 views of 8×4 px" in out
    # The command that the list gives makes the picture, from views in the order of their numbers.
    (tmp_path / "views").mkdir()
    for i, (row, column) in enumerate(np.ndindex(2, 3)):
        write_image(tmp_path / "views" / f"{i}.png", ramp[row::2, column::3])
    words = shlex.split(next(line for line in out.splitlines() if "raytrace-ii import" in line))
    assert run("import", tmp_path / words[2], *words[3:])[0] == 0
    code, out, _ = run("benchmark", definition, "--list", "--pictures", tmp_path)
    assert code == 0 and "ramp: there, pixels as defined" in out
    assert run("import", tmp_path / "views", "--grid", "3x2", "--middle", "2x1", "--no-flip-down", "--no-flip-across",
               "-o", tmp_path / "m.png")[0] == 0  # fmt: skip
    few = IIPicture.load(tmp_path / "m.png")
    assert few.ei_pixels == (1, 2) and np.array_equal(few.pixels[:, :, 0], ramp[:, 1::3, 0])
    assert "middle is 9×9 views" in run("import", tmp_path / "views", "--grid", "3x2", "--middle", "9x9",
                                        "-o", tmp_path / "n.png")[2]  # fmt: skip
    assert run(*taken, "-o", tmp_path / "r.json")[0] == 0
    assert json.loads((tmp_path / "r.json").read_text())["pictures"][0]["as_defined"] is True
    for target in (4, 8):
        write_pleno_views(picture, tmp_path / "coded" / "ramp" / str(target), "png")
        (tmp_path / "coded" / "ramp" / str(target) / "bytes.txt").write_text("20")
    foreign = ("benchmark", definition, "--pictures", tmp_path, "--decoded", tmp_path / "coded", "--views", "png")
    assert "--name gives the name of the coder" in run(*foreign, "-o", tmp_path / "f.json")[2]
    assert run(*foreign, "--name", "elsewhere", "-o", tmp_path / "f.json")[0] == 0
    point = json.loads((tmp_path / "f.json").read_text())["pictures"][0]["points"][0]
    assert (point["nbytes"], point["q_global"], point["reached"]) == (20, "inf", True)
    picture.with_pixels(ramp ^ 1).save(tmp_path / "ramp.png")
    code, _, error = run(*taken, "-o", tmp_path / "s.json")
    assert code == 2 and "ramp.png has other pixels than profile tiny fixes" in error
    for command in (("benchmark", definition, "--scheme", "jpeg2000", "-o", tmp_path / "t.json"),
                    ("render", "--set", f"benchmark:{definition}", "-o", tmp_path / "set")):  # fmt: skip
        code, _, error = run(*command)
        assert code == 2 and "photograph" in error and len(error.splitlines()) == 1


def test_a_set_keeps_foreign_files_and_refuses_options(run, refused, tmp_path):
    (tmp_path / "tiny.toml").write_text(TINY)
    (tmp_path / "data" / "tiny").mkdir(parents=True)
    (tmp_path / "data" / "tiny" / "apples.png").write_text("mine")
    named = f"benchmark:{tmp_path / 'tiny.toml'}"
    refused(
        run("render", "--set", named, "-o", tmp_path / "data"), "apples.png is there already: --force replaces it"
    )
    assert [path.name for path in (tmp_path / "data" / "tiny").iterdir()] == ["apples.png"]
    refused(run("render", "--set", named, "-o", tmp_path / "new", "--scale", 2), "leave out --scale")
    refused(run("render", "--set", "benchmark:none", "-o", tmp_path / "new"), "unknown profile 'none'")
    refused(run("benchmark", tmp_path / "tiny.toml", "--scheme", "jpeg2000", "--pictures", tmp_path / "new", "-o",
                tmp_path / "r.json"), "has no picture apples")  # fmt: skip
    assert not (tmp_path / "new").exists() and not list(tmp_path.glob("r*"))


@pytest.mark.slow
def test_a_stopped_run_continues(run, tmp_path, monkeypatch):
    (tmp_path / "tiny.toml").write_text(TINY)
    calls, encode = [], codec.encode

    def dies(picture, scheme, *, bpp):
        calls.append(bpp)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return encode(picture, scheme, bpp=bpp)

    monkeypatch.setattr(codec, "encode", dies)
    command = ("benchmark", tmp_path / "tiny.toml", "--scheme", "jpeg2000", "-o", tmp_path / "r.json")
    assert run(*command)[0] == 130 and (tmp_path / "r.points.jsonl").exists()
    assert run(*command)[0] == 0 and calls == [4.0, 8.0, 8.0]
    assert [p["target_bpp"] for p in json.loads((tmp_path / "r.json").read_text())["pictures"][0]["points"]] == [4, 8]
    assert not (tmp_path / "r.points.jsonl").exists()


@pytest.mark.slow
def test_a_video_is_rendered_coded_and_ranked(run, refused, tmp_path):
    made, data = tmp_path / "tiny.toml", tmp_path / "data"
    made.write_text(VIDEO)
    code, out, _ = run("render", "--set", f"benchmark:{made}", "-o", data)
    frames = open_video(data / "tiny" / "apples")
    found = identity("", frames)["sha256"]
    assert code == 0 and f"tiny/apples  {found}" in out and frames.frames == 2
    assert frames[0].pixels.tobytes() != frames[1].pixels.tobytes()
    assert identity("", rendered(profile(str(made)).pictures[0]))["sha256"] == found
    assert "apples, frames 0–1" in (data / "tiny" / "README.md").read_text()
    when = (data / "tiny" / "apples" / "frame_0001.png").stat().st_mtime_ns
    assert run("render", "--set", f"benchmark:{made}", "-o", data)[0] == 0
    assert (data / "tiny" / "apples" / "frame_0001.png").stat().st_mtime_ns == when  # not rendered again

    taken = ("benchmark", made, "--pictures", data, "-o", tmp_path / "r.json", "--scheme")
    refused(run(*taken, "jpeg2000"), "scheme jpeg2000 codes no takes: apples of profile tiny is one")
    assert run(*taken, "si-h264")[0] == 0
    row = json.loads((tmp_path / "r.json").read_text())["pictures"][0]
    assert (row["sha256"], row["frames"], row["pixels"]) == (found, 2, [128, 64])
    again = codec.open_take(codec.encode_take(frames, "si-h264", bpp=8.0))
    point = row["points"][1]
    # The rate is of all frames, the PSNR of all their errors.
    assert point["bpp"] == 8 * point["nbytes"] / (2 * 128 * 64) <= 8.0
    assert point["q_global"] == pytest.approx(measure_take(frames, again).pooled_psnr, abs=1e-9)
    assert run("ranking", made, tmp_path / "r.json", "-o", tmp_path / "page.md")[0] == 0
    (data / "tiny" / "apples" / "frame_0001.png").unlink()
    code, _, error = run(*taken, "si-h264", "--force")
    assert code == 2 and "apples has 1 frames: 2 are needed" in error


@pytest.mark.slow
def test_the_small_profile_renders_to_the_bit():
    for reference in profile("small").pictures:
        assert picture_json("", rendered(reference))["sha256"] == reference.sha256, reference.name
