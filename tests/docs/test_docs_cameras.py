"""Pages of cameras: every key, element and camera, and the numbers of the worked display."""

import math
import re
from dataclasses import fields
from pathlib import Path

from benchmarks.pages.cameras import KINDS as GROUPS
from ii_core import IICamera, camera_names, panel_display
from ii_core.camera.optics import KINDS, LensModel

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "camera_files.md").read_text(encoding="utf-8")
ITEMS = dict(re.findall(r"^- (?:\*\*)?`([\w-]+)[^`]*`((?:.|\n(?=  ))*)", PAGE, re.M))  # text by key


def test_every_key_of_a_camera_file_has_an_item():
    keys = {field.name for field in fields(IICamera)} - {"name"}
    assert keys <= set(ITEMS) and "`name`" in PAGE and "`about`, `notes`" in PAGE


def test_every_element_has_an_item_with_its_parameters():
    for kind, element in KINDS.items():
        for field in fields(element):
            assert f"`{field.name}`" in ITEMS[kind], f"{kind}: {field.name}"
    models = PAGE[PAGE.index("## Optical elements") : PAGE.index("Elements in front")]
    assert {kind for kind, element in KINDS.items() if issubclass(element, LensModel)} == set(
        re.findall(r"^- `([\w-]+)`", models, re.M)
    )


def test_the_worked_display_is_the_design():
    made = panel_display(size_mm=15.6 * 25.4, pixels=(3840, 2160), lens_pitch_mm=1.0, viewer_mm=600)
    camera = made.camera
    across, down = camera.lenses
    numbers = {
        f"{camera.pixel_pitch_mm:.4f} mm", f"{across}×{down} lenses", f"{camera.ei_pitch_mm[0]:.4f} mm",
        f"{camera.lens_pitch_mm[0]:.4f} mm", f"{camera.gap_mm:.3f} mm",
        f"{camera.ei_pitch_mm[0] * 600 / camera.gap_mm:.1f} mm",
    }  # fmt: skip
    for number in numbers:
        assert number in " ".join(PAGE.split()), number
    assert math.isclose(camera.view_angle_deg, 30)


def test_every_camera_is_on_its_page_once():
    named = [name for names in GROUPS.values() for name in names]
    assert sorted(named) == sorted(name for name in camera_names() if not name.startswith("setup2"))
    text = (DOCS / "cameras.md").read_text(encoding="utf-8")
    assert re.findall(r"^### (\S+)$", text, re.M) == named
    assert [kind for kind in re.findall(r"^## (.+)$", text, re.M) if kind in GROUPS] == list(GROUPS)
