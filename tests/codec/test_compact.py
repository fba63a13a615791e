"""Compact values of file headers: exact inverse, unique form."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.bitstream import compact
from codec.bitstream.compact import WORDS, read_values, write_values

NUMBERS = st.integers(-(2**63) + 1, 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
TEXTS = st.text(max_size=20) | st.sampled_from(WORDS)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.slow
@given(st.lists(VALUES, max_size=5))
def test_values_come_back_with_their_types(values):
    back = read_values(write_values(values))
    assert json.dumps(back) == json.dumps(values)  # tells 1, 1.0, true and −0.0 apart


@given(st.binary(max_size=40))
def test_any_bytes_are_refused_or_in_canonical_form(data):
    try:
        values = read_values(data)
    except ValueError:
        return
    assert write_values(values) == data


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_take_at_most_nine_bytes(number):
    assert len(write_values([number])) <= 9


@pytest.mark.parametrize(
    ("value", "length"), [(0, 1), (95, 1), (96, 2), (512, 3), (-1, 2), (0.0061, 3), (1.461497432, 8), (math.pi, 9)]
)
def test_lengths(value, length):
    assert len(write_values([value])) == length


def test_words_beyond_128_take_two_bytes(monkeypatch):
    words = (*WORDS, *(f"later{i}" for i in range(600)))
    monkeypatch.setattr(compact, "WORDS", words)
    monkeypatch.setattr(compact, "_NUMBER", {word: number for number, word in enumerate(words)})
    for number, word in enumerate(words):
        data = write_values([word])
        assert len(data) == 1 + (number >= 128)
        assert read_values(data) == [word]
    monkeypatch.undo()
    with pytest.raises(ValueError, match="a newer version of this program"):
        read_values(data)
