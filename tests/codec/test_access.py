"""Random access to frames and component images, and extraction of streams."""

import io
import json
import shutil
import subprocess
from dataclasses import replace
from functools import cache
from itertools import product
from typing import ClassVar

import av
import imagecodecs
import numpy as np
import pytest
from PIL import Image

import codec
from codec import Coder, CodingResult, Encoded, Run, contract, decode, decode_component, decode_frame, encode, schemes
from codec.coders.decoding import decoded_frames
from codec.coders.pseudo_video import PseudoVideo
from codec.coders.volume import GROUP
from codec.contract import find
from codec.inspect.extract import extract, suffixes
from codec.inspect.random_access import sequence
from codec.order import selection_order
from ii_core import IIPicture, component_images, sub_images
from tests.support.slow import first_fast

VIDEOS = sorted(n for n in schemes() if isinstance(find(n), PseudoVideo))
STILLS = sorted(set(schemes()) - set(VIDEOS))
FFPROBE = shutil.which("ffprobe")


@cache
def picture(k=20, l=18, u=4, v=3):
    """Smooth, with disparity and noise; frames of every kind at odd sizes."""
    y, x = np.mgrid[:l, :k]
    field = np.empty((l, v, k, u, 3))
    for row in range(v):
        for col in range(u):
            shade = 128 + 80 * np.sin((x + col) / 4) * np.cos((y + row) / 5)
            field[:, row, :, col] = np.stack([shade, 255 - shade, shade / 2], axis=-1)
    field += np.random.default_rng(0).standard_normal(field.shape[:4])[..., None]
    return IIPicture(np.clip(field, 0, 255).astype(np.uint8).reshape(l * v, k * u, 3), (k, l), (u, v))


@cache
def coded(scheme):
    name = scheme.partition(":")[0]
    coder = find(name)
    if coder.lossless({key: option.default for key, option in coder.options.items()}):
        return encode(picture(), scheme)
    if coder.qp_range:
        return encode(picture(), scheme, qp=coder.qp_range[1] // 2)
    if coder.rate_control:
        return encode(picture(), scheme, bpp=2)
    low, high = coder.quality_range
    return encode(picture(), scheme, quality=type(low)((low + high) / 2))


@pytest.mark.parametrize("scheme", VIDEOS)
@pytest.mark.parametrize("gop", first_fast([5, 1, 0]))
def test_a_component_decoded_alone_equals_the_whole_picture(scheme, gop):
    """To the bit: a group decoded alone equals the group in the whole stream."""
    stream = coded(f"{scheme}:gop={gop}" if "gop" in find(scheme).options else scheme)
    gop = gop if "gop" in find(scheme).options else 0
    kind = scheme.partition("-")[0]
    whole = component_images(decode(stream), kind)
    if kind == "ri":  # the stack is [v, l], the grid has v across
        whole = whole.swapaxes(0, 1)
    rows, cols = whole.shape[:2]
    for row, col in ((0, 0), (rows - 1, cols - 1), (rows // 2, cols // 2), (0, cols - 1)):
        place = (col, row)
        np.testing.assert_array_equal(decode_component(stream, place), whole[row, col])
    taken = sequence(stream)
    count = len(taken.packets)
    groups = sum(packet.key for packet in taken.packets)
    needed = 1 if gop == 0 else -(-count // gop)
    # MPEG-2 ends a group early rather than with B pictures that look ahead.
    assert groups >= needed if scheme.endswith("mpeg2") else groups == needed
    flat = whole.reshape(count, *whole.shape[2:])[selection_order("parallel", rows, cols)]
    for index in {0, min(4, count - 1), min(5, count - 1), count - 1}:
        np.testing.assert_array_equal(decode_frame(stream, index), flat[index])


def test_a_component_that_was_coded_on_its_side():
    """Frames of 4×30 are turned for x265, and came out turned; no frames of the picture above are."""
    stream = encode(picture(30, 3, 4, 3), "ri-hevc", qp=20)
    assert sequence(stream).film.layout.turned
    whole = component_images(decode(stream), "ri")  # the stack is [v, l]
    for v, l in np.ndindex(3, 3):
        np.testing.assert_array_equal(decode_component(stream, (v, l)), whole[v, l])


SMALL_SIZES = (20, 18, 4, 3), (1, 5, 3, 2)
LARGE_SIZES = (150, 270, 2, 2), (3, 2, 37, 37)  # many precincts, and many planes


def packets():
    """Return sizes, options and types; the large sizes are slow."""
    for case in product(SMALL_SIZES + LARGE_SIZES, ("", ":wavelet=53", ":lossless=1"), (np.uint8, np.uint16)):
        slow = case[0] in LARGE_SIZES
        yield pytest.param(*case, marks=[pytest.mark.slow] if slow else [])


@pytest.mark.parametrize(("size", "options", "dtype"), list(packets()))
def test_a_component_of_one_codestream_by_its_own_packets(size, options, dtype, monkeypatch):
    """To the bit, for all precincts, code blocks and groups, without decoding another plane."""
    from codec.coders import planes

    made = picture(*size)
    made = made.with_pixels(made.pixels.astype(dtype) * (257 if dtype == np.uint16 else 1))
    stream = encode(made, f"si-jpeg2000{options}", **({} if "lossless" in options else {"quality": 40}))
    whole = component_images(decode(stream), "si")
    decoded = []
    real = planes.decode_planes
    monkeypatch.setattr(
        planes, "decode_planes", lambda s, shape, *a, **k: decoded.append(shape) or real(s, shape, *a, **k)
    )
    k, l, u, v = size
    edges = {divmod(index, u)[::-1] for index in (GROUP - 1, GROUP) if index < u * v}  # of groups of planes
    for place in {(0, 0), (u - 1, v - 1), (u // 2, v - 1)} | edges:
        np.testing.assert_array_equal(decode_component(stream, place), whole[place[1], place[0]])
    np.testing.assert_array_equal(decode_frame(stream, u), whole[1, 0])
    assert set(decoded) == {(3, l, k)}
    rng = np.random.default_rng(1)
    for _ in range(20):
        damaged = bytearray(stream.payload)
        for at in rng.integers(len(damaged), size=3):
            damaged[at] ^= 1 << rng.integers(8)
        try:
            assert decode_component(replace(stream, payload=bytes(damaged)), (0, 0)).shape == (l, k, 3)
        except ValueError as error:
            assert "is damaged" in str(error)


def test_b_pictures_and_other_orders():
    stream = coded("si-h264:gop=6,bframes=3,order=spiral")
    whole = component_images(decode(stream), "si")
    for v, u in np.ndindex(3, 4):
        np.testing.assert_array_equal(decode_component(stream, (u, v)), whole[v, u])


def test_only_its_own_group_is_read():
    """The slices of all other groups are replaced by zeros."""
    stream = coded("si-h264:gop=4")
    taken = sequence(stream)
    data = [packet.data for packet in taken.packets]
    for i in (*range(0, 4), *range(8, 12)):
        data[i] = data[i][:-8] + bytes(range(1, 9))
    broken = replace(stream, payload=b"".join(data))
    np.testing.assert_array_equal(decode_frame(broken, 6), decode_frame(stream, 6))


def test_refused():
    stream = coded("si-h264:gop=4")
    for index in (-1, 12, True):
        with pytest.raises(ValueError, match="does not exist: there are 12, from 0"):
            decode_frame(stream, index)
    with pytest.raises(ValueError, match=r"component image \(4, 0\) does not exist: there are 4×3"):
        decode_component(stream, (4, 0))
    with pytest.raises(ValueError, match="codes the picture as a whole"):
        decode_frame(coded("jpeg2000"), 0)
    for payload in (b"", b"nothing at all", stream.payload[:-200]):
        with pytest.raises(ValueError, match="is damaged"):
            decode_frame(replace(stream, payload=payload), 11)


def frames_of(path, shown):
    """All frames of a file, as FFmpeg decodes them."""
    with av.open(path) as container:
        decoded = list(container.decode(container.streams.video[-1]))  # in AVIF after the cover image
    assert {(frame.width, frame.height) for frame in decoded} == {shown.size}
    assert len(decoded) == shown.frames
    return [samples(frame, *shown.size) for frame in decoded]


def samples(frame, width, height):
    """The bytes of a frame's planes, without the padding of their lines, up to a width and height."""
    size = 4 if frame.format.name == "bgr0" else -(-frame.format.components[0].bits // 8)
    planes = []
    for plane in frame.planes:
        rows = np.frombuffer(plane, np.uint8, plane.height * plane.line_size).reshape(plane.height, -1)
        across, down = (-(-side * part // whole) for side, part, whole in (
            (width, plane.width, frame.width), (height, plane.height, frame.height)
        ))  # fmt: skip
        planes.append(rows[:down, : across * size].tobytes())
    return planes


@pytest.mark.parametrize("scheme", first_fast(VIDEOS, 3))
def test_streams_are_files_that_ffmpeg_decodes_to_the_same(scheme, tmp_path):
    """Every frame of every container is the one that our own decoding puts into the picture."""
    stream = coded(f"{scheme}:gop=5" if "gop" in find(scheme).options else scheme)
    taken = sequence(stream)
    own = list(decoded_frames(taken.coder, stream.payload, taken.film))
    for suffix in suffixes(stream):
        path = tmp_path / f"out{suffix}"
        shown = extract(stream, path)
        assert shown.frames == len(own)
        expected = [samples(frame, *shown.size) for frame in own]
        assert frames_of(str(path), shown) == expected, suffix
        if FFPROBE and suffix in (".mkv", ".mp4", ".ivf", ".obu"):
            shown = probe(path)
            assert int(shown["nb_read_frames"]) == len(expected)
            if taken.film.format.chroma in ("444", "420") and not scheme.endswith("mpeg2"):
                # MPEG-2 has no full range: its decoders report limited range for every container.
                assert (shown["color_range"], shown["color_space"]) == ("pc", "bt709")


def probe(path):
    command = [FFPROBE, "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return json.loads(done.stdout)["streams"][0]


@pytest.mark.parametrize("depth", ["8", "10"])
def test_avif_shows_sub_images_in_their_colours(depth, tmp_path):
    """Against libavif, which is independent of our decoding, within the rounding of its colour conversion."""
    stream = encode(picture(), f"si-avif:depth={depth}", qp=5)
    assert str(extract(stream, tmp_path / "x.avif")) == "12 frames of 20×18 pixels"
    shown = imagecodecs.avif_decode((tmp_path / "x.avif").read_bytes()).astype(int) >> (int(depth) - 8)
    images = component_images(decode(stream), "si").reshape(12, 18, 20, 3)[selection_order("parallel", 3, 4)]
    assert np.abs(shown - images).max() <= 1


@pytest.mark.parametrize(
    ("scheme", "said", "size"),
    [
        ("ei-hevc", "360 frames of 4×3 pixels", (4, 3)),
        ("si-hevc", "12 frames of 20×18 pixels", (20, 18)),
        ("ri-hevc", "9 frames of 30×4 pixels, rows are the columns of images of 4×30", (30, 4)),
        ("ei-hevc:chroma=420", "the image is the upper left 4×3 and the rest is filling", (4, 4)),
        ("ei-mpeg2", "360 frames of 16×16 pixels, the image is the upper left 4×3", (16, 16)),
    ],
)
def test_extract_reports_the_component_image_within_frames(scheme, said, size, tmp_path):
    """HEVC frames have at least 24×16 pixels; an earlier test compared padded frames with padded frames."""
    stream = encode(picture(30, 3, 4, 3), scheme, qp=20) if scheme == "ri-hevc" else coded(scheme)
    shown = extract(stream, tmp_path / "x.mkv")
    assert said in str(shown) and shown.size == size
    with av.open(str(tmp_path / "x.mkv")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert {frame.shape[1::-1] for frame in frames} == {size}
    if "hevc" in scheme and "420" not in scheme:
        first = decode_frame(stream, 0).astype(int)
        assert np.abs((first.swapaxes(0, 1) if shown.turned else first) - frames[0]).max() <= 2


def test_frames_of_b_pictures_are_shown_in_order(tmp_path):
    stream = coded("si-h264:bframes=3")
    extract(stream, tmp_path / "x.mp4")
    with av.open(str(tmp_path / "x.mp4")) as container:
        times = [frame.pts for frame in container.decode(video=0)]
    assert len(set(np.diff(times))) == 1


@pytest.mark.parametrize("scheme", STILLS)
def test_whole_pictures_are_files_that_open(scheme, tmp_path):
    stream = coded(scheme)
    for suffix in suffixes(stream):
        path = tmp_path / f"out{suffix}"
        extract(stream, path)
        assert path.stat().st_size - len(stream.payload) in (0, 85)
        if suffix in (".jp2", ".j2k", ".jpg"):
            with Image.open(path) as image:
                assert image.size == picture().size
                off = np.asarray(image).astype(int) - decode(stream).pixels
                assert np.abs(off).max() <= (2 if suffix == ".jpg" else 0)
        if FFPROBE and suffix in (".jp2", ".j2k", ".jpg"):
            assert (probe(path)["width"], probe(path)["height"]) == picture().size


def test_unsuitable_containers_are_refused(tmp_path):
    stream = coded("si-h264")
    with pytest.raises(ValueError, match=r"does not go into x\.webm: possible are \.mkv, \.mp4"):
        extract(stream, tmp_path / "x.webm")
    with pytest.raises(ValueError, match="is damaged"):
        extract(replace(stream, payload=stream.payload[:-200]), tmp_path / "x.mkv")
    assert list(tmp_path.iterdir()) == []


def test_command(run, refused, tmp_path):
    stream = coded("si-h264:gop=4")
    stream.save(tmp_path / "x.ii")
    code, out, _ = run("extract", tmp_path / "x.ii", "-o", tmp_path / "x.mkv")
    assert code == 0 and "si-h264, 12 frames of 20×18 pixels" in out
    assert run("decode", tmp_path / "x.ii", "--component", "2,1", "-o", tmp_path / "c.png")[0] == 0
    with Image.open(tmp_path / "c.png") as image:
        np.testing.assert_array_equal(np.asarray(image), component_images(decode(stream), "si")[1, 2])
    refused(run("decode", tmp_path / "x.ii", "--component", "2", "-o", tmp_path / "d.png"), "component is '2'")
    refused(run("decode", tmp_path / "x.ii", "--component", "4,0", "-o", tmp_path / "d.png"), "there are 4×3")
    refused(run("extract", tmp_path / "x.ii", "-o", tmp_path / "x.png"), "does not go into x.png")
    refused(run("extract", tmp_path / "x.ii", "-o", tmp_path / "x.mkv"), "is there already")


def test_the_bare_payload_is_a_stream(tmp_path):
    """The payload of the file is a complete stream without changes."""
    stream = coded("si-h264")
    stream.save(tmp_path / "x.ii")
    payload = (tmp_path / "x.ii").read_bytes()[-len(stream.payload) :]
    assert Encoded.load(tmp_path / "x.ii").payload == payload
    with av.open(io.BytesIO(payload), format="h264") as container:
        assert sum(1 for _ in container.decode(video=0)) == 12


def test_a_coder_of_another_package_decodes_components_alone(monkeypatch):
    """Earlier, a fixed list of classes could do so."""

    class Raw(Coder):
        name, about, kind, components_alone = "test-raw", "sub-images as they are", "si", True
        versions: ClassVar = {}
        rate_control = False

        def lossless(self, options):
            return True

        def check(self, picture, options):
            pass

        def encode(self, picture, options, goal):
            return CodingResult(run=Run(sub_images(picture).tobytes(), 0.0))

        def decode(self, payload, blank, options):
            raise AssertionError("decodes the whole picture")

        def decode_component(self, payload, blank, options, index):
            (k, l), size = blank.lenses, 3 * blank.lenses[0] * blank.lenses[1]
            return np.frombuffer(payload, np.uint8, size, index * size).reshape(l, k, 3)

    monkeypatch.setitem(contract._CODERS, "test-raw", Raw())
    stream = encode(picture(), "test-raw")
    assert np.array_equal(decode_component(stream, (1, 2)), sub_images(picture())[2, 1])
    assert np.array_equal(decode_frame(stream, 9), sub_images(picture())[2, 1])


@pytest.mark.slow
def test_cost_of_a_view_counts_its_group():
    field = IIPicture(np.random.default_rng(0).integers(0, 256, (96, 128, 3), np.uint8), (32, 24), (4, 4))
    whole = encode(field, "si-h264", qp=30)
    nbytes, seconds = codec.access_cost(whole, (1, 2))
    assert whole.nbytes - 70 < nbytes <= whole.nbytes and seconds >= 0  # one group: all but the header of the file
    alone = [codec.access_cost(encode(field, "si-h264:gop=1", qp=30), (u, v))[0] for v in range(4) for u in range(4)]
    stream = encode(field, "si-h264:gop=1", qp=30)
    assert max(alone) < stream.nbytes / 8 and stream.nbytes - 200 < sum(alone) <= stream.nbytes
    assert codec.access_cost(encode(field, "jpeg2000", bpp=2.0), (0, 0)) is None
    levels = encode(field, "si-lf", bpp=1.0)
    costs = [codec.access_cost(levels, (u, v))[0] for v in range(4) for u in range(4)]
    assert min(costs) < max(costs) <= levels.nbytes
