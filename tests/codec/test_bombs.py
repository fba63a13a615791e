"""Files with false sizes: refused in a second and in bounded memory, with every scheme.

The tests run in a separate process of limited address space, on files with correct checksums.
"""

import json
import subprocess
import sys

import numpy as np
import pytest

from codec import decode, encode
from ii_core import IIPicture

SCRIPT = """
import json, resource, sys, time
from dataclasses import replace
from pathlib import Path
from benchmarks.coding.fuzz import sample
from codec import decode, schemes

CLAIMS = [
    ([1 << 15, 1 << 14], [1, 4]),  # as many pixels as are allowed
    ([1, 4], [1 << 15, 1 << 14]),
    ([1 << 15, 1], [1, 1 << 16]),
    ([1 << 10, 1 << 10], [32, 32]),
    ([1 << 20, 1 << 20], [1 << 20, 1 << 20]),
]
coded = [sample(name) for name in sorted(schemes())]
for one in coded:
    decode(one)
room = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + (1 << 29)
resource.setrlimit(resource.RLIMIT_AS, (room, room))
for one in coded:
    for lenses, ei_pixels in CLAIMS:
        started = time.process_time()
        try:
            decode(replace(one, structure={**one.structure, "lenses": lenses, "ei_pixels": ei_pixels}))
            said = "a picture"
        except ValueError as error:
            said = "refused"
        except BaseException as error:
            said = repr(error)
        print(json.dumps([one.scheme, lenses, ei_pixels, said, time.process_time() - started]))
"""


def test_claims_are_refused_fast_and_small():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(results) >= 6 * 4
    wrong = [result for result in results if result[3] != "refused" or result[4] > 1]
    assert wrong == []


FORGED = """
import io, resource, sys, time
from pathlib import Path
import numpy as np
from codec import Encoded, decode, encode
from ii_core import IIPicture

side, path = int(sys.argv[2]), sys.argv[3]
asked = {"bpp": 1} if sys.argv[1] == "jpeg2000" else {"quality": 5}
coded = encode(IIPicture(np.zeros((64, 64, 3), np.uint8), (8, 8), (8, 8)), sys.argv[1], **asked)
small, large = (64).to_bytes(4, "big"), side.to_bytes(4, "big")
payload = coded.payload
if sys.argv[1] == "jpeg":
    at = payload.index(b"\\xff\\xc2") + 5
    payload = payload[:at] + 2 * large[2:] + payload[at + 4 :]
else:
    assert payload.count(small) == 4
    payload = payload.replace(small, large)
structure = coded.structure | {"lenses": [side // 8, side // 8]}
Encoded(scheme=coded.scheme, options=coded.options, payload=payload, structure=structure).save(path)
assert Path(path).stat().st_size < 1500
room = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + (1 << 28)
resource.setrlimit(resource.RLIMIT_AS, (room, room))
started = time.process_time()
try:
    decode(path)
except ValueError as error:
    print(error)
assert time.process_time() - started < 1
"""


@pytest.mark.parametrize(
    ("scheme", "side", "said"),
    [
        ("jpeg", 32000, "at most 134217728 are decoded, raise max_pixels"),
        ("jpeg", 8000, "cannot hold 8000×8000 pixels"),
        ("jpeg2000", 32000, "at most 134217728 are decoded, raise max_pixels"),
    ],
)
def test_forged_streams_that_agree_with_a_forged_structure_are_refused_small(scheme, side, said, tmp_path):
    """The test above forges only the structure, which the size of the stream contradicts."""
    path = str(tmp_path / "forged.ii")
    done = subprocess.run(
        [sys.executable, "-c", FORGED, scheme, str(side), path],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert said in done.stdout


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


PRECINCTS = """
import resource, sys, time
from dataclasses import replace
import numpy as np
from codec import decode, encode
from ii_core import IIPicture

how = sys.argv[1]
coded = encode(IIPicture(np.zeros((2048, 2048, 3), np.uint8), (256, 256), (8, 8)), "jpeg2000", bpp=1)
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
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
started = time.process_time()
try:
    decode(replace(coded, payload=payload))
except ValueError as error:
    print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before >> 10, time.process_time() - started)
"""


@pytest.mark.parametrize("how", ["whole", "precincts", "second style", "style of a tile", "tiles"])
def test_forged_precincts_and_tiles_of_jpeg2000_take_no_memory(how):
    """Small precincts took 1600 bytes per pixel; the tests above forge only sizes."""
    done = subprocess.run(
        [sys.executable, "-c", PRECINCTS, how], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    *said, numbers = done.stdout.splitlines()
    megabytes, seconds = map(float, numbers.split())
    assert ("damaged" in "".join(said)) == (how != "whole")
    assert megabytes < (120 if how == "whole" else 20)  # 10 bytes a pixel of the picture are 42 MB
    assert seconds < 5
