"""Takes: orders over view and time, coding by every pseudo video scheme, rates, damage, random access."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from codec import DamagedTake, EncodedTake, Plan, component_cost, encode_take, open_take, take_floor, view_cost
from codec.coders import groups
from codec.coders.pseudo_video import PseudoVideo, Source
from codec.contract import find, schemes
from codec.takes.order import WALKS
from ii_core import IIPicture, open_video, sub_images, video_of
from ii_core.base.files import read_image, read_json

VIDEO_SCHEMES = [name for name in schemes() if isinstance(find(name), PseudoVideo)]
LENSES, EI = (32, 32), (4, 3)  # 12 sub-images of 32×32, 1024 elementary images of 4×3


def take(frames=5, lenses=LENSES, ei=EI):
    """Return a pattern that moves by one pixel per frame, and by one per view."""
    (k, l), (u, v) = lenses, ei
    y, x = np.mgrid[: l * v, : k * u]
    row, col, side, up = y // v, x // u, x % u, y % v
    shown = []
    for t in range(frames):
        s = 128 + 80 * np.sin((col + side + t) / 4) + 40 * np.cos((row + up) / 3)
        shown.append(IIPicture(np.stack([s, s[::-1], 255 - s], axis=2).clip(0, 255).astype(np.uint8), lenses, ei))
    return video_of(shown, fps=10)


# Orders


@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize(
    ("views", "instants", "group", "strip"), [(12, 5, 0, 4), (12, 4, 3, 2), (7, 1, 0, 3), (1, 6, 1, 1), (10, 3, 5, 8)]
)
def test_every_frame_once_and_groups_apart(walk, views, instants, group, strip):
    plan = Plan(walk=walk, group=group, strip=strip)
    table = plan.table(views, instants)
    assert sorted(map(tuple, table.tolist())) == [(j, t) for j in range(views) for t in range(instants)]
    size = plan.group_frames(views, instants)
    for first in range(0, len(table), size):
        held = table[first : first + size, 0]
        assert np.ptp(held) + 1 == (group or views) and set(table[first : first + size, 1]) == set(range(instants))


@pytest.mark.parametrize("walk", WALKS)
def test_consecutive_frames_are_neighbours_in_view_or_time(walk):
    table = Plan(walk=walk, strip=4).table(12, 5)
    steps = np.abs(np.diff(table, axis=0))
    within = np.ones(len(steps), bool)
    if walk == "interleaved":
        within[4 * 5 - 1 :: 4 * 5] = False  # from strip to strip
    assert (steps[within].sum(axis=1) == 1).all()


def test_walks_by_hand():
    def walked(walk, **more):
        return [f"{j}{t}" for j, t in Plan(walk=walk, **more).table(4, 2).tolist()]

    assert walked("view-first") == ["00", "10", "20", "30", "31", "21", "11", "01"]
    assert walked("time-first") == ["00", "01", "11", "10", "20", "21", "31", "30"]
    assert walked("interleaved", strip=2) == ["00", "10", "11", "01", "20", "30", "31", "21"]
    assert walked("view-first", group=2) == walked("interleaved", strip=2)


def test_an_interleaved_frame_finds_both_neighbours_within_its_references():
    strip = 4
    table = Plan(walk="interleaved", strip=strip).table(12, 6).tolist()
    place = {tuple(frame): i for i, frame in enumerate(table)}
    back = [place[j, t] - place[j, t - 1] for j, t in place if t]
    assert max(back) == 2 * strip - 1 and min(back) == 1


# Random access, in closed form


@pytest.mark.parametrize(
    ("walk", "span", "group"),
    [
        ("view-first", 4, 0),
        ("time-first", 4, 0),
        ("time-first", 4, 1),
        ("interleaved", 2, 4),
        ("view-first", 1, 0),
        ("view-first", 1, 1),
    ],
)
def test_a_component_image_costs_half_its_group(walk, span, group):
    views, instants = 12, 8
    cost = component_cost(Plan(walk=walk, span=span, group=group), views, instants)
    size = span * (group or views)
    assert (cost.mean, cost.worst) == ((size + 1) / 2, size)


def test_a_view_image_of_all_views_in_closed_form():
    views, span, every = 12, 4, range(12)
    first = view_cost(Plan(walk="view-first", span=span), views, 8, every)
    assert (first.mean, first.worst) == (views * (span + 1) / 2, views * span)  # whole instants up to this one
    films = view_cost(Plan(walk="time-first", span=span, group=1), views, 8, every)
    assert (films.mean, films.worst) == (views * (span + 1) / 2, views * span)
    long = view_cost(Plan(walk="time-first", span=span), views, 8, every)
    assert (long.mean, long.worst) == ((views - 1) * span + (span + 1) / 2, views * span)
    alone = view_cost(Plan(walk="view-first", span=1, group=1), views, 8, [3, 7])
    assert (alone.mean, alone.worst) == (2, 2)


def test_a_short_last_segment_counts_as_long_as_it_is():
    cost = component_cost(Plan(span=4), 3, 6)  # groups of 12 and of 6 frames
    assert cost.mean == pytest.approx((12 * 6.5 + 6 * 3.5) / 18) and cost.worst == 12


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"walk": "x"}, "known are"),
        ({"span": -1}, "span is -1"),
        ({"strip": 0}, "strip is 0"),
        ({"group": 5}, "group is 5 views: a divisor of their number 12"),
    ],
)
def test_invalid_plans_are_refused(change, named):
    with pytest.raises(ValueError, match=named):
        Plan(**change).check(12)


# Coding


@pytest.mark.parametrize("scheme", [name for name in VIDEO_SCHEMES if not name.startswith("ri")])
def test_every_scheme_codes_takes_and_gives_component_images_alone(scheme, tmp_path):
    coder, small = find(scheme), scheme.startswith("ei")
    video = take(5, (4, 4), (32, 32)) if small else take()
    given = {} if coder.qp_range is None else {"qp": coder.qp_range[0] + 10}
    plan = Plan(walk="interleaved", span=3, group=2 if "gop" in coder.options else 0, strip=2)
    coded = encode_take(video, scheme, plan=plan, path=tmp_path / "t.ii", **given)
    assert (tmp_path / "t.ii").stat().st_size == coded.nbytes
    assert coded.bpp == pytest.approx(8 * coded.nbytes / (5 * np.prod(video.size)))
    assert coded.mbit_per_second == pytest.approx(8e-6 * coded.nbytes / 0.5)
    whole, alone = open_take(tmp_path / "t.ii"), open_take(tmp_path / "t.ii")
    assert (whole.frames, whole.fps, whole.structure.lenses) == (5, 10, video.structure.lenses)
    for frame in (4, 1):
        error = np.abs(whole[frame].pixels.astype(int) - video[frame].pixels).mean()
        assert error < (1e-9 if scheme.endswith("ffv1") else 12), (frame, error)
        for place in ((1, 2), (3, 0)):
            np.testing.assert_array_equal(
                alone.component(frame, coder.kind, place), whole.component(frame, coder.kind, place)
            )
    assert not alone._kept, "no whole frame was decoded"


def test_a_group_alone_is_decoded_for_a_component_image(monkeypatch):
    """With groups of one view and three instants no image costs more than three frames."""
    coded = encode_take(take(6), "si-h264", qp=30, plan=Plan(walk="time-first", span=3, group=1))
    counts = []
    original = groups.decode_frame

    def counted(stream, index, dtype):
        start, stop = stream.group(index)
        counts.append((index - start + 1, stop - start))
        return original(stream, index, dtype)

    monkeypatch.setattr(groups, "decode_frame", counted)
    video = open_take(coded)
    for frame in range(6):
        for view in range(12):
            video.component(frame, "si", (view % 4, view // 4))
    cost = component_cost(coded.plan, 12, 6)
    assert np.mean([done for done, _ in counts]) == cost.mean == 2 and max(size for _, size in counts) == 3


def test_orders_are_permutations_of_the_same_pictures():
    video = take(4)
    for walk in WALKS:
        back = open_take(encode_take(video, "si-ffv1", plan=Plan(walk=walk, span=2)))
        for a, b in zip(back, video, strict=True):
            np.testing.assert_array_equal(a.pixels, b.pixels)


@pytest.mark.parametrize("rate", ["take", "segment"])
def test_a_target_rate_is_met_over_the_take(rate):
    video = take(12, (48, 48), (4, 3))
    coded = encode_take(video, "si-h264", bpp=0.6, rate=rate, plan=Plan(span=2))
    assert coded.reached and abs(coded.bpp / 0.6 - 1) <= 0.02


def test_a_still_take_costs_less_than_its_pictures():
    """A still take costs far less than its pictures one by one."""
    still = video_of([take(1)[0]] * 8)
    single = encode_take(still, "si-h264", qp=28, plan=Plan(span=1))
    for walk in WALKS:
        assert encode_take(still, "si-h264", qp=28, plan=Plan(walk=walk, span=8)).nbytes < 0.6 * single.nbytes


@pytest.mark.parametrize(("scheme", "options", "named"), [
    ("jpeg2000", {"bpp": 1}, "codes no takes: a pseudo video sequence"), ("si-h264", {}, "exactly one of bpp and qp"),
    ("si-h264:gop=4", {"qp": 30}, "the plan's span and group"), ("si-h264", {"qp": 30, "rate": "x"}, "unknown rate"),
    ("si-h264", {"qp": 30, "plan": Plan(group=5)}, "divisor"),
    ("si-avif", {"qp": 30, "plan": Plan(group=3)}, "no groups of pictures"),
])  # fmt: skip
def test_uncodable_takes_are_refused(scheme, options, named):
    with pytest.raises(ValueError, match=named):
        encode_take(take(2), scheme, **options)


# Files


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    coded = encode_take(take(7), "si-h264", qp=30, plan=Plan(span=2))
    path = tmp_path_factory.mktemp("takes") / "t.ii"
    coded.save(path)
    return coded, path


def test_files_of_takes_round_trip(saved):
    coded, path = saved
    again = EncodedTake.load(path)
    for name in ("scheme", "options", "structure", "dtype", "frames", "fps", "plan", "segments", "qp"):
        assert getattr(again, name) == getattr(coded, name), name
    assert again.nbytes == path.stat().st_size


def test_partial_decodes_the_frames_before_the_damage(saved, tmp_path):
    coded, path = saved
    data = path.read_bytes()
    start = len(data) - sum(map(len, coded.segments[2:])) - 30
    for name, broken, wrong in (
        ("cut", data[:-5], "is truncated, in segment 4 of 4"),
        ("flipped", data[:start] + bytes([data[start] ^ 1]) + data[start + 1 :], "is damaged, in segment"),
    ):
        file = tmp_path / f"{name}.ii"
        file.write_bytes(broken)
        with pytest.raises(DamagedTake, match=wrong) as caught:
            open_take(file)
        assert "can be decoded with partial=True" in str(caught.value)
        video = open_take(file, partial=True)
        assert video.frames == 2 * caught.value.whole
        for frame in range(video.frames):
            np.testing.assert_array_equal(video[frame].pixels, open_take(coded)[frame].pixels)


def test_truncation_and_flipped_bytes_are_detected(saved, tmp_path):
    _, path = saved
    data, file = path.read_bytes(), tmp_path / "bad.ii"
    rng = np.random.default_rng(0)
    for at in [*range(60), *rng.integers(0, len(data), 60).tolist()]:
        for broken in (data[:at], data[:at] + bytes([data[at] ^ 16]) + data[at + 1 :]):
            file.write_bytes(broken)
            with pytest.raises(ValueError, match=r"truncated|damaged|no coded take|version"):
                open_take(file)
    file.write_bytes(data + b"x")
    with pytest.raises(ValueError, match="1 bytes more"):
        open_take(file)


class Stopped(Exception):
    pass


@pytest.fixture
def encoder_runs(monkeypatch):
    """A list that grows by one with every run of an encoder."""
    runs, run_parts = [], Source.run_parts
    monkeypatch.setattr(Source, "run_parts", lambda source, parts: runs.append(None) or run_parts(source, parts))
    return runs


@pytest.mark.slow
def test_a_killed_run_continues_after_its_last_segment(tmp_path, encoder_runs):
    take(40).save(tmp_path / "take")
    code = (
        "from ii_core import open_video; from codec import encode_take, Plan\n"
        f"encode_take(open_video({str(tmp_path / 'take')!r}), 'si-h264:preset=veryslow', qp=20, "
        f"plan=Plan(span=1), path={str(tmp_path / 't.ii')!r})"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    part, deadline = tmp_path / "t.ii.part.json", time.monotonic() + 100
    while time.monotonic() < deadline and (not part.exists() or part.read_text().count(",") < 4):
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert part.exists() and not (tmp_path / "t.ii").exists()

    video, kept = open_video(tmp_path / "take"), len(read_json(part)["segments"])
    given = {"qp": 20, "plan": Plan(span=1)}
    again = encode_take(video, "si-h264:preset=veryslow", path=tmp_path / "t.ii", **given)
    assert 4 <= kept < 40 and len(encoder_runs) == 40 - kept
    assert again.segments == encode_take(video, "si-h264:preset=veryslow", **given).segments
    assert sorted(os.listdir(tmp_path)) == ["t.ii", "take"]


def interrupted(video, path, after, **goal):
    """Code a take and stop after so many segments."""

    def progress(done, total):
        if done == after:
            raise Stopped

    with pytest.raises(Stopped):
        encode_take(video, "si-h264", plan=Plan(span=1), path=path, progress=progress, **goal)


@pytest.mark.parametrize(
    ("goal", "after"), [({"qp": 30}, 3), ({"bpp": 0.6}, 7), ({"bpp": 0.6, "rate": "segment"}, 3)]
)
def test_no_segment_is_coded_twice_after_an_interruption(goal, after, tmp_path, encoder_runs):
    """A search of four segments that stops at its seventh has one whole trial and three segments of the second."""
    video = take(4, (48, 48), (4, 3))
    plain = encode_take(video, "si-h264", plan=Plan(span=1), **goal)
    needed = len(encoder_runs)
    interrupted(video, tmp_path / "t.ii", after, **goal)
    again = encode_take(video, "si-h264", plan=Plan(span=1), path=tmp_path / "t.ii", **goal)
    assert len(encoder_runs) - needed == needed > after
    assert again.segments == plain.segments and os.listdir(tmp_path) == ["t.ii"]


def test_kept_segments_of_other_pictures_or_settings_are_not_used(tmp_path, encoder_runs):
    video = take(4)
    interrupted(video, tmp_path / "t.ii", 3, qp=30)
    frames = list(video)
    frames[1] = frames[1].with_pixels(255 - frames[1].pixels)
    del encoder_runs[:]
    changed = encode_take(video_of(frames, fps=10), "si-h264", qp=30, plan=Plan(span=1), path=tmp_path / "t.ii")
    assert len(encoder_runs) == 2, "the changed frame and the last one"
    np.testing.assert_allclose(open_take(changed)[1].pixels, frames[1].pixels, atol=60)
    interrupted(video, tmp_path / "t.ii", 3, qp=30)
    del encoder_runs[:]
    encode_take(video, "si-h264", qp=31, plan=Plan(span=1), path=tmp_path / "t.ii")
    assert len(encoder_runs) == 4


def test_a_truncated_file_of_kept_segments_gives_its_whole_ones(tmp_path, encoder_runs):
    video = take(4)
    interrupted(video, tmp_path / "t.ii", 3, qp=30)
    part = tmp_path / "t.ii.part"
    part.write_bytes(part.read_bytes()[:-1])
    del encoder_runs[:]
    again = encode_take(video, "si-h264", qp=30, plan=Plan(span=1), path=tmp_path / "t.ii")
    assert len(encoder_runs) == 2
    assert again.segments == encode_take(video, "si-h264", qp=30, plan=Plan(span=1)).segments


def test_a_segment_larger_than_allowed_is_refused(saved):
    with pytest.raises(ValueError, match="raise max_pixels"):
        open_take(saved[1], max_pixels=1000)


def test_sub_images_of_a_coded_take_are_those_of_its_frames(saved):
    video = open_take(saved[1])
    np.testing.assert_array_equal(video.component(6, "si", (2, 1)), sub_images(open_take(saved[1])[6])[1, 2])


# The command


@pytest.mark.slow
def test_the_command_codes_and_decodes_takes(run, tmp_path):
    video = take(5)
    video.save(tmp_path / "take")
    code, out, err = run(
        "encode", tmp_path / "take", "--qp", 30, "--walk", "time-first", "--span", 2, "-o", tmp_path / "t.ii"
    )
    assert code == 0 and "5 frames" in out and "Mbit/s" in out, err
    coded = EncodedTake.load(tmp_path / "t.ii")
    assert coded.plan == Plan(walk="time-first", span=2) and coded.fps == 10
    assert run("decode", tmp_path / "t.ii", "-o", tmp_path / "back")[0] == 0
    assert run("decode", tmp_path / "t.ii", "--frame", 4, "-o", tmp_path / "four.png")[0] == 0
    back, four = open_video(tmp_path / "back"), IIPicture.load(tmp_path / "four.png")
    assert (back.frames, back.fps) == (5, 10)
    np.testing.assert_array_equal(back[4].pixels, four.pixels)
    assert run("decode", tmp_path / "t.ii", "--frame", 4, "--component", "2,1", "-o", tmp_path / "si.png")[0] == 0
    np.testing.assert_array_equal(read_image(tmp_path / "si.png"), sub_images(four)[1, 2])
    (tmp_path / "cut.ii").write_bytes((tmp_path / "t.ii").read_bytes()[:-3])
    code, _, err = run("decode", tmp_path / "cut.ii", "-o", tmp_path / "part")
    assert code == 2 and "frames 0..3 can be decoded with partial=True (--partial)" in err
    assert run("decode", tmp_path / "cut.ii", "--partial", "-o", tmp_path / "part")[0] == 0
    assert open_video(tmp_path / "part").frames == 4
    for words, named in ((("--frame", 9), "frames 0..4"), (("--component", "0,0"), "needs its --frame")):
        code, _, err = run("decode", tmp_path / "t.ii", *words, "-o", tmp_path / "x.png")
        assert code == 2 and named in err


# Header portion


def test_headers_of_a_take_follow_from_its_numbers_of_pictures():
    """N_I·h_I + N_P·h_P: two cases give h_I and h_P, others must follow."""
    views, lenses, ei = 12, (32, 32), (4, 3)

    def bits(frames, **plan):
        return take_floor("si-h264", lenses, ei, frames=frames, plan=Plan(**plan)).bits

    # one I picture and 11 others a segment of one instant; 6 instants in groups of 6 views: 2 I pictures
    one, two = bits(1, span=1), bits(1, span=1, group=6)
    intra = two - one  # h_I − h_P
    other = (one - intra) / views  # h_P
    for frames, plan in (
        (6, {"span": 1}),
        (6, {"span": 6}),
        (6, {"span": 3, "group": 4}),
        (8, {"span": 4, "group": 1}),
    ):
        segments = frames // plan["span"]
        count = segments * views // plan.get("group", views)
        expected = count * intra + frames * views * other
        for walk in WALKS:
            assert bits(frames, walk=walk, **plan) == pytest.approx(expected, rel=0.03), (plan, walk)
    floor = take_floor("si-h264", lenses, ei, frames=6, plan=Plan(span=6))
    assert floor.portion(floor.bpp) == 1 and floor.portion(2 * floor.bpp) == 0.5


def test_a_take_has_an_instant():
    """Segments of no instants divided by zero."""
    for ask in (Plan().count, Plan().segments):
        with pytest.raises(ValueError, match="instants"):
            ask(0)
