"""Wrong arguments of the public functions of ii_core and metrics: errors that name the argument."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import ii_core
import metrics
from ii_core import IICamera, IIPicture


def encode(picture, scheme, bpp):
    return SimpleNamespace(bpp=bpp, nbytes=1, encode_seconds=0.0, reached=True)


CAMERA = IICamera(pixels=(48, 48), lenses=(12, 12), pixel_pitch_mm=0.1, gap_mm=1.5)
PIXELS = np.random.default_rng(0).integers(0, 256, (48, 48, 3), np.uint8)
PICTURE = IIPicture(PIXELS, (12, 12), (4, 4), CAMERA)
DEPTH = np.full((48, 48), 15.0)
QUALITY = metrics.q_depth(PICTURE, PICTURE, depth=DEPTH)
FRONT = (0.0, 0.0, -150.0)
CURVE = [1.0, 2.0, 3.0, 4.0]
POINT = {
    "scheme": "x", "options": {}, "target_bpp": 1.0, "bpp": 1.0, "reached": True, "q_global": 30.0,
    "encode_seconds": 1.0, "decode_seconds": 1.0, "nbytes": 8,
    "q_depth": [1.0], "depth_mm": [5.0], "q_depth_min": 1.0, "q_depth_mean": 1.0, "q_depth_max": 1.0,
}  # fmt: skip
STUDY = {"picture": {"name": "x"}, "points": [POINT]}
PAIR = {"reference": PICTURE, "decoded": PICTURE}
BD = {"rates_a": CURVE, "quality_a": CURVE, "rates_b": CURVE, "quality_b": CURVE}
# Good arguments of every public function; "to" of a path is filled in by the test.
CALLS = {
    "IICamera": {"pixels": (4, 4), "lenses": (2, 2), "pixel_pitch_mm": 0.1, "gap_mm": 1.0, "lens_pitch_mm": 0.2,
                 "lattice": "hexagonal", "lens_offset_mm": (0, 0), "origin_mm": (0, 0, 0)},
    "IIPicture": {"pixels": PIXELS, "lenses": (12, 12), "ei_pixels": (4, 4), "camera": CAMERA},
    "add_sensor_noise": {"picture": PICTURE, "sigma": 1.0, "seed": 0},
    "component_images": {"picture": PICTURE, "kind": "si"},
    "elementary_images": {"picture": PICTURE},
    "sub_images": {"picture": PICTURE},
    "ray_space_images": {"picture": PICTURE},
    "picture_pixels": {"stack": ii_core.sub_images(PICTURE), "kind": "si"},
    "find_views": {"source": "nowhere", "grid": (2, 2)},
    "load_mosaic": {"path": "nowhere", "ei_pixels": (2, 2)},
    "picture_of": {"views": None},
    "write_views": {"picture": PICTURE, "folder": "."},
    "write_hci": {"picture": PICTURE, "folder": ".", "depth": DEPTH},
    "write_quilt": {"picture": PICTURE, "path": "q.png", "row": 0},
    "write_maps": {"folder": ".", "cameras": [CAMERA], "format": "exr"},
    "read_maps": {"folder": "nowhere"},
    "preset": {"name": "setup1", "scale": 8},
    "preset_cameras": {"name": "setup1", "scale": 8},
    "five_viewpoints": {"camera": CAMERA},
    "projection_camera": {"camera": CAMERA, "across": 10},
    "stand_back": {"camera": CAMERA, "plane_mm": 1.0},
    "orthoscopic": {"picture": PICTURE},
    "refocus": {"picture": PICTURE, "depth_mm": 10.0},
    "view_image": {"picture": PICTURE, "viewpoint_mm": FRONT, "interpolation": "linear"},
    "resampled": {"picture": PICTURE, "ei_pixels": (4, 4)},
    "smallest_rectangle": {"picture": PICTURE},
    "from_smallest_rectangle": {"picture": PICTURE, "camera": CAMERA},
    "embed_viewer": {"picture": PICTURE, "height": 300},
    "camera_pose": {"at_mm": (0.0, 0.0, 0.0), "look_at_mm": (0.0, 0.0, 1.0), "up": (0.0, 1.0, 0.0),
                    "turn_deg": (0.0, 0.0, 0.0)},
    "panel_display": {"size_mm": 100.0, "pixels": (320, 160), "lens_pitch_mm": 3.0, "viewer_mm": 500.0,
                      "gap_mm": 5.0, "start_mm": 10.0},
    "q_global": {**PAIR, "mask": np.ones((48, 48), bool)},
    "q_angle": {**PAIR, "mask": np.ones((48, 48), bool)},
    "mean_q_angle": PAIR,
    "q_angle_ycbcr": PAIR,
    "q_angle_ssim": {**PAIR, "scales": 1},
    "q_view": {**PAIR, "viewpoints": {"front": FRONT}, "mask": np.ones((48, 48), bool)},
    "q_depth": {**PAIR, "depth": DEPTH, "layers_mm": [10.0, 20.0], "mask": np.ones((48, 48), bool)},
    "error_map": {**PAIR, "viewpoint_mm": FRONT},
    "depth_from_focus": {"picture": PICTURE, "layers_mm": [10.0, 20.0], "method": "robust", "base": [[0, 0]],
                         "reference": [[0, 0]], "weights": [[1.0]], "interpolation": "linear", "workers": 1},
    "angle_axes": {"camera": CAMERA},
    "linear_layers": {"camera": CAMERA, "count": 3},
    "logarithmic_layers": {"near_mm": 1.0, "far_mm": 2.0, "count": 3},
    "covering_layers": {"camera": CAMERA, "depth_mm": DEPTH, "count": 3},
    "measuring": {"reference": PICTURE, "names": ["q_global"], "method": "robust"},
    "quality_rows": PAIR,
    "report": PAIR,
    "register_measure": {"measure": metrics.MEASURES["q_global"]},
    "bd_rate": BD,
    "bd_psnr": BD,
    "rate_distortion": {"picture": PICTURE, "schemes": ["x"], "rates": [1.0], "encode": encode,
                        "decode": lambda coded: PICTURE,
                        "workers": 1},
    "default_rates": {"picture": PICTURE, "schemes": ["x"], "encode": encode, "decode": lambda coded: PICTURE},
    "differences": {"study": STUDY, "anchor": "x", "measure": "q_global"},
    "mean_differences": {"studies": [STUDY], "anchor": "x", "measure": "q_global"},
    "plot_angle": {**PAIR, "path": "a"},
    "plot_error_views": {**PAIR, "path": "a"},
    "plot_views": {**PAIR, "path": "a"},
    "plot_pair": {"picture": PICTURE, "path": "a"},
    "plot_depth": {"quality": QUALITY, "path": "a"},
    "plot_error_layers": {"reference": PICTURE, "quality": QUALITY, "path": "a"},
    "plot_all": {**PAIR, "quality": QUALITY, "folder": "."},
    "rd_chart": {"study": STUDY, "path": "a.png", "measure": "q_global"},
    "depth_rate_chart": {"study": STUDY, "path": "a.png"},
    "depth_over_rate": {"study": STUDY, "scheme": "x"},
    "summary_table": {"study": STUDY, "measure": "q_global"},
    "write_csv": {"path": "a.csv", "records": [POINT]},
    "write_latex": {"path": "a.tex", "rows": [{"a": "b"}]},
    "write_study": {"path": "a.json", "picture_name": "x", "records": [POINT], "picture": PICTURE},
    "read_study": {"path": "nowhere"},
}  # fmt: skip
ODD = [
    *(None, True, 3, -1, 1.5, float("nan"), 10**400, "text", b"bytes", object(), np.zeros(3)),
    *((), {}, (1, None), ["a", "b"], {1: 2}),
]
NEVER = [value for value in ODD if type(value) in (bytes, object)]  # right for no argument
# What messages call an argument otherwise: a file's kind is refused by its name, a camera and a measure as such.
SAID = {
    "path": "path|text", "folder": "folder|text", "source": "source|text", "name": "name|unknown camera",
    "kind": "kind|component image", "viewpoints": "viewpoint", "names": "names|measure",
}  # fmt: skip


def function(name):
    return getattr(ii_core if hasattr(ii_core, name) else metrics, name)


def takes_long(call, name, value):
    """Whether the value is right after all, and the work long: threads without end."""
    return name == "workers" and isinstance(value, int) and value > 2**64


@pytest.mark.parametrize(("call", "name"), [(call, name) for call, given in CALLS.items() for name in given])
def test_wrong_arguments_are_named(call, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    failed = []
    for value in ODD:
        if takes_long(call, name, value):
            continue
        try:
            function(call)(**CALLS[call] | {name: value})
        except (TypeError, ValueError) as error:
            if not re.search(SAID.get(name, name), str(error)):
                failed.append((value, f"{type(error).__name__}: {error}"))
        except FileNotFoundError:
            assert name in ("path", "folder", "source", "name")  # any text is a path
        except Exception as error:
            failed.append((value, f"{type(error).__name__}: {error}"))
        else:
            if any(value is never for never in NEVER):
                failed.append((value, "taken"))
    assert not failed, "\n".join(f"{value!r:.40}: {said[:120]}" for value, said in failed)
