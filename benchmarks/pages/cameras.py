"""Page docs/cameras.md: every camera with its maps, a detail of its picture and a view.

    python -m benchmarks run cameras

*Apples* at an eighth of the lenses each way (a fifth for ``hdtv``), so that single pixels can be seen.
"""

from __future__ import annotations

import json
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from benchmarks.pages.pictures import write_picture
from benchmarks.records import ROOT
from ii_core import (
    IICamera,
    IIPicture,
    five_viewpoints,
    orthoscopic,
    preset,
    preset_cameras,
    projection_camera,
    stand_back,
    sub_images,
    view_image,
)
from ii_core.picture.regular import resampled
from raytrace_ii import Scene, load_scene, render, scene_names

DOCS, CAMERAS = ROOT / "docs", ROOT / "assets" / "cameras.json"
PANEL = (320, 160)  # pixels across and down
GAP = 6
SCALES = {"hdtv": 5}
# Shift of the camera in mm towards the viewer, to make room for its front lens.
BACK = {
    "depth-control": 70, "grin-hexagonal-depth-control": 70, "plenoptic1": 150, "plenoptic2": 150,
    "plenoptic1-double-gauss": 130, "plenoptic2-triplet": 150,
}  # fmt: skip


def main() -> None:
    """Render all and write the page."""
    scene = load_scene("apples")
    folder = DOCS / "images" / "cameras"
    folder.mkdir(parents=True, exist_ok=True)
    for kind, names in KINDS.items():
        strips = [
            np.pad(strip(scene, shown(name), name), ((0, GAP), (0, 0), (0, 0)), constant_values=255) for name in names
        ]
        write_picture(folder / file_name(kind), np.concatenate(strips)[:-GAP])
        print(kind, flush=True)
    write_picture(DOCS / "images" / "scenes.webp", all_scenes())
    (DOCS / "cameras.md").write_text(page(), encoding="utf-8")


def file_name(kind: str) -> str:
    """Return the name of the sheet of a kind of cameras."""
    return f"{kind.lower().replace(' ', '-')}.webp"


def page() -> str:
    """Return the page: cameras by kind, and the precision of stored maps."""
    text = [INTRODUCTION]
    for kind, names in KINDS.items():
        text.append(f"\n## {kind}\n")
        text += [entry(name, preset_cameras(name), shown(name)) for name in names]
        text.append(f"\n![from top to bottom: {', '.join(names)}](images/cameras/{file_name(kind)})\n")
    return "\n".join([*text, PRECISION, IN_SCENE])


def shown(name: str) -> IICamera:
    """Return the camera of the pictures, the first of several."""
    return preset_cameras(name, scale=SCALES.get(name, 8))[0]


# All cameras, without the family setup2, whose members differ only in numbers.
KINDS = {
    "Setups of the dissertation": ("setup1", "setup3"),
    "Other lenses": ("grin", "hpo", "depth-priority", "resolution-priority", "multi-focus", "spherical"),
    "Other arrays": ("hexagonal", "plenoptic", "hdtv"),
    "A lens in front of the array": ("depth-control", "grin-hexagonal-depth-control", "plenoptic1", "plenoptic2"),
    "A lens of glass in front of the array": ("plenoptic1-double-gauss", "plenoptic2-triplet"),
    "Several pixel arrays": ("moving-lenslets", "stacked-sensors", "multi-view"),
    "One lens": ("pinhole2d",),
}


INTRODUCTION = """# Cameras

With this page you can choose a camera of the package and the format of its maps. A camera is a
location and a direction for every pixel. Under the cameras of a kind stand their strips, from top
to bottom (`python -m benchmarks run cameras`; an eighth of the lenses each way, of several arrays
the first):

1. the locations L over the whole array, with x, y and z as red, green and blue;
2. the directions D of a few lenses, in the same colours, black if blocked;
3. the same few lenses of *Apples*, rendered through L and D;
4. the view of a viewer in front of the display; with a main lens, the middle sub-image, upright.

Unless given, cameras have pinholes, 8192×4096 px, 512×256 lenses in a rectangular array, 16×16 px
each, and a viewing angle α = 29.9°. `raytrace-ii camera NAME -o dir/` stores L and D as pictures,
`--report` prints properties and limits. [Camera files](camera_files.md) lists all keys and
elements.
"""
USUAL = ("pinhole", "8192×4096 px", "512×256 lenses", "rectangular", "16×16 px each", "α = 29.9°")


def entry(name: str, full: tuple[IICamera, ...], shown: IICamera) -> str:
    """Return heading, text and properties."""
    first = full[0]
    u, v = first.ei_pixels
    chain = " → ".join(e.kind for e in first.optics)
    _, _, weight = shown.weighted_rays()
    blocked = "" if weight is None or weight.all() else f", {1 - (weight > 0).mean():.0%} of the rays blocked"
    facts = [
        f"{first.pixels[0]}×{first.pixels[1]} px", f"{first.lenses[0]}×{first.lenses[1]} lenses", first.lattice,
        f"{u:.4g}×{v:.4g} px each", f"α = {first.view_angle_deg:.1f}°",
    ]  # fmt: skip
    arrays = [f"{len(full)} arrays"] if len(full) > 1 else []
    facts = [f"{chain}{blocked}", *arrays, *facts]
    facts = [fact for fact in facts if fact not in USUAL]
    sheet = json.loads(CAMERAS.read_text(encoding="utf-8"))[name]
    about = sheet["about"][:1].upper() + sheet["about"][1:]
    given = f" *{', '.join(facts)}.*" if facts else ""
    text = fill(f"{about}. {sheet['notes']}{given}", 100, break_on_hyphens=False)
    return f"\n### {name}\n\n{text}\n"


def all_scenes() -> NDArray[np.uint8]:
    """Return views of every scene on setup 1's display, two in a row."""
    pinhole, pose = projection_camera(preset("setup1"), 480)
    pictures = [
        orthoscopic(render(load_scene(name), pinhole, samples=9, pose=pose, support=()).picture).pixels
        for name in sorted(scene_names())
    ]
    padded = [np.pad(p, ((0, GAP), (0, GAP), (0, 0)), constant_values=255) for p in pictures]
    padded += [np.full_like(padded[0], 255)] * (len(padded) % 2)
    rows = [np.concatenate(padded[i : i + 2], axis=1) for i in range(0, len(padded), 2)]
    return np.concatenate(rows)[:-GAP, :-GAP]


PRECISION = """
## Stored as pictures: which format is enough

Greatest errors of the maps of `setup1`, `setup3` and `spherical` at a quarter of the lenses each
way, and PSNR of *Apples* and *Cuboid* against pictures of float maps:

| format | bytes per ray | angle | location | PSNR |
|---|---|---|---|---|
| png16 | 0.068–0.29 | 5.3 µrad | 0.42 µm | 48.9–57.2 dB |
| png8 | 0.025–0.076 | 1350 µrad | 109 µm | 19.7–31.9 dB |
| exr | 0.24–2.7 | 0.019 µrad | 0.0011 µm | reference |
| hdr | 2.3–4.4 | 5336 µrad | 417 µm | 16.8–26.6 dB |

Measured by `6307c74` (`map_precision`, git `85f29ab`).

**PNG-16** is sufficient for all pictures with sensor noise, which alone gives 47.5 dB: pixels
change only where a ray grazes an edge. **EXR** is for pictures that must agree to the bit.
**PNG-8** and **RGBE** (`hdr`) are for viewing: an error of a milliradian moves a point 100 mm away
by a tenth of a millimetre, a whole lens of `setup1`.
"""

IN_SCENE = """
## Against a camera of glass inside the scene

*Apples*, lit from behind, through lenses of glass in the scene (16 segments a lens) is at 33.8 dB to
the picture through L and D of `spherical`: maps leave out Fresnel losses, stray light in the glass,
and the camera's shadow. With the losses added it is at 46.8 dB, without the stray light at 48.8. The
rest comes from the faces of the lenses' meshes: 6 dB for every doubling. L and D take at most a third
of the time (`camera_in_scene`, git `58549fc`).
"""


def strip(scene: Scene, camera: IICamera, name: str) -> NDArray[np.uint8]:
    """Return L, D, a detail and a view side by side on white."""
    pose = stand_back(camera) if camera.lenses == (1, 1) else np.eye(4)
    pose[2, 3] -= BACK.get(name, 0)
    picture = render(scene, camera, samples=16, pose=pose, support=()).picture
    L, D, weight = camera.weighted_rays()
    D = D / np.linalg.norm(D, axis=-1, keepdims=True)
    on = np.ones(L.shape[:2], bool) if weight is None else weight > 0
    block = middle(camera)
    panels = [
        fitted(as_colour(L, on), Image.Resampling.BOX),
        fitted(as_colour(D, on)[block], Image.Resampling.NEAREST),
        fitted(picture.pixels[block], Image.Resampling.NEAREST),
        fitted(seen(picture, name), Image.Resampling.BICUBIC),
    ]
    width = len(panels) * (PANEL[0] + GAP) - GAP
    page = np.full((PANEL[1], width, 3), 255, np.uint8)
    for i, panel in enumerate(panels):
        left = i * (PANEL[0] + GAP) + (PANEL[0] - panel.shape[1]) // 2
        top = (PANEL[1] - panel.shape[0]) // 2
        page[top : top + panel.shape[0], left : left + panel.shape[1]] = panel
    return page


def middle(camera: IICamera) -> tuple[slice, slice]:
    """Return a block of about eight by four lenses, or the whole array if it is smaller."""
    (m, n), (u, v) = camera.pixels, camera.ei_pixels
    width, height = (m, n) if camera.lenses == (1, 1) else (round(8 * u), round(4 * max(u, v)))
    left, top = max(0, (m - width) // 2), max(0, (n - height) // 2)
    if camera.regular and camera.lenses != (1, 1):
        left, top = left // u * u, top // v * v
    return slice(top, top + height), slice(left, left + width)


def as_colour(values: NDArray[np.float64], on: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return x, y, z from least to greatest as red, green, blue; constant axes are dark, blocked rays black."""
    low, high = values[on].min(axis=0), values[on].max(axis=0)
    share = (values - low) / np.where(high - low > 1e-9, high - low, np.inf)
    return np.where(on[..., None], np.clip(255 * share, 0, 255), 0).astype(np.uint8)


def seen(picture: IIPicture, name: str) -> NDArray[Any]:
    """Return the view from the front; with a main lens the middle sub-image, rotated."""
    if picture.lenses == (1, 1):
        return orthoscopic(picture).pixels
    if name.startswith("plenoptic") and name != "plenoptic":
        stack = sub_images(picture)
        view = stack[stack.shape[0] // 2, stack.shape[1] // 2][::-1, ::-1]
    else:
        if not picture.regular:
            picture, _ = resampled(picture)
        assert picture.camera is not None
        view, _ = view_image(picture, five_viewpoints(picture.camera)["front"])
    assert picture.camera is not None
    across, down = picture.camera.lens_pitch_mm
    unit = min(across, down)
    return view.repeat(round(4 * across / unit), axis=1).repeat(round(4 * down / unit), axis=0)


def fitted(pixels: NDArray[Any], how: Image.Resampling) -> NDArray[np.uint8]:
    """Return a picture scaled to fit the panel."""
    image = Image.fromarray(np.ascontiguousarray(pixels))
    share = min(PANEL[0] / image.width, PANEL[1] / image.height)
    return np.asarray(image.resize((max(1, round(image.width * share)), max(1, round(image.height * share))), how))
