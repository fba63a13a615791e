"""Commands that write into folders: a refused one leaves the disk as it was.

The tests of refused commands in `test_faults.py` compare files, and cannot detect an empty folder.
"""

import numpy as np
import pytest

from codec import encode_take
from ii_core import IICamera, IIPicture, video_of
from ii_core.base.files import write_image

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
