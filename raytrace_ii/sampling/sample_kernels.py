"""Supersampling: places of samples, sums and standard errors."""

from __future__ import annotations

import math

import numpy as np

from ii_core.base.jit import exact_stage_kernel, kernel

from ..tracing.kernels.glossy import LOW, mix_bits


@kernel
def places(seed, m, n, columns, first, count, pair, table, lens, out):
    """Samples ``first`` … ``first + count`` of pixels (m, n), as rows of ``out``, pixel by pixel, in [0, 1)².

    Rows of ``table`` (n, 2), turned or mirrored by a hash of seed and pixel; under a ``lens`` of so many pixels
    mirrored across by one of seed and column under the lens, and down by one of the row. If it has no rows, a
    (0, 2)-sequence, van der Corput's and Sobol''s, Owen-scrambled by that hash (Owen 1995; hashes of Laine and Karras
    2011, Burley 2020): any first 2^k samples lie one in each cell of every grid of 2^k equal cells of sides 2^-i.
    ``pair`` 0 is the place in the pixel, 1 that on the aperture, which walks through the same sequence in another
    order so as not to follow the first.
    """
    for i in range(m.shape[0]):
        if table.shape[0] > 0 and lens[0] > 0:
            across = mix_bits(np.uint64(seed) ^ mix_bits(np.uint64(m[i] % lens[0]))) & np.uint64(2)
            down = mix_bits(np.uint64(seed) ^ mix_bits(np.uint64(lens[0] + n[i] % lens[1]))) & np.uint64(4)
            _turned(table[first : first + count], across | down, out[i * count : (i + 1) * count])
            continue
        pixel = np.uint64(n[i]) * np.uint64(columns) + np.uint64(m[i])
        own = mix_bits(mix_bits(np.uint64(seed) ^ mix_bits(pixel)) + np.uint64(pair))
        if table.shape[0] > 0:
            _turned(table[first : first + count], own, out[i * count : (i + 1) * count])
            continue
        across, down, order = own & LOW, own >> np.uint64(32), mix_bits(own) & LOW
        for j in range(count):
            index = np.uint64(first + j)
            if pair:
                index = _scrambled(index, order)
            out[i * count + j, 0] = _scrambled(_reversed(index), across) * (1.0 / 4294967296.0)
            out[i * count + j, 1] = _scrambled(_sobol(index), down) * (1.0 / 4294967296.0)


@exact_stage_kernel
def _turned(places, bits, out):
    """Places in the unit square, turned or mirrored by the last three bits."""
    swapped = int(bits & _ONE)
    across, down = (bits & np.uint64(2)) != 0, (bits & np.uint64(4)) != 0
    for j in range(places.shape[0]):
        x, y = places[j, swapped], places[j, 1 - swapped]
        out[j, 0], out[j, 1] = 1.0 - x if across else x, 1.0 - y if down else y


@kernel
def near_together(m, n, places, parts, pixels, traced, columns, rows, within):
    """Order of samples in which those of the same part of so many pixels in a row stand together.

    ``places`` (p, count, 2) are the samples of pixels (m, n), in [0, 1)²; a pixel has ``parts``² parts. ``traced``
    gets the numbers of the samples in their order, the other arrays their pixels and places.
    """
    many, count = places.shape[0], places.shape[1]
    ends = np.empty(parts * parts + 1, np.int64)
    row = 0
    for first in range(0, many, pixels):
        last = min(first + pixels, many)
        ends[:] = 0
        for i in range(first, last):
            for j in range(count):
                ends[_part(places, i, j, parts) + 1] += 1
        for part in range(parts * parts):
            ends[part + 1] += ends[part]
        for i in range(first, last):
            for j in range(count):
                part = _part(places, i, j, parts)
                place = row + ends[part]
                traced[place], columns[place], rows[place] = i * count + j, m[i], n[i]
                within[2 * place], within[2 * place + 1] = places[i, j, 0], places[i, j, 1]
                ends[part] += 1
        row += (last - first) * count


@exact_stage_kernel
def _part(places, i, j, parts):
    return int(places[i, j, 1] * parts) * parts + int(places[i, j, 0] * parts)


@kernel
def merge_quarters(which, quarters):
    """Make the four sums of each pixel named the first two of twice as many samples."""
    for i in range(which.shape[0]):
        pixel = which[i]
        for c in range(3):
            quarters[pixel, 0, c] += quarters[pixel, 1, c]
            quarters[pixel, 1, c] = quarters[pixel, 2, c] + quarters[pixel, 3, c]
            quarters[pixel, 2, c] = 0.0
            quarters[pixel, 3, c] = 0.0


@kernel
def sum_samples(radiance, count, out):
    """Add to each row of ``out`` the next ``count`` rows of ``radiance``, in their order."""
    for i in range(out.shape[0]):
        for c in range(3):
            total = radiance[i * count, c]
            for j in range(1, count):
                total += radiance[i * count + j, c]
            out[i, c] += total


@kernel
def add_samples(radiance, which, first, count, quarter, quarters):
    """Add rows of ``radiance``, ``count`` samples from ``first`` on of each pixel named, to its sums of a quarter."""
    for i in range(which.shape[0]):
        pixel = which[i]
        for j in range(count):
            part = (first + j) // quarter
            for c in range(3):
                quarters[pixel, part, c] += radiance[i * count + j, c]


@kernel
def means(quarters, which, counts, out):
    """Means of the samples of each pixel named, of which there are ``counts``."""
    for i in range(which.shape[0]):
        pixel = which[i]
        for c in range(3):
            total = quarters[pixel, 0, c] + quarters[pixel, 1, c] + quarters[pixel, 2, c] + quarters[pixel, 3, c]
            out[i, c] = total / counts[i]


@kernel
def steps_to_neighbours(mean, lens, top, left, out):
    """Largest difference, by channel, of each pixel to its eight neighbours under the same lens.

    ``mean`` (h, w, 3) and ``lens`` (h, w) have a rim around the pixels of ``out``, which start at (top, left).
    """
    height, width = lens.shape
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            y, x = top + i, left + j
            for c in range(3):
                most = 0.0
                for b in range(max(y - 1, 0), min(y + 2, height)):
                    for a in range(max(x - 1, 0), min(x + 2, width)):
                        if lens[b, a] == lens[y, x]:
                            most = max(most, abs(mean[b, a, c] - mean[y, x, c]))
                out[i, j, c] = most


@kernel
def standard_errors(quarters, which, step, n, curve, out):
    """Standard error of the mean of ``n`` samples, in codes of ``curve``: half of what lies between mean ± error.

    From the means of the four quarters of the samples of each pixel named, and from ``step``, its difference to the
    neighbours.
    """
    share, hidden = 1.0 / n, 1.0 / (float(n) * n * n)
    for i in range(out.shape[0]):
        worst, pixel = 0.0, np.uint64(which[i])
        for c in range(3):
            a, b, d, e = quarters[pixel, 0, c], quarters[pixel, 1, c], quarters[pixel, 2, c], quarters[pixel, 3, c]
            mean, four = (a + b + d + e) * share, 4.0 * share
            scatter = (
                (a * four - mean) ** 2 + (b * four - mean) ** 2 + (d * four - mean) ** 2 + (e * four - mean) ** 2
            )
            error = math.sqrt(scatter / 12.0 + step[i, c] * step[i, c] * hidden)
            worst = max(worst, 0.5 * (_code(mean + error, curve) - _code(mean - error, curve)))
        out[i] = worst


@exact_stage_kernel
def _code(x, curve):
    last = curve.shape[0] - 1
    at = min(max(x, 0.0), 1.0) * last
    j = min(int(at), last - 1)
    return curve[j] + (at - j) * (curve[j + 1] - curve[j])


_ONE = np.uint64(1)


@exact_stage_kernel
def _sobol(index):
    """The second dimension of Sobol's sequence, as a fraction of 2³²."""
    bits, direction = np.uint64(0), np.uint64(0x80000000)
    while index:
        if index & _ONE:
            bits ^= direction
        index >>= _ONE
        direction ^= direction >> _ONE
    return bits


@exact_stage_kernel
def _reversed(x):
    x = ((x & np.uint64(0x55555555)) << np.uint64(1)) | ((x >> np.uint64(1)) & np.uint64(0x55555555))
    x = ((x & np.uint64(0x33333333)) << np.uint64(2)) | ((x >> np.uint64(2)) & np.uint64(0x33333333))
    x = ((x & np.uint64(0x0F0F0F0F)) << np.uint64(4)) | ((x >> np.uint64(4)) & np.uint64(0x0F0F0F0F))
    x = ((x & np.uint64(0x00FF00FF)) << np.uint64(8)) | ((x >> np.uint64(8)) & np.uint64(0x00FF00FF))
    return ((x & np.uint64(0xFFFF)) << np.uint64(16)) | (x >> np.uint64(16))


@exact_stage_kernel
def _scrambled(x, seed):
    """Owen's scramble: each bit is flipped or not by a hash of all bits before it."""
    x = (_reversed(x) + seed) & LOW
    x ^= (x * np.uint64(0x6C50B47C)) & LOW
    x ^= (x * np.uint64(0xB82F1E52)) & LOW
    x ^= (x * np.uint64(0xC7AFE638)) & LOW
    x ^= (x * np.uint64(0x8D22F6E6)) & LOW
    return _reversed(x)
