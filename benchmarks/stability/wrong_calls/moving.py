"""Good calls of functions on takes, in all packages."""

from __future__ import annotations

from pathlib import Path

import codec
import ii_core
import metrics
import raytrace_ii
from ii_core import IIVideo

from .good import CAMERA, FRONT, PICTURE, Call

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


def take_calls(folder: Path) -> dict[str, Call]:
    """Return a good call of each function of takes by name; files are in a folder."""
    scene = folder / "moving.toml"
    scene.write_text(SCENE, encoding="utf-8")
    moving = raytrace_ii.load_take(scene)
    video = ii_core.video_of([PICTURE, PICTURE])
    plan = codec.Plan(span=2)
    coded = codec.encode_take(video, "si-h264", qp=40, plan=plan)
    quality = metrics.measure_take(video, video)
    coded.save(folder / "take.ii")
    fields = {name: getattr(coded, name) for name in codec.EncodedTake.__dataclass_fields__}
    options = {"samples": 1, "error": 0.5, "seed": 0, "noise": 0.0, "texture_filter": True, "workers": 1,
               "executor": None}  # fmt: skip
    named = {
        "IIVideo": (IIVideo, {"frames": 2, "fps": 24.0, "source": video.source, "structure": PICTURE, "poses": None}),
        "IIVideo.component": (video.component, {"frame": 0, "kind": "si", "place": (0, 0)}),
        "IIVideo.view": (video.view, {"frame": 0, "viewpoint_mm": FRONT, "interpolation": "linear"}),
        "IIVideo.save": (video.save, {"folder": folder / "frames", "progress": None}),
        "IIVideo.write_index": (video.write_index, {"folder": folder / "frames"}),
        "video_of": (ii_core.video_of, {"pictures": [PICTURE, PICTURE], "fps": 24.0}),
        "open_video": (ii_core.open_video, {"source": video.save(folder / "video"), "fps": 24.0}),
        "write_view_folders": (ii_core.write_view_folders, {"video": video, "folder": folder / "films",
            "progress": None}),
        "Plan": (codec.Plan, {"walk": "view-first", "span": 2, "group": 4, "strip": 2}),
        "component_cost": (codec.component_cost, {"plan": plan, "views": 16, "instants": 2}),
        "light_field_cost": (codec.light_field_cost, {"plan": plan, "ei_pixels": (2, 2), "instants": 2}),
        "view_cost": (codec.view_cost, {"plan": plan, "views": 16, "instants": 2, "needed": [0, 3]}),
        "encode_take": (codec.encode_take, {"video": video, "scheme": "si-h264", "qp": 40, "plan": plan,
            "rate": "take", "path": folder / "take.ii", "progress": None}),
        "encode_take at a rate": (codec.encode_take, {"video": video, "scheme": "si-h264", "bpp": 1.0,
            "rate": "segment"}),
        "open_take": (codec.open_take, {"coded": coded, "partial": False, "max_pixels": 10000}),
        "is_take": (codec.is_take, {"path": folder / "take.ii"}),
        "EncodedTake": (codec.EncodedTake, fields),
        "EncodedTake.save": (coded.save, {"path": folder / "saved.ii"}),
        "EncodedTake.load": (codec.EncodedTake.load, {"path": folder / "take.ii", "partial": False}),
        "codes_takes": (codec.codes_takes, {"scheme": "si-h264"}),
        "take_floor": (codec.take_floor, {"scheme": "si-h264", "lenses": (8, 8), "ei_pixels": (2, 2), "frames": 2,
            "plan": plan}),
        "measure_take": (metrics.measure_take, {"reference": video, "decoded": video, "viewpoints_mm": [FRONT],
            "progress": None}),
        "time_chart": (metrics.time_chart, {"takes": {"a": quality}, "path": folder / "time.png"}),
        "load_take": (raytrace_ii.load_take, {"name": scene, "fps": 24.0}),
        "load_take by a clip": (raytrace_ii.load_take, {"name": scene, "clip": None}),
        "Take.scene_at": (moving.scene_at, {"seconds": 0.0}),
        "Take.pose_at": (moving.pose_at, {"seconds": 0.0}),
        "render_take": (raytrace_ii.render_take, {"take": moving, "folder": folder / "rendered", "camera": CAMERA,
            "frames": [0], "pose": None, "support": {}, "suffix": ".png", "dtype": "uint8", "force": False,
            "progress": None, **options}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}
