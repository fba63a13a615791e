"""Still life rendered by POV-Ray 3.7 with the same primitives, lights and rays.

    python -m benchmarks run povray [--scale 16]

POV-Ray intersects balls and planes in closed form. Its ``mesh_camera`` takes one ray per pixel from a mesh of small
triangles: from the centroid along the normal, so that any L and D can be passed. Its picture is compared with ours
(triangles) and with `analytic` (closed form, too): PSNR of linear light by object, and a picture of the difference.
``povray`` must be on the path (Debian: ``apt-get install povray``); without it the script prints this and ends.
Numbers and pictures go to ``benchmarks/results/povray.jsonl`` and ``docs/images/povray.webp``.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.analytic import Array, Ball, Floor, World, still_life
from benchmarks.arguments import command_line
from benchmarks.pages.pictures import IMAGES, write_picture
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, table
from ii_core import IICamera, preset
from ii_core.base.colour import srgb
from raytrace_ii import Light, Material, trace

RECORDS = Records("povray", ("benchmarks.accuracy.povray", "benchmarks.accuracy.analytic"))
SCALE = 16  # scale on the page
SEGMENTS = 384
SIDE = 1.0  # mm from corner to centroid of a triangle that stands for a ray; POV-Ray drops very small ones


def main() -> None:
    """Render with all three, compare and record."""
    asked = command_line(__doc__, scale=SCALE).parse_args()
    if shutil.which("povray") is None:
        print("povray is not installed: nothing to compare with (Debian: apt-get install povray)")
        sys.exit(0)
    world = still_life()
    array = preset("setup1", scale=asked.scale)
    pitch = 10.24 / array.pixels[0]
    flat = IICamera(name="pinhole", pixels=array.pixels, lenses=(1, 1), pixel_pitch_mm=pitch, gap_mm=8.0)
    pictures = []
    cases = {("pinhole", "pinhole"): flat, ("pinhole", "mesh_camera"): flat, ("setup1", "mesh_camera"): array}
    keys = [{"scale": asked.scale, "camera": name, "rays by": by, "segments": SEGMENTS} for name, by in cases]
    if not (keys := RECORDS.todo(keys, asked.again)):
        publish(tables())
        return
    for key in keys:

        def found(name: str = key["camera"], by: str = key["rays by"]) -> dict[str, Any]:
            rows, picture = compare(world, cases[name, by], by == "mesh_camera")
            if (name, by) != ("pinhole", "mesh_camera"):
                pictures.append(picture)
            return {"povray": version(), "rows": rows}

        for row in RECORDS.measure(key, found)["result"]["rows"]:
            print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()))
    if len(pictures) == 2:
        gap = np.full((8, pictures[0].shape[1], 3), 255, np.uint8)
        write_picture(IMAGES / "povray.webp", np.concatenate([pictures[0], gap, pictures[1]]))
    publish(tables())


def compare(world: World, camera: IICamera, mesh: bool) -> tuple[list[dict[str, Any]], NDArray[np.uint8]]:
    """Return PSNR by object for one camera, with glass and without; and both pictures with their difference."""
    L, D = camera.rays()
    if not mesh:  # POV-Ray's own pinhole makes upright pictures: turned by 180° they are the pinhole's
        L, D = L[::-1, ::-1], D[::-1, ::-1]
    o, d = L.reshape(-1, 3), D.reshape(-1, 3) / np.linalg.norm(D.reshape(-1, 3), axis=1, keepdims=True)
    ours = trace(world.scene(SEGMENTS), o, d).radiance.astype(float)
    exact = world.radiance(o, d)
    theirs = povray(world, camera, o, d, mesh).reshape(-1, 3)
    _, which, _ = world.nearest(o, d)
    rows = []
    for i, name in [(None, "all"), (-1, "sky"), *((i, solid.name) for i, solid in enumerate(world.solids))]:
        here = np.full(len(which), True) if i is None else which == i
        if not here.any():
            continue
        row: dict[str, Any] = {"seen": name}
        for pair, a, b in (
            ("ours", ours, theirs),
            ("closed form", exact, theirs),
            ("ours / closed form", ours, exact),
        ):
            error = np.abs(a[here] - b[here])
            label = pair if "/" in pair else f"POV-Ray / {pair}"
            row |= {f"{label}, dB": _psnr(error), f"{label}, median": float(np.median(error.max(axis=1)))}
        rows.append(row | {"off by more than 0.01": float((np.abs(ours - theirs)[here].max(axis=1) > 0.01).mean())})
    shape = (*L.shape[:2], 3)
    parts = [_coded(ours), _coded(theirs), np.clip(128 + 8 * 255 * (theirs - ours), 0, 255).astype(np.uint8)]
    return rows, np.concatenate([part.reshape(shape) for part in parts], axis=1)


def tables() -> Tables:
    """Return the table of the page of stability: rows by what is seen, columns by camera; equal columns are one."""
    pairs = ("POV-Ray / closed form", "POV-Ray / ours", "ours / closed form")
    measured = RECORDS.rows(scale=SCALE)
    columns: dict[str, dict[str, str]] = {}
    for one in measured:
        cells = {row["seen"]: " · ".join(f"{row[f'{pair}, dB']:.1f}" for pair in pairs) for row in one["rows"]}
        if columns.get(one["camera"], cells) == cells:
            columns[one["camera"]] = cells
        else:
            columns[f"{one['camera']}, rays by {one['rays by']}"] = cells
    rows = dict.fromkeys(name for cells in columns.values() for name in cells)
    lines = [[name, *(cells.get(name, "") for cells in columns.values())] for name in rows]
    heads = " | ".join(["", *columns]).strip()
    return {("docs/stability.md", "povray"): [*table(heads, lines), "", origin(measured)]}


def _psnr(error: Array) -> float:
    return float(-10 * np.log10(np.mean(error**2)))


def _coded(light: Array) -> NDArray[np.uint8]:
    return np.rint(255 * srgb(np.clip(light, 0, 1))).astype(np.uint8)


def version() -> str:
    """Return the version that ``povray`` prints."""
    run = subprocess.run(["povray", "--version"], capture_output=True, text=True, check=False)
    return stated(run.stdout + run.stderr)


def stated(text: str) -> str:
    """Return the version in POV-Ray's output, which may also contain warnings about missing configuration files.

    Raises
    ------
    ValueError
        If the output has no version.
    """
    found = re.search(r"POV-Ray \d\S*", text)
    if found is None:
        raise ValueError(f"povray --version prints no version: {text.strip()[:200]!r}")
    return found.group()


def povray(world: World, camera: IICamera, o: Array, d: Array, mesh: bool) -> Array:
    """Return linear light (rows, columns, 3) rendered by POV-Ray."""
    width, height = camera.pixels
    height += (
        mesh  # row n of a mesh camera's picture shows the triangles of row n − 1: one row more, the first dropped
    )
    with tempfile.TemporaryDirectory() as folder:
        scene, picture = Path(folder) / "scene.pov", Path(folder) / "scene.ppm"
        seen = mesh_camera(o, d) if mesh else pinhole(camera)
        scene.write_text("\n".join([HEAD.format(world.max_depth + 1), seen, *described(world)]), encoding="ascii")
        command = [
            "povray", f"+I{scene.name}", f"+O{picture.name}", f"+W{width}", f"+H{height}",
            "+FP16", "-A", "-D", "+WT1", "File_Gamma=1.0",
        ]  # fmt: skip
        run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if run.returncode or not picture.is_file():
            raise OSError(f"povray failed ({run.returncode}): {run.stderr[-600:]}")
        data = picture.read_bytes()
    pixels = np.frombuffer(data[-width * height * 6 :], ">u2").astype(np.float64) / 65535
    return pixels.reshape(height, width, 3)[int(mesh) :]


HEAD = """#version 3.7;
global_settings {{ assumed_gamma 1.0 max_trace_level {} adc_bailout 1/4000 ambient_light rgb 1 }}"""


def vector(values: Sequence[float] | Array) -> str:
    return "<" + ",".join(f"{value:.17g}" for value in values) + ">"


def pinhole(camera: IICamera) -> str:
    """Return POV-Ray's own camera with the same field of view."""
    (width, height), gap = camera.size_mm, camera.gap_mm
    return (
        f"camera {{ perspective location <0,0,{gap}> direction <0,0,{gap}> right <{width},0,0> up <0,{height},0> }}"
    )


def mesh_camera(o: Array, d: Array) -> str:
    """Return a mesh camera: for every ray a triangle around its start, perpendicular to it, pixel by pixel."""
    side = np.cross(d, np.where(np.abs(d[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(d, side)
    around = [SIDE * (np.cos(angle) * side + np.sin(angle) * other) for angle in (0, -2 * np.pi / 3, -4 * np.pi / 3)]
    corners = np.stack([o + away for away in around], axis=1)
    triangles = (f"triangle {{ {a},{b},{c} }}" for a, b, c in map(lambda t: map(vector, t), corners))
    mesh = "mesh { " + " ".join(triangles) + " }"  # a mesh2 is refused here: "No triangles"
    return f"camera {{ mesh_camera {{ 1 0 {mesh} }} location <0,0,0.000001> }}"


def described(world: World) -> list[str]:
    """Return the world as POV-Ray's input: no fall-off, Lambert, Blinn's highlight, Fresnel, Beer–Lambert, sky."""
    b = world.background
    # a sky sphere's colour map runs over (1 + y)/2; ours is linear in y up to the sine of the spread
    steep = np.sin(np.radians(b.spread_deg))
    stops = [
        (0.0, b.nadir),
        ((1 - steep) / 2, b.nadir),
        (0.5, b.horizon),
        ((1 + steep) / 2, b.zenith),
        (1.0, b.zenith),
    ]
    colours = " ".join(f"[{at:.12g} rgb {vector(colour)}]" for at, colour in stops)
    out = [
        f"sky_sphere {{ pigment {{ function {{ (1+y)/2 }} color_map {{ {colours} }} }} }}",
        *(light(one) for one in world.lights),
    ]
    return [*out, *(solid(one, world) for one in world.solids)]


def light(one: Light) -> str:
    colour = f"rgb {vector(one.colour)}"
    if one.kind == "point":
        return f"light_source {{ {vector(one.vector)} {colour} }}"
    towards = -np.asarray(one.vector, float)
    towards /= np.linalg.norm(towards)
    return f"light_source {{ {vector(1e6 * towards)} {colour} parallel point_at <0,0,0> }}"


def solid(one: Ball | Floor, world: World) -> str:
    if isinstance(one, Ball):
        shape = f"sphere {{ {vector(one.centre_mm)}, {one.radius_mm}"
    else:
        (x, y, z), (across, along) = one.centre_mm, one.size_mm
        low, high = (x - across / 2, y - 1e-9, z - along / 2), (x + across / 2, y, z + along / 2)
        shape = f"box {{ {vector(low)}, {vector(high)}"
    return f"{shape} {finish(one.material, world)} }}"


def finish(m: Material, world: World) -> str:
    """Return a material as POV-Ray's input."""
    local = 1 - max(m.mirror) - max(m.transmission)
    if max(m.transmission) > 0:
        # fade_power 1001 is Beer–Lambert: colour^(path/distance); each face transmits its share, `filter`
        colour = np.exp(-np.array(m.absorption_per_mm))
        return (
            f"pigment {{ rgbf <{m.transmission[0]},{m.transmission[1]},{m.transmission[2]},1> }} "
            f"finish {{ ambient 0 diffuse 0 specular 0 reflection {{ 0 {max(m.transmission)} fresnel on }} "
            f"conserve_energy }} interior {{ ior {m.ior} fade_distance 1 fade_power 1001 "
            f"fade_color rgb {vector(colour)} }}"
        )
    shine = f"specular {m.specular} roughness {1 / m.shininess:.9g}" if m.specular else "specular 0"
    ambient = vector(np.array(world.ambient) * local)  # POV-Ray multiplies by the pigment's colour
    return (
        f"pigment {{ rgb {vector(m.colour)} }} finish {{ ambient rgb {ambient} diffuse {local:.9g} {shine} "
        f"reflection {{ rgb {vector(m.mirror)} }} }}"
    )
