"""Files with false sizes: refused in a second and in bounded memory, with every scheme.

All are decoded in one separate process, which forks for every case: limits of address space and the most memory taken
are those of one case.
"""

import json
import subprocess
import sys

import numpy as np
import pytest

from codec import decode, encode
from ii_core import IIPicture

SCRIPT = """
import json, os, resource, signal, sys, time, traceback
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from benchmarks.coding.fuzz import sample
from codec import Encoded, decode, encode, schemes
from ii_core import IIPicture

CLAIMS = [
    ([1 << 15, 1 << 14], [1, 4]),  # as many pixels as are allowed
    ([1, 4], [1 << 15, 1 << 14]),
    ([1 << 15, 1], [1, 1 << 16]),
    ([1 << 10, 1 << 10], [32, 32]),
    ([1 << 20, 1 << 20], [1 << 20, 1 << 20]),
]


def bound(extra):
    room = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + extra
    resource.setrlimit(resource.RLIMIT_AS, (room, room))


def said(coded, **forged):
    started = time.process_time()
    try:
        decode(replace(coded, **forged) if forged else coded)
        answer = "a picture"
    except ValueError as error:
        answer = str(error)
    except BaseException as error:
        answer = repr(error)
        return "wrong", answer, time.process_time() - started
    return "picture" if answer == "a picture" else "refused", answer, time.process_time() - started


def most(who=resource.RUSAGE_SELF):
    return resource.getrusage(who).ru_maxrss >> 10


def claims():
    coded = [sample(name) for name in sorted(schemes())]
    for one in coded:
        decode(one)
    bound(1 << 29)
    return [
        [one.scheme, *claim, *said(one, structure=one.structure | dict(zip(("lenses", "ei_pixels"), claim)))]
        for one in coded for claim in CLAIMS
    ]


def forged(scheme, side, path):
    asked = {"bpp": 1} if scheme == "jpeg2000" else {"quality": 5}
    coded = encode(IIPicture(np.zeros((64, 64, 3), np.uint8), (8, 8), (8, 8)), scheme, **asked)
    small, large = (64).to_bytes(4, "big"), side.to_bytes(4, "big")
    payload = coded.payload
    if scheme == "jpeg":
        at = payload.index(b"\\xff\\xc2") + 5
        payload = payload[:at] + 2 * large[2:] + payload[at + 4 :]
    else:
        assert payload.count(small) == 4
        payload = payload.replace(small, large)
    structure = coded.structure | {"lenses": [side // 8, side // 8]}
    Encoded(scheme=coded.scheme, options=coded.options, payload=payload, structure=structure).save(path)
    assert Path(path).stat().st_size < 1500
    bound(1 << 28)
    return said(path)


@cache
def black():
    return encode(IIPicture(np.zeros((2048, 2048, 3), np.uint8), (256, 256), (8, 8)), "jpeg2000", bpp=1)


def precincts(how):
    coded = black()
    payload = coded.payload
    assert len(payload) < 1000
    at = payload.index(b"\\xff\\x52")
    style = payload[at : at + 14]
    levels = style[9]
    small = b"\\xff\\x52" + (13 + levels).to_bytes(2, "big") + b"\\x01" + style[5:14] + b"\\x00" + b"\\x11" * levels
    if how == "precincts":
        payload = payload[:at] + small + payload[at + 14 :]
    elif how == "second style":
        payload = payload[: at + 14] + small + payload[at + 14 :]
    elif how == "style of a tile":
        tile = payload.index(b"\\xff\\x93")
        payload = payload[:tile] + small + payload[tile:]
    elif how == "tiles":
        payload = payload[:24] + (16).to_bytes(4, "big") * 2 + payload[32:]
    before = most()
    return [*said(coded, payload=payload), most() - before]


for case in json.loads(sys.argv[1]):
    name, *arguments = case
    if name == "precincts":
        black()  # once, before the forks
    sys.stdout.flush()
    child = os.fork()
    if not child:
        signal.alarm(60)  # ends a case that hangs
        try:
            print(json.dumps([case, globals()[name](*arguments)]), flush=True)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)
    os.waitpid(child, 0)
"""
SIZES = [
    ("jpeg", 32000, "at most 134217728 are decoded, raise max_pixels"),
    ("jpeg", 8000, "cannot hold 8000×8000 pixels"),
    ("jpeg2000", 32000, "at most 134217728 are decoded, raise max_pixels"),
]
STYLES = ["whole", "precincts", "second style", "style of a tile", "tiles"]


def decoded(cases):
    """Return how every case ended."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, json.dumps(cases)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert [case for case, _ in results] == cases, done.stderr[-2000:]
    return {tuple(case[:3]): answer for case, answer in results}


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """Return how all quick cases ended."""
    folder = tmp_path_factory.mktemp("forged")
    cases = [["claims"], *(["precincts", how] for how in STYLES)]
    cases += [["forged", scheme, side, str(folder / f"{scheme}{side}.ii")] for scheme, side, _ in SIZES]
    return decoded(cases)


@pytest.mark.slow
def test_claims_are_refused_fast_and_small(ended):
    results = ended["claims",]
    assert len(results) >= 6 * 4
    wrong = [result for result in results if result[3] != "refused" or result[5] > 1]
    assert wrong == []


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "side", "said"), SIZES)
def test_forged_streams_that_agree_with_a_forged_structure_are_refused_small(ended, scheme, side, said):
    """The test above forges only the structure, which the size of the stream contradicts."""
    kind, answer, seconds = ended["forged", scheme, side]
    assert kind == "refused" and said in answer and seconds < 1


def test_larger_pictures_decode_by_an_explicit_limit(run, tmp_path):
    picture = IIPicture(np.zeros((64, 64, 3), np.uint8), (8, 8), (8, 8))
    coded = encode(picture, "jpeg", quality=50)
    with pytest.raises(ValueError, match=r"has 64×64 pixels: at most 4095 are decoded, raise max_pixels"):
        decode(coded, max_pixels=4095)
    assert decode(coded, max_pixels=4096).size == (64, 64)
    coded.save(tmp_path / "x.ii")
    code, _, err = run("decode", tmp_path / "x.ii", "-o", tmp_path / "x.png", "--max-pixels", "4095")
    assert code == 2 and "at most 4095 are decoded" in err
    assert run("decode", tmp_path / "x.ii", "-o", tmp_path / "x.png", "--max-pixels", "4096")[0] == 0


@pytest.mark.parametrize("chroma", ["444", "420"])
def test_the_smallest_jpeg_stream_decodes(chroma):
    picture = IIPicture(np.zeros((1024, 1024, 3), np.uint8), (64, 64), (16, 16))
    assert decode(encode(picture, f"jpeg:chroma={chroma}", quality=1)).pixels.max() <= 1  # a rounding of colour


@pytest.mark.slow
@pytest.mark.parametrize("how", STYLES)
def test_forged_precincts_and_tiles_of_jpeg2000_take_no_memory(ended, how):
    """Small precincts took 1600 bytes per pixel; the tests above forge only sizes."""
    kind, answer, seconds, megabytes = ended["precincts", how]
    assert kind == ("picture" if how == "whole" else "refused") and ("damaged" in answer) == (how != "whole")
    assert megabytes < (120 if how == "whole" else 20)  # 10 bytes a pixel of the picture are 42 MB
    assert seconds < 5
