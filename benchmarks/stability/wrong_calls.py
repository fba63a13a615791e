"""Wrong calls of every public function: each argument in turn is of another type or out of range.

    python -m benchmarks run wrong_calls [--only q_global]

A call must be taken, or end in TypeError or ValueError that names the argument, or in OSError where the value is a
path. Anything else is an accidental error: raised inside, about something that the caller never wrote. A row is
appended to ``benchmarks/results/wrong_calls.jsonl``.
"""

from __future__ import annotations

import inspect
import os
import re
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

import codec
import ii_core
import metrics
import raytrace_ii
from benchmarks.arguments import command_line
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin
from codec.inspect.header import coarsest, floor, parts
from ii_core import IICamera, IIPicture, design, properties
from ii_core.display.lenticular import lenticular
from ii_core.formats.find import find_views
from ii_core.maps import read_maps, write_maps
from raytrace_ii import Background, Body, Fog, Light, Material, Scene

RECORDS = Records("wrong_calls", ("benchmarks.stability.wrong_calls",))
PACKAGES = (ii_core, codec, metrics, raytrace_ii)


class Odd:
    """A class of no use to anyone."""


WRONG = [
    *(None, True, 3, -1, 0, 1.5, 1e300, float("nan"), float("inf"), 10**400, "", "text", "\0", "é" * 5000),
    *(np.zeros(3), np.zeros((0, 3)), np.full((2, 2), np.nan), np.array("text"), np.array([None])),
    *((), {}, set(), (1, None), (-1, -1), (10**9, 10**9), ["a", "b"], [[1, 2], [3]], {1: 2}, {"a": None}),
    *(slice("a", None), object(), b"bytes", Odd(), 1j),
]


class Call(NamedTuple):
    """A function, and good values of its arguments."""

    function: Callable[..., Any]
    good: Mapping[str, Any]


def encode(picture: IIPicture, scheme: str, bpp: float) -> Any:
    """Stand in for a coder, so that a study takes no time."""
    return SimpleNamespace(bpp=bpp, nbytes=1, encode_seconds=0.0, reached=True)


def calls(folder: Path) -> dict[str, Call]:
    """Return a good call of every public function, class and method by name; files are in a folder."""
    return {**_core(folder), **_codec(folder), **_metrics(folder), **_raytrace(folder)}


CAMERA = IICamera(pixels=(48, 48), lenses=(12, 12), pixel_pitch_mm=0.1, gap_mm=1.5)
PIXELS = np.random.default_rng(0).integers(0, 256, (48, 48, 3), np.uint8)
PICTURE = IIPicture(PIXELS, (12, 12), (4, 4), CAMERA)
DEPTH = np.full((48, 48), 15.0)
MASK = np.ones((48, 48), bool)
LOW, HIGH = sorted(map(float, ii_core.disparity_of_depth(CAMERA, [10.0, 100.0])))
FRONT = (0.0, 0.0, -150.0)
CURVE = [1.0, 2.0, 3.0, 4.0]
BLOCK = {"rows": slice(0, 2), "cols": slice(0, 2)}
SAMPLE = {"sample": (0.5, 0.5), "place": (0.5, 0.5)}
PAIR = {"reference": PICTURE, "decoded": PICTURE}


def _core(folder: Path) -> dict[str, Call]:
    views = folder / "views"
    for name in ("views", "written", "hci"):
        (folder / name).mkdir()
    ii_core.write_views(PICTURE, views)
    write_maps([CAMERA], folder / "maps")
    PICTURE.save(folder / "picture.png")
    maps = read_maps(folder / "maps")[0]
    lengths = {"lens_pitch_mm": 1.0, "gap_mm": 1.0}
    named = {
        "IICamera": (IICamera, {"pixels": (4, 4), "lenses": (2, 2), "pixel_pitch_mm": 0.1, "gap_mm": 1.0,
            "lens_pitch_mm": 0.2, "lattice": "hexagonal", "optics": ("pinhole",), "lens_offset_mm": (0, 0),
            "origin_mm": (0, 0, 0), "name": "a"}),
        "IICamera.rays": (CAMERA.rays, BLOCK | SAMPLE),
        "IICamera.rays_at": (CAMERA.rays_at, {"m": 1, "n": 1} | SAMPLE),
        "IICamera.weighted_rays": (CAMERA.weighted_rays, BLOCK | SAMPLE),
        "IICamera.weighted_rays_at": (CAMERA.weighted_rays_at, {"m": 1, "n": 1} | SAMPLE),
        "IICamera.separable_rays": (CAMERA.separable_rays, BLOCK),
        "IICamera.from_json": (IICamera.from_json, {"data": CAMERA.to_json()}),
        "IIPicture": (IIPicture, {"pixels": PIXELS, "lenses": (12, 12), "ei_pixels": (4, 4), "camera": CAMERA,
            "erect": False}),
        "IIPicture.with_pixels": (PICTURE.with_pixels, {"pixels": PIXELS}),
        "IIPicture.check_same_structure": (PICTURE.check_same_structure, {"other": PICTURE}),
        "IIPicture.save": (PICTURE.save, {"path": folder / "saved.png"}),
        "IIPicture.load": (IIPicture.load, {"path": folder / "picture.png", "lenses": None, "ei_pixels": None}),
        "IIPicture.from_structure_json": (IIPicture.from_structure_json,
            {"pixels": PIXELS, "data": PICTURE.structure_json()}),
        "MapCamera.rays": (maps.rays, BLOCK),
        "MapCamera.stored_rays": (maps.stored_rays, {"sample": 0} | BLOCK),
        "add_sensor_noise": (ii_core.add_sensor_noise, {"picture": PICTURE, "sigma": 1.0, "seed": 0}),
        "component_images": (ii_core.component_images, {"picture": PICTURE, "kind": "si"}),
        "picture_pixels": (ii_core.picture_pixels, {"stack": ii_core.sub_images(PICTURE), "kind": "si"}),
        "find_views": (find_views, {"source": views, "grid": None}),
        "load_mosaic": (ii_core.load_mosaic, {"path": folder / "picture.png", "ei_pixels": (4, 4)}),
        "picture_of": (ii_core.picture_of, {"views": find_views(views), "transposed": False, "flip_down": False,
            "flip_across": False}),
        "write_views": (ii_core.write_views, {"picture": PICTURE, "folder": folder / "written"}),
        "write_hci": (ii_core.write_hci, {"picture": PICTURE, "folder": folder / "hci", "depth": DEPTH}),
        "write_quilt": (ii_core.write_quilt, {"picture": PICTURE, "path": folder / "q.png", "row": 0}),
        "write_maps": (write_maps, {"folder": folder / "again", "cameras": [CAMERA], "format": "exr",
            "samples": [((0.5, 0.5), (0.5, 0.5))], "progress": None}),
        "read_maps": (read_maps, {"folder": folder / "maps"}),
        "preset": (ii_core.preset, {"name": "setup1", "scale": 8}),
        "preset_cameras": (ii_core.preset_cameras, {"name": "setup1", "scale": 8}),
        "five_viewpoints": (ii_core.five_viewpoints, {"camera": CAMERA}),
        "projection_camera": (ii_core.projection_camera, {"camera": CAMERA, "across": 10}),
        "stand_back": (ii_core.stand_back, {"camera": CAMERA, "plane_mm": 1.0}),
        "refocus": (ii_core.refocus, {"picture": PICTURE, "depth_mm": 10.0}),
        "view_image": (ii_core.view_image, {"picture": PICTURE, "viewpoint_mm": FRONT, "interpolation": "linear"}),
        "resampled": (ii_core.resampled, {"picture": PICTURE, "ei_pixels": (4, 4), "deshift": False}),
        "camera_pose": (ii_core.camera_pose, {"at_mm": (0, 0, -9), "look_at_mm": (0, 0, 0), "turn_deg": (0, 0, 0),
            "up": (0, 1, 0)}),
        "disparity_of_depth": (ii_core.disparity_of_depth, {"camera": CAMERA, "z_mm": 10.0}),
        "depth_of_disparity": (ii_core.depth_of_disparity, {"camera": CAMERA, "disparity": 0.5}),
        "panel_display": (ii_core.panel_display, {"size_mm": (300.0, 200.0), "pixels": (3000, 2000),
            "lens_pitch_mm": 1.0, "viewer_mm": 600.0, "view_angle_deg": 20.0, "gap_mm": None, "lenses": None,
            "start_mm": 0.0, "name": "a", "enlarge": 1.0}),
        "from_smallest_rectangle": (ii_core.from_smallest_rectangle, {"picture": PICTURE, "camera": CAMERA}),
        "lenticular": (lenticular, {"picture": PICTURE, "size": (48, 48), "pitch_px": 4.0, "slope": 0.1,
            "centre_px": 0.0, "views": 4, "depth_mm": 10.0, "cone": 1.0}),
        "solve": (design.solve, {**lengths, "pixel_pitch_mm": 0.1, "ei_pixels": None, "view_angle_deg": None}),
        "report of a camera": (design.report, {"camera": CAMERA}),
        "properties": (properties.properties, {"camera": CAMERA, "wavelength_mm": 5e-4}),
        "view_angle_deg": (properties.view_angle_deg, lengths),
        "image_plane_mm": (properties.image_plane_mm, {"focal_mm": 2.0, "gap_mm": 1.0}),
        "depth_range_mm": (properties.depth_range_mm, {**lengths, "z_mm": 9.0, "pixel_pitch_mm": 0.1}),
    }  # fmt: skip
    for name in ("elementary_images", "sub_images", "ray_space_images", "orthoscopic", "smallest_rectangle"):
        named[name] = (getattr(ii_core, name), {"picture": PICTURE})
    return {name: Call(*call) for name, call in named.items()}


def _codec(folder: Path) -> dict[str, Call]:
    coded = codec.encode(PICTURE, "si-h264", qp=40)
    fields = dict(scheme=coded.scheme, options=coded.options, payload=coded.payload, structure=coded.structure,
                  dtype="uint8", target_bpp=None, qp=40, quality=None, reached=True, runs=1, encode_seconds=1.0,
                  codec_seconds=1.0, versions={})  # fmt: skip
    axis = {"low": 0.0, "high": 50.0, "start": 20.0, "octave": 6.0, "step": 1.0, "overshoot": 0.1, "runs": 3}

    def encode_at(setting: float) -> codec.Run:
        return codec.Run(b"x" * int(1000 / (setting + 1)), 0.0)

    named = {
        "encode": (codec.encode, {"picture": PICTURE, "scheme": "si-h264", "bpp": 1.0}),
        "encode at a quantiser": (codec.encode, {"picture": PICTURE, "scheme": "si-h264", "qp": 40}),
        "encode with options": (codec.encode, {"picture": PICTURE, "scheme": "si-h264", "qp": 40, "gop": 4,
            "order": "row"}),
        "encode by quality": (codec.encode, {"picture": PICTURE, "scheme": "jpeg", "quality": 40}),
        "decode": (codec.decode, {"coded": coded, "max_pixels": 10000}),
        "timed_decode": (codec.timed_decode, {"coded": coded, "max_pixels": 10000}),
        "decode_frame": (codec.decode_frame, {"coded": coded, "index": 0}),
        "decode_component": (codec.decode_component, {"coded": coded, "place": (0, 0)}),
        "extract": (codec.extract, {"coded": coded, "path": folder / "x.mkv"}),
        "options": (codec.options, {"scheme": "jpeg"}),
        "parse_scheme": (codec.parse_scheme, {"scheme": "jpeg"}),
        "analyse_orders": (codec.analyse_orders, {"picture": PICTURE, "kinds": ("si",), "orders": ("row",)}),
        "register": (codec.register, {"coder": None}),
        "meet_size": (codec.meet_size, {"encode_at": encode_at, "target": 100.0, "axis": codec.Axis(**axis),
            "finest": None}),
        "Axis": (codec.Axis, axis),
        "Option": (codec.Option, {"about": "a", "default": 1, "choices": (), "low": 0, "high": 2}),
        "Encoded": (codec.Encoded, fields),
        "Encoded.load": (codec.Encoded.load, {"path": folder / "none.ii"}),
        "Encoded.save": (coded.save, {"path": folder / "c.ii"}),
        "parts": (parts, {"coded": coded}),
        "floor": (floor, {"scheme": "si-h264", "lenses": (2, 2), "ei_pixels": (2, 2)}),
        "coarsest": (coarsest, {"picture": PICTURE, "scheme": "si-h264"}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}


def _metrics(folder: Path) -> dict[str, Call]:
    quality = metrics.q_depth(PICTURE, PICTURE, depth=DEPTH)
    point = {
        "scheme": "x", "options": {}, "target_bpp": 1.0, "bpp": 1.0, "reached": True, "q_global": 30.0,
        "encode_seconds": 1.0, "decode_seconds": 1.0, "nbytes": 8,
        "q_depth": [1.0], "depth_mm": [5.0], "q_depth_min": 1.0, "q_depth_mean": 1.0, "q_depth_max": 1.0,
    }  # fmt: skip
    study: dict[str, Any] = {"picture": {"name": "x"}, "points": [point]}
    metrics.write_study(folder / "study.json", "x", [point], picture=PICTURE)
    curves = {"rates_a": CURVE, "quality_a": CURVE, "rates_b": CURVE, "quality_b": CURVE}
    layers = {"layers_mm": [10.0, 20.0], "method": "dissertation"}
    m = metrics
    named = {
        "q_global": (m.q_global, {**PAIR, "mask": MASK, "structure": None}),
        "q_angle": (m.q_angle, {**PAIR, "mask": MASK, "structure": None}),
        "mean_q_angle": (m.mean_q_angle, {**PAIR, "mask": MASK, "structure": None}),
        "q_angle_ycbcr": (m.q_angle_ycbcr, {**PAIR, "structure": None}),
        "q_angle_ssim": (m.q_angle_ssim, {**PAIR, "scales": 1, "structure": None}),
        "q_view": (m.q_view, {**PAIR, "viewpoints": {"front": FRONT}, "mask": MASK, "structure": None}),
        "q_depth": (m.q_depth, {**PAIR, **layers, "depth": DEPTH, "mask": MASK, "structure": None}),
        "error_map": (m.error_map, {**PAIR, "viewpoint_mm": FRONT}),
        "depth_from_focus": (m.depth_from_focus, {"picture": PICTURE, "layers_mm": [10.0, 20.0], "method": "robust",
            "base": [[0, 0]], "reference": [[0, 0]], "weights": [[1.0]], "interpolation": "linear", "workers": 1}),
        "angle_axes": (m.angle_axes, {"camera": CAMERA, "erect": False}),
        "disparity_layers": (m.disparity_layers, {"camera": CAMERA, "low": LOW, "high": HIGH, "count": 3}),
        "linear_layers": (m.linear_layers, {"camera": CAMERA, "count": 3}),
        "logarithmic_layers": (m.logarithmic_layers, {"near_mm": 1.0, "far_mm": 2.0, "count": 3}),
        "covering_layers": (m.covering_layers, {"camera": CAMERA, "depth_mm": DEPTH, "count": 3}),
        "measuring": (m.measuring, {"reference": PICTURE, "names": ["q_global"], "depth": DEPTH, **layers}),
        "quality_rows": (m.quality_rows, PAIR),
        "report": (m.report, {**PAIR, **layers, "mask": MASK, "ssim": False, "over_depth": False, "depth": DEPTH,
            "structure": None}),
        "PicturePair": (m.PicturePair, {**PAIR, **layers, "mask": MASK, "depth": DEPTH}),
        "PointLog": (m.PointLog, {"path": folder / "points.jsonl", "picture": PICTURE}),
        "Measure": (m.Measure, {"name": "mine", "compute": lambda pair: 1.0, "value": float, "text": "a",
            "label": "a", "unit": "dB", "digits": 2, "higher_is_better": True, "needs": m.Needs()}),
        "Needs": (m.Needs, {"regular": True, "camera": True, "lenses": 1, "all_pixels": True, "depth": True}),
        "register_measure": (m.register_measure, {"measure": None}),
        "default_rates": (m.default_rates, {"picture": PICTURE, "schemes": ["x"], "encode": encode,
            "decode": lambda coded: PICTURE}),
        "differences": (m.differences, {"study": study, "anchor": "x", "measure": "q_global"}),
        "mean_differences": (m.mean_differences, {"studies": [study], "anchor": "x", "measure": "q_global"}),
        "bd_rate": (m.bd_rate, curves),
        "bd_psnr": (m.bd_psnr, curves),
        "rate_distortion": (m.rate_distortion, {"picture": PICTURE, "schemes": ["x"], "rates": [1.0],
            "encode": encode, "decode": lambda coded: PICTURE, "workers": 1, "progress": None,
            "measure": None, "known": None, "executor": None, "keep": None}),
        "plot_angle": (m.plot_angle, {**PAIR, "path": folder / "a.png"}),
        "plot_error_views": (m.plot_error_views, {**PAIR, "path": folder / "a.png"}),
        "plot_views": (m.plot_views, {**PAIR, "path": folder / "a.png"}),
        "plot_pair": (m.plot_pair, {"picture": PICTURE, "path": folder / "a.png"}),
        "plot_depth": (m.plot_depth, {"quality": quality, "path": folder / "a.png"}),
        "plot_error_layers": (m.plot_error_layers, {"reference": PICTURE, "quality": quality,
            "path": folder / "a.png"}),
        "plot_all": (m.plot_all, {**PAIR, "quality": quality, "folder": folder}),
        "rd_chart": (m.rd_chart, {"study": study, "path": folder / "a.png", "measure": "q_global"}),
        "depth_rate_chart": (m.depth_rate_chart, {"study": study, "path": folder / "a.png"}),
        "depth_over_rate": (m.depth_over_rate, {"study": study, "scheme": "x"}),
        "summary_table": (m.summary_table, {"study": study, "measure": "q_global", "anchor": "x"}),
        "write_csv": (m.write_csv, {"path": folder / "a.csv", "records": [point]}),
        "write_latex": (m.write_latex, {"path": folder / "a.tex", "rows": [{"a": "b"}], "caption": "a"}),
        "write_study": (m.write_study, {"path": folder / "a.json", "picture_name": "x", "records": [point],
            "extra": None, "picture": PICTURE, "anchor": None}),
        "read_study": (m.read_study, {"path": folder / "study.json"}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}


def _raytrace(folder: Path) -> dict[str, Call]:
    corners, faces = np.array([[-5.0, -5, 20], [5, -5, 20], [0, 5, 20]]), np.array([[0, 1, 2]])
    body = {"name": "a", "vertices": corners, "faces": faces, "material": Material(), "normals": -np.eye(3),
            "texture_coordinates": np.zeros((3, 3))}  # fmt: skip
    light = {"kind": "point", "vector": (0, 0, 0), "colour": (1, 1, 1), "direction": (0, 0, 1), "cone_deg": (10, 20)}
    scene = {"bodies": [Body(**body)], "lights": [Light(**light)], "background": Background(), "fog": None,
             "ambient": (0, 0, 0), "max_depth": 3, "name": "a"}  # fmt: skip
    made = Scene(**scene)
    options = {"samples": 1, "error": 0.5, "seed": 0, "noise": 0.0, "dtype": "uint8", "workers": 1, "executor": None,
               "pose": None, "texture_filter": True}  # fmt: skip
    material = {name: field.default for name, field in inspect.signature(Material).parameters.items()}
    background = {name: field.default for name, field in inspect.signature(Background).parameters.items()}
    named = {
        "Body": (Body, body),
        "Light": (Light, light),
        "Scene": (Scene, scene),
        "Scene.with_depth": (made.with_depth, {"max_depth": 2}),
        "Material": (Material, material),
        "Background": (Background, background),
        "Fog": (Fog, {"colour": (1, 1, 1), "density_per_mm": 0.1}),
        "RenderOptions": (raytrace_ii.RenderOptions, options),
        "load_scene": (raytrace_ii.load_scene, {"name": "cuboid"}),
        "render": (raytrace_ii.render, {"scene": made, "camera": CAMERA, "support": (), "progress": None, **options}),
        "render_to": (raytrace_ii.render_to, {"picture": folder / "r.png", "scene": made, "camera": CAMERA,
            "support": {}, "upright": False, "progress": None, **options}),
        "trace": (raytrace_ii.trace, {"scene": made, "locations": [0.0, 0, 0], "directions": [0.0, 0, 1],
            "pose": None}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}


# What messages call an argument otherwise.
SAID = {
    "path": "path|text|name|file|known \\w+ type|possible are", "folder": "folder|text|name",
    "source": "source|text|name|holds one view", "bodies": "bodies|object", "size_mm": "size_mm|lens of",
    "lenses": "lenses|lens",
    "name": "name|camera|scene", "kind": "kind|component image", "viewpoints": "viewpoint", "names": "names|measure",
    "low": "low|disparity",
    "high": "high|disparity", "kinds": "kinds|component image", "orders": "orders?",
    "data": "data|camera|picture|structure|lenses|ei_pixels",
    "dtype": "dtype|pixel type", "index": "index|frame", "place": "place|component image",
    "vertices": "vertices|vertex|object", "faces": "faces|face|object", "count": "count|viewpoints",
    "depth_mm": "depth_mm|depth", "views": "views|viewpoints", "cone": "cone|zone", "directions": "directions?|ray",
    "ei_pixels": "ei_pixels|elementary image|lenses of", "qp": "qp|scheme", "bpp": "bpp|scheme",
    "quality": "quality|scheme",
    "picture": "picture|name|file", "optics": "optics|element|optical", "study": "study|points",
}  # fmt: skip
# Values that are right, and whose work has no end: threads, and samples of 10⁹.
LONG = {"workers", "samples", "across", "runs", "count", "views", "max_depth"}
# Values that are right, and take seconds: depth from focus over layers that nobody gave.
DEFAULTS = {("q_depth", "depth"), ("depth_from_focus", "layers_mm"), ("plot_all", "quality"), ("plot_all", "folder")}


def outcome(call: Call, argument: str, value: Any) -> str:
    """Return "taken", "refused", "path", or what is wrong with the error."""
    if argument in LONG and isinstance(value, int | float) and 1000 < value < float("inf") and value < 10**400:
        return "taken"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call.function(**{**call.good, argument: value})
    except (TypeError, ValueError) as error:
        named = re.search(rf"\b({SAID.get(argument, argument)})", str(error))
        return "refused" if named else f"not named: {type(error).__name__}: {str(error)[:120]}"
    except OSError as error:
        named = isinstance(value, str | os.PathLike | bytes) or argument in str(error)
        return "path" if named else f"{type(error).__name__}: {str(error)[:120]}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:120]}"
    return "taken"


GOOD = {"taken", "refused", "path"}
SLOW: set[str] = set()  # functions left out of a short run


def attack(named: Mapping[str, Call], wrong: list[Any]) -> tuple[Counter[str], list[str]]:
    """Try all values for all arguments; return counts and a line for each accidental error."""
    counts: Counter[str] = Counter()
    findings = []
    for name, call in named.items():
        for argument in call.good if name not in SLOW else ():
            for value in wrong:
                if (name, argument) in DEFAULTS and (value is None or (isinstance(value, str) and not value)):
                    continue
                end = outcome(call, argument, value)
                counts[end if end in GOOD else "accidental"] += 1
                if end not in GOOD:
                    shown = (
                        f"{type(value).__name__} {value!r:.30}" if type(value) is not int else f"int {value % 10**9}"
                    )
                    findings.append(f"{name}({argument}={shown}): {end}")
    return counts, findings


def untried(named: Mapping[str, Call]) -> list[str]:
    """Return the public functions and their arguments that no call has."""
    tried = {call.function: set(call.good) for call in named.values()}
    missing = []
    for package in PACKAGES:
        for name in package.__all__:
            function = getattr(package, name)
            if not inspect.isfunction(function):
                continue
            wanted = {p.name for p in inspect.signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD}
            known = set().union(*(good for tried_one, good in tried.items() if tried_one == function))
            missing += [f"{name}({argument})" for argument in sorted(wanted - known)]
    return missing


def main() -> None:
    """Attack all, print accidental errors, append the row."""
    parser = command_line(__doc__)
    parser.add_argument("--only", help="one function, without a record")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # relative names write here
        named = calls(Path(folder))
        if arguments.only:
            named = {name: call for name, call in named.items() if name == arguments.only}
        found: list[str] = []

        def measure() -> dict[str, Any]:
            counts, lines = attack(named, WRONG)
            found.extend(lines)
            return {"functions": len(named), "counts": dict(counts), "findings": lines[:50]}

        if arguments.only:
            print(measure()["counts"])
        for key in [] if arguments.only else RECORDS.todo([{"values": len(WRONG)}], arguments.again):
            print(RECORDS.measure(key, measure)["result"]["counts"])
        os.chdir("/")
    print("\n".join(found))
    if not arguments.only:
        publish(tables())


def tables() -> Tables:
    """Return the sentence of the page of stability."""
    rows = RECORDS.rows()[-1:]
    if not rows:
        return {("docs/stability.md", "wrong-calls"): []}
    counts = rows[0]["counts"]
    line = (
        f"{rows[0]['functions']} functions, classes and methods, each argument with {len(WRONG)} wrong values: "
        f"{sum(counts.values())} calls, {counts.get('refused', 0)} refused by name, {counts.get('path', 0)} missing "
        f"files, {counts.get('taken', 0)} values that were right, {counts.get('accidental', 0)} accidental errors."
    )
    return {("docs/stability.md", "wrong-calls"): [line, "", origin(rows)]}


if __name__ == "__main__":
    main()
