"""`si-lf` with references in time: round trips, groups in time, random access, damage."""

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec import EncodedTake, Plan, encode, encode_take, light_field_cost, open_take, take_floor
from codec.coders.lf import motion, segment
from codec.coders.lf.field import Field
from codec.coders.lf.state import MIXED, TIMED
from codec.contract import checked_options, find
from ii_core import IIPicture, sub_images, video_of
from tests.support.pictures import unpacked
from tests.support.slow import first_fast

FROZEN = unpacked("lf.zip")
PIXELS = {
    "take": "8b3cb59440303240863c58aa18f1e6b9c4e41870d01515ba256ac8f0cd051c5d",
    "tuned_take": "91a07b475cca35a7f71736e6bdecdd3553d78ed161b562d26da7d3196ca487f3",
}


def plane(frames=3, across=1.0, grid=(3, 3), height=16, width=24, dtype=np.uint8):
    """A plane of disparity 1 whose fine, band-limited texture moves by so many samples an instant, to the right."""
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 256, (height + 32, width + 64, 3)).astype(float)
    for axis in (0, 1):
        texture = (np.roll(texture, -1, axis) + 2 * texture + np.roll(texture, 1, axis)) / 4
    waves, turns = np.fft.fft(texture, axis=1), np.fft.fftfreq(texture.shape[1])[None, :, None]
    rows, cols = grid
    pictures = []
    for t in range(frames):
        field = np.empty((height, rows, width, cols, 3))
        moved = np.fft.ifft(waves * np.exp(-2j * np.pi * turns * across * t), axis=1).real.clip(0, 255)
        for v in range(rows):
            for u in range(cols):
                y, x = 16 + v - rows // 2, 32 + u - cols // 2
                field[:, v, :, u] = moved[y : y + height, x : x + width]
        scale = 257 if dtype == np.uint16 else 1
        pixels = (np.round(field) * scale).astype(dtype).reshape(height * rows, width * cols, 3)
        pictures.append(IIPicture(pixels, (width, height), (cols, rows)))
    return video_of(pictures, fps=10)


def noise(frames, lenses, ei, seed=0, dtype=np.uint8):
    rng = np.random.default_rng(seed)
    shape = lenses[1] * ei[1], lenses[0] * ei[0], 3
    return video_of([IIPicture(rng.integers(0, 256, shape).astype(dtype), lenses, ei) for _ in range(frames)], fps=1)


def error(video, again):
    return max(
        float(np.abs(one.pixels.astype(int) - other.pixels).mean()) for one, other in zip(video, again, strict=True)
    )


@pytest.mark.parametrize("across", first_fast([0.25, 1.0, -2.0]))
def test_motion_takes_few_bytes(across):
    """A plane that moves: a later instant costs less than a third of one coded alone, at a step of 4 codes.

    All residuals are transformed: blocks without a transform make the first instant cheaper, not the motion.
    """
    video = plane(across=across)
    taken, alone = (encode_take(video, "si-lf:tune=rgb,skip=0", qp=20, plan=Plan(span=span)) for span in (3, 1))
    first = len(alone.segments[0])
    later = (sum(map(len, taken.segments)) - first) / 2
    assert later < sum(map(len, alone.segments[1:])) / 2 / 3
    assert error(video, open_take(taken)) < 0.55
    assert len(encode_take(video, "si-lf:tune=rgb", qp=20).segments[0]) < len(taken.segments[0])


def test_an_instant_alone_is_coded_as_a_picture():
    """But for the segment's head and the picture's length."""
    video = plane(frames=1)
    (coded,) = encode_take(video, "si-lf", qp=30).segments
    assert coded.endswith(encode(video[0], "si-lf", qp=30).payload)


def test_a_still_scene_costs_almost_nothing():
    video = plane(frames=1, grid=(5, 5))
    still = video_of([video[0]] * 5, fps=10)
    one, five = (len(encode_take(v, "si-lf", qp=20).segments[0]) for v in (video, still))
    assert (five - one) / 4 < 0.02 * one


@settings(max_examples=5, deadline=None)
@given(
    st.tuples(st.integers(1, 6), st.integers(1, 6)),
    st.tuples(st.integers(1, 3), st.integers(1, 3)),
    st.integers(1, 4),
    st.sampled_from([np.uint8, np.uint16]),
)
def test_lossless_takes_of_any_size_keep_every_bit(lenses, ei, frames, dtype):
    video = noise(frames, lenses, ei, dtype=dtype)
    again = open_take(encode_take(video, "si-lf:lossless=1", plan=Plan(span=3)))
    for one, other in zip(video, again, strict=True):
        np.testing.assert_array_equal(one.pixels, other.pixels)


def test_groups_in_time_need_no_other():
    """Every second instant begins anew: a segment has the same bytes wherever it stands, and decodes alone."""
    video = plane(frames=4)
    whole = encode_take(video, "si-lf", qp=26, plan=Plan(span=2))
    (last,) = encode_take(video_of([video[2], video[3]], fps=10), "si-lf", qp=26, plan=Plan(span=2)).segments
    assert whole.segments[1] == last
    whole.segments[0] = b"damaged"
    again = open_take(whole)
    assert np.abs(again[3].pixels.astype(int) - video[3].pixels).mean() < 4
    with pytest.raises(ValueError, match="damaged in segment 1: its segment is of version 100"):
        again[0]


@pytest.mark.slow
def test_one_view_is_that_of_the_whole_and_takes_the_views_that_are_counted(monkeypatch):
    video = plane(frames=3, grid=(5, 6))
    coded = encode_take(video, "si-lf", qp=26, plan=Plan(span=3))
    whole, alone, counts, seen = open_take(coded), open_take(coded), [], segment.decode_view

    def counted(*arguments):
        pixels, views = seen(*arguments)
        counts.append(views)
        return pixels, views

    monkeypatch.setattr(segment, "decode_view", counted)
    images = [sub_images(whole[frame]) for frame in range(3)]
    for frame in range(3):
        for v in range(5):
            for u in range(6):
                np.testing.assert_array_equal(alone.component(frame, "si", (u, v)), images[frame][v, u])
    cost = light_field_cost(Plan(span=3), (6, 5), 3)
    assert (np.mean(counts), max(counts)) == (cost.mean, cost.worst)
    assert min(counts) == 1 and sorted(counts)[1] == 2  # the view in the middle, at instants 0 and 1


def test_blocks_are_predicted_in_time_alone_and_mixed(monkeypatch):
    kinds, code = set(), Field.code

    def noting(field, coder, job, work, *same):
        code(field, coder, job, work, *same)
        kinds.update(np.unique(job.blocks[0]).tolist())

    monkeypatch.setattr(Field, "code", noting)
    rng = np.random.default_rng(1)
    video = video_of(
        [p.with_pixels((p.pixels * 0.8 + rng.integers(0, 50, p.pixels.shape)).astype(np.uint8)) for p in plane()],
        fps=1,
    )
    open_take(encode_take(video, "si-lf", qp=26))[2]
    assert {TIMED, MIXED} <= kinds


def test_a_vector_is_one_number():
    for vector in [(0, 0, 0), (3, -motion.MOST, motion.MOST), (1, 5, -7)]:
        assert motion.unpacked(motion.packed(*vector)) == vector
    assert motion.unpacked(motion.STILL) == (0, 0, 0)


def test_threads_change_no_byte():
    video = plane(frames=2, grid=(5, 5))
    one, two = (encode_take(video, f"si-lf:threads={n}", qp=26).segments for n in (1, 2))
    assert one == two


@pytest.mark.slow
def test_a_rate_is_met_over_the_take():
    coded = encode_take(plane(), "si-lf", bpp=1.0)
    assert coded.reached


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.0, 0.02, 0.4, 0.9, 0.999])
def test_a_segment_that_ends_early_is_refused(part):
    video = plane(frames=3)
    (whole,) = encode_take(video, "si-lf", qp=20).segments
    options = checked_options(find("si-lf"), {})
    with pytest.raises(ValueError, match=r"ends early|too few|is empty|where its index says"):
        list(segment.decoded_fields(whole[: int(part * len(whole))], video.structure, options, 3))
    with pytest.raises(ValueError, match="has 1 bytes more than its 3 instants"):
        list(segment.decoded_fields(whole + b"x", video.structure, options, 3))


def test_damaged_segments_decode_to_something_or_are_refused():
    video = plane(frames=3)
    (whole,) = encode_take(video, "si-lf", qp=20).segments
    options = checked_options(find("si-lf"), {})
    rng = np.random.default_rng(0)
    for _ in range(40):
        damaged = bytearray(whole)
        damaged[rng.integers(len(damaged))] ^= 1 << rng.integers(8)
        try:
            fields = list(segment.decoded_fields(bytes(damaged), video.structure, options, 3))
        except ValueError:
            continue
        assert len(fields) == 3


@pytest.mark.parametrize(("plan", "named"), [(Plan(walk="time-first"), "time-first"), (Plan(group=3), "group 3")])
def test_other_orders_are_refused(plan, named):
    with pytest.raises(ValueError, match=rf"{named}.*: scheme si-lf codes whole instants and needs"):
        encode_take(plane(), "si-lf", qp=30, plan=plan)


def test_headers_of_a_black_take_are_counted():
    floor = take_floor("si-lf", (8, 8), (4, 4), frames=4)
    assert 0 < floor.bits < 8 * 200
    assert floor.portion(2 * floor.bpp) == pytest.approx(0.5)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("name", PIXELS)
def test_frozen_takes_decode_to_the_same_pixels(name, threads):
    """Four instants of 4×4 views of 24×16 samples, two to a segment; three of 42×26 samples by version 7."""
    coded = EncodedTake.load(FROZEN / f"{name}.ii")
    assert {part[0] for part in coded.segments} == {segment.VERSION} == {4}
    coded.options["threads"] = threads
    digest = hashlib.sha256(b"".join(picture.pixels.tobytes() for picture in open_take(coded)))
    assert digest.hexdigest() == PIXELS[name]
