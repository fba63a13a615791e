"""Kernels that gather views: shift and add, and rays looked up by depth."""

from __future__ import annotations

import math

import numpy as np

from ..base.jit import lean_kernel, stage_kernel
from .disparity_kernels import _cubic


@stage_kernel
def _pixel(image, c, y, x):
    """Return the cubic interpolation of channel ``c`` at (y, x) inside the image; the border is continued."""
    height, width = image.shape[:2]
    j, i = int(y), int(x)
    a0, a1, a2, a3 = _cubic(np.float32(y - j))
    b0, b1, b2, b3 = _cubic(np.float32(x - i))
    i0, i2, i3 = max(i - 1, 0), min(i + 1, width - 1), min(i + 2, width - 1)
    j0, j2, j3 = max(j - 1, 0), min(j + 1, height - 1), min(j + 2, height - 1)
    return (
        a0 * (b0 * image[j0, i0, c] + b1 * image[j0, i, c] + b2 * image[j0, i2, c] + b3 * image[j0, i3, c])
        + a1 * (b0 * image[j, i0, c] + b1 * image[j, i, c] + b2 * image[j, i2, c] + b3 * image[j, i3, c])
        + a2 * (b0 * image[j2, i0, c] + b1 * image[j2, i, c] + b2 * image[j2, i2, c] + b3 * image[j2, i3, c])
        + a3 * (b0 * image[j3, i0, c] + b1 * image[j3, i, c] + b2 * image[j3, i2, c] + b3 * image[j3, i3, c])
    )


@lean_kernel
def add_view(image, own, down, across, weight, limit, disparity, total, mass, first, last):
    """Add a view, moved by its step times the disparity of each pixel, to ``total``, and its weight to ``mass``.

    Where its colour differs from ``own`` by much more than ``limit`` the weight is less; infinite: never.
    """
    height, width = disparity.shape
    for y in range(first, last):
        for x in range(width):
            sy, sx = y - disparity[y, x] * down, x - disparity[y, x] * across
            if not (0 <= sy <= height - 1 and 0 <= sx <= width - 1):
                continue
            r, g, b = _pixel(image, 0, sy, sx), _pixel(image, 1, sy, sx), _pixel(image, 2, sy, sx)
            w = weight
            if limit < np.inf:
                e = (r - own[y, x, 0]) ** 2 + (g - own[y, x, 1]) ** 2 + (b - own[y, x, 2]) ** 2
                w /= (1.0 + e / (limit * limit)) ** 2
            total[y, x, 0] += w * r
            total[y, x, 1] += w * g
            total[y, x, 2] += w * b
            mass[y, x] += w


# Longest shift between views, px and share of a view's shorter side. Beyond it light changes with the direction
# alone: the line to a far point leaves the view or passes many edges. Apples to lenses of twice the pitch: 25.2 dB
# without a limit, 26.1, 26.6, 26.9 and 26.9 with 1, 2, 4 and 8 px (2026-11-25).
SHIFT, SHIFT_SHARE = 4.0, 1 / 16
SPAN = 0.75  # views beyond the outermost ones that a ray may lie outside
# Disparities of one point in two views, and of neighbours on one surface, differ by less, px and share of themselves.
AGREE, AGREE_SHARE, JUMP, JUMP_SHARE = 0.35, 0.05, 0.75, 0.1


@stage_kernel
def _near(depths, j, i, y, x):
    """Return the disparity of view (j, i) at the pixel nearest to (y, x), at the border beyond it."""
    rows, cols = depths.shape[2:]
    return depths[j, i, min(max(int(y + 0.5), 0), rows - 1), min(max(int(x + 0.5), 0), cols - 1)]


@lean_kernel
def look_up(views, depths, low, high, order, tall, places, total, ends, mask, first, last):
    """Add the light of rays at ``places`` (x, y, u, v) to ``total``; ``mask`` 2 is seen, 1 filled, 0 outside.

    ``ends`` becomes the disparity where each ray ends.
    ``depths`` are shifts of a point in x from view to view, and ``tall`` times these in y; ``order`` is 1 if large
    shifts are near, else −1.
    """
    rows, cols, height, width = views.shape[:4]
    longest = max(SHIFT, min(height, width) * SHIFT_SHARE)
    for n in range(first, last):
        for m in range(places.shape[1]):
            x, y, u, v = places[n, m]
            if not (-0.5 <= x <= width - 0.5 and -0.5 <= y <= height - 0.5):
                continue
            if not (-SPAN <= u <= cols - 1 + SPAN and -SPAN <= v <= rows - 1 + SPAN):
                continue
            left, top = min(max(math.floor(u), 0), max(cols - 2, 0)), min(max(math.floor(v), 0), max(rows - 2, 0))
            right, below = min(left + 1, cols - 1), min(top + 1, rows - 1)
            # Each view says where the ray ends; the end that most views see, weighted, counts: the nearest of equals.
            at, most, behind, hidden = 0.0, -1.0, 0.0, True
            for q in range(4):
                j, i = (below if q & 2 else top), (right if q & 1 else left)
                if (q & 1 and right == left) or (q & 2 and below == top):
                    continue
                d, clear = _end(depths, j, i, y, x, tall * (v - j), u - i, low, high, order)
                if q == 0 or order * d < order * behind:
                    behind = d
                if not clear:
                    continue
                limit, support = AGREE + AGREE_SHARE * abs(d), 1e-6 * order * (d - low)
                for p in range(4):
                    dy, dx = v - (below if p & 2 else top), u - (right if p & 1 else left)
                    if (p & 1 and right == left) or (p & 2 and below == top):
                        continue
                    sy, sx = y + d * tall * dy, x + d * dx
                    there = _near(depths, below if p & 2 else top, right if p & 1 else left, sy, sx)
                    if abs(there - d) <= limit:
                        support += max(1.0 - abs(dy), 1e-6) * max(1.0 - abs(dx), 1e-6)
                if support > most:
                    at, most, hidden = d, support, False
            if hidden:
                at = behind
            r, g, b, mass = 0.0, 0.0, 0.0, 0.0
            for q in range(4):
                j, i = (below if q & 2 else top), (right if q & 1 else left)
                if (q & 1 and right == left) or (q & 2 and below == top):
                    continue
                w = max(1.0 - abs(v - j), 1e-6) * max(1.0 - abs(u - i), 1e-6)
                shift, share = _place(depths, j, i, y, x, tall * (v - j), u - i, at, low, high, longest)
                w *= share
                sy = y + min(max(shift * tall * (v - j), -longest), longest)
                sx = x + min(max(shift * (u - i), -longest), longest)
                sy, sx = min(max(sy, 0.0), height - 1.0), min(max(sx, 0.0), width - 1.0)
                if share < 1.0:  # beside an edge: interpolation would mix both surfaces
                    sy, sx = float(int(sy + 0.5)), float(int(sx + 0.5))
                r += w * _pixel(views[j, i], 0, sy, sx)
                g += w * _pixel(views[j, i], 1, sy, sx)
                b += w * _pixel(views[j, i], 2, sy, sx)
                mass += w
            if mass > 0.0:
                total[n, m, 0] += max(r / mass, 0.0)
                total[n, m, 1] += max(g / mass, 0.0)
                total[n, m, 2] += max(b / mass, 0.0)
                ends[n, m] = at
                mask[n, m] = max(mask[n, m], 1) if hidden else 2


@stage_kernel
def _place(depths, j, i, y, x, down, across, at, low, high, longest):
    """Return the shift nearest to ``at`` whose place in a view has the disparity ``at``, and a weight.

    The surface seen through a hole, or the sky, is taken from where the view sees it next.
    """
    height, width = depths.shape[2:]
    limit = AGREE + AGREE_SHARE * abs(at)
    reach = max(abs(down), abs(across))
    steps = math.ceil((high - low) * reach * 2.0) + 1
    for k in range(steps + 1):
        for side in range(2 if k > 0 else 1):
            shift = at + (1 - 2 * side) * (k * 0.5 / reach if reach > 0.0 else 0.0)
            sy = y + min(max(shift * down, -longest), longest)
            sx = x + min(max(shift * across, -longest), longest)
            if (
                -0.5 <= sy <= height - 0.5
                and -0.5 <= sx <= width - 0.5
                and abs(_near(depths, j, i, sy, sx) - at) <= limit
            ):
                return shift, 1.0 if k == 0 else 1e-3 / k
    return at, 1e-9


@stage_kernel
def _end(depths, j, i, y, x, down, across, low, high, order):
    """Return the shift at which a ray meets a surface of view (j, i), and whether the view sees it there.

    If it does not, the shift is that of the farthest surface on the way.

    From near to far: before the surface the shift is nearer than that of the view where the ray passes, behind it
    farther. Where the view's surface changes by a jump in between, the ray goes behind an edge.
    """
    span = high - low
    steps = math.ceil(span * max(abs(down), abs(across)) * 2.0) + 1
    near, far = (high, low) if order > 0 else (low, high)
    was_d, was = near, _near(depths, j, i, y + near * down, x + near * across)
    if order * was >= order * near:
        return was, True
    hidden, deepest = False, was
    for k in range(1, steps + 1):
        d = near + (far - near) * k / steps
        here = _near(depths, j, i, y + d * down, x + d * across)
        if order * here < order * deepest:
            deepest = here
        if order * d <= order * here and order * was_d > order * was:
            if abs(here - was) <= JUMP + JUMP_SHARE * abs(here):
                a, b = abs(was_d - was), abs(d - here)
                return was + (here - was) * (a / (a + b) if a + b > 0.0 else 0.0), True
            # the nearer surface beyond the jump may itself be met between the two
            met = _near(depths, j, i, y + here * down, x + here * across)
            if order * was < order * here and abs(met - here) <= AGREE:
                return here, True
            hidden = True
        was_d, was = d, here
    return deepest, not hidden
