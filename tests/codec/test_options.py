"""Options of pseudo video sequences, coder by coder, and pictures at the limits of size."""

from dataclasses import replace

import av
import numpy as np
import pytest

from codec import decode, encode, schemes
from codec.bitstream import framing
from codec.bitstream.framing import temporal_units
from codec.coders.decoding import stream_packets
from codec.coders.pseudo_video import PseudoVideo
from codec.contract import find, parse_scheme
from ii_core import IIPicture
from tests.codec.test_contract import finest, psnr, quick, quick_ones, textured
from tests.support.slow import first_fast

VIDEO = [name for name in schemes() if isinstance(find(name), PseudoVideo)]
SI = [name for name in VIDEO if name.startswith("si-")]


def small():
    return textured(16, 8, 4, 4)


def extremes():
    """Every option of every coder at its ends, or at each of its names."""
    for name in SI:
        for key, option in find(name).options.items():
            for value in option.choices or (option.low, option.high):
                if value not in ("placebo", "veryslow"):  # slow presets test the same
                    yield f"{name}:{key}={value}"


@pytest.mark.parametrize("scheme", first_fast(extremes(), 44))
def test_every_value_of_every_option_codes_and_decodes(scheme):
    coder, options = parse_scheme(scheme)
    low, high = coder.qp_range or (0, 0)
    asked = {} if coder.lossless(options) else {"qp": low + (high - low) // 3}
    picture = small()
    decoded = decode(encode(picture, scheme, **asked))
    assert psnr(picture, decoded) > 20


@pytest.mark.parametrize("rate", ["cbr", "cq", "crf", "2pass"])
def test_every_rate_control_of_x264_meets_a_rate(rate):
    coded = encode(textured(), f"si-h264:rate={rate},bframes=1", bpp=1.2)
    assert coded.reached
    assert coded.payload == encode(textured(), f"si-h264:rate={rate},bframes=1", bpp=1.2).payload


@pytest.mark.parametrize("rate", ["cbr", "cq", "crf", "2pass"])
def test_a_rate_too_low_for_x264_gives_its_least(rate):
    """After a first pass x264 fails to open for a rate that is too low."""
    least = encode(textured(), "si-h264:rate=cq", qp=51)
    coded = encode(textured(), f"si-h264:rate={rate}", bpp=0.1 * least.bpp)
    assert not coded.reached and coded.bpp <= 1.1 * least.bpp


@pytest.mark.parametrize("rate", ["cq", "2pass"])
def test_every_rate_control_of_x265_meets_a_rate(rate):
    assert encode(textured(), f"si-hevc:preset=medium,rate={rate}", bpp=1.2).reached


def keys(scheme, picture):
    """Which frames of a stream are key pictures."""
    coded = encode(picture, scheme, qp=30)
    coder, options = parse_scheme(scheme)
    context = av.CodecContext.create(coder.decoder, "r")
    film = coder.film(picture, options)
    packets = [*stream_packets(coder, context, coded.payload, film), None]
    return [number for number, frame in enumerate(f for p in packets for f in context.decode(p)) if frame.key_frame]


@pytest.mark.parametrize(
    "scheme", ["si-h264:gop=16,bframes=1", "si-hevc:fast,gop=16", "si-av1:fast,gop=16", "si-vp9:fast,gop=16"]
)
def test_a_gop_begins_with_a_key_picture(scheme):
    assert keys(scheme, textured()) == [0, 16, 32, 48]


@pytest.mark.parametrize("scheme", ["si-hevc:fast", "si-av1:fast", "si-vp9:fast", "si-h264:fast"])
def test_without_a_gop_there_is_one_key_picture(scheme):
    assert keys(scheme, textured()) == [0]


@pytest.mark.parametrize("kind", ["ei", "ri"])
def test_x265_and_the_decoder_agree_on_narrow_frames(kind):
    """With frames one block wide they do not: 32 dB instead of 44 in the case found."""
    picture = textured(16, 16, 16, 16)
    assert psnr(picture, decode(encode(picture, f"{kind}-hevc:fast,rate=cq", qp=8))) > 40


@pytest.mark.parametrize("scheme", quick_ones(VIDEO))
@pytest.mark.parametrize("colour", [(0, 0, 0), (255, 255, 255), (255, 0, 0), (3, 250, 120)])
def test_constant_pictures_stay_constant(scheme, colour):
    pixels = np.broadcast_to(np.uint8(colour), (32, 64, 3)).copy()
    picture = IIPicture(pixels, (16, 8), (4, 4))
    decoded = decode(encode(picture, quick(scheme), **finest(scheme)))
    assert np.abs(decoded.pixels.astype(int) - pixels).max() <= 3
    if not find(scheme).lossless(parse_scheme(scheme)[1]):
        coarse = encode(picture, quick(scheme), qp=find(scheme).qp_range[1])
        assert np.ptp(decode(coarse).pixels, axis=(0, 1)).max() <= 12


@pytest.mark.parametrize("scheme", VIDEO)
def test_quality_falls_with_the_quantiser_down_to_its_end(scheme):
    coder = find(scheme)
    if coder.qp_range is None:
        return
    low, high = coder.qp_range
    coded = [encode(small(), quick(scheme), qp=qp) for qp in (low, (low + high) // 2, high)]
    assert coded[0].nbytes > coded[1].nbytes > coded[2].nbytes
    found = [psnr(small(), decode(c)) for c in coded]
    assert found[0] > found[1] > found[2] > 8


@pytest.mark.parametrize("scheme", [name for name in VIDEO if "ffv1" not in name])  # FFV1 states no size
def test_a_stream_of_other_frames_is_refused(scheme):
    coded = encode(textured(16, 8, 4, 4), quick(scheme), **finest(scheme))
    lenses, ei_pixels = {"ei": ((16, 8), (32, 32)), "si": ((32, 16), (4, 4)), "ri": ((64, 8), (4, 4))}[scheme[:2]]
    size = lenses[1] * ei_pixels[1], lenses[0] * ei_pixels[0], 3
    structure = IIPicture(np.zeros(size, np.uint8), lenses, ei_pixels).structure_json()
    with pytest.raises(ValueError, match="is damaged"):
        decode(replace(coded, structure=structure))


@pytest.mark.slow
def test_rates_below_the_headers_are_settled_by_one_run():
    for scheme in ("ei-h264", "ei-hevc:fast", "ei-av1:fast", "ei-vp9:fast", "ei-mpeg2"):
        coded = encode(textured(), scheme, bpp=1e-6)
        assert not coded.reached
        assert coded.runs == 1
        assert coded.payload == encode(textured(), scheme, qp=find(scheme.partition(":")[0]).qp_range[1]).payload


def test_packets_come_back_and_broken_tables_are_refused():
    packets = [b"", b"a", bytes(200), bytes(20_000)]
    payload = framing.pack(b"first", packets)
    first, found = framing.unpack(payload, 4)
    assert first == b"first" and [bytes(packet) for packet in found] == packets
    for broken, count, said in (
        (payload, 3, "it has 4 packets, 3 are needed"),
        (payload[:-1], 4, "bytes"),
        (payload + b"x", 4, "bytes"),
        (b"", 0, "table"),
        (b"\xff" * 20, 4, "table"),
        (b"\x00\x04\xff\xff\xff\xff\x0f", 4, "table"),
    ):
        with pytest.raises(ValueError, match=said):
            framing.unpack(broken, count)


def test_temporal_units_are_cut_at_their_delimiters():
    delimiter, frame = b"\x12\x00", b"\x32\x03abc"
    assert [bytes(unit) for unit in temporal_units(2 * (delimiter + frame))] == 2 * [delimiter + frame]
    for broken in (b"", frame, delimiter + frame[:-1], delimiter + b"\x30abc", delimiter + b"\x32" + b"\xff" * 9):
        with pytest.raises(ValueError, match="not made of whole units"):
            list(temporal_units(broken))
