"""Gallery of reference scenes: a viewer page and a still of each.

    python -m benchmarks run gallery [--scenes twins hairdo] [--missing] [--stills] [--scale 2]

Pages go to ``docs/gallery``. Git does not keep them; ``make gallery`` writes missing ones. With ``--stills`` a
browser draws the stills of the scenes, which git keeps, and ``docs/gallery/README.md`` is written.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.pages.pictures import write_picture
from benchmarks.records import ROOT
from benchmarks.speed.viewer import tab
from ii_core import preset
from ii_core.display.viewer import write_viewer
from raytrace_ii import load_scene, render, scene_names

GALLERY = ROOT / "docs" / "gallery"
STILL = {"width": 900, "height": 500}
# State of the viewer page in each still.
STILLS = {"apples": "#a=3", "cuboid": "#x=0.5&y=0.3", "objects": "#stereo=anaglyph&eyes=0.15", "mountains": "#f=0"}
QUALITY = 80
SAMPLES = 16
SCALE = 2  # 256×128 lenses: pages of a few megabytes
INTRODUCTION = f"""# Gallery

Here you choose a [reference scene](../scenes.md). `make gallery` makes a [viewer](../viewer.md) page of each, which
opens in any browser without a network, in 20 minutes of CPU time. Each is
`setup1` with half of the lenses each way, {SAMPLES} samples per pixel, JPEG of quality {QUALITY}. *Mountains* and
the ground behind the *Twins* are so far away that each lens sees them whole: no display of this
kind can resolve them.
"""


def main() -> None:
    """Write the pages, and with ``--stills`` the stills."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", choices=list(scene_names()), default=list(scene_names()))
    parser.add_argument("--stills", action="store_true", help="draw the stills and write the README, in a browser")
    parser.add_argument("--scale", type=int, default=SCALE, help="divides the lenses of setup1")
    parser.add_argument("--missing", action="store_true", help="keep existing pages")
    asked = parser.parse_args()
    for name in asked.scenes:
        if asked.missing and page_of(name).exists():
            continue
        size = write_page(name, asked.scale)
        print(f"{page_of(name)}: {size / 2**20:.1f} MB", flush=True)
    if asked.stills:
        draw_stills(asked.scenes)


def page_of(name: str) -> Path:
    """Return the path of a scene's page."""
    return GALLERY / f"{name}.html"


def write_page(name: str, scale: int = SCALE) -> int:
    """Render a scene and write its page; return its bytes."""
    GALLERY.mkdir(parents=True, exist_ok=True)
    shot = render(load_scene(name), preset("setup1", scale=scale), samples=SAMPLES, support=("depth",))
    return write_viewer(page_of(name), shot.picture, depth=shot.depth, title=name, quality=QUALITY)


def draw_stills(names: Sequence[str]) -> None:
    """Draw a still of each page in a browser, and write the README that shows those of all scenes."""
    with tab(STILL) as page:
        for name in names:
            page.goto(f"file://{page_of(name)}{STILLS.get(name, '')}")
            page.evaluate("async () => { await ii.ready }")
            page.wait_for_timeout(1000)
            write_picture(
                GALLERY / f"{name}.webp", np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
            )
    lines = [f"## {name}\n\n![{name}]({name}.webp)\n" for name in scene_names()]
    (GALLERY / "README.md").write_text("\n".join([INTRODUCTION, *lines]), encoding="utf-8")
