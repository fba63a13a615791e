"""Header portion: streams parsed against FFmpeg, measured floors, analytic limits."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from codec import encode
from codec.inspect.header_bits import coarsest, floor, frames, parts, si_below_ei, si_below_ri
from ii_core import IIPicture


def picture(k=12, l=8, u=4, v=4):
    y, x = np.mgrid[: l * v, : k * u]
    shade = 128 + 60 * np.sin(x / 7) * np.cos(y / 5) + np.random.default_rng(0).standard_normal((l * v, k * u))
    return IIPicture(np.repeat(shade[..., None], 3, axis=2).astype(np.uint8), (k, l), (u, v))


SETTINGS = ["", ":gop=5", ":bframes=3,gop=8", ":bframes=2"]


@pytest.mark.parametrize("kind", ["si", "ei", "ri"])
@pytest.mark.parametrize("setting", SETTINGS)
def test_bits_add_up_and_every_slice_is_found(kind, setting):
    coded = encode(picture(), f"{kind}-h264{setting}", qp=30)
    found = parts(coded)
    assert found.total == 8 * len(coded.payload)
    assert found.units == frames(kind, (12, 8), (4, 4))
    assert found.messages == 0 and found.parameters > 0 and found.headers >= 16 * found.units
    assert found.headers % 8 == 0  # arithmetic coding starts on a byte


@pytest.mark.parametrize("scheme", ["si-hevc", "ei-hevc", "si-av1", "ei-av1"])
def test_units_of_other_streams_add_up(scheme):
    """HEVC and AV1 by units: all bytes accounted for, at least a slice or frame for each picture."""
    coded = encode(picture(), f"{scheme}:gop=8", qp=40)
    found = parts(coded)
    assert found.total == 8 * len(coded.payload) and found.headers is None
    assert found.units >= frames(scheme[:2], (12, 8), (4, 4))
    assert found.parameters > 0 and found.framing > 0 and found.data > 0


def traced_header_bits(stream, path):
    """Bits of all slice headers, alignment included, as FFmpeg's trace_headers prints them."""
    path.write_bytes(stream)
    command = ["ffmpeg", "-hide_banner", "-i", path, "-c", "copy", "-bsf:v", "trace_headers", "-f", "null", "-"]
    total, last, inside = 0, 8, False
    said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    for line in [*said.splitlines(), "Packet"]:
        line = line.split("] ", 1)[-1]
        if re.match(r"Slice Header|Sequence Parameter|Picture Parameter|Access Unit|Packet|Supplemental", line):
            total += last - 8 if inside else 0
            inside, last = line.startswith("Slice Header"), 8
        elif match := re.match(r"(\d+)\s+\S+\s+([01]+) = ", line):
            last = int(match[1]) + len(match[2])
    return total


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs the ffmpeg program")
@pytest.mark.parametrize("setting", SETTINGS)
def test_slice_headers_are_those_ffmpeg_reads(setting, tmp_path):
    coded = encode(picture(), f"si-h264{setting}", qp=30)
    assert parts(coded).headers == traced_header_bits(coded.payload, tmp_path / "x.h264")


def test_more_detail_is_more_data_and_no_more_header():
    coarse, fine = (parts(encode(picture(), "si-h264", qp=qp)) for qp in (50, 20))
    assert fine.data > 3 * coarse.data
    assert (fine.headers, fine.framing, fine.parameters) == (coarse.headers, coarse.framing, coarse.parameters)


def test_a_black_picture_is_nearly_all_header():
    """An all-skipped P frame: headers and two bytes of macroblocks."""
    low = floor("ei-h264", (12, 8), (4, 4))
    bits = parts(low.coded)
    assert bits.data < 32 * bits.units
    assert low.bits == bits.total and low.bpp == low.bits / (48 * 32)
    assert low.portion(low.bpp) == 1 and low.portion(2 * low.bpp) == 0.5
    real = coarsest(picture(), "ei-h264")
    assert real.nbytes > low.coded.nbytes


def test_schemes_without_quantiser_have_a_floor_too():
    assert floor("jpeg2000", (12, 8), (4, 4)).bpp < 1


@pytest.mark.slow
@pytest.mark.parametrize("side", [2, 4, 8, 16, 32])
def test_fewer_frames_fewer_header_bits_just_as_predicted(side):
    """256×256 pixels: SI below EI while U·V < 256, and below RI while U < L = 256/side, that is up to 8 for both."""
    lenses, ei = (256 // side, 256 // side), (side, side)
    bits = {kind: floor(f"{kind}-h264", lenses, ei).bits for kind in ("si", "ei", "ri")}
    assert frames("ei", lenses, ei) * side**2 == 256**2
    assert si_below_ei(lenses, ei) == (side < 16) == (bits["si"] < bits["ei"])
    assert si_below_ri(lenses, ei) == (side < 16) == (bits["si"] < bits["ri"])


def test_header_limits_of_figure_5_12():
    """Figure 5.12: 16², 32² and 64² pixel elementary images of 8192×4096, not 128² and 256²."""
    below = [si_below_ei((8192 // side, 4096 // side), (side, side)) for side in (16, 32, 64, 128, 256)]
    assert below == [True, True, True, False, False]


def test_invalid_streams_are_refused():
    coded = encode(picture(), "si-h264", qp=30)
    with pytest.raises(ValueError, match="are not parsed: known are those of h264"):
        parts(encode(picture(), "jpeg2000", bpp=1))
    for payload in (b"", b"nothing", b"\0\0\1\x65\x88\x84", coded.payload[:30] + b"\0\0\1\x65"):
        with pytest.raises(ValueError, match="the stream of scheme si-h264 is damaged"):
            parts(replace(coded, payload=payload))
