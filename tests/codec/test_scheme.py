"""Scheme names, options and presets."""

import av
import numpy as np
import pytest

from codec import decode, encode, general_scheme, options, schemes
from codec.coders.jpeg2000 import Jpeg2000
from codec.contract import find, parse_scheme, register
from ii_core import IIPicture
from ii_core.base.extras import NotInstalled

PICTURE = IIPicture(np.zeros((4, 4, 3), np.uint8), (2, 2), (2, 2))


def test_schemes_list_their_options_and_defaults():
    told = schemes()
    assert set(told) >= {"ei-h264", "si-h264", "ri-h264", "jpeg2000"}
    for name, line in told.items():
        assert all("\n" not in text for text in (line, *options(name).values()))
    lines = options("si-h264")
    assert lines["order=parallel"] == "of the component images; one of row, column, parallel, zigzag, spiral"
    assert lines["merange=16"] == "motion range in pixels; a whole number from 16 to 128"
    assert lines["qp"].endswith("; a whole number from 0 to 51")


def test_options_default_and_override():
    coder, found = parse_scheme("si-h264:order=spiral,gop=32")
    assert coder.name == "si-h264"
    assert found.items() >= {"order": "spiral", "gop": 32, "bframes": 0, "merange": 16}.items()
    assert parse_scheme("jpeg2000")[1] == {}


def test_options_override_presets():
    fast, found = find("si-av1").presets["fast"], parse_scheme("si-av1:preset=5,fast,gop=32")[1]
    assert found["gop"] == 32
    assert found["preset"] == 5 != fast["preset"]
    assert {**fast, "preset": 5}.items() <= found.items()
    for name in schemes():
        for preset in find(name).presets:
            assert parse_scheme(f"{name}:{preset}")[0].name == name


@pytest.mark.parametrize(
    ("scheme", "message"),
    [
        ("si-h26", "unknown scheme 'si-h26': known are ei-"),
        ("", "unknown scheme ''"),
        (None, "scheme is None: a name is needed"),
        ("si-h264:speed=3", "scheme si-h264 has no option speed: known are order, by, gop, bframes, merange"),
        ("jpeg2000:order=row", "scheme jpeg2000 has no option order: known are none"),
        ("si-h264:order", "'order' is no option=value and no preset: known are"),
        ("si-h264:", "'' is no option=value and no preset"),
        ("si-h264:gop=4,gop=8", "option gop is given twice"),
        (
            "si-h264:order=diagonal",
            "option order is 'diagonal': one of row, column, parallel, zigzag, spiral is needed",
        ),
        ("si-h264:bframes=17", "option bframes is '17': a whole number from 0 to 16 is needed"),
        ("si-h264:pbratio=5", "option pbratio is '5': a number from 0.5 to 4.0 is needed"),
        ("si-h264:pbratio=nan", "option pbratio is 'nan'"),
        ("si-av1:swift", "'swift' is no option=value and no preset: known are fast, balanced, best"),
        ("si-av1:fast,best", "'best' is a second preset"),
        ("si-h264:gop=-1", "option gop is '-1': a whole number from 0"),
        ("si-h264:merange=8", "option merange is '8': a whole number from 16 to 128 is needed"),
        ("si-h264:gop=2.5", "option gop is '2.5'"),
    ],
)
def test_invalid_schemes_are_named(scheme, message):
    with pytest.raises(ValueError) as caught:
        encode(PICTURE, scheme, bpp=1)
    assert message in str(caught.value)


def test_options_are_keywords_too():
    coded = encode(PICTURE, "si-hevc", preset="fast", gop=4, depth=8, bpp=1)
    assert coded.payload == encode(PICTURE, "si-hevc:fast,gop=4,depth=8", bpp=1).payload
    assert coded.options["preset"] == find("si-hevc").presets["fast"]["preset"]
    assert parse_scheme("si-hevc", preset="veryslow")[1]["preset"] == "veryslow"  # x265's own
    assert parse_scheme("si-av1", preset=6)[1]["preset"] == 6
    assert parse_scheme("si-av1:gop=8", preset="best")[1].items() >= {"gop": 8, "preset": 2}.items()
    assert parse_scheme("htj2k", lossless=True)[1]["lossless"] == 1


@pytest.mark.parametrize(
    ("scheme", "keywords", "message"),
    [
        ("si-h264:gop=4", {"gop": 8}, "option gop is given twice"),
        ("si-h264", {"speed": 3}, "scheme si-h264 has no option speed: known are order, by, gop"),
        ("si-h264", {"gop": True}, "option gop is True: a whole number from 0"),
        ("si-h264", {"gop": None}, "option gop is None: a whole number from 0"),
        ("si-h264:fast", {"preset": "best"}, "'best' is a second preset"),
        ("si-vp9", {"preset": "swift"}, "'swift' is no option=value and no preset: known are fast, balanced, best"),
        ("si-av1", {"preset": "swift"}, "option preset is 'swift': a whole number from 0 to 7 is needed"),
    ],
)
def test_invalid_keywords_are_named(scheme, keywords, message):
    with pytest.raises(ValueError) as caught:
        encode(PICTURE, scheme, bpp=1, **keywords)
    assert message in str(caught.value)


def test_only_pictures_are_coded():
    with pytest.raises(ValueError, match="picture is ndarray: an IIPicture is needed"):
        encode(PICTURE.pixels, "jpeg2000", bpp=1)


def test_a_name_is_given_once():
    with pytest.raises(ValueError, match="'jpeg2000' is registered already"):
        register(Jpeg2000())


def test_pictures_beyond_all_bounds_are_refused_before_work():
    huge = IIPicture(np.broadcast_to(np.uint8(0), (1 << 16, 1 << 16, 3)), (1 << 12, 1 << 12), (16, 16))
    with pytest.raises(ValueError, match="65536×65536 pixels"):
        encode(huge, "si-h264", bpp=1)
    wide = IIPicture(np.broadcast_to(np.uint8(0), (1, 20_000, 3)), (20_000, 1), (1, 1))
    with pytest.raises(ValueError, match="frames of scheme si-h264 would have 20000×1 pixels"):
        encode(wide, "si-h264", bpp=1)


def without(monkeypatch, *codecs):
    monkeypatch.setattr(av, "codecs_available", av.codecs_available - set(codecs))


def test_a_missing_encoder_is_named_with_schemes_that_work(monkeypatch):
    without(monkeypatch, "libx265")
    message = "^scheme si-hevc needs libx265 in PyAV .*, which is not installed: take one of .*si-av1.*si-h264"
    with pytest.raises(NotInstalled, match=message):
        encode(PICTURE, "si-hevc", bpp=1)
    assert "NOT INSTALLED: libx265" in schemes()["si-hevc"]
    assert "NOT INSTALLED" not in schemes()["si-h264"]
    with pytest.raises(NotInstalled) as caught:
        encode(PICTURE, "ri-hevc", qp=30)
    assert "\n" not in str(caught.value) and "hevc," not in str(caught.value)


def test_a_missing_decoder_is_named(monkeypatch):
    coded = encode(PICTURE, "si-vp9", qp=30)
    without(monkeypatch, "vp9")
    with pytest.raises(NotInstalled, match=r"decoding of VP9 needs vp9 in PyAV .*, which is not installed"):
        decode(coded)


def test_the_general_scheme_fits_the_picture():
    assert general_scheme(PICTURE, bpp=1) == "si-lf"
    plain = IIPicture(np.zeros((32, 32, 3), np.uint8), (32, 32), (1, 1))
    assert general_scheme(plain, bpp=1) == "jpeg2000"
    row = IIPicture(np.zeros((32, 32, 3), np.uint8), (16, 32), (2, 1))
    assert general_scheme(row, bpp=1) == "jpeg2000"
    with pytest.raises(ValueError, match="no bpp or qp or quality is given"):
        general_scheme(PICTURE)
    with pytest.raises(TypeError, match="picture is"):
        general_scheme(PICTURE.pixels, bpp=1)
