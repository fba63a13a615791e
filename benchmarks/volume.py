"""What the volume gains: SI-PVI against sub-images coded apart, JPEG 2000 on the plain picture and SI-PVS.

    python -m benchmarks.volume [--scale 4] [--scenes apples cuboid]

Rates against the dissertation's video setting (x264 IPPP, 4:2:0, constant quantiser, parallel order) are Bjøntegaard
differences by RGB PSNR, over the qualities that both curves reach. Goes to ``benchmarks/results/volume.json`` and
into the tables of ``docs/volume.md``.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

import numpy as np

from codec import decode, encode
from codec.bitstream.jpeg2000 import decode_planes, encode_planes, whole_codestream
from codec.frames import layout
from ii_core import IIPicture, component_images, preset
from ii_core.files import write_json
from metrics import bd_rate, provenance, q_global
from raytrace_ii import load_scene, render

RESULTS = Path(__file__).parent / "results"
DOCS = Path(__file__).parents[1] / "docs" / "volume.md"
ANCHOR = "si-h264:rate=cq,chroma=420"
# Settings by scheme: PSNR in dB, or quantisers.
CURVES: dict[str, list[dict[str, Any]]] = {
    ANCHOR: [{"qp": qp} for qp in (20, 29, 38, 47)],
    "si-jp3d": [{"quality": q} for q in (17, 22, 27, 33)],
    "si-sperr": [{"quality": q} for q in (17, 22, 27, 33)],
    "si-jp3d:wavelet=53": [{"quality": q} for q in (17, 22, 27, 33)],
    "si-jp3d:order=row": [{"quality": q} for q in (17, 22, 27, 33)],
    "si-jpeg2000": [{"quality": q} for q in (17, 22, 27, 33)],
    "ri-jp3d": [{"quality": q} for q in (17, 22, 27, 33)],
    "ei-jp3d": [{"quality": q} for q in (17, 22, 27, 33)],
    "jpeg2000": [{"bpp": r} for r in (0.05, 0.3, 1.0, 4.0)],
    "htj2k": [{"qp": qp} for qp in (20, 29, 38, 47)],
    "jpeg": [{"quality": q} for q in (2, 10, 40, 85)],
    "jpegxl:fast": [{"quality": q} for q in (5, 20, 50, 85)],
}
LOSSLESS = ("si-jp3d", "si-jp3d:levels=1", "ri-jp3d", "ei-jp3d", "si-jpeg2000", "htj2k", "jpegxl:fast", "si-ffv1")


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scale", type=int, default=4)
    parser.add_argument("--scenes", nargs="+", default=["apples", "cuboid"])
    arguments = parser.parse_args()
    scenes = {}
    for name in arguments.scenes:
        picture = render(load_scene(name), preset("setup1", scale=arguments.scale), noise=1.0, support=()).picture
        scenes[name] = {"size": picture.size, "curves": curves(picture), "lossless_bpp": lossless(picture)}
        scenes[name]["apart"] = apart(picture)
        for row in rows(name, scenes[name]):
            print(row, flush=True)
    record = {**provenance(), "anchor": ANCHOR, "scale": arguments.scale, "scenes": scenes}
    RESULTS.mkdir(exist_ok=True)
    write_json(RESULTS / "volume.json", record)
    fill(scenes)


def curves(picture: IIPicture) -> dict[str, list[tuple[float, float]]]:
    """(bpp, RGB PSNR) of each scheme."""
    found: dict[str, list[tuple[float, float]]] = {}
    for scheme, settings in CURVES.items():
        found[scheme] = []
        for setting in settings:
            coded = encode(picture, scheme, **setting)
            found[scheme].append((coded.bpp, q_global(picture, decode(coded))))
    return found


def lossless(picture: IIPicture) -> dict[str, float]:
    """Bits per pixel to the bit."""
    found = {}
    for name in LOSSLESS:
        coded = encode(
            picture,
            name if name.endswith("ffv1") else f"{name}:lossless=1" if ":" not in name else f"{name},lossless=1",
        )
        assert np.array_equal(decode(coded).pixels, picture.pixels), name
        found[name] = coded.bpp
    return found


def apart(picture: IIPicture, squared_error: float = 10.0) -> dict[str, float]:
    """What one codestream for all sub-images saves against one for each at the same squared error."""
    shape = layout(picture.lenses, picture.ei_pixels, "si")
    stack = component_images(picture, "si").reshape(shape.frames, shape.height, shape.width, 3)
    planes = np.ascontiguousarray(np.moveaxis((stack.astype(np.int16) - 128) * 4, -1, 1))
    size, head, error = 0, 0, 0.0
    for slices in planes:
        stream = encode_planes(slices, 16 * squared_error, wavelet="9/7")
        whole = whole_codestream(stream, slices.shape, "int16", wavelet="9/7", lossless=False)
        size += len(whole)
        head += whole.index(b"\xff\x93")  # all before the data
        back = decode_planes(stream, slices.shape, "int16", wavelet="9/7", lossless=False)
        error += float(np.mean((back.astype(float) - slices) ** 2)) / len(planes) / 16
    together = planes.reshape(-1, shape.height, shape.width)
    stream = encode_planes(together, 16 * error, wavelet="9/7")
    pixels = picture.size[0] * picture.size[1]
    return {
        "apart_bpp": 8 * size / pixels,
        "headers_bpp": 8 * head / pixels,
        "together_bpp": 8 * len(stream) / pixels,
    }


def rows(name: str, scene: dict[str, Any]) -> list[str]:
    """The scene's lines of the table."""
    anchor = list(zip(*scene["curves"][ANCHOR], strict=True))
    lines = []
    for scheme, points in scene["curves"].items():
        curve = list(zip(*points, strict=True))
        try:
            gain = f"{bd_rate(*anchor, *curve):+.0f} %"
        except ValueError:
            gain = "no overlap"
        low, high = points[0], points[-1]
        if low[0] > high[0]:
            low, high = high, low
        spans = f"{low[0]:.3f}–{high[0]:.2f} | {low[1]:.1f}–{high[1]:.1f}"
        exact = scene["lossless_bpp"].get(scheme)
        lines.append(f"| {name} | `{scheme}` | {gain} | {spans} | {'' if exact is None else f'{exact:.2f}'} |")
    return lines


def fill(scenes: dict[str, Any]) -> None:
    """Put the figures between the marks of the page."""
    table = ["| scene | scheme | rate | bpp | dB | lossless, bpp |", "|---|---|---|---|---|---|"]
    for name, scene in scenes.items():
        table += rows(name, scene)
    apart_table = ["| scene | a stream each, bpp | of it headers | one stream, bpp |", "|---|---|---|---|"]
    for name, scene in scenes.items():
        a = scene["apart"]
        apart_table.append(
            f"| {name} | {a['apart_bpp']:.3f} | {a['headers_bpp']:.3f} | {a['together_bpp']:.3f} "
            f"({100 * (a['together_bpp'] / a['apart_bpp'] - 1):+.1f} %) |"
        )
    text = DOCS.read_text()
    for mark, lines in (("rates", table), ("apart", apart_table)):
        block = f"<!-- {mark} -->\n\n" + "\n".join(lines) + f"\n\n<!-- /{mark} -->"
        text = re.sub(rf"<!-- {mark} -->.*?<!-- /{mark} -->", lambda _, block=block: block, text, flags=re.DOTALL)
    DOCS.write_text(text)


if __name__ == "__main__":
    main()
