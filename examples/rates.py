"""Table of the quality of a scheme over rate.

python examples/rates.py [--scene apples] [--scale 8] [--scheme si-hevc] [--rates 0.1,0.2,0.4]
"""

from __future__ import annotations

import argparse

from codec import decode, encode
from ii_core import preset
from metrics import q_angle, q_global
from raytrace_ii import load_scene, render


def main() -> None:
    """Print a row per rate."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="apples")
    parser.add_argument("--scale", type=int, default=8, help="divides setup1's lenses")
    parser.add_argument("--scheme", default="si-hevc")
    parser.add_argument("--rates", default="0.1,0.2,0.4")
    arguments = parser.parse_args()
    picture = render(load_scene(arguments.scene), preset("setup1", scale=arguments.scale), noise=1.0).picture
    print("target    bpp   Q_global   worst Q_angle   CPU s")
    for rate in map(float, arguments.rates.split(",")):
        coded = encode(picture, arguments.scheme, bpp=rate)
        decoded = decode(coded)
        worst = q_angle(picture, decoded).worst
        row = f"{rate:6g} {coded.bpp:6.3f} {q_global(picture, decoded):7.2f} dB {worst:12.2f} dB"
        print(f"{row} {coded.encode_seconds:7.2f}")


if __name__ == "__main__":
    main()
