"""Rays through lenses of surfaces against optiland: ``python -m benchmarks run lens_rays --peer PYTHON``.

PYTHON is an interpreter with optiland. Tests do not install optiland: it takes over 1 GB with its dependencies. Both
programs get the same surfaces and refractive indices. Our rays leave the image plane and end in front of the lens;
optiland traces them back into the image plane.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.records import Records
from ii_core.camera.elements import Bundle
from ii_core.camera.glass import CATALOGUE
from ii_core.camera.prescriptions import lens
from ii_core.camera.surfaces import Surface, Surfaces

RECORDS = Records("lens_rays", modules=("benchmarks.accuracy.lens_rays",))
RAYS = 5000
AHEAD_MM = 10.0  # distance from the plane where our rays end to the first vertex
WAVELENGTHS_NM = (486.1327, 587.5618, 656.2725)

# Program for the peer: reads surfaces and rays, prints rays in the image plane. Light runs along +z from the vertex.
PEER = """
import json, sys
import numpy as np
from importlib.metadata import version
from optiland.materials import IdealMaterial
from optiland.optic import Optic
from optiland.rays import RealRays
given = json.loads(open(sys.argv[1]).read())
optic = Optic()
optic.surfaces.add(index=0, radius=np.inf, thickness=np.inf)
for i, s in enumerate(given["surfaces"], 1):
    optic.surfaces.add(
        index=i, radius=s["radius"] or np.inf, conic=s["conic"], thickness=s["thickness"],
        material=IdealMaterial(n=s["index"]), is_stop=s["stop"],
    )
optic.surfaces.add(index=len(given["surfaces"]) + 1)
optic.set_aperture(aperture_type="EPD", value=1)
optic.set_field_type("angle")
optic.fields.add(y=0)
optic.wavelengths.add(value=0.5875618, is_primary=True)
x, y, z, L, M, N = np.array(given["rays"])
rays = RealRays(x=x, y=y, z=z, L=L, M=M, N=N, intensity=np.ones_like(x), wavelength=np.full_like(x, 0.5875618))
optic.surfaces.trace(rays)
found = [np.asarray(a).tolist() for a in (rays.x, rays.y, rays.L, rays.M, rays.N)]
print(json.dumps({"version": version("optiland"), "rays": found}))
"""


def conic_singlet(wavelength_nm: float) -> tuple[Surfaces, float]:
    """Return a lens of N-SF11 with an ellipsoid and a hyperboloid, and its back distance."""
    made = Surfaces(
        z_mm=0.0,
        wavelength_nm=wavelength_nm,
        surfaces=(
            Surface(
                radius_mm=40.0, conic=-0.6, thickness_mm=9.0, glass=CATALOGUE["N-SF11"], diameter_mm=30.0, stop=True
            ),
            Surface(radius_mm=-70.0, conic=-3.0, diameter_mm=30.0),
        ),
    )
    return made, 25.0


def cases() -> dict[str, Any]:
    """Return functions from the wavelength to a lens and its back distance."""

    def published(name: str) -> Any:
        made = lens(name)
        return lambda nm: (made.at(0.0, wavelength_nm=nm), made.back_mm)

    return {
        "triplet": published("triplet"),
        "double-gauss": published("double-gauss"),
        "conic singlet": conic_singlet,
    }


def start_rays(placed: Surfaces, back_mm: float, count: int) -> Bundle:
    """Return rays from the image plane towards the whole pupil and beyond its rim."""
    rng = np.random.default_rng(21)
    z, diameter = placed.pupil() or (0.0, 1.0)
    field = math.tan(math.radians(14)) * placed.focal_mm
    x, y = rng.uniform(-field, field, (2, count)) / math.sqrt(2)
    px, py = rng.uniform(-0.6, 0.6, (2, count)) * diameter
    return Bundle(x, y, np.full(count, -back_mm), px - x, py - y, np.full(count, z + back_mm))


def compared(make: Any, peer: str, wavelength_nm: float) -> dict[str, Any]:
    """Return the largest distances of places and directions in the image plane, for rays that pass."""
    placed, back = make(wavelength_nm)
    rays = start_rays(placed, back, RAYS)
    out = placed.pass_on(rays)
    on = np.asarray(out.weight) > 0
    L, D = (np.stack([np.broadcast_to(a, on.shape)[on] for a in three]) for three in (out[:3], out[3:6]))
    ahead = placed.end_mm + AHEAD_MM
    place = L + D * ((ahead - L[2]) / D[2])
    gaps = [*(s.thickness_mm for s in placed.surfaces[:-1]), back]
    given = {
        "surfaces": [
            {"radius": s.radius_mm, "conic": s.conic, "thickness": gap, "stop": s.stop,
             "index": 1.0 if s.glass is None else s.glass.index(wavelength_nm)}
            for s, gap in zip(placed.surfaces, gaps, strict=True)
        ],
        "rays": [*place[:2].tolist(), np.full(on.sum(), -AHEAD_MM).tolist(), *(-D[:2]).tolist(), D[2].tolist()],
    }  # fmt: skip
    answer = run_peer(peer, given)
    x, y, l, m, n = np.array(answer["rays"])
    start = np.stack([np.asarray(a, np.float64)[on] for a in rays[:6]])
    unit = start[3:] / np.linalg.norm(start[3:], axis=0)
    return {
        "rays": int(on.sum()),
        "blocked": int((~on).sum()),
        "place_nm": 1e6 * worst(np.stack([x, y]) - start[:2]),
        "angle_nrad": 1e9 * worst(np.stack([l, m, -n]) + unit),
        "focal_mm": placed.focal_mm,
        "peer": f"optiland {answer['version']}",
    }


def worst(differences: NDArray[np.float64]) -> float:
    """Return the largest length of the columns."""
    return float(np.linalg.norm(differences, axis=0).max())


def run_peer(python: str, given: dict[str, Any]) -> Any:
    """Return the peer's rays in the image plane."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rays.json"
        path.write_text(json.dumps(given), encoding="utf-8")
        done = subprocess.run(
            [python, "-W", "ignore", "-c", PEER, str(path)], capture_output=True, text=True, timeout=300, check=False
        )
    if done.returncode:
        raise ValueError(f"{python} did not trace: {done.stderr.strip()[-300:]}")
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--peer", default=sys.executable, help="Interpreter with optiland.")
    arguments = parser.parse_args()
    for name, make in cases().items():
        for wavelength in WAVELENGTHS_NM:
            key = {"lens": name, "wavelength_nm": wavelength}
            record = RECORDS.measure(key, lambda make=make, nm=wavelength: compared(make, arguments.peer, nm))
            print(name, wavelength, record["result"])


if __name__ == "__main__":
    main()
