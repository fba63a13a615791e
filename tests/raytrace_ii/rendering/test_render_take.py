"""Takes in a folder: frames, repeated frames, and interrupted runs."""

import json
import os
import signal
import subprocess
import sys
import time
import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from ii_core import IIPicture, preset
from raytrace_ii import load_take, render, render_take
from tests.raytrace_ii.files.test_take import BALLS, MOVES

CAMERA = preset("setup1", scale=64)
FRAMES = [0, 3, 4]


@pytest.fixture
def take(tmp_path):
    return take_of(tmp_path, BALLS + MOVES)


def take_of(folder, text):
    (folder / "moving.toml").write_text(text, encoding="utf-8")
    return load_take(folder / "moving.toml")


def stamps(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("frame_*")}


def test_frames_are_the_stills_of_their_instant(take, tmp_path):
    manifest = render_take(take, tmp_path / "out", CAMERA, frames=FRAMES, support={"s.exr": ["depth", "object_id"]})
    assert sorted(manifest["frames"]) == ["0", "3", "4"]
    for number in FRAMES:
        t = number / take.fps
        still = render(take.scene_at(t), CAMERA, pose=take.pose_at(t), support=())
        shown = IIPicture.load(tmp_path / "out" / f"frame_{number:04}.png")
        np.testing.assert_array_equal(shown.pixels, still.picture.pixels)
        assert shown.camera == CAMERA
        assert (tmp_path / "out" / f"frame_{number:04}_s.exr").is_file()
        np.testing.assert_allclose(manifest["frames"][str(number)]["pose"], take.pose_at(t))


def test_other_executors_give_the_same_files(take, tmp_path):
    render_take(take, tmp_path / "a", CAMERA, frames=[2], workers=1)
    with ThreadPoolExecutor(2) as pool:
        render_take(take, tmp_path / "b", CAMERA, frames=[2], executor=pool)
    files = [(tmp_path / name / "frame_0002.png").read_bytes() for name in "ab"]
    assert files[0] == files[1]


def test_only_what_a_keyframe_changes_is_made_again(take, tmp_path):
    render_take(take, tmp_path / "out", CAMERA, frames=range(6))
    before = stamps(tmp_path / "out")
    render_take(take, tmp_path / "out", CAMERA, frames=range(6))
    assert stamps(tmp_path / "out") == before, "nothing has changed"
    # the light's second keyframe holds from frame 5 on
    changed = take_of(tmp_path, BALLS + MOVES.replace("[1, -1, 0]", "[-1, -1, 0]"))
    render_take(changed, tmp_path / "out", CAMERA, frames=range(6))
    again = {name for name, when in stamps(tmp_path / "out").items() if before[name] != when}
    assert again == {"frame_0005.png", "frame_0005.png.json"}


def test_a_damaged_frame_is_made_again(take, tmp_path):
    render_take(take, tmp_path / "out", CAMERA, frames=[0, 1])
    whole = (tmp_path / "out" / "frame_0001.png").read_bytes()
    (tmp_path / "out" / "frame_0001.png").write_bytes(whole[:-9])
    render_take(take, tmp_path / "out", CAMERA, frames=[0, 1])
    assert (tmp_path / "out" / "frame_0001.png").read_bytes() == whole


@pytest.mark.slow
def test_a_killed_take_goes_on(tmp_path):
    """SIGKILL leaves whole frames, of which at most the last is made again."""
    take_of(tmp_path, BALLS + MOVES.replace("frames = 11", "frames = 400"))
    command = [
        sys.executable, "-m", "raytrace_ii.cli", "render", str(tmp_path / "moving.toml"), "--frames", "all",
        "--scale", "64", "-o", str(tmp_path / "out"),
    ]  # fmt: skip
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while len(list((tmp_path / "out").glob("frame_*.png"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    recorded = json.loads((tmp_path / "out" / "manifest.json").read_text())["frames"]
    pictures = {path.name for path in (tmp_path / "out").glob("frame_*.png")}
    assert 2 <= len(recorded) < 400 and 0 <= len(pictures) - len(recorded) <= 1
    before = stamps(tmp_path / "out")
    count = len(recorded) + 2
    take = load_take(tmp_path / "moving.toml")
    render_take(take, tmp_path / "out", preset("setup1", scale=64), frames=range(count))
    after = stamps(tmp_path / "out")
    assert all(after[f"frame_{int(number):04}.png"] == before[f"frame_{int(number):04}.png"] for number in recorded)
    assert len([name for name in after if name.endswith(".png")]) == count


@pytest.mark.slow
def test_memory_is_that_of_a_still_however_many_frames(take, tmp_path):
    """Peaks of numpy's and Python's allocations, after a first frame has filled the caches."""
    camera = preset("setup1", scale=32)

    def peak(count):
        tracemalloc.start()
        render_take(take, tmp_path / f"{count}", camera, frames=range(count), workers=1)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(1)
    frame = 3 * camera.pixels[0] * camera.pixels[1]
    assert peak(5) <= peak(2) + frame


def test_other_files_are_not_overwritten(take, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "frame_0001.png").write_bytes(b"mine")
    with pytest.raises(FileExistsError, match=r"frame_0001.png is there already and not of this take"):
        render_take(take, tmp_path / "out", CAMERA)
    assert os.listdir(tmp_path / "out") == ["frame_0001.png"]
    render_take(take, tmp_path / "out", CAMERA, frames=[1], force=True)
    assert IIPicture.load(tmp_path / "out" / "frame_0001.png").size == CAMERA.pixels


def test_a_folder_holds_one_take(take, tmp_path):
    render_take(take, tmp_path / "out", CAMERA, frames=[0])
    (tmp_path / "other.toml").write_text(BALLS + MOVES, encoding="utf-8")
    with pytest.raises(ValueError, match="not the manifest of the take 'other'"):
        render_take(load_take(tmp_path / "other.toml"), tmp_path / "out", CAMERA)


def test_missing_frames_are_named(take, tmp_path, run):
    with pytest.raises(ValueError, match="frames holds 11: moving has 11, from 0 to 10"):
        render_take(take, tmp_path / "out", CAMERA, frames=[11])
    for frames, named in (("0..11", "LAST <= 10"), ("x", "one number, two like"), ("5..3", "FIRST <= LAST")):
        code, _, err = run(
            "render", tmp_path / "moving.toml", "--frames", frames, "--scale", 64, "-o", tmp_path / "out"
        )
        assert code == 2 and named in err
    code, _, err = run("render", "twins", "--frames", "0", "--scale", 64, "-o", tmp_path / "out")
    assert code == 2 and "does not move" in err


@pytest.mark.slow
@pytest.mark.parametrize("name", ["apples", "car", "cuboid"])
def test_reference_takes_move_in_every_frame(name):
    take = load_take(name)
    assert (take.frames, take.fps) == (48, 24)
    poses = np.stack([take.pose_at(t) for t in (0.0, 1.0, 47 / 24)])
    if name == "apples":
        assert take.scene_at(0.0) is take.scene_at(1.0) and np.ptp(poses[:, 0, 3]) == 12
    else:
        moving = [a is not b for a, b in zip(take.scene_at(0.0).bodies, take.scene_at(1.0).bodies, strict=True)]
        assert any(moving) and not all(moving) and not np.ptp(poses, axis=0).any()
