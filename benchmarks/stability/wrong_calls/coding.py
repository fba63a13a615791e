"""Good calls of `codec`."""

from __future__ import annotations

from pathlib import Path

import codec
from codec.inspect.header_bits import coarsest, floor, parts

from .good import PICTURE, Call


def codec_calls(folder: Path) -> dict[str, Call]:
    coded = codec.encode(PICTURE, "si-h264", qp=40)
    fields = dict(scheme=coded.scheme, options=coded.options, payload=coded.payload, structure=coded.structure,
                  dtype="uint8", target_bpp=None, qp=40, quality=None, reached=True, runs=1, encode_seconds=1.0,
                  codec_seconds=1.0, versions={})  # fmt: skip
    light_field = codec.encode(PICTURE, "si-lf", quality=30)
    axis = {"low": 0.0, "high": 50.0, "start": 20.0, "octave": 6.0, "step": 1.0, "overshoot": 0.1, "runs": 3}

    def encode_at(setting: float) -> codec.Run:
        return codec.Run(b"x" * int(1000 / (setting + 1)), 0.0)

    named = {
        "encode": (codec.encode, {"picture": PICTURE, "scheme": "si-h264", "bpp": 1.0, "progress": None}),
        "encode at a quantiser": (codec.encode, {"picture": PICTURE, "scheme": "si-h264", "qp": 40}),
        "encode with options": (codec.encode, {"picture": PICTURE, "scheme": "si-h264", "qp": 40, "gop": 4,
            "order": "row"}),
        "encode by quality": (codec.encode, {"picture": PICTURE, "scheme": "jpeg", "quality": 40}),
        "decode": (codec.decode, {"coded": coded, "max_pixels": 10000, "progress": None}),
        "timed_decode": (codec.timed_decode, {"coded": coded, "max_pixels": 10000, "progress": None}),
        "decode_frame": (codec.decode_frame, {"coded": coded, "index": 0}),
        "decode_component": (codec.decode_component, {"coded": coded, "place": (0, 0)}),
        "decode_levels": (codec.decode_levels, {"coded": light_field}),
        "decode_view": (codec.decode_view, {"coded": light_field, "place": (0, 0)}),
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
