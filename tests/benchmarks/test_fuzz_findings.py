"""Findings of the fuzzing of readers, each as its smallest case."""

import json
import logging
import os
import re

import numpy as np
import pytest

from benchmarks import workers
from benchmarks.coding import fuzz
from benchmarks.stability.fuzz_readers import __main__ as readers
from benchmarks.stability.fuzz_readers import seeds
from benchmarks.stability.fuzz_readers.__main__ import case, outcome
from benchmarks.stability.fuzz_readers.containers import png_changed
from benchmarks.stability.fuzz_readers.measurements import ABOUT, ZMX, _result
from codec import Encoded, decode, encode
from codec.container import write
from codec.file_header import values
from ii_core import IIPicture, preset
from ii_core.base.files import MAX_MESSAGE, one_line, read_image, write_image
from ii_core.base.json_lines import read_records
from ii_core.camera.maps import read_maps, write_maps
from ii_core.camera.prescriptions import lens
from ii_core.camera.presets import preset_cameras
from ii_core.display.look import MOST_FRAMES, viewpoints_around
from ii_core.formats.find import find_views
from ii_core.formats.lfp import read_packed
from metrics.benchmark.profile import profile
from metrics.benchmark.ranking import check_comparable
from metrics.benchmark.result import read_result
from metrics.reports.point_log import read_points
from metrics.reports.study import read_study
from raytrace_ii.files.load import read_model
from raytrace_ii.rendering.render_sets import _read_manifest
from raytrace_ii.shapes.implicit_parts import Ball


def refusal(call, *arguments):
    """Return the message of a ValueError or OSError, which must be one line of bounded length."""
    with pytest.raises((ValueError, OSError)) as caught:
        call(*arguments)
    message = str(caught.value)
    assert "\n" not in message and len(message) < MAX_MESSAGE + 200
    return message


def test_errors_of_picture_libraries_have_one_line(tmp_path):
    """OpenImageIO's messages have up to four lines; the command line joined them, the library did not."""
    path = tmp_path / "a.png"
    said = set()
    for number in range(40):
        path.write_bytes(png_changed(seeds.png_files()[0], np.random.default_rng(number)))
        try:
            read_image(path)
        except (ValueError, OSError) as error:
            said.add(str(error))
    assert any("PNG library error" in message for message in said)
    assert not any("\n" in message for message in said)


def test_errors_in_parameters_cfg_have_one_line(tmp_path):
    for i in range(4):
        write_image(tmp_path / f"input_Cam{i:03}.png", seeds.pixels())
    (tmp_path / "parameters.cfg").write_text("image_resolution_x_px = 16\n")
    assert "parameters.cfg does not say num_cams_x" in refusal(find_views, tmp_path)


@pytest.mark.parametrize("value", ["a" * 5000, [[0] * 3000]])
def test_long_values_are_not_quoted_whole(value, tmp_path):
    picture = tmp_path / "p.png"
    picture.write_bytes(seeds.png_files()[0])
    sidecar = {**seeds.structures()[0], "lenses": value}
    (tmp_path / "p.png.json").write_text(json.dumps(sidecar))
    assert "two whole numbers are needed" in refusal(IIPicture.load, picture)
    camera = {**seeds.camera_trees()["multi-focus"], "optics": [{"kind": "lenslet", "focal_mm": [value]}]}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    assert "lenslet: focal_mm" in refusal(preset_cameras, tmp_path / "camera.json")
    tree, _ = seeds.gltf()
    (tmp_path / "a.gltf").write_text(json.dumps({**tree, "accessors": value}))
    assert "accessors" in refusal(read_model, tmp_path / "a.gltf")


def test_pixels_far_larger_than_lenses(tmp_path):
    """The pitch in pixels was rounded to zero, by which rays were divided."""
    camera = {**seeds.camera_trees()["hexagonal"], "pixel_pitch_mm": 6.1e7}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    assert "lens_pitch_mm is 0.0845241: at least 1e-06 of pixel_pitch_mm" in refusal(
        preset_cameras, tmp_path / "camera.json"
    )


@pytest.mark.parametrize("name", ["a" * 300, "a\nb", "a" * 5000])
def test_errors_on_names_of_maps_have_one_short_line(name, tmp_path):
    """Found by 20 000 cases, not by 300: "File name too long" quoted the whole name; names had line breaks."""
    write_maps([preset("setup1", scale=256)], tmp_path)
    sheet = json.loads((tmp_path / "camera.json").read_text())
    sheet["arrays"][0]["samples"][0]["L"]["file"] = name
    (tmp_path / "camera.json").write_text(json.dumps(sheet))
    assert re.search("does not exist|File name too long", refusal(read_maps, tmp_path))


def test_one_line_keeps_both_ends():
    assert one_line("a\n b\t c") == "a b c"
    line = one_line("begin " + "x" * 5000 + " end")
    assert line.startswith("begin") and line.endswith("end") and len(line) < MAX_MESSAGE + 5


@pytest.mark.parametrize("box", [[["0", "1"]] * 3, [[0, True], [0, None], [0, 1]], [[0, 1e999], [0, 1], [0, 1]]])
def test_box_of_maps_holds_numbers(box, tmp_path):
    """numpy accepts "0.5" as a number: a box of texts was loaded and failed at its first rays."""
    for name in "LD":
        write_image(tmp_path / f"{name}.png", seeds.pixels(kind="uint16"))
    sample = {name: {"file": f"{name}.png", "C": 65536, "box": box} for name in "LD"}
    (tmp_path / "camera.json").write_text(json.dumps({"arrays": [{"samples": [sample]}]}))
    assert "three pairs of numbers are needed" in refusal(read_maps, tmp_path)


@pytest.mark.parametrize("claim", [3, None, {"a": 1}])
def test_claims_of_a_manifest_must_be_names(claim, tmp_path):
    (tmp_path / "manifest.json").write_text(json.dumps({**seeds.MANIFEST, "claims": [claim]}))
    assert "is damaged" in refusal(_read_manifest, tmp_path, "reference")


@pytest.mark.parametrize("point", [None, 3, [], {"scheme": "si-h264"}, "missing"])
def test_lines_of_a_point_log_must_be_points(point, tmp_path):
    line = {**seeds.POINT_LINE, "point": point}
    if point == "missing":
        del line["point"]
    (tmp_path / "p.jsonl").write_text(json.dumps(seeds.POINT_LINE) + "\n" + json.dumps(line) + "\n")
    assert "p.jsonl, line 2: points[0]" in refusal(read_points, tmp_path / "p.jsonl")


def test_records_nested_too_deeply(tmp_path):
    (tmp_path / "p.jsonl").write_text("[" * 100_000 + "\n")
    assert "line 1: nested too deeply" in refusal(read_records, tmp_path / "p.jsonl", "ii-record", 1)


def test_studies_are_read_within_bounds(tmp_path):
    path = tmp_path / "s.json"
    path.write_text(json.dumps(seeds.STUDY).replace("0.0991", "9" * 30))
    assert "a number of 30 digits" in refusal(read_study, path)
    path.write_bytes(b" " * ((16 << 20) + 1))
    assert "longer than 16 MiB" in refusal(read_study, path)
    path.write_bytes(b'"\xff"')
    assert "no UTF-8" in refusal(read_study, path)
    path.unlink()
    os.mkfifo(path)
    assert "pipe" in refusal(read_study, path)


def coded_picture(**header):
    coded = encode(IIPicture(seeds.pixels(), (4, 2), (4, 4)), "jpeg2000", bpp=2)
    return values(coded), coded.payload


def test_target_of_zero_in_a_coded_file(tmp_path):
    header, payload = coded_picture()
    header[7] = {"bpp": 0}
    write(tmp_path / "p.ii", header, payload)
    assert Encoded.load(tmp_path / "p.ii").reached is False


def test_names_in_a_coded_file_are_quoted_in_one_short_line(tmp_path):
    for scheme, options in (("a" * 5000, {}), ("si-h264", {"a\nb": 1})):
        header, payload = coded_picture()
        header[6], header[7] = scheme, options
        write(tmp_path / "p.ii", header, payload)
        assert "is damaged" in refusal(decode, tmp_path / "p.ii")


def test_pipes_are_refused_as_coded_pictures(tmp_path):
    """Opening a pipe waits for a writer without a time limit."""
    os.mkfifo(tmp_path / "p.ii")
    assert "pipe" in refusal(decode, tmp_path / "p.ii")


def test_nan_normals_print_nothing(tmp_path, monkeypatch):
    """trimesh logs a traceback, which Python prints if no handler is set."""
    monkeypatch.setattr(logging.root, "handlers", [])
    text = seeds.stl_files()[1].decode().replace("facet normal 0 0 1", "facet normal 0 0 up", 1)
    (tmp_path / "a.stl").write_text(text)
    assert outcome(lambda: read_model(tmp_path / "a.stl")) == "object"


def test_films_have_a_stated_limit():
    picture = IIPicture(seeds.pixels(), (4, 2), (4, 4))
    assert f"at most {MOST_FRAMES}" in refusal(viewpoints_around, picture, 10**9)


def test_cases_that_failed(tmp_path):
    """The numbers reproduce the failures only while the makers of cases do not change; the tests above always do."""
    for name, seed, number in (
        (".ii header", 3, 16),
        ("study", 3, 650),
        ("study", 3, 1202),
        ("manifest", 3, 10),
        ("camera", 0, 204),
    ):
        assert outcome(case(name, seed, number, tmp_path)) in ("object", "refused")


@pytest.mark.parametrize("depth", [150, 900, 3000])
def test_values_nested_deeply_are_refused_where_they_are_read(depth, tmp_path):
    """Found by 20 000 cases of studies, not by 300: text that parses, but exhausts the stack of its readers."""
    nested = "[" * depth + "]" * depth
    log = tmp_path / "points.jsonl"
    log.write_text(json.dumps(seeds.POINT_LINE).replace('"q_depth": [', f'"q_depth": [{nested}, ', 1) + "\n")
    assert "nested too deeply" in refusal(read_points, log)
    study = tmp_path / "study.json"
    study.write_text(json.dumps(seeds.STUDY).replace('"q_depth": [', f'"q_depth": [{nested}, ', 1))
    assert "nested too deeply" in refusal(read_study, study)


@pytest.mark.parametrize("kind", [5120, 5122, 5126])
def test_sparse_rows_are_unsigned(kind, tmp_path):
    """Floats as indices were an IndexError, case 18 826; negative ones counted from the end."""
    tree, chunk = seeds.gltf()
    sparse = {"count": 1, "indices": {"bufferView": 0, "componentType": kind}, "values": {"bufferView": 0}}
    tree = json.loads(json.dumps(tree))
    tree["accessors"][0]["sparse"] = sparse
    whole = {**tree, "buffers": [{"byteLength": len(chunk), "uri": seeds.embedded(chunk)}]}
    (tmp_path / "a.gltf").write_text(json.dumps(whole))
    assert "sparse indices are" in refusal(read_model, tmp_path / "a.gltf")


def test_errors_on_the_number_of_views_have_one_line(tmp_path):
    for i in range(4):
        write_image(tmp_path / f"view_{i // 2}_{i % 2}.png", seeds.pixels())
    (tmp_path / "structure.json").write_text(json.dumps({"ei_pixels": ["a\nb", "c" * 5000]}))
    assert "2×2 are there" in refusal(find_views, tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("UNIT MM X W X CM MR CPMM", "UNIT", ""),
        ("TYPE STANDARD", "TYPE", ""),
        ("PWAV 1", "PWAV", ""),
        ("SURF 1", "SURF", ""),
    ]
    + [("WAVM 1 0.5876 1.0\nPWAV 1", f"WAVL 0.5\nPWAV {n}", "") for n in ("inf", "nan", "1e30", "-1")]
    + [("UNIT MM", "UNIT FT", "unit 'FT'"), ("CURV 0.016", "CURV", "nothing"), ("PWAV 1", "PWAV x", "is no number")],
)
def test_lines_of_lens_files_without_words(old, new, said, tmp_path):
    """IndexErrors and OverflowErrors; no reader of lenses had been fuzzed."""
    (tmp_path / "a.zmx").write_text(ZMX.replace(old, new, 1))
    if said:
        assert said in refusal(lens, tmp_path / "a.zmx")
    else:
        assert len(lens(tmp_path / "a.zmx").surfaces) == 2


@pytest.mark.parametrize("key", ["width", "height"])
def test_sizes_of_raw_pictures_are_finite(key, tmp_path):
    (tmp_path / "a.raw").write_bytes(bytes(72))
    (tmp_path / "a.json").write_text(json.dumps({**ABOUT, "image": {**ABOUT["image"], key: 1e999}}))
    assert "infinity" in refusal(read_packed, tmp_path / "a.raw", tmp_path / "a.json")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"coder": ["a"]}, "coder is ['a']: text is needed"),
        ({"profile": {**_result()["profile"], "sha256": 7}}, "sha256 is 7: text is needed"),
        ({"pictures": [{**_result()["pictures"][0], "points": 7}]}, "points of the records are 7: a list"),
        ({"pictures": [{**_result()["pictures"][0], "name": None}]}, "name is None: text is needed"),
    ],
)
def test_damaged_results_of_the_benchmark(change, said, tmp_path):
    """Results of another hand ended in TypeErrors where they were ranked."""
    (tmp_path / "a.json").write_text(json.dumps({**_result(), **change}))
    assert said in refusal(read_result, tmp_path / "a.json")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("encode_seconds", "a", "encode_seconds is 'a': a number is needed"),
        ("nbytes", [1], "nbytes is [1]: a number is needed"),
        ("q_global", "a", "q_global is 'a': a number is needed"),
        ("q_global", [1], "has no q_global at every rate"),
    ],
)
def test_damaged_points_of_the_benchmark(name, value, said, tmp_path):
    result = json.loads(json.dumps(_result()))
    result["pictures"][0]["points"][1][name] = value
    (tmp_path / "a.json").write_text(json.dumps(result))
    assert said in refusal(lambda: check_comparable(profile("small"), [("a", read_result(tmp_path / "a.json"))]))


def test_a_benchmark_of_a_name_of_two_lines(tmp_path):
    result = {**_result(), "profile": {**_result()["profile"], "name": "small\nest"}}
    (tmp_path / "a.json").write_text(json.dumps(result))
    said = refusal(lambda: check_comparable(profile("small"), [("a", read_result(tmp_path / "a.json"))]))
    assert "is of profile small est version" in said


def test_a_ball_of_enormous_radii_is_measured():
    """The square of a half axis overflowed."""
    ball = Ball(part="ball", radii_mm=(1e200, 1e200, 1e200))
    np.testing.assert_array_equal(ball.distance(*np.zeros((3, 2))), [-1e200, -1e200])


# -- fuzzing script: counts of mutations, death of a worker process


def test_mutations_are_counted_and_reproducible(capsys):
    first, second = ([], [])
    for lines in (first, second):
        fuzz.work("si-h264", 7, 0, 60, limit=False)
        lines += [json.loads(line)[:2] for line in capsys.readouterr().out.splitlines()]
    assert first == second
    assert [number for number, _ in first] == list(range(60))
    assert {what for _, what in first} <= {"picture", "refused"}


@pytest.mark.parametrize(("watched", "name"), [(fuzz.watched, "si-h264"), (readers.watched, "PLY")])
def test_a_dead_worker_is_a_finding(watched, name, monkeypatch):
    """A worker that cannot start ends at each of its cases; every such end is a finding."""
    monkeypatch.setattr("sys.executable", "false")
    outcome = watched(name, 0, 3)
    assert [finding["number"] for finding in outcome["findings"]] == [0, 1, 2]
    assert outcome["counts"] == {"died with 1": 3}


def test_cases_of_a_worker_that_dies_once(tmp_path, monkeypatch):
    """The worker dies at case 2 of 4: that case is a finding with its last line, the next worker begins at 3."""
    script = tmp_path / "worker.py"
    script.write_text(
        "import sys\n"
        "first, last = map(int, sys.argv[-2:])\n"
        "for number in range(first, last):\n"
        "    if number == 2:\n"
        "        sys.exit('no more')\n"
        "    print(f'[{number}, \"object\", 0.5, 7.0]', flush=True)\n"
    )
    monkeypatch.setattr(workers, "ROOT", tmp_path)
    dead = workers.Case(2, "died with 1", said="no more")
    good = [workers.Case(number, "object", 0.5, 7.0) for number in range(4)]
    assert list(workers.cases("worker", (), 4)) == [*good[:2], dead, good[3]]


def test_nearly_all_mutations_differ():
    data, rng = bytes(range(256)), np.random.default_rng(0)
    mutants = {fuzz.damaged(data, [b"stranger"], rng) for _ in range(50)}
    assert len(mutants) > 45


@pytest.mark.parametrize("scheme", ["si-h264", "jpeg2000"])
def test_samples_have_a_useful_size(scheme):
    assert 100 < fuzz.sample(scheme).nbytes < 4000
