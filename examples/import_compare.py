"""Import of a light field from other programs, and comparison of several schemes on it.

python examples/import_compare.py FOLDER [--bpp 0.5] [--schemes si-hevc,si-av1,jpeg2000] [-o compared.html]
FOLDER holds one picture per view; each name contains two numbers, row and column.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from codec import decode, encode
from ii_core import find_views, picture_of
from ii_core.display.viewer import write_viewer
from metrics import q_global, quality_rows


def main() -> None:
    """Print a row per scheme; write the viewer page of the best one beside the original."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bpp", type=float, default=0.5)
    parser.add_argument("--schemes", default="si-hevc,si-av1,jpeg2000")
    parser.add_argument("-o", "--output", type=Path, default=Path("compared.html"))
    arguments = parser.parse_args()
    picture, order = picture_of(find_views(arguments.folder))
    print(picture)
    print(order.describe())
    decoded = {}
    for scheme in arguments.schemes.split(","):
        coded = encode(picture, scheme, bpp=arguments.bpp)
        decoded[scheme] = decode(coded)
        print(f"{scheme:12} {coded.bpp:6.3f} bpp {q_global(picture, decoded[scheme]):7.2f} dB")
    best = max(decoded, key=lambda scheme: q_global(picture, decoded[scheme]))
    rows = quality_rows(picture, decoded[best])
    write_viewer(arguments.output, picture, decoded[best], title=best, quality_rows=rows)
    print(f"{arguments.output}: {best} beside the original")


if __name__ == "__main__":
    main()
