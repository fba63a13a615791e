"""Coders and measures of other packages that fail or return wrong values; coded pictures constructed by hand."""

import sys
import tracemalloc

import numpy as np
import pytest

from codec import (
    Coder,
    CodingResult,
    DamagedTake,
    Encoded,
    EncodedTake,
    Run,
    decode,
    encode,
    encode_take,
    open_take,
    register,
)
from codec.contract import _CODERS
from codec.takes import container
from codec.takes.api import _values
from ii_core import IIPicture, video_of
from ii_core.base.foreign import ForeignError
from metrics import Measure, measuring, register_measure, report
from metrics.measures.measure import MEASURES

PICTURE = IIPicture(np.random.default_rng(3).integers(0, 256, (32, 64, 3), np.uint8), (16, 8), (4, 4))


class Odd(BaseException):
    """An exception that is no subclass of Exception."""


def ends(error):
    def fail(*arguments):
        raise error

    return fail


class Broken(Coder):
    """A coder whose encoder and decoder are given functions."""

    name, about, versions = "broken", "for this test", {}
    rate_control, quality_range = False, (0, 9)
    coded = staticmethod(lambda: CodingResult(run=Run(b"x", 0.0)))
    decoded = staticmethod(lambda: (PICTURE.pixels, 0.0))

    def check(self, picture, options):
        pass

    def encode(self, picture, options, goal):
        return self.coded()

    def decode(self, payload, blank, options):
        return self.decoded()


@pytest.fixture
def broken():
    coder = Broken()
    register(coder)
    yield coder
    del _CODERS["broken"]


@pytest.mark.parametrize(
    ("does", "said"),
    [
        (ends(SystemExit(3)), r"scheme broken failed to encode: SystemExit: 3 \(.*test_foreign.py, line \d+\)"),
        (ends(Odd("no")), "scheme broken failed to encode: Odd: no"),
        (ends(AttributeError("none")), "scheme broken failed to encode: AttributeError: none"),
        (lambda: None, "scheme broken encoded to NoneType: a CodingResult with bytes is needed"),
        (lambda: CodingResult(run=Run("text", 0.0)), "a CodingResult with bytes is needed"),
    ],
)
@pytest.mark.parametrize("goal", [{"quality": 5}, {"bpp": 1.0}])
def test_a_coder_that_fails_to_encode_is_named(broken, does, said, goal):
    broken.coded = does
    with pytest.raises(ForeignError, match=said):
        encode(PICTURE, "broken", **goal)


@pytest.mark.parametrize(
    ("does", "said"),
    [
        (ends(SystemExit()), "scheme broken failed to decode: SystemExit"),
        (ends(KeyError("k")), "scheme broken failed to decode: KeyError: 'k'"),
        (ends(ValueError("short")), "the coded picture is damaged: short"),
        (lambda: None, "scheme broken decoded to NoneType: pixels .32, 64, 3. of uint8 are needed"),
        (lambda: PICTURE.pixels, "scheme broken decoded in NoneType: a number of CPU seconds is needed"),
        (lambda: (PICTURE.pixels[:4], 0.0), "scheme broken decoded to an array .4, 64, 3. of uint8"),
        (lambda: (PICTURE.pixels.astype(float), 0.0), "an array .32, 64, 3. of float64"),
    ],
)
def test_a_coder_that_fails_to_decode_is_named(broken, does, said):
    coded = encode(PICTURE, "broken", quality=5)
    broken.decoded = does
    with pytest.raises((ForeignError, ValueError), match=said):
        decode(coded)


@pytest.mark.parametrize("does", [ends(SystemExit(1)), ends(Odd()), lambda pair: None, lambda pair: "text"])
def test_a_measure_that_fails_is_named(does):
    register_measure(Measure(name="broken", compute=does, text="for this test"))
    try:
        for measure in (lambda: report(PICTURE, PICTURE), lambda: measuring(PICTURE, ["broken"])(PICTURE)):
            with pytest.raises(ForeignError, match="measure broken failed: "):
                measure()
    finally:
        del MEASURES["broken"]


def test_a_failing_coder_is_one_line_of_the_command(broken, run, refused, tmp_path):
    broken.coded = ends(SystemExit(0))
    PICTURE.save(tmp_path / "p.png")
    words = ("--scheme", "broken", "--quality", 5, "-o", tmp_path / "p.ii")
    refused(run("encode", tmp_path / "p.png", *words), "scheme broken failed to encode: SystemExit: 0")
    assert not (tmp_path / "p.ii").exists()


def test_ctrl_c_of_the_user_is_no_fault_of_the_coder(broken):
    broken.coded = ends(KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        encode(PICTURE, "broken", quality=5)


CODED = encode(PICTURE, "si-h264", qp=40)
WRONG = [
    ({"scheme": "none"}, "unknown scheme 'none'"),
    ({"scheme": None}, "scheme is None"),
    ({"options": {"gop": -1}}, "option gop is -1"),
    ({"options": None}, "options is None"),
    ({"dtype": "float64"}, "dtype is 'float64'"),
    ({"structure": {}}, "lenses is None"),
    ({"structure": {"lenses": [4, 4], "ei_pixels": [1 << 20, 1 << 20]}}, "at most 2147483648 are allowed"),
    ({"qp": "text"}, "qp is 'text'"),
]


@pytest.mark.parametrize(
    ("wrong", "said"), [*WRONG, ({"payload": "text"}, "payload is 'text'"), ({"versions": 1}, "versions is 1")]
)
def test_a_coded_picture_of_wrong_parts_is_refused_when_it_is_made(wrong, said):
    with pytest.raises((TypeError, ValueError), match=said):
        Encoded(**{**vars(CODED), **wrong})


@pytest.mark.parametrize(
    ("wrong", "said"),
    [*WRONG, ({"segments": "text"}, "segments is 'text'"), ({"segments": [1]}, "segments holds a value that is 1"),
     ({"fps": 0}, "fps is 0"), ({"frames": 0}, "frames is 0"), ({"plan": None}, "plan is None"),
     ({"scheme": "jpeg2000", "options": {}}, "codes no takes")],
)  # fmt: skip
def test_a_coded_take_of_wrong_parts_is_refused_when_it_is_made(wrong, said):
    coded = encode_take(video_of([PICTURE]), "si-h264", qp=40)
    with pytest.raises((TypeError, ValueError), match=said):
        type(coded)(**{**vars(coded), **wrong})


def test_a_coded_take_without_all_segments_is_refused():
    coded = encode_take(video_of([PICTURE]), "si-h264", qp=40)
    with pytest.raises(ValueError, match="has 0 segments: 1 are needed for 1 frames"):
        open_take(type(coded)(**{**vars(coded), "segments": []}))


def test_a_take_that_states_many_segments_takes_no_memory(tmp_path):
    """A header of 2²⁴ segments made a list of as many ranges, 900 MB."""
    coded = encode_take(video_of([PICTURE]), "si-h264", qp=40)
    values = _values(coded)
    values[9], values[12] = 1 << 24, 1  # frames, span
    container.write(tmp_path / "t.ii", values, coded.segments)
    tracemalloc.start()
    try:
        with pytest.raises(DamagedTake, match="segment 2 of 16777216: frames "):
            EncodedTake.load(tmp_path / "t.ii")
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("none.py", None, "none.py does not exist"),
        ("folder.py", "", "is a folder"),
        ("text.txt", b"x = 1", "is no Python file: .py is needed"),
        ("syntax.py", b"x = (", "syntax.py, line 1: SyntaxError"),
        ("latin.py", b"x = '\xe9'", "latin.py"),
        ("nul.py", b"x = 1\0", "nul.py"),
        ("raises.py", b"\nraise KeyError('k')", "raises.py, line 2: KeyError: 'k'"),
        ("exits.py", b"import sys\nsys.exit(0)", "exits.py, line 2: SystemExit: 0"),
        ("odd.py", b"class Odd(BaseException): pass\nraise Odd", "odd.py, line 2: Odd"),
        ("again.py", b"import codec\ncodec.register(codec.contract.find('jpeg'))", "'jpeg' is registered already"),
        ("deep.py", b"x = " + b"(" * 5000 + b")" * 5000, "deep.py"),
    ],
)
def test_invalid_plugin_files_are_one_line(run, refused, tmp_path, monkeypatch, name, content, said):
    """`except Exception` had let SystemExit pass: the command ended with exit code 0 and did nothing."""
    monkeypatch.chdir(tmp_path)
    if content == "":
        (tmp_path / name).mkdir()
    elif content is not None:
        (tmp_path / name).write_bytes(content)
    known = set(sys.modules)
    refused(run("schemes", "--plugin", name), said)
    assert {module for module in set(sys.modules) - known if module.startswith("plugin_")} == set()
