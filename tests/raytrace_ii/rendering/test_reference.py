"""Render sets: renders, repeats, interrupts, and hashes of scenes."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from ii_core import IIPicture, preset
from ii_core.base.files import read_channels, read_image
from raytrace_ii import Scene, load_scene, render
from raytrace_ii.rendering import render_sets as reference
from raytrace_ii.scene.hashing import content_hash
from raytrace_ii.tracing.packing import packed
from tests.support.processes import hear_interrupts
from tests.support.trace_scenes import body, hall, sphere, wall

CAMERA = preset("setup1", scale=64)
NAMES = ("one", "two", "three")


@pytest.fixture
def small_set(monkeypatch):
    """Replace the set by three quick scenes; yield the loaded scenes, which tests may change."""
    scenes = {name: dataclasses.replace(hall(), ambient=(0.1 * i,) * 3, name=name) for i, name in enumerate(NAMES)}
    monkeypatch.setitem(reference.SETS, "small", NAMES)
    monkeypatch.setattr(reference, "load_scene", scenes.get)
    monkeypatch.setattr(reference, "FLAT_PIXELS", 64)
    return scenes


def make(folder, **options):
    """Render the set; return the manifest, and the files made."""
    made = []

    def tell(title, done, total):
        if title not in made:
            made.append(title)

    options = {"progress": tell, "poses": [None], **options}
    return reference.render_set("small", folder, [CAMERA], **options), made


def files(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir() if path.name != "manifest.json"}


def test_a_set_is_pictures_support_images_projections_a_contact_sheet_and_a_manifest(small_set, tmp_path):
    manifest, made = make(tmp_path, samples=2, seed=5)
    assert made == [f"{name}{end}" for name in NAMES for end in (".png", "_support.exr", "_flat.png")]
    shot = render(small_set["two"], CAMERA, samples=2, seed=5)
    np.testing.assert_array_equal(IIPicture.load(tmp_path / "two.png").pixels, shot.picture.pixels)
    support = read_channels(tmp_path / "two_support.exr")
    centres = render(small_set["two"], CAMERA, support=("depth", "disparity"))
    np.testing.assert_array_equal(support["depth.Z"], centres.depth)
    np.testing.assert_array_equal(support["disparity"], centres.disparity)
    assert {"normal.X", "objectId", "rayLength"} < set(support)
    assert IIPicture.load(tmp_path / "two_flat.png").size == (64, 32)
    assert read_image(tmp_path / "contact.png").shape[1] == 2 * 480 + 3 * 8 - 4, "two panels in a row"
    stored = json.loads((tmp_path / "manifest.json").read_text())
    assert stored == json.loads(json.dumps(manifest))
    options = {"samples": 2, "error": None, "seed": 5, "noise": 0.0, "dtype": "uint8", "texture_filter": True}
    assert stored["options"] == options
    assert stored["camera"][0]["name"] == "setup1" and set(stored["scenes"]) == set(NAMES)
    picture = stored["scenes"]["two"]["products"]["picture"]
    assert picture["rays"] == shot.stats.rays and picture["samples"] == {"2": 128 * 64} and picture["seconds"] > 0
    assert stored["scenes"]["two"]["hash"] == content_hash(small_set["two"])


@pytest.mark.slow
def test_only_what_changed_is_made_again(small_set, tmp_path):
    make(tmp_path)
    before = files(tmp_path)
    assert make(tmp_path)[1] == [] and files(tmp_path) == before

    pictures = [f"{name}.png" for name in NAMES]
    for option in ({"seed": 1}, {"noise": 1.0}, {"samples": (4, 8)}, {"samples": (4, 8), "error": 3.0}, {"bits": 16}):
        assert make(tmp_path, **option)[1] == pictures, option
    assert make(tmp_path)[1] == pictures
    before = files(tmp_path)
    assert make(tmp_path, workers=1)[1] == [], "who renders does not matter"

    small_set["two"] = dataclasses.replace(small_set["two"], max_depth=2)
    assert make(tmp_path)[1] == ["two.png", "two_support.exr", "two_flat.png"]
    changed = {name for name, written in files(tmp_path).items() if written != before[name]}
    assert changed == {
        "two.png", "two.png.json", "two_support.exr",
        "two_flat.png", "two_flat.png.json", "two_flat_support.exr", "contact.png",
    }  # fmt: skip

    assert make(tmp_path, poses=[np.diag([1.0, 1.0, 1.0, 1.0]) + np.eye(4, k=3) * 2])[1] == [
        f"{name}{end}" for name in NAMES for end in (".png", "_support.exr")
    ]


def test_missing_and_changed_files_are_made_again(small_set, tmp_path):
    make(tmp_path)
    (tmp_path / "one.png").unlink()
    (tmp_path / "two_flat_support.exr").unlink()
    damaged = bytearray((tmp_path / "three_support.exr").read_bytes())
    damaged[-1] ^= 1
    (tmp_path / "three_support.exr").write_bytes(damaged)
    (tmp_path / "contact.png").write_bytes(b"")
    assert make(tmp_path)[1] == ["one.png", "two_flat.png", "three_support.exr"]
    assert read_image(tmp_path / "contact.png").size > 0
    assert make(tmp_path)[1] == []


@pytest.mark.parametrize("stop_at", ["one.png", "two_support.exr", "three_flat.png"])
def test_an_interrupted_set_continues(small_set, tmp_path, stop_at):
    made = []

    def stop(title, done, total):
        if title not in made:
            made.append(title)
        if title == stop_at:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(tmp_path, progress=stop)
    finished = files(tmp_path)
    assert stop_at not in finished and not any(name.startswith(".") for name in finished)
    rest = make(tmp_path)[1]
    assert rest[0] == stop_at and made[:-1] + rest == [
        f"{name}{end}" for name in NAMES for end in (".png", "_support.exr", "_flat.png")
    ]
    assert {name: t for name, t in files(tmp_path).items() if name in finished} == finished


@pytest.mark.slow
def test_an_interrupt_from_outside(tmp_path):
    """The command on the real scenes: after Ctrl-C the manifest lists all finished files, and all are whole."""
    out = tmp_path / "set"
    command = [sys.executable, "-m", "raytrace_ii.cli", "render", "--set", "reference", "--scale", "128", "-o", out]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=hear_interrupts)
    try:
        deadline = time.monotonic() + 240  # with nothing compiled, on a busy machine, the first took over 60
        while not (out / "apples_flat.png").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        error = process.communicate(timeout=60)[1]
    finally:
        process.kill()
    assert process.returncode == 130 and "Traceback" not in error
    assert error.endswith("interrupted\n")
    manifest = json.loads((out / "manifest.json").read_text())
    assert "picture" in manifest["scenes"]["apples"]["products"] and "twins" not in manifest["scenes"]
    assert not [name for name in os.listdir(out) if name.startswith(".")]


def test_strange_files_are_not_replaced(small_set, tmp_path):
    (tmp_path / "two.png").write_bytes(b"mine")
    with pytest.raises(FileExistsError, match=r"two\.png is there already and not of this set: --force"):
        make(tmp_path)
    assert (tmp_path / "two.png").read_bytes() == b"mine" and len(list(tmp_path.iterdir())) == 1
    make(tmp_path, force=True)
    assert IIPicture.load(tmp_path / "two.png").size == (128, 64)


def test_wrong_input_is_one_line(run, refused, tmp_path):
    def call(*arguments):
        return run("render", *arguments)

    out = ("-o", tmp_path / "set")
    refused(call("--set", "all", *out), "unknown set 'all': known are reference")
    refused(call("apples", "--set", "reference", *out), "one of a scene, --set and --rgbd is needed")
    refused(call(*out), "one of a scene, --set and --rgbd is needed")
    refused(call("--set", "reference", "--depth", tmp_path / "d.exr", *out), "a set includes all support images")
    refused(call("--set", "reference", "--samples", "0", "--scale", "64", *out), "samples is 0")
    refused(call("--set", "reference", "--scale", "7", *out), "scale 7 does not divide")
    assert not (tmp_path / "set").exists()
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "manifest.json").write_text("{}")
    refused(call("--set", "reference", "--scale", "64", *out), "is not the manifest of the set 'reference'")
    (tmp_path / "set" / "manifest.json").write_text("{")
    refused(call("--set", "reference", "--scale", "64", *out), "manifest.json: ")


def test_the_hash_of_a_scene_is_that_of_its_content():
    one, two = load_scene("apples"), load_scene("apples")
    assert content_hash(one) == content_hash(two)
    assert packed(one) is not None and content_hash(one) == content_hash(two), "Embree's trees do not count"
    hashes = {content_hash(one)}
    first = one.bodies[0]
    moved = np.array(first.vertices)
    moved[0, 0] = np.nextafter(moved[0, 0], np.inf)
    for bodies in (
        (dataclasses.replace(first, vertices=moved), *one.bodies[1:]),
        (dataclasses.replace(first, material=dataclasses.replace(first.material, ior=1.6)), *one.bodies[1:]),
        one.bodies[1:],
    ):
        hashes.add(content_hash(dataclasses.replace(one, bodies=bodies)))
    hashes.add(content_hash(one.with_depth(one.max_depth + 1)))
    assert len(hashes) == 5


def test_different_values_have_different_hashes():
    values = [
        1, 1.0, True, "1", None, [1], [[1]], [1, [2]], [[1], 2], "", [], ["ab", "c"], ["a", "bc"],
        np.zeros(3), np.zeros((1, 3)), np.zeros(3, np.float32), {"a": 1}, Scene(bodies=[body(wall(5))]),
        Scene(bodies=[body(sphere(1))]),
    ]  # fmt: skip
    assert len({content_hash(value) for value in values}) == len(values)
    assert content_hash((1, 2)) == content_hash([1, 2]) == content_hash([np.int64(1), np.int32(2)])
    with pytest.raises(TypeError, match="no content hash"):
        content_hash(object())
