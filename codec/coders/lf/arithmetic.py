"""Adaptive binary arithmetic coding: one function for both directions.

`code_bit` writes a bit or reads one, by the direction of the coder it is given, so that each syntax element is
written down once for encoder and decoder. From version 12 on the coder is refined: all bits with a context are mixed.

A context holds two probabilities of a one in units of 2^-16, which follow the bits at two rates, and the number of
bits seen. Their mean is used. The range coder is that of LZMA (Pavlov) with 40 bits of range instead of 32: bytes
leave from the top, a carry runs through those that wait.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ii_core.base.jit import lean_kernel, part_kernel, stage_kernel
from ii_core.base.references import by_reference

from .contexts import ELEMENT_OF, ELEMENT_WEIGHTS, HISTORY, PLACE_OF, RECENT

LOW, RANGE, CACHE, WAITING, AT, DECODING, CODE, REFINED, REGISTERS = range(9)
FULL = (1 << 40) - 1
LEAST_RANGE = 1 << 32
ONE = 1 << 16
LEAST = 48  # of a probability: 0.001 bit
FAST, SLOW, SEEN = 16, 140, 255  # the rates' limits as 1/n
BEYOND = 16  # bytes a decoder may read past the end: the encoder drops zeros there

_N = np.arange(SEEN + 1)
RATES = np.stack(
    [np.rint(ONE * np.maximum(1 / (_N + 1.6), 1 / limit)).astype(np.int64) for limit in (FAST, SLOW)], axis=1
)
# Cost in bits of an event of probability i / 4096.
COSTS = -np.log2(np.maximum(np.arange(4097), 0.5) / 4096).astype(np.float32)

# Log odds in 2^-8 of probabilities in 2^-12, and probabilities in 2^-16 of log odds up to FARTHEST.
FARTHEST = 1900
MIXING_RATE, REFINED_RATE = 3, 41
_P = np.maximum(np.arange(4096), 0.5) / 4096
STRETCHED = np.rint(256 * np.log(_P / (1 - _P))).astype(np.int32)
SQUASHED = np.rint(ONE / (1 + np.exp(-np.arange(-FARTHEST, FARTHEST + 1) / 256))).astype(np.int32)
SQUASHED = np.clip(SQUASHED, LEAST, ONE - LEAST)


@by_reference
class Arithmetic(NamedTuple):
    """State of a coder: contexts (C, 3), registers and bytes."""

    contexts: Any
    state: Any
    data: Any


def new_contexts(count: int) -> NDArray[np.int32]:
    """Contexts that have seen nothing."""
    contexts = np.zeros((count, 3), np.int32)
    contexts[:, :2] = ONE // 2
    return contexts


def writer(contexts: NDArray[np.int32], capacity: int, *, refined: bool = False) -> Arithmetic:
    """A coder that writes at most so many bytes; `finish` gives them. It mixes as of version 12 if it is refined."""
    state = np.zeros(REGISTERS, np.int64)
    state[RANGE], state[WAITING], state[REFINED] = FULL, 1, refined
    return Arithmetic(contexts, state, np.zeros(capacity, np.uint8))


def enlarged(coder: Arithmetic, capacity: int) -> Arithmetic:
    """The same coder with room for so many bytes more."""
    if coder.data.size - coder.state[AT] - coder.state[WAITING] >= capacity:
        return coder
    data = np.zeros(2 * coder.data.size + capacity, np.uint8)
    data[: coder.data.size] = coder.data
    return coder._replace(data=data)


def reader(contexts: NDArray[np.int32], data: bytes, *, refined: bool = False) -> Arithmetic:
    """A coder that reads bytes, and zeros after them. It mixes as of version 12 if it is refined."""
    state = np.zeros(REGISTERS, np.int64)
    state[RANGE], state[DECODING], state[AT], state[REFINED] = FULL, 1, 5, refined
    state[CODE] = int.from_bytes(data[:5].ljust(5, b"\0"), "big")
    return Arithmetic(contexts, state, np.array(np.frombuffer(data, np.uint8)))


def finish(coder: Arithmetic) -> bytes:
    """The bytes written: so few that the decoder, which reads zeros after them, stays within the range."""
    low, size = int(coder.state[LOW]), int(coder.state[RANGE])
    for zeros in range(40, -1, -1):
        value = -(-low >> zeros) << zeros
        if value < low + size:
            break
    coder.state[LOW] = value
    for _ in range(6):
        _shift(coder)
    # The first byte is the carry's place, always zero.
    return coder.data[1 : int(coder.state[AT])].tobytes().rstrip(b"\0")


def overrun(coder: Arithmetic) -> bool:
    """Whether a decoder has read further than the encoder can have written."""
    return bool(coder.state[AT] > coder.data.size + BEYOND)


@lean_kernel
def _shift(coder):
    """Move the top byte out, with what waits for a carry."""
    state, data = coder.state, coder.data
    low = state[LOW]
    if low < 0xFF00000000 or low > FULL:
        carry = low >> 40
        at = state[AT]
        byte = state[CACHE]
        for _ in range(state[WAITING]):
            data[at] = (byte + carry) & 255
            at += 1
            byte = 255
        state[AT] = at
        state[WAITING] = 0
        state[CACHE] = (low >> 32) & 255
    state[WAITING] += 1
    state[LOW] = (low & 0xFFFFFFFF) << 8


@stage_kernel
def _normalise(coder):
    state = coder.state
    while state[RANGE] < LEAST_RANGE:
        state[RANGE] <<= 8
        if state[DECODING]:
            at = state[AT]
            state[CODE] <<= 8
            if at < coder.data.size:
                state[CODE] |= np.int64(coder.data[at])
            state[AT] = at + 1
        else:
            _shift(coder)


@stage_kernel
def probability(contexts, context):
    """Of a one, in units of 2^-16."""
    p = (np.int64(contexts[context, 0]) + np.int64(contexts[context, 1])) >> 1
    return min(max(p, LEAST), ONE - LEAST)


def bit_costs(contexts: NDArray[np.int32]) -> NDArray[np.float32]:
    """Bits (contexts, 2) that a zero and a one would take in each context."""
    means = (contexts[:, 0].astype(np.int64) + contexts[:, 1]) >> 1
    p = (np.clip(means, LEAST, ONE - LEAST) + 8) >> 4
    return np.stack([COSTS[4096 - p], COSTS[p]], axis=1)


@stage_kernel
def bit_cost(costs, context, bit):
    """Bits that a bit would take, of the table by `bit_costs`."""
    return costs[np.uint64(context), np.uint64(bit)]


@stage_kernel
def _code_below(coder, split, bit):
    """Write or read a bit: one takes the part of the range below the split, zero the rest."""
    state = coder.state
    if state[DECODING]:
        bit = 1 if state[CODE] < split else 0
        if not bit:
            state[CODE] -= split
    elif not bit:
        state[LOW] += split
    state[RANGE] = split if bit else state[RANGE] - split
    _normalise(coder)
    return bit


@stage_kernel
def _code_with(coder, p, bit):
    """Write or read a bit that is one with probability p."""
    return _code_below(coder, (coder.state[RANGE] >> 16) * p, bit)


@stage_kernel
def _learn(contexts, context, bit):
    seen = contexts[context, 2]
    target = ONE if bit else 0
    for rate in range(2):
        p = np.int64(contexts[context, rate])
        contexts[context, rate] = p + (((target - p) * RATES[seen, rate]) >> 16)
    if seen < SEEN:
        contexts[context, 2] = seen + 1


@stage_kernel
def _odds(contexts, context):
    """Log odds of a one, in units of 2^-8."""
    return np.int64(STRETCHED[probability(contexts, context) >> 4])


@stage_kernel
def _mixed_probability(odds):
    return np.int64(SQUASHED[min(max(odds >> 16, -FARTHEST), FARTHEST) + FARTHEST])


@stage_kernel
def _weighed(contexts, weights, odds):
    """Sum of three log odds by the weights of a row, in units of 2^-24."""
    total = np.int64(contexts[weights, 0]) * odds[0] + np.int64(contexts[weights, 1]) * odds[1]
    return total + np.int64(contexts[weights, 2]) * odds[2]


@stage_kernel
def _learn_three(contexts, weights, of, odds, missed, bit):
    """Move the weights of a row by what their sum missed, and three contexts by the bit."""
    contexts[weights, 0] += (odds[0] * missed) >> 20
    contexts[weights, 1] += (odds[1] * missed) >> 20
    contexts[weights, 2] += (odds[2] * missed) >> 20
    _learn(contexts, of[0], bit)
    _learn(contexts, of[1], bit)
    _learn(contexts, of[2], bit)


@part_kernel
def _code_refined(coder, context, bit):
    """As `code_bit`, mixed with the bits of the same element before."""
    contexts, element = coder.contexts, np.int64(ELEMENT_OF[context])
    weights = ELEMENT_WEIGHTS + 2 * element
    before = np.int64(contexts[weights + 1, 0])
    of = context, HISTORY + 16 * element + before, RECENT + 4 * np.int64(PLACE_OF[context]) + (before & 3)
    odds = _odds(contexts, of[0]), _odds(contexts, of[1]), _odds(contexts, of[2])
    p = _mixed_probability(_weighed(contexts, weights, odds))
    bit = _code_with(coder, p, bit)
    _learn_three(contexts, weights, of, odds, ((ONE if bit else 0) - p) * REFINED_RATE, bit)
    contexts[weights + 1, 0] = (2 * before + bit) & 15
    return bit


@part_kernel
def code_of_four(coder, one, other, third, fourth, weights, bit):
    """As `code_mixed`, of four contexts; the fourth weight stands in the row after the others."""
    contexts, of = coder.contexts, (one, other, third)
    odds, last = (_odds(contexts, one), _odds(contexts, other), _odds(contexts, third)), _odds(contexts, fourth)
    p = _mixed_probability(_weighed(contexts, weights, odds) + np.int64(contexts[weights + 1, 0]) * last)
    bit = _code_with(coder, p, bit)
    missed = ((ONE if bit else 0) - p) * REFINED_RATE
    _learn_three(contexts, weights, of, odds, missed, bit)
    contexts[weights + 1, 0] += (last * missed) >> 20
    _learn(contexts, fourth, bit)
    return bit


@part_kernel
def code_bit(coder, context, bit):
    """Write or read a bit in a context, which learns it; return it."""
    if coder.state[REFINED]:
        return _code_refined(coder, context, bit)
    bit = _code_with(coder, probability(coder.contexts, context), bit)
    _learn(coder.contexts, context, bit)
    return bit


@part_kernel
def code_mixed(coder, one, other, weights, bit):
    """Write or read a bit by two contexts: their log odds are added by weights, which learn as well (Mahoney 2005).

    ``contexts[weights, :2]`` are the weights in 2^-16.
    """
    contexts = coder.contexts
    a, b = _odds(contexts, one), _odds(contexts, other)
    p = _mixed_probability(np.int64(contexts[weights, 0]) * a + np.int64(contexts[weights, 1]) * b)
    bit = _code_with(coder, p, bit)
    missed = ((ONE if bit else 0) - p) * (REFINED_RATE if coder.state[REFINED] else MIXING_RATE)
    contexts[weights, 0] += (a * missed) >> 20
    contexts[weights, 1] += (b * missed) >> 20
    _learn(contexts, one, bit)
    _learn(contexts, other, bit)
    return bit


@part_kernel
def code_raw(coder, bit):
    """Write or read a bit of even odds."""
    return _code_below(coder, coder.state[RANGE] >> 1, bit)


MOST_DIGITS = 24


@part_kernel
def code_number(coder, first, count, order, value):
    """Write or read a number from 0 up: an Exp-Golomb code whose prefix has contexts first … first + count - 1."""
    total = value + (1 << order)
    digits = order
    while digits < MOST_DIGITS:
        if not code_bit(coder, first + min(digits - order, count - 1), 1 if total >> (digits + 1) else 0):
            break
        digits += 1
    found = 1
    for place in range(digits - 1, -1, -1):
        found = 2 * found + code_raw(coder, (total >> place) & 1)
    return found - (1 << order)


@part_kernel
def number_cost(costs, first, count, order, value):
    """Bits that `code_number` would take."""
    total = value + (1 << order)
    bits = np.float32(0)
    digits = order
    while total >> (digits + 1):
        bits += bit_cost(costs, first + min(digits - order, count - 1), 1)
        digits += 1
    return bits + bit_cost(costs, first + min(digits - order, count - 1), 0) + np.float32(digits)
