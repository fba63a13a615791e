"""Kernels of depth from focus."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..base.jit import exact_stage_kernel, kernel

# Least neighbours of a half: a single one often agrees by chance. More would also exclude lenses at the border.
FEWEST = 2


class Tables(NamedTuple):
    """Pixels that see the point of each layer: `lens_tables.pixel_tables` or `views.view_tables`."""

    cols: Any  # (layers, n, K)
    col_weights: Any
    rows: Any  # (layers, n, L)
    row_weights: Any


class Star(NamedTuple):
    """Neighbours of a lens in eight directions."""

    where: Any  # (n, 2) table rows of each
    sides: Any  # (n, 4) the halves that it belongs to
    own: Any  # the neighbour at step 0


@exact_stage_kernel
def _between(pixels, m, n, x, y):
    """Interpolate the colour at the shares x and y from pixel (m, n) to its right and lower neighbours."""
    # At a weight of 0 the neighbour may lie outside the picture.
    right, below = m + (x > 0), n + (y > 0)
    a, b, c, e = (1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x
    return (
        a * pixels[n, m, 0] + b * pixels[n, right, 0] + c * pixels[below, m, 0] + e * pixels[below, right, 0],
        a * pixels[n, m, 1] + b * pixels[n, right, 1] + c * pixels[below, m, 1] + e * pixels[below, right, 1],
        a * pixels[n, m, 2] + b * pixels[n, right, 2] + c * pixels[below, m, 2] + e * pixels[below, right, 2],
    )


@exact_stage_kernel
def _sees(tables, where, i, d, l, k):
    """Whether a neighbour sees the point of layer ``d`` at lens (k, l)."""
    return tables.cols[d, where[i, 0], k] >= 0 and tables.rows[d, where[i, 1], l] >= 0


@exact_stage_kernel
def _colour(pixels, tables, where, i, d, l, k):
    """Return the colour of that point under a neighbour that sees it."""
    m, n = tables.cols[d, where[i, 0], k], tables.rows[d, where[i, 1], l]
    return _between(pixels, m, n, tables.col_weights[d, where[i, 0], k], tables.row_weights[d, where[i, 1], l])


@kernel
def focus_cost(pixels, tables, where, members, out, first, last):
    """out[l, k, d] = Σ_rgb |B_d − R_d|, NaN without a comparison, for lens rows ``first`` to ``last``.

    ``where`` (n, 2) holds the table rows of the neighbours, ``members`` (n, 2) their membership in B and R.
    """
    for l in range(first, last):
        for d in range(out.shape[2]):
            for k in range(out.shape[1]):
                out[l, k, d] = np.nan
                b0, b1, b2, r0, r1, r2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                in_b, in_r, in_both = 0, 0, 0
                for i in range(where.shape[0]):
                    if not _sees(tables, where, i, d, l, k):
                        continue
                    p0, p1, p2 = _colour(pixels, tables, where, i, d, l, k)
                    if members[i, 0]:
                        b0, b1, b2 = b0 + p0, b1 + p1, b2 + p2
                        in_b += 1
                    if members[i, 1]:
                        r0, r1, r2 = r0 + p0, r1 + p1, r2 + p2
                        in_r += 1
                        in_both += members[i, 0]
                if in_b == 0 or in_r == 0 or (in_b == in_both and in_r == in_both):
                    continue
                out[l, k, d] = abs(b0 / in_b - r0 / in_r) + abs(b1 / in_b - r1 / in_r) + abs(b2 / in_b - r2 / in_r)


@kernel
def half_cost(pixels, tables, star, limit, out, first, last):
    """out[l, k, d] = min over halves of the mean over their neighbours of min(Σ_rgb |p − p_own|, limit), or NaN.

    For lens rows ``first`` to ``last``.
    """
    total, count = np.empty(4), np.empty(4)
    for l in range(first, last):
        for d in range(out.shape[2]):
            for k in range(out.shape[1]):
                if _sees(tables, star.where, star.own, d, l, k):
                    _add_halves(pixels, tables, star, limit, d, l, k, total, count)
                    out[l, k, d] = _least_mean(total, count)
                else:
                    out[l, k, d] = np.nan


@exact_stage_kernel
def _add_halves(pixels, tables, star, limit, d, l, k, total, count):
    """Sum differences to the own lens's colour over the neighbours of each half, and count them."""
    total[:], count[:] = 0.0, 0.0
    q0, q1, q2 = _colour(pixels, tables, star.where, star.own, d, l, k)
    for i in range(star.where.shape[0]):
        if i == star.own or not _sees(tables, star.where, i, d, l, k):
            continue
        p0, p1, p2 = _colour(pixels, tables, star.where, i, d, l, k)
        difference = min(abs(p0 - q0) + abs(p1 - q1) + abs(p2 - q2), limit)
        for s in range(4):
            if star.sides[i, s]:
                total[s] += difference
                count[s] += 1


@exact_stage_kernel
def _least_mean(total, count):
    """Return the least mean of the halves with enough neighbours; NaN without one."""
    best = np.inf
    for s in range(4):
        if count[s] >= FEWEST:
            best = min(best, total[s] / count[s])
    return best if best < np.inf else np.nan


@kernel
def weigh(cost, h, view, alike, out, first, last):
    """out = cost ∗ h for rows ``first`` to ``last``, over the neighbours with a cost.

    The weights of h are multiplied by exp(−Σ_rgb |Δview|/alike): similar colours are assumed to have equal depth.
    """
    rows, cols, layers = cost.shape
    up, left = h.shape[0] // 2, h.shape[1] // 2
    total, weight = np.empty(layers), np.empty(layers)
    for l in range(first, last):
        for k in range(cols):
            total[:], weight[:] = 0.0, 0.0
            for j in range(max(0, l - up), min(rows, l + up + 1)):
                for i in range(max(0, k - left), min(cols, k + left + 1)):
                    difference = 0.0
                    for c in range(3):
                        difference += abs(view[j, i, c] - view[l, k, c])
                    # A convolution mirrors its kernel.
                    w = h[up - (j - l), left - (i - k)] * math.exp(-difference / alike)
                    for d in range(layers):
                        if not np.isnan(cost[j, i, d]):
                            total[d] += w * cost[j, i, d]
                            weight[d] += w
            for d in range(layers):
                out[l, k, d] = np.nan
                if weight[d] > 0 and not np.isnan(cost[l, k, d]):
                    out[l, k, d] = total[d] / weight[d]


@kernel
def pass_on(cost, view, place, slope, leap, alike, down, back, total, first, last):
    """Aggregate costs along one scan direction (semi-global matching) and add them to ``total``.

    A change of layer from one lens to the next costs ``slope`` times the difference of ``place``, at most ``leap``.
    Both are smaller where the colour of the view changes, as in `weigh`. ``down`` scans columns, ``back`` scans
    backwards. Rows (columns) ``first`` to ``last`` are scanned.

    A layer without a cost has the mean cost of the other layers.
    """
    layers = cost.shape[2]
    count = cost.shape[0] if down else cost.shape[1]
    before, now = np.zeros(layers), np.zeros(layers)
    for line in range(first, last):
        for step in range(count):
            at = count - 1 - step if back else step
            l, k = (at, line) if down else (line, at)
            mean, found = 0.0, 0
            for d in range(layers):
                if not np.isnan(cost[l, k, d]):
                    mean += cost[l, k, d]
                    found += 1
            mean /= max(found, 1)
            now[:] = 0.0
            if step > 0:
                was = at + 1 if back else at - 1
                pl, pk = (was, line) if down else (line, was)
                difference = 0.0
                for c in range(3):
                    difference += abs(view[l, k, c] - view[pl, pk, c])
                w = math.exp(-difference / alike)
                low = before.min()
                for d in range(layers):
                    now[d] = min(before[d] - low, leap * w)
                # Lower envelope of slopes from all layers, in two passes.
                for d in range(1, layers):
                    now[d] = min(now[d], now[d - 1] + slope * w * (place[d] - place[d - 1]))
                for d in range(layers - 2, -1, -1):
                    now[d] = min(now[d], now[d + 1] + slope * w * (place[d + 1] - place[d]))
            for d in range(layers):
                before[d] = now[d] + (mean if np.isnan(cost[l, k, d]) else cost[l, k, d])
                total[l, k, d] += before[d]


@kernel
def judge(cost, layer, floor, comparisons, trials, confidence, first, last):
    """Confidence of the chosen layers for lens rows ``first`` to ``last``, by a likelihood ratio against noise.

    The null hypothesis is that noise alone makes the costs of a pixel differ. A mean of ``comparisons`` differences
    of pure noise is below a share s of its expectation with a probability of about s to the power ``comparisons``.
    The confidence is 1/(1 + expected number of such costs among ``trials``); costs below ``floor`` count as
    ``floor``.
    """
    for l in range(first, last):
        for k in range(cost.shape[1]):
            confidence[l, k] = 0.0
            if layer[l, k] < 0:
                continue
            total, count = 0.0, 0
            for d in range(cost.shape[2]):
                if not np.isnan(cost[l, k, d]):
                    total += cost[l, k, d]
                    count += 1
            if count == 0:
                continue
            share = max(np.float64(cost[l, k, layer[l, k]]), floor) / max(total / count, floor)
            if share < 1:
                confidence[l, k] = 1 / (1 + trials * share**comparisons)


@kernel
def choose(cost, tie, layer, fit, first, last):
    """Choose the layer of least cost for lens rows ``first`` to ``last``, the nearest of equals.

    The layer is −1 if all costs are equal within ``tie``. ``fit`` is the offset, −½ to ½ layers, of the minimum of
    the parabola through the costs of the layer and its neighbours.
    """
    for l in range(first, last):
        for k in range(cost.shape[1]):
            best, low, high = -1, np.inf, -np.inf
            for d in range(cost.shape[2]):
                c = np.float64(cost[l, k, d])
                if np.isnan(c):
                    continue
                high = max(high, c)
                if c < low:
                    best, low = d, c
            layer[l, k], fit[l, k] = -1, 0.0
            if high - low > tie:
                layer[l, k] = best
                if 0 < best < cost.shape[2] - 1:
                    before, after = np.float64(cost[l, k, best - 1]), np.float64(cost[l, k, best + 1])
                    bend = before - 2 * low + after
                    if bend > 0:  # false for NaN and for three equal costs
                        fit[l, k] = (before - after) / (2 * bend)
