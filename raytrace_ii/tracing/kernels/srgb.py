"""Linear light to integer sRGB."""

from __future__ import annotations

from ii_core.jit import lean_kernel as kernel


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
