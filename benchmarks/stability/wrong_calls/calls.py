"""A good call of every public function, class and method.

The value of an argument is that of the function here, else that of the argument's name in `Made.by_name`, else the
default.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

import codec
import ii_core
import metrics
import raytrace_ii
from codec.inspect import header_bits
from ii_core import DisplayModel, Eye, IICamera, IIPicture, disparity_of_depth
from ii_core.camera import glass, optics, prescriptions, surfaces
from ii_core.camera.maps import read_maps, write_maps
from ii_core.design import design, properties
from ii_core.display.lenticular import lenticular
from ii_core.formats.find import find_views
from ii_core.formats.lytro import RawColour
from ii_core.waves import spread, spread_files, wave
from metrics import observers
from metrics.observers import simulated
from metrics.plots import opinion_chart
from raytrace_ii import Body, Light, Material, Scene

PACKAGES = (ii_core, codec, metrics, raytrace_ii, observers)
# Modules with a page of the API, besides the packages.
MODULES = (wave, spread, spread_files, optics, surfaces, glass, prescriptions, simulated, opinion_chart)
# Functions of modules without a page.
MORE = (
    lenticular, design.solve, properties.properties, properties.view_angle_deg, properties.image_plane_mm,
    properties.depth_range_mm, header_bits.parts, header_bits.floor, header_bits.coarsest,
)  # fmt: skip
# Classes that nobody makes: results, bases, errors, elements without values. Functions that get checked elements.
UNTRIED = {
    "chain", "placed", "scaled_chain", "surfaces_of", "unit_disk",
    "AccessCost", "AngleQuality", "Audit", "Calibration", "Camera", "Coder", "CodingResult", "DamagedTake",
    "DecodedView", "DepthEstimate", "DepthQuality", "EmbeddedViewer", "EyeImage", "FocusDepth",
    "Goal", "Grin", "Judged", "Lenticular",
    "MapCamera", "NoLenses", "Observer", "OpinionScores", "PairScale", "PanelDesign", "Paraxial", "Pinhole",
    "Prediction", "Prescription", "Report", "Results", "Retargeted", "Rig", "Run", "Shot",
    "SpreadMaps", "Stage", "Stats", "Take", "TakeFloor", "TakeQuality", "Verdict", "ViewQuality", "ViewingZone",
}  # fmt: skip
CAMERA = IICamera(pixels=(48, 48), lenses=(12, 12), pixel_pitch_mm=0.1, gap_mm=1.5)
PIXELS = np.random.default_rng(0).integers(0, 256, (48, 48, 3), np.uint8)
PICTURE = IIPicture(PIXELS, (12, 12), (4, 4), CAMERA)
DEPTH = np.full((48, 48), 15.0)
LOW, HIGH = sorted(map(float, disparity_of_depth(CAMERA, [10.0, 100.0])))
FRONT, CURVE = (0.0, 0.0, -150.0), [1.0, 2.0, 3.0, 4.0]
SCORES = [[1.0, 2.0], [3.0, 4.0]]
# In place of defaults that take long, or leave a part of the function out.
INSTEAD: dict[str, Any] = {
    "depth": DEPTH, "mask": np.ones((48, 48), bool), "layers_mm": [10.0, 20.0], "count": 3, "workers": 1, "rays": 1,
    "viewpoints": {"front": FRONT}, "viewpoints_mm": [FRONT], "max_pixels": 10000, "wavelengths_nm": (610, 550, 465),
}  # fmt: skip
SCENE = """
max_depth = 1
[animation]
frames = 2
track = [{of = ["object.ball"], key = "radius_mm", frames = [0, 1], values = [[3.0], [4.0]]}]
[material.matt]
colour = "#ffffff"
[[light]]
kind = "point"
position_mm = [0, 0, 0]
colour = "#ffffff"
[[object]]
name = "ball"
shape = "sphere"
radius_mm = 3
segments = 8
position_mm = [0, 0, 20]
material = "matt"
"""
Values = dict[str, Any]


class Call(NamedTuple):
    """A function, and good values of its arguments."""

    function: Callable[..., Any]
    good: Mapping[str, Any]


def calls(folder: Path) -> dict[str, Call]:
    """Return the calls by name; files are in a folder."""
    made = Made(folder)
    own = {**of_pictures(made), **of_lenses(made), **of_coding(made), **of_measures(made), **of_scenes(made)}
    functions = {name: function for name, function in public() if name not in UNTRIED}
    functions |= {function.__name__: function for function in MORE}
    named = {name: filled(function, own.get(name, {}), made) for name, function in functions.items()}
    others = {name: filled(function, values, made) for name, (function, values) in again(made).items()}
    return named | others


def public() -> Iterator[tuple[str, Any]]:
    """Yield name and object of each public function and class: those of the packages, and of the pages of the API."""
    for package in PACKAGES:
        yield from ((name, getattr(package, name)) for name in package.__all__ if callable(getattr(package, name)))
    for module in MODULES:
        for name, found in vars(module).items():
            own = not name.startswith("_") and getattr(found, "__module__", "") == module.__name__
            if own and (inspect.isfunction(found) or inspect.isclass(found)):
                yield name, found


def filled(function: Callable[..., Any], own: Values, made: Made) -> Call:
    """Return a call with values for all arguments; an argument without one has `inspect.Parameter.empty`."""
    good = dict(own)
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind is parameter.VAR_KEYWORD or name in own or name.startswith("_"):
            continue
        if parameter.default is parameter.empty:
            good[name] = made.by_name.get(name, parameter.empty)
        elif not isinstance(parameter.default, type) and "factory" not in repr(parameter.default):
            good[name] = INSTEAD.get(name, parameter.default)
    return Call(function, good)


def untried(named: Mapping[str, Call]) -> list[str]:
    """Return the functions and their arguments without a value."""
    empty = inspect.Parameter.empty
    return [f"{name}({a})" for name, call in named.items() for a, value in call.good.items() if value is empty]


class Made:
    """Objects and files that calls need.

    Parameters
    ----------
    folder : Path
        Of the files.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("views", "answers", "out"):
            (folder / name).mkdir()
        ii_core.write_views(PICTURE, folder / "views")
        write_maps([CAMERA], folder / "maps")
        PICTURE.save(folder / "picture.png")
        (folder / "moving.toml").write_text(SCENE, encoding="utf-8")
        self.take = raytrace_ii.load_take(folder / "moving.toml")
        self.video, self.plan = ii_core.video_of([PICTURE, PICTURE]), codec.Plan(span=2)
        self.coded = codec.encode(PICTURE, "si-h264", qp=40)
        self.light_field = codec.encode(PICTURE, "si-lf", quality=30)
        self.coded_take = codec.encode_take(self.video, "si-h264", qp=40, plan=self.plan)
        self.coded_take.save(folder / "take.ii")
        self.maps = spread.spread_maps(CAMERA, 50.0)
        self.written = write_maps([CAMERA], folder / "spread")
        spread_files.write_spread([self.maps], self.written)
        self.point = {
            "scheme": "x", "options": {}, "target_bpp": 1.0, "bpp": 1.0, "reached": True, "q_global": 30.0,
            "encode_seconds": 1.0, "decode_seconds": 1.0, "nbytes": 8,
            "q_depth": [1.0], "depth_mm": [5.0], "q_depth_min": 1.0, "q_depth_mean": 1.0, "q_depth_max": 1.0,
        }  # fmt: skip
        self.study = {"picture": {"name": "x"}, "points": [self.point]}
        metrics.write_study(folder / "study.json", "x", [self.point], picture=PICTURE)
        corners, faces = np.array([[-5.0, -5, 20], [5, -5, 20], [0, 5, 20]]), np.array([[0, 1, 2]])
        self.body = {"name": "a", "vertices": corners, "faces": faces, "material": Material(), "normals": -np.eye(3),
                     "texture_coordinates": np.zeros((3, 3))}  # fmt: skip
        lamp = Light(kind="point", vector=(0, 0, 0), colour=(1, 1, 1))
        self.scene = Scene(bodies=[Body(**self.body)], lights=[lamp], max_depth=3, name="a")
        self.observe()
        self.by_name = self.values()

    def observe(self) -> None:
        """Make a test with observers and simulated answers."""
        self.stimuli = [
            observers.Stimulus(
                scene="a", name=str(i), picture=PICTURE, reference=i == 0, measures={"q_global": 20.0 + i}
            )
            for i in range(6)
        ]
        self.options = observers.Options(show="front", frames=2, observers=2, training=1)
        self.test = observers.write_test(self.folder / "test.html", self.stimuli, self.options)
        self.ranks = [5.0, 4.0, 3.0, 2.5, 2.0, 1.0]
        self.answers = simulated.write_simulated(self.folder / "answers", self.test, self.ranks, 3)
        self.results = observers.read_results(self.answers)
        self.verdict = observers.verdict(self.results)

    def values(self) -> Values:
        """Return good values by the name of the argument."""
        return {
            "picture": PICTURE, "reference": PICTURE, "decoded": PICTURE, "camera": CAMERA, "pixels": PIXELS,
            "lenses": (12, 12), "ei_pixels": (4, 4), "kind": "si", "name": "a", "viewpoint_mm": FRONT, "z_mm": 10.0,
            "depth_mm": 10.0, "display": DisplayModel(camera=CAMERA), "eye": Eye(position_mm=(0.0, 0.0, -300.0)),
            "path": self.folder / "out.png", "folder": self.folder / "out", "scheme": "si-h264", "coded": self.coded,
            "plan": self.plan, "views": 16, "instants": 2, "video": self.video, "place": (0, 0),
            "index": 0, "cameras": [CAMERA], "pictures": [PICTURE, PICTURE], "study": self.study,
            "scores": SCORES, "wins": SCORES,
            "rates_a": CURVE, "quality_a": CURVE, "rates_b": CURVE, "quality_b": CURVE,
            "quality": metrics.q_depth(PICTURE, PICTURE, depth=DEPTH), "records": [self.point], "schemes": ["x"],
            "encode": _encode, "decode": lambda coded: PICTURE, "scene": self.scene, "take": self.take,
            "x": np.linspace(-1.0, 1.0, 65), "intensity": np.ones(65), "width_mm": 0.1, "gap_mm": 0.2,
            "wavelength_nm": 550.0, "results": self.results, "made": self.verdict, "maps": self.maps,
            "data": CAMERA.to_json(),
            "colour": (1, 1, 1), "pixel_pitch_mm": 0.1, "lens_pitch_mm": 1.0, "source": self.folder / "views",
        }  # fmt: skip


def _encode(picture: IIPicture, scheme: str, bpp: float) -> Any:
    """Act as a coder without work, so that a study takes no time."""
    return SimpleNamespace(bpp=bpp, nbytes=1, encode_seconds=0.0, reached=True)


def of_pictures(made: Made) -> dict[str, Values]:
    """Values of `ii_core`, with raw pictures and displays."""
    x, y = np.meshgrid(np.arange(126) + 0.5, np.arange(108) + 0.5)
    raw = (1000 * np.sin(x * np.pi / 9.3) ** 2 * np.sin(y * np.pi / 9.3) ** 2).astype(np.uint16)
    frames = {"raw": raw, "white": raw, "dark": np.zeros_like(raw), "mosaic": "rggb"}
    calibration = ii_core.calibrate(raw, white=raw)
    calibrated = ii_core.calibrated_picture(calibration, raw)
    return {
        "IICamera": {"pixels": (4, 4), "lenses": (2, 2), "gap_mm": 1.0, "lens_pitch_mm": 0.2, "lattice": "hexagonal",
            "optics": ("pinhole",)},
        "IIPicture": {"camera": CAMERA},
        "IIVideo": {"frames": 2, "fps": 24.0, "source": made.video.source, "structure": PICTURE},
        "picture_pixels": {"stack": ii_core.sub_images(PICTURE)},
        "load_mosaic": {"path": made.folder / "picture.png"},
        "picture_of": {"views": find_views(made.folder / "views"), "transposed": False, "flip_down": False,
            "flip_across": False},
        "read_maps": {"folder": made.folder / "maps"},
        "preset": {"name": "setup1", "scale": 8},
        "preset_cameras": {"name": "setup1", "scale": 8},
        "projection_camera": {"across": 10},
        "resampled": {"ei_pixels": (4, 4)},
        "camera_pose": {"at_mm": (0, 0, -9), "look_at_mm": (0, 0, 0)},
        "depth_of_disparity": {"disparity": 0.5},
        "panel_display": {"size_mm": (300.0, 200.0), "pixels": (3000, 2000), "viewer_mm": 600.0,
            "view_angle_deg": 20.0},
        "write_quilt": {"row": 0},
        "open_video": {"source": made.video.save(made.folder / "video"), "fps": 24.0},
        "lenticular": {"size": (48, 48), "pitch_px": 4.0, "slope": 0.1, "views": 4, "depth_mm": 10.0},
        "solve": {"lens_pitch_mm": 1.0, "gap_mm": 1.0, "pixel_pitch_mm": 0.1},
        "image_plane_mm": {"focal_mm": 2.0, "gap_mm": 1.0},
        "depth_range_mm": {"gap_mm": 1.0, "z_mm": 9.0},
        "calibrate": {**frames, "lattice": "rectangular", "pixel_pitch_mm": 0.01, "gap_mm": 0.2},
        "calibrated_picture": {**frames, "calibration": calibration, "full_scale": 250.0,
            "colour": RawColour((1.2, 1.0, 1.5), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))},
        "defective_pixels": {"white": raw, "dark": frames["dark"], "mosaic": "rggb", "calibration": calibration},
        "centres_picture": {"calibration": calibration, "picture": calibrated},
        "estimate_depth": {"view": (1, 1), "low": -0.5, "high": 0.5},
        "focused": {"disparity": 0.5, "weights": np.ones((4, 4)), "view": (1, 1), "limit": 0.5},
        "retarget": {"disparity": np.full((4, 4, 12, 12), -0.1)},
        "plane_disparity": {"view": (1, 1)},
        "pupil_weights": {"views": (4, 4)},
        "DisplayModel": {"lens_pitch_mm": 0.4, "gap_mm": 1.5},
        "Eye": {"position_mm": (0.0, 0.0, -300.0), "pupil_mm": 3.0, "focus_mm": 300.0},
        "eye_image": {"size": (12, 12)},
        "viewing_zone": {"distance_mm": 300.0},
        "crosstalk": {"pupil_mm": 3.0, "border_mm": 1.0},
    }  # fmt: skip


def of_lenses(made: Made) -> dict[str, Values]:
    """Values of waves, point-spread functions, glasses and elements."""
    near = {"focal_mm": 0.2, "depth_mm": 20.0}
    lens = next(iter(prescriptions.lens_names()))
    return {
        "angular_spectrum": {"field": np.ones(64), "step_mm": 0.001, "wavelength_mm": 5e-4, "distance_mm": 1.0},
        "lens_spread": near,
        "defocus_mm": near,
        "model_spread": near,
        "pixel_kernel": {"pixel_mm": 0.1, "reach": 3},
        "lens_blurred": {"depth_mm": 20.0},
        "spread_maps": {"depth_mm": 50.0, "focal_mm": 1.5},
        "spread_files": {"count": 1},
        "write_spread": {"maps": [made.maps], "folder": made.written, "format": "exr"},
        "read_spread": {"folder": made.written},
        "Lenslet": {"focal_mm": 1.5, "aperture_mm": 0.4},
        "SphericalLenslet": {"radius_mm": 0.8, "ior": 1.52, "aperture_mm": 0.4},
        "Lens": {"focal_mm": 50.0, "diameter_mm": 20.0},
        "element": {"data": {"kind": "lens", "z_mm": 10.0, "focal_mm": 50.0}},
        "Surface": {"radius_mm": 50.0, "thickness_mm": 2.0, "glass": "N-BK7", "diameter_mm": 20.0},
        "Surfaces": {"surfaces": prescriptions.lens(lens).at(10.0).surfaces, "wavelengths_nm": None},
        "Glass": {"ior": 1.5, "abbe": 60.0, "name": "a"},
        "glass": {"value": "N-BK7"},
        "known_glass": {"name": "N-BK7"},
        "CatalogueGlass": {"maker": "a", "glass": glass.Glass(ior=1.5), "ior": 1.5, "abbe": 60.0},
        "lens": {"name": lens},
    }  # fmt: skip


def of_coding(made: Made) -> dict[str, Values]:
    """Values of `codec`."""
    axis = {"low": 0.0, "high": 50.0, "start": 20.0, "octave": 6.0, "step": 1.0, "runs": 3}
    stored = {name: getattr(made.coded, name) for name in ("scheme", "options", "payload", "structure")}
    return {
        "encode": {"bpp": 1.0},
        "decode_levels": {"coded": made.light_field},
        "decode_view": {"coded": made.light_field},
        "extract": {"path": made.folder / "x.mkv"},
        "options": {"scheme": "jpeg"},
        "parse_scheme": {"scheme": "jpeg"},
        "analyse_orders": {"kinds": ("si",), "orders": ("row",)},
        "register": {"coder": None},
        "meet_size": {"encode_at": lambda setting: codec.Run(b"x" * int(1000 / (setting + 1)), 0.0), "target": 100.0,
            "axis": codec.Axis(**axis)},
        "Axis": axis,
        "Option": {"about": "a", "default": 1, "high": 2},
        "Encoded": {**stored, "qp": 40, "runs": 1, "encode_seconds": 1.0, "codec_seconds": 1.0, "versions": {}},
        "Plan": {"span": 2, "group": 4, "strip": 2},
        "view_cost": {"needed": [0, 3]},
        "encode_take": {"qp": 40, "plan": made.plan, "path": made.folder / "take.ii"},
        "open_take": {"coded": made.coded_take},
        "is_take": {"path": made.folder / "take.ii"},
        "EncodedTake": {name: getattr(made.coded_take, name) for name in codec.EncodedTake.__dataclass_fields__},
        "take_floor": {"lenses": (8, 8), "ei_pixels": (2, 2), "frames": 2, "plan": made.plan},
    }  # fmt: skip


def of_measures(made: Made) -> dict[str, Values]:
    """Values of `metrics`, with tests of observers; all their answers are simulated."""
    return {
        "depth_from_focus": {"method": "robust", "base": [[0, 0]], "reference": [[0, 0]], "weights": [[1.0]]},
        "disparity_layers": {"low": LOW, "high": HIGH},
        "depth_errors": {"disparity": DEPTH, "truth": DEPTH, "regions": {"all": DEPTH > 0},
            "camera": replace(CAMERA, viewer_mm=300.0)},
        "depth_regions": {"truth": DEPTH, "view": PIXELS},
        "logarithmic_layers": {"near_mm": 1.0, "far_mm": 2.0},
        "covering_layers": {"depth_mm": DEPTH},
        "measuring": {"names": ["q_global"]},
        "Measure": {"compute": lambda pair: 1.0, "value": float, "text": "a", "needs": metrics.Needs()},
        "register_measure": {"measure": None},
        "differences": {"anchor": "x"},
        "mean_differences": {"studies": [made.study], "anchor": "x"},
        "depth_over_rate": {"scheme": "x"},
        "summary_table": {"anchor": "x"},
        "default_rates": {"encode": _encode, "decode": lambda coded: PICTURE},
        "rate_distortion": {"rates": [1.0]},
        "measure_take": {"reference": made.video, "decoded": made.video},
        "time_chart": {"takes": {"a": metrics.measure_take(made.video, made.video)}},
        "write_csv": {"path": made.folder / "a.csv"},
        "write_latex": {"path": made.folder / "a.tex", "rows": [{"a": "b"}], "caption": "a"},
        "write_study": {"path": made.folder / "a.json", "picture_name": "x"},
        "read_study": {"path": made.folder / "study.json"},
        "PointLog": {"path": made.folder / "points.jsonl"},
        "pair_scale": {"model": "thurstone"},
        "predicted_scores": {"measure": [*CURVE, 5.0], "mos": [*CURVE, 6.0], "half_width": [0.1] * 5},
        "simulated_scores": {"quality": CURVE, "observers": 3},
        "simulated_wins": {"scale": CURVE, "comparisons": 3, "model": "thurstone"},
        "Stimulus": {"scene": "a", "scheme": "si-h264", "bpp": 1.0, "measures": {"q_global": 30.0}},
        "Options": {"show": "front", "frames": 2, "observers": 2, "training": 1},
        "write_test": {"path": made.folder / "t.html", "stimuli": made.stimuli, "options": made.options},
        "read_results": {"paths": made.answers},
        "write_simulated": {"folder": made.folder / "answers", "plan": made.test, "quality": made.ranks,
            "observers": 2},
    }  # fmt: skip


def of_scenes(made: Made) -> dict[str, Values]:
    """Values of `raytrace_ii`."""
    options = {"samples": (4, 4), "error": 0.5, "seed": 0, "noise": 0.0, "workers": 1, "executor": None,
               "texture_filter": True}  # fmt: skip
    one = {**options, "dtype": "uint8", "pose": None}
    return {
        "Body": made.body,
        "Light": {"kind": "point", "vector": (0, 0, 0)},
        "Scene": {"bodies": made.scene.bodies, "lights": made.scene.lights, "background": made.scene.background},
        "Fog": {"density_per_mm": 0.1},
        "load_scene": {"name": "cuboid"},
        "rgbd_scene": {"picture": np.zeros((4, 6, 3), np.uint8), "depth": np.ones((4, 6)), "inverse": None},
        "render": {"support": (), **one},
        "render_to": {"picture": made.folder / "r.png", "support": {}, **one},
        "trace": {"locations": [0.0, 0, 0], "directions": [0.0, 0, 1]},
        "load_take": {"name": made.folder / "moving.toml", "fps": 24.0},
        "render_take": {"frames": [0], "support": {}, **options},
    }  # fmt: skip


def again(made: Made) -> dict[str, tuple[Callable[..., Any], Values]]:
    """Methods, and functions called in another way, by name."""
    coded, take, video, folder = made.coded, made.coded_take, made.video, made.folder
    maps, lens = read_maps(folder / "maps")[0], prescriptions.lens(next(iter(prescriptions.lens_names())))
    built = lens.at(10.0)
    block = {"rows": slice(0, 2), "cols": slice(0, 2)}
    two = {"m": 1, "n": 1}
    return {
        "report of a camera": (design.report, {}),
        "IICamera.rays": (CAMERA.rays, block),
        "IICamera.rays_at": (CAMERA.rays_at, two),
        "IICamera.weighted_rays": (CAMERA.weighted_rays, block),
        "IICamera.weighted_rays_at": (CAMERA.weighted_rays_at, two),
        "IICamera.separable_rays": (CAMERA.separable_rays, block),
        "IICamera.from_json": (IICamera.from_json, {}),
        "IIPicture.with_pixels": (PICTURE.with_pixels, {}),
        "IIPicture.check_same_structure": (PICTURE.check_same_structure, {"other": PICTURE}),
        "IIPicture.save": (PICTURE.save, {}),
        "IIPicture.load": (IIPicture.load, {"path": folder / "picture.png"}),
        "IIPicture.from_structure_json": (IIPicture.from_structure_json, {"data": PICTURE.structure_json()}),
        "MapCamera.rays": (maps.rays, block),
        "MapCamera.stored_rays": (maps.stored_rays, {"sample": 0, **block}),
        "Eye.pair": (Eye(position_mm=(0.0, 0.0, -300.0)).pair, {}),
        "IIVideo.component": (video.component, {"frame": 0}),
        "IIVideo.view": (video.view, {"frame": 0}),
        "IIVideo.save": (video.save, {"folder": folder / "frames"}),
        "IIVideo.write_index": (video.write_index, {"folder": folder / "frames"}),
        "Surfaces.moved": (built.moved, {"by_mm": 1.0}),
        "Surfaces.image_mm": (built.image_mm, {"z_mm": 500.0}),
        "Glass by Sellmeier": (glass.Glass, {"sellmeier": (1.0, 0.2, 1.0, 0.006, 0.02, 100.0), "name": "a"}),
        "Glass.index": (glass.Glass(ior=1.5).index, {}),
        "Prescription.at": (lens.at, {}),
        "encode at a quantiser": (codec.encode, {"qp": 40, "gop": 4, "order": "row"}),
        "encode by quality": (codec.encode, {"scheme": "jpeg", "quality": 40}),
        "Encoded.load": (codec.Encoded.load, {"path": folder / "none.ii"}),
        "Encoded.save": (coded.save, {"path": folder / "c.ii"}),
        "encode_take at a rate": (codec.encode_take, {"bpp": 1.0, "rate": "segment"}),
        "EncodedTake.save": (take.save, {"path": folder / "saved.ii"}),
        "EncodedTake.load": (codec.EncodedTake.load, {"path": folder / "take.ii"}),
        "load_take by a clip": (raytrace_ii.load_take, {"name": folder / "moving.toml"}),
        "Take.scene_at": (made.take.scene_at, {"seconds": 0.0}),
        "Take.pose_at": (made.take.pose_at, {"seconds": 0.0}),
        "Scene.with_depth": (made.scene.with_depth, {"max_depth": 2}),
        "Verdict.with_measure": (made.verdict.with_measure, {"measure": "q_global"}),
    }  # fmt: skip
