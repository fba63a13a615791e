"""Fresnel reflectance of dielectric faces."""

from __future__ import annotations

import math

from ii_core.base.jit import part_kernel


@part_kernel
def fresnel(cosine, ratio):
    """Unpolarised reflectance of a dielectric face, and the cosine behind it.

    ``ratio`` is n1/n2. Total internal reflection gives (1, 0).
    """
    sine2 = ratio * ratio * (1.0 - cosine * cosine)
    if sine2 >= 1.0:
        return 1.0, 0.0
    behind = math.sqrt(1.0 - sine2)
    s = (ratio * cosine - behind) / (ratio * cosine + behind)
    p = (ratio * behind - cosine) / (ratio * behind + cosine)
    return 0.5 * (s * s + p * p), behind
