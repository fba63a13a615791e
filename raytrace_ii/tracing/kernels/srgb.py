"""Linear light to integer sRGB."""

from __future__ import annotations

import numpy as np

from ii_core.base.jit import lean_kernel as kernel


@kernel
def encode_srgb(radiance, rows, scale, curve, out):
    """Linear light times ``scale`` to rounded integer sRGB by a curve of samples over [0, 1].

    ``rows`` says where in ``out`` each colour goes.
    """
    last = curve.shape[0] - 1
    for i in range(radiance.shape[0]):
        for c in range(3):
            x = min(max(radiance[i, c] * scale, 0.0), 1.0) * last
            j = min(int(x), last - 1)
            out[rows[i], c] = int(curve[j] + (x - j) * (curve[j + 1] - curve[j]) + 0.5)


@kernel
def encode_steps(radiance, rows, scale, codes, edges, out):
    """Write the same 8-bit codes as `encode_srgb`, by a table of steps, in a third of its time.

    Parameters
    ----------
    radiance : (n, 3)
        Sums of linear light; times ``scale`` they are from 0 to 1.
    rows : (n,) of int
        Row of ``out`` for each ray.
    codes : (samples,) of uint8
        sRGB codes of evenly spaced light from 0 to 1; neighbours differ by one at most.
    edges : (256,)
        Light at which each code ends, in spacings of the samples; infinity for 255.
    out : (n, 3) of uint8
    """
    last = float(codes.shape[0] - 1)
    steps = scale * last
    for i in range(radiance.shape[0]):
        row = np.uint64(rows[i])  # unsigned: numba need not look for negative indices
        for c in range(3):
            x = radiance[i, c] * steps
            x = x if x > 0.0 else 0.0
            x = x if x < last else last
            code = np.uint64(codes[np.uint64(np.int32(x))])
            out[row, c] = code + np.uint64(x >= edges[code])
