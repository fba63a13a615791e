"""Wrong calls of public functions: the script's attack with fewer values, and its own judgement."""

import numpy as np
import pytest

from benchmarks.stability import wrong_calls
from benchmarks.stability.wrong_calls import Call, attack, calls, outcome, untried

FEW = [
    None,
    True,
    -1,
    float("nan"),
    10**400,
    "text",
    np.zeros((0, 3)),
    [[1, 2], [3]],
    {"a": None},
    slice("a", None),
    object(),
]
# Functions without a call of their own: they need takes, raw pictures, displays or scores.
WITHOUT = {
    "calibrate", "calibrated_picture", "centres_picture", "component_cost", "converging_distance", "crosstalk",
    "decode_levels", "decode_view", "embed_viewer", "encode_take", "eye_image", "is_take", "load_take",
    "measure_take", "open_take", "opinion_scores", "pair_scale", "open_video", "predicted_scores", "render_take",
    "screened_observers", "simulated_scores", "simulated_wins", "take_floor", "time_chart", "video_of", "view_cost",
    "viewing_zone", "write_view_folders",
}  # fmt: skip


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    return calls(tmp_path_factory.mktemp("calls"))


def test_no_error_is_accidental(named, tmp_path, monkeypatch):
    """On b1dc540 1271 of 4530 calls raised AttributeErrors, IndexErrors and accidental TypeErrors."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(wrong_calls, "SLOW", {"plot_all", "q_depth", "depth_from_focus"})
    counts, findings = attack(named, FEW)
    assert not findings
    assert counts["refused"] > 3000


def test_every_public_function_is_tried_with_every_argument(named):
    missing = {entry.partition("(")[0] for entry in untried(named)}
    assert missing - WITHOUT == {"encode"} & missing  # its three targets exclude one another
    assert not {name for name in WITHOUT if name in named}


def test_judgement():
    def indexes(argument):
        return [1, 2, 3][argument]

    def names(argument):
        raise ValueError(f"argument is {argument}: another is needed")

    def hides(argument):
        raise TypeError("unsupported operand")

    assert outcome(Call(indexes, {"argument": 0}), "argument", 1) == "taken"
    assert outcome(Call(indexes, {"argument": 0}), "argument", 9).startswith("IndexError")
    assert outcome(Call(names, {"argument": 0}), "argument", 9) == "refused"
    assert outcome(Call(hides, {"argument": 0}), "argument", 9).startswith("not named: TypeError")
