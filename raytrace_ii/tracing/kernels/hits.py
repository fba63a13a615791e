"""Where in its face a ray hits, reckoned again in float64.

Embree's u and v differ between instruction sets by up to 4e-4. Reckoned from ray and face alone they are the same
whatever found the face: a packet, a single ray, another CPU.
"""

from __future__ import annotations

import numpy as np

from ii_core.jit import lean_kernel as kernel


@kernel
def place_hits(origins, directions, corners, primitives, u, v, distances):
    """Replace u, v and distance of every hit by those of ray and plane (Möller, Trumbore 1997).

    u and v are kept within the face: Embree's robust rays hit edges from just beside them. Where the ray lies in
    the face's plane, Embree's numbers stay.
    """
    for i in range(primitives.shape[0] if corners.shape[0] > 0 else 0):
        f = max(primitives[i], 0)
        x, y, z = np.float64(corners[f, 0, 0]), np.float64(corners[f, 0, 1]), np.float64(corners[f, 0, 2])
        ax, ay, az = corners[f, 1, 0] - x, corners[f, 1, 1] - y, corners[f, 1, 2] - z
        bx, by, bz = corners[f, 2, 0] - x, corners[f, 2, 1] - y, corners[f, 2, 2] - z
        dx, dy, dz = np.float64(directions[i, 0]), np.float64(directions[i, 1]), np.float64(directions[i, 2])
        x, y, z = origins[i, 0] - x, origins[i, 1] - y, origins[i, 2] - z
        px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
        qx, qy, qz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
        turn = ax * px + ay * py + az * pz
        inverse = 1.0 / (turn if turn != 0.0 else 1.0)
        a = max((x * px + y * py + z * pz) * inverse, 0.0)
        b = max((dx * qx + dy * qy + dz * qz) * inverse, 0.0)
        t = (bx * qx + by * qy + bz * qz) * inverse
        within = 1.0 / max(a + b, 1.0)
        sure = (primitives[i] >= 0) & (turn != 0.0)
        u[i] = a * within if sure else u[i]
        v[i] = b * within if sure else v[i]
        distances[i] = max(t, 0.0) if sure else distances[i]
