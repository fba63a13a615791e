"""Images read by all lanes of a packet, each over its own footprint."""

from __future__ import annotations

import numpy as np

from ii_core.base.colour import LINEAR
from ii_core.base.jit import lane_part, lane_stage

from . import lanes as at
from .lanes import BLOCK
from .tables import LEVELS
from .texels import add_mixed
from .textures import filter_taps, folded, texels_about

_LINEAR = LINEAR.astype(np.float32)
_ZERO = np.float32(0)
_3, _4 = np.uint64(3), np.uint64(4)


@lane_part
def read_images(table, texels, work):
    """Colours of images over ellipses about (u, v) of two diameters: means of their pyramids (Williams 1983).

    Image rows of the table of textures, −1 for none, are in ``IMAGE``, places in ``SU`` and ``SV``, diameters in ``AU``
    … ``BV``; colours come to ``Q0`` … ``Q2``.
    """
    single, whole = work.single, work.whole
    for k in range(4 * BLOCK):
        single[at.QUAD + k] = _ZERO
    for tap in range(_choose_levels(table, work)):
        for far in range(2):
            _find_texels(np.float64(tap), far * 4 * BLOCK, work.single, work.double, work.whole)
            for k in range(BLOCK):
                if whole[at.READ + k] != 0:
                    _add_texels(k, whole[at.CODES + far * BLOCK + k] != 0, texels, single, whole)
    for k in range(BLOCK):
        q = at.QUAD + 4 * k
        single[at.Q0 + k], single[at.Q1 + k], single[at.Q2 + k] = single[q], single[q + 1], single[q + 2]


@lane_stage
def _choose_levels(table, work):
    """Choose taps and two levels of each lane's image.

    Returns
    -------
    int
        The largest number of taps.
    """
    single, double, whole = work.single, work.double, work.whole
    for k in range(BLOCK):
        row = np.uint64(max(whole[at.IMAGE + k], 0))
        double[at.WIDTHS + k], double[at.HEIGHTS + k] = table[row, 2], table[row, 3]
        double[at.ACROSS + k], double[at.DOWN + k] = table[row, 6], table[row, 7]
        double[at.PART + k] = table[row, LEVELS]
    for k in range(BLOCK):
        taps, level, bu, bv = filter_taps(
            double[at.WIDTHS + k], double[at.HEIGHTS + k], double[at.PART + k], np.float64(single[at.AU + k]),
            np.float64(single[at.AV + k]), np.float64(single[at.BU + k]), np.float64(single[at.BV + k]),
        )  # fmt: skip
        near = np.floor(level)
        double[at.TAPS + k], double[at.WAY_U + k], double[at.WAY_V + k] = taps, bu, bv
        double[at.NEAR + k], double[at.PART + k] = near, level - near
    most = 0
    for k in range(BLOCK):
        double[at.TAPS + k] = double[at.TAPS + k] if whole[at.IMAGE + k] >= 0 else 0.0
        most = max(most, int(double[at.TAPS + k]))
        row = np.uint64(max(whole[at.IMAGE + k], 0) + int(double[at.NEAR + k]))
        double[at.FIRST + k], whole[at.CODES + k] = table[row, 1], int(table[row, 5])
        double[at.WIDTHS + k], double[at.HEIGHTS + k] = table[row, 2], table[row, 3]
        row += np.uint64(double[at.PART + k] > 0.0)
        double[at.FIRST + 4 * BLOCK + k], whole[at.CODES + BLOCK + k] = table[row, 1], int(table[row, 5])
        double[at.WIDTHS + 4 * BLOCK + k], double[at.HEIGHTS + 4 * BLOCK + k] = table[row, 2], table[row, 3]
    for k in range(BLOCK):
        share = 1.0 / max(double[at.TAPS + k], 1.0)
        double[at.SHARE + k] = (1.0 - double[at.PART + k]) * share
        double[at.SHARE + 4 * BLOCK + k] = double[at.PART + k] * share
    return most


@lane_stage
def _find_texels(tap, level, single, double, whole):
    """Find the four texels about one tap of each lane in one of its levels, and their shares of its colour."""
    for k in range(BLOCK):
        taps, width, first = double[at.TAPS + k], double[at.WIDTHS + level + k], double[at.FIRST + level + k]
        across, down, share = double[at.ACROSS + k], double[at.DOWN + k], double[at.SHARE + level + k]
        s = (tap + 0.5) / max(taps, 1.0) - 0.5
        x = folded(double[at.SU + k] + s * double[at.WAY_U + k], across)
        y = 1.0 - folded(double[at.SV + k] + s * double[at.WAY_V + k], down)
        i0, i1, j0, j1, fx, fy = texels_about(x, y, width, double[at.HEIGHTS + level + k], across, down)
        share = share if tap < taps else 0.0
        whole[at.TEXELS + k] = np.int64(first + j0 * width + i0)
        whole[at.TEXELS + BLOCK + k] = np.int64(first + j0 * width + i1)
        whole[at.TEXELS + 2 * BLOCK + k] = np.int64(first + j1 * width + i0)
        whole[at.TEXELS + 3 * BLOCK + k] = np.int64(first + j1 * width + i1)
        single[at.SHARES + k] = share * (1.0 - fx) * (1.0 - fy)
        single[at.SHARES + BLOCK + k] = share * fx * (1.0 - fy)
        single[at.SHARES + 2 * BLOCK + k] = share * (1.0 - fx) * fy
        single[at.SHARES + 3 * BLOCK + k] = share * fx * fy
        whole[at.READ + k] = 1 if share > 0.0 else 0


@lane_stage
def _add_texels(k, codes, texels, single, whole):
    """Add one lane's four texels."""
    s, t, q = at.SHARES + k, at.TEXELS + k, at.QUAD + 4 * k
    weights = single[s], single[s + BLOCK], single[s + 2 * BLOCK], single[s + 3 * BLOCK]
    a, b, c, d = (
        np.uint64(whole[t]), np.uint64(whole[t + BLOCK]), np.uint64(whole[t + 2 * BLOCK]),
        np.uint64(whole[t + 3 * BLOCK]),
    )  # fmt: skip
    if codes:
        for channel in range(3):
            i = np.uint64(channel)
            single[q + channel] += (
                weights[0] * _LINEAR[texels[1][a * _4 + i]] + weights[1] * _LINEAR[texels[1][b * _4 + i]]
                + weights[2] * _LINEAR[texels[1][c * _4 + i]] + weights[3] * _LINEAR[texels[1][d * _4 + i]]
            )  # fmt: skip
    else:
        add_mixed(texels[0], (a * _3, b * _3, c * _3, d * _3), weights, single, q)
