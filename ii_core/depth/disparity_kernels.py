"""Kernels of disparity: costs along half-lines of views, Gauss–Newton steps over all views, windows of planes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types

from ..base.jit import array_kernel, compiled_by, lean_kernel, stage_kernel

UNSEEN = 0.6  # of the cost of another surface


class Views(NamedTuple):
    """Views around the one whose disparity is estimated."""

    pixels: Any  # (n, 3, H, W) of uint16
    steps: Any  # (n, 2) of float32: steps down and to the right from the reference; the first is the reference itself
    lines: Any  # (n,) half-line of each view, −1 for none


_HALF, _ONE, _THREE_HALVES, _TWO = np.float32(0.5), np.float32(1.0), np.float32(1.5), np.float32(2.0)
_FIVE_HALVES = np.float32(2.5)


@stage_kernel
def _cubic(f):
    """Return the weights of four samples around a place f beyond the second (Catmull–Rom), float32."""
    return (
        f * (f * (_ONE - _HALF * f) - _HALF),
        f * f * (_THREE_HALVES * f - _FIVE_HALVES) + _ONE,
        f * (f * (_TWO - _THREE_HALVES * f) + _HALF),
        f * f * (_HALF * f - _HALF),
    )


def _sample_4x4(typing: Any, pixels: Any, at: Any, row: Any, down: Any, across: Any) -> Any:
    """Rows of four samples are vectors: LLVM makes none of them from single samples."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        four, codes, lane = ir.VectorType(ir.FloatType(), 4), ir.VectorType(ir.IntType(16), 4), ir.IntType(32)
        data, place = context.make_array(pixels)(context, builder, values[0]).data, values[1]
        total = ir.Constant(four, [0.0] * 4)
        for k in range(4):
            samples = builder.load(builder.bitcast(builder.gep(data, [place]), codes.as_pointer()), align=2)
            weight = builder.insert_element(
                ir.Constant(four, ir.Undefined), builder.extract_value(values[3], k), lane(0)
            )
            weight = builder.shuffle_vector(weight, weight, ir.Constant(ir.VectorType(lane, 4), [0] * 4))
            product = builder.fmul(weight, builder.uitofp(samples, four), flags=("contract",))
            total, place = builder.fadd(total, product, flags=("contract",)), builder.add(place, values[2])
        terms = [
            builder.fmul(builder.extract_element(total, lane(k)), builder.extract_value(values[4], k))
            for k in range(4)
        ]
        return builder.fadd(builder.fadd(terms[0], terms[1]), builder.fadd(terms[2], terms[3]))

    return types.float32(pixels, types.uint64, types.uint64, down, across), generate


@compiled_by(_sample_4x4)
def sample_4x4(pixels: Any, at: Any, row: Any, down: Any, across: Any) -> Any:
    """Return the weighted sum of 4×4 samples, from ``pixels[at]`` on in rows that are ``row`` apart."""
    corners = [int(at) + k * int(row) for k in range(4)]
    samples = np.array([pixels[c : c + 4] for c in corners], np.float32)
    return np.float32(np.array(down) @ samples @ np.array(across))


@array_kernel
def line_costs(views, labels, limit, lines, out, first, last):
    """out[y, x, d] = mean over the better half of the half-lines of views of the mean of min(Σ_rgb |Δ|, limit).

    A point outside a view counts as `UNSEEN` of ``limit``: labels that few views see do not win by chance. ``lines``
    is 8. Loops run over rows of pixels that start at index 0 and write one array: only those become vector
    instructions.
    """
    width = out.shape[1]
    on = np.zeros(lines, np.float32)
    for n in range(1, views.steps.shape[0]):
        if views.lines[n] >= 0:
            on[views.lines[n]] += np.float32(1.0)
    total, count = np.empty((lines, width), np.float32), np.empty((lines, width), np.float32)
    own, rows = np.empty((3, width), np.float32), np.empty((3, width + 3), np.float32)
    half, cost = np.empty(width, np.float32), np.empty(width, np.float32)
    for y in range(first, last):
        for c in range(3):
            for x in range(width):
                own[c, x] = views.pixels[0, c, y, x]
        for d in range(labels.size):
            total[:] = 0.0
            count[:] = 0.0
            for n in range(1, views.steps.shape[0]):
                line = views.lines[n]
                if line >= 0:
                    sy, sx = -labels[d] * views.steps[n, 0], -labels[d] * views.steps[n, 1]
                    _add_differences(views.pixels[n], own, y, sy, sx, limit, rows, total[line], count[line])
            _better_half(total, count, on, limit, half, cost)
            for x in range(width):
                out[y, x, d] = np.uint16(cost[x] + np.float32(0.5))


@stage_kernel
def _add_differences(pixels, own, y, sy, sx, limit, rows, total, count):
    """Add min(Σ_rgb |Δ|, limit) between a row of the reference and a view, moved by (sy, sx), cubic."""
    height, width = pixels.shape[1:]
    top, left = math.floor(sy), math.floor(sx)
    if y + top < 0 or y + top + (sy > top) >= height:
        return
    # pixels whose neighbours on both sides lie in the view
    start, stop = max(0, -left), min(width, width - left - (sx > left))
    if stop <= start:
        return
    for c in range(3):
        _moved_row(pixels[c], y + top, np.float32(sy - top), rows[c])
    b0, b1, b2, b3 = _cubic(np.float32(sx - left))
    at, size = start + left, stop - start
    p0, p1, p2, p3 = rows[0, at:], rows[0, at + 1 :], rows[0, at + 2 :], rows[0, at + 3 :]
    q0, q1, q2, q3 = rows[1, at:], rows[1, at + 1 :], rows[1, at + 2 :], rows[1, at + 3 :]
    r0, r1, r2, r3 = rows[2, at:], rows[2, at + 1 :], rows[2, at + 2 :], rows[2, at + 3 :]
    o, p, q = own[0, start:], own[1, start:], own[2, start:]
    sums, seen = total[start:], count[start:]
    if sx == left:  # along columns
        for x in range(size):
            e = abs(p1[x] - o[x]) + abs(q1[x] - p[x]) + abs(r1[x] - q[x])
            sums[x] += e if e < limit else limit
    else:
        for x in range(size):
            e = abs(b0 * p0[x] + b1 * p1[x] + b2 * p2[x] + b3 * p3[x] - o[x])
            e += abs(b0 * q0[x] + b1 * q1[x] + b2 * q2[x] + b3 * q3[x] - p[x])
            e += abs(b0 * r0[x] + b1 * r1[x] + b2 * r2[x] + b3 * r3[x] - q[x])
            sums[x] += e if e < limit else limit
    for x in range(size):
        seen[x] += np.float32(1.0)


@stage_kernel
def _moved_row(image, y, part, row):
    """Interpolate a row of an image at y + part, continued by one pixel on the left and two on the right."""
    height, width = image.shape
    a0, a1, a2, a3 = _cubic(part)
    i0, i1 = image[max(y - 1, 0)], image[y]
    i2, i3 = image[min(y + 1, height - 1)], image[min(y + 2, height - 1)]
    inner = row[1:]
    if part == 0.0:  # half of the half-lines lie along rows
        for x in range(width):
            inner[x] = np.float32(i1[x])
    else:
        for x in range(width):
            inner[x] = (
                a0 * np.float32(i0[x]) + a1 * np.float32(i1[x]) + a2 * np.float32(i2[x]) + a3 * np.float32(i3[x])
            )
    row[0], row[width + 1], row[width + 2] = row[1], row[width], row[width]


@stage_kernel
def _better_half(total, count, on, limit, half, cost):
    """``cost`` is the mean of the lower half of the half-lines' means; ``limit`` without one."""
    half[:] = 0.0
    for k in range(8):
        sums, seen, unseen = total[k], count[k], limit * np.float32(UNSEEN)
        for x in range(half.size):
            mean = (sums[x] + (on[k] - seen[x]) * unseen) / on[k]
            sums[x] = mean if seen[x] > 0.0 else np.float32(np.inf)
        for x in range(half.size):
            half[x] += np.float32(1.0) if seen[x] > 0.0 else np.float32(0.0)
    for k in range(0, 8, 4):  # both fours in order
        _in_order(total[k], total[k + 1])
        _in_order(total[k + 2], total[k + 3])
        _in_order(total[k], total[k + 2])
        _in_order(total[k + 1], total[k + 3])
        _in_order(total[k + 1], total[k + 2])
    for k in range(4):  # the lower four of both
        low, other = total[k], total[7 - k]
        for x in range(half.size):
            low[x] = other[x] if other[x] < low[x] else low[x]
    _in_order(total[0], total[2])
    _in_order(total[1], total[3])
    _in_order(total[0], total[1])
    _in_order(total[2], total[3])
    cost[:] = 0.0
    for k in range(4):
        low = total[k]
        for x in range(half.size):
            cost[x] += low[x] if half[x] > np.float32(2 * k) else np.float32(0.0)
    for x in range(half.size):
        cost[x] = cost[x] / np.float32((int(half[x]) + 1) // 2) if half[x] > 0.0 else limit


@stage_kernel
def _in_order(low, high):
    """Exchange the values of two rows where the first is larger."""
    for x in range(low.size):
        a, b = low[x], high[x]
        low[x] = b if b < a else a
        high[x] = a if b < a else b


@array_kernel
def add_evidence(views, disparity, limit, smooth, here, push, reach, slopes, mean, first, last):
    """Add up what the differences of all views tell about the motion of each pixel.

    Between views that are s = (down, across) apart, a pixel moves by M·s; on a surface M is its disparity times the
    unit matrix. With g the slopes of colours, ``push`` (4, H, W) is Σ w·e·g_i·s_j of the differences e at the
    disparity, ``reach`` (3, H, W) Σ w·s_j·s_l, and ``slopes`` (3, H, W) Σ_rgb g_i·g_k: the normal equations of M.
    A view's weight w is 1/(1 + r²/limit²)², r² its squared difference, ``smooth`` (3, H, W) the image of the slopes.
    Where ``here`` is set, they are filled, and ``mean`` (3, H, W), the weighted mean of all views at the disparity. A
    row goes through one view after the other: rows of one view stay in the first cache, those of all do not.
    """
    height, width = disparity.shape
    own, pixels = views.pixels[0], views.pixels.reshape(-1)
    colours = np.zeros((3, width), np.float32)
    across, down = np.zeros((3, width), np.float32), np.zeros((3, width), np.float32)  # slopes of colours
    moved, mass = np.empty((3, width), np.float32), np.empty(width, np.float32)  # differences and weights, added up
    parts = np.empty((3, width), np.float32), np.empty(width, np.float32)  # those of a view
    for y in range(first, last):
        for x in range(width):
            if here[y, x]:
                push[:, y, x], reach[:, y, x], slopes[:, y, x] = 0.0, 0.0, 0.0
                for c in range(3):
                    mean[c, y, x] = own[c, y, x]
        if y < 1 or y > height - 2:
            continue
        for c in range(3):
            for x in range(1, width - 1):
                colours[c, x] = own[c, y, x]
                down[c, x] = _HALF * (smooth[c, y + 1, x] - smooth[c, y - 1, x])
                across[c, x] = _HALF * (smooth[c, y, x + 1] - smooth[c, y, x - 1])
        moved[:], mass[:] = 0.0, 1.0
        for n in range(1, views.steps.shape[0]):
            a, b = views.steps[n, 0], views.steps[n, 1]
            _differences(pixels, n, height, a, b, y, disparity[y], here[y], colours, *parts)
            _weigh(limit, a, b, down, across, *parts, push[:, y], reach[:, y], moved, mass)
        for x in range(1, width - 1):
            if here[y, x]:
                for c in range(3):
                    mean[c, y, x] += moved[c, x] / mass[x]
                    slopes[0, y, x] += down[c, x] * down[c, x]
                    slopes[1, y, x] += down[c, x] * across[c, x]
                    slopes[2, y, x] += across[c, x] * across[c, x]


@stage_kernel
def _differences(pixels, n, height, a, b, y, disparity, here, colours, off, seen):
    """Set the differences of a row from view n, whose step is (a, b), and 1 where they are seen, else 0."""
    width = disparity.size
    plane, row = np.uint64(height * width), np.uint64(width)
    start = np.uint64(3 * n) * plane
    bottom, right = np.float32(height - 2), np.float32(width - 2)
    off[:], seen[:] = 0.0, 0.0
    for x in range(1, width - 1):
        if not here[x]:
            continue
        sy, sx = np.float32(y) - disparity[x] * a, np.float32(x) - disparity[x] * b
        if not (_ONE <= sy < bottom and _ONE <= sx < right):
            continue
        j, i = int(sy), int(sx)
        down, across = _cubic(sy - np.float32(j)), _cubic(sx - np.float32(i))
        at = start + np.uint64((j - 1) * width + i - 1)
        off[0, x] = sample_4x4(pixels, at, row, down, across) - colours[0, x]
        off[1, x] = sample_4x4(pixels, at + plane, row, down, across) - colours[1, x]
        off[2, x] = sample_4x4(pixels, at + plane + plane, row, down, across) - colours[2, x]
        seen[x] = _ONE


@stage_kernel
def _weigh(limit, a, b, down, across, off, seen, push, reach, moved, mass):
    """Add the evidence of a view to a row; every loop writes one array, and becomes vector instructions."""
    e0, e1, e2, scale = off[0], off[1], off[2], _ONE / (limit * limit)
    for x in range(seen.size):
        odds = _ONE + (e0[x] * e0[x] + e1[x] * e1[x] + e2[x] * e2[x]) * scale
        seen[x] = seen[x] / (odds * odds)
    _add_slopes(a, down, off, seen, push[0])
    _add_slopes(b, down, off, seen, push[1])
    _add_slopes(a, across, off, seen, push[2])
    _add_slopes(b, across, off, seen, push[3])
    _add_times(a * a, seen, reach[0])
    _add_times(a * b, seen, reach[1])
    _add_times(b * b, seen, reach[2])
    for c in range(3):
        e, m = off[c], moved[c]
        for x in range(seen.size):
            m[x] += seen[x] * e[x]
    _add_times(_ONE, seen, mass)


@stage_kernel
def _add_slopes(step, slopes, off, seen, total):
    """total += step · w · Σ_rgb e·g."""
    e0, e1, e2, g0, g1, g2 = off[0], off[1], off[2], slopes[0], slopes[1], slopes[2]
    for x in range(seen.size):
        total[x] += step * seen[x] * (e0[x] * g0[x] + e1[x] * g1[x] + e2[x] * g2[x])


@stage_kernel
def _add_times(factor, seen, total):
    """total += factor · w."""
    for x in range(seen.size):
        total[x] += factor * seen[x]


@lean_kernel
def fit_planes(disparity, push, weight, view, radius, alike, near, prior, flat, here, out, sure, first, last):
    """Fit a plane to the disparities d + push/weight around each pixel, weighted; its value at the pixel is ``out``.

    Neighbours up to ``radius`` pixels away weigh exp(−Σ_rgb |Δview|/alike − |Δd|/near). ``prior`` is the weight of
    the old disparities, which keeps weak windows where they are. ``sure`` is the sum of weights. Pixels outside
    ``here`` stay.
    """
    height, width = disparity.shape
    for y in range(first, last):
        for x in range(width):
            if not here[y, x]:
                continue
            s0, sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            t0, tx, ty = 0.0, 0.0, 0.0
            d = disparity[y, x]
            for j in range(-radius, radius + 1):
                if y + j < 0 or y + j >= height:
                    continue
                for i in range(-radius, radius + 1):
                    if x + i < 0 or x + i >= width:
                        continue
                    v, u = y + j, x + i
                    if weight[v, u] <= 0.0:
                        continue
                    far = (
                        abs(view[0, v, u] - view[0, y, x])
                        + abs(view[1, v, u] - view[1, y, x])
                        + abs(view[2, v, u] - view[2, y, x])
                    )
                    w = math.exp(-far / alike - abs(disparity[v, u] - d) / near)
                    q = w * (push[v, u] + weight[v, u] * (disparity[v, u] - d))
                    w *= weight[v, u]
                    s0 += w
                    sx += w * i
                    sy += w * j
                    sxx += w * i * i
                    sxy += w * i * j
                    syy += w * j * j
                    t0 += q
                    tx += q * i
                    ty += q * j
            sure[y, x] = s0
            if s0 <= 0.0:
                out[y, x] = d
                continue
            # the normal equations, around the mean position
            mx, my = sx / s0, sy / s0
            cxx, cxy, cyy = sxx - sx * mx, sxy - sx * my, syy - sy * my
            ridge = flat * s0 + prior * radius * radius
            cxx += ridge
            cyy += ridge
            qx, qy = tx - t0 * mx, ty - t0 * my
            det = cxx * cyy - cxy * cxy
            px, py = 0.0, 0.0
            if det > 0.0:
                px, py = (cyy * qx - cxy * qy) / det, (cxx * qy - cxy * qx) / det
            out[y, x] = d + t0 / (s0 + prior) - px * mx - py * my


@lean_kernel
def move_to_view(disparity, down, across, filled, out):
    """Move a disparity to the view a step away: the nearest in front, holes NaN or ``filled`` from behind."""
    height, width = out.shape
    out[:] = np.nan
    for y in range(height):
        for x in range(width):
            d = disparity[y, x]
            if np.isnan(d):
                continue
            # where neighbours of one surface move apart, pixels between them are covered, too
            sy, sx = y - d * down, x - d * across
            for j in range(math.floor(sy), math.floor(sy) + 2):
                for i in range(math.floor(sx), math.floor(sx) + 2):
                    near = abs(j - sy) <= 0.75 and abs(i - sx) <= 0.75
                    if near and 0 <= j < height and 0 <= i < width and not out[j, i] >= d:
                        out[j, i] = d
    if not filled:
        return
    for y in range(height):
        left, x = np.float32(np.nan), 0
        while x < width:
            if not np.isnan(out[y, x]):
                left = out[y, x]
                x += 1
                continue
            end = x
            while end < width and np.isnan(out[y, end]):
                end += 1
            right = out[y, end] if end < width else np.float32(np.nan)
            behind = right if np.isnan(left) or right < left else left
            for i in range(x, end):
                out[y, i] = behind
            x = end


@lean_kernel
def rivals(cost, total, labels, apart, ratio, margin, first, last):
    """Compare the label of least ``total`` with others at least ``apart`` px away.

    ``ratio`` is its cost over the least cost of those, ``margin`` their least total above its own.
    """
    for y in range(first, last):
        for x in range(cost.shape[1]):
            best = 0
            for d in range(cost.shape[2]):
                if total[y, x, d] < total[y, x, best]:
                    best = d
            other, least = np.float32(np.inf), np.float32(np.inf)
            for d in range(cost.shape[2]):
                if abs(labels[d] - labels[best]) >= apart:
                    other = min(other, np.float32(cost[y, x, d]))
                    least = min(least, np.float32(total[y, x, d]))
            ratio[y, x] = np.float32(cost[y, x, best]) / other if 0.0 < other < np.inf else np.float32(1.0)
            margin[y, x] = least - np.float32(total[y, x, best]) if least < np.inf else np.float32(0.0)
