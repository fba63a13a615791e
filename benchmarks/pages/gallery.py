"""Gallery of reference scenes: a viewer page of each.

    python -m benchmarks run gallery [--scenes twins hairdo] [--missing] [--scale 2]

Pages go to ``docs/gallery``. Git does not keep them; ``make gallery`` writes missing ones. ``docs/gallery/README.md``
lists the scenes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.records import ROOT
from ii_core import preset
from ii_core.display.viewer import write_viewer
from raytrace_ii import load_scene, render, scene_names

GALLERY = ROOT / "docs" / "gallery"
QUALITY = 80
SAMPLES = 16
SCALE = 2  # 256×128 lenses: pages of a few megabytes


def main() -> None:
    """Write the pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", choices=list(scene_names()), default=list(scene_names()))
    parser.add_argument("--scale", type=int, default=SCALE, help="divides the lenses of setup1")
    parser.add_argument("--missing", action="store_true", help="keep existing pages")
    asked = parser.parse_args()
    for name in asked.scenes:
        if asked.missing and page_of(name).exists():
            continue
        size = write_page(name, asked.scale)
        print(f"{page_of(name)}: {size / 2**20:.1f} MB", flush=True)


def page_of(name: str) -> Path:
    """Return the path of a scene's page."""
    return GALLERY / f"{name}.html"


def write_page(name: str, scale: int = SCALE) -> int:
    """Render a scene and write its page; return its bytes."""
    GALLERY.mkdir(parents=True, exist_ok=True)
    shot = render(load_scene(name), preset("setup1", scale=scale), samples=SAMPLES, support=("depth",))
    return write_viewer(page_of(name), shot.picture, depth=shot.depth, title=name, quality=QUALITY)
