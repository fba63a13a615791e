"""SI-PVI against sub-images coded alone, JPEG 2000 on the II-picture, and SI-PVS.

    python -m benchmarks run volume [--scale 4] [--scenes apples,cuboid]

Rates against the dissertation's video setting (x264 IPPP, 4:2:0, constant quantiser, parallel order) are Bjøntegaard
differences by RGB PSNR, over the qualities that both curves reach. Numbers go to ``benchmarks/results/volume.jsonl``,
the tables to ``docs/volume.md``.
"""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np

from benchmarks.arguments import command_line
from benchmarks.coding.rd import rd_point
from benchmarks.pages.tables import Tables, publish
from benchmarks.records import Records, origin, with_commits
from codec import decode, encode
from codec.bitstream.jpeg2000 import whole_codestream
from codec.coders.planes import decode_planes, encode_planes
from codec.frames import layout
from ii_core import IIPicture, component_images, preset
from metrics import bd_rate
from raytrace_ii import load_scene, render

RECORDS = Records("volume", ("benchmarks.coding.volume", "benchmarks.coding.rd"))
SCALE = 4  # scale on the page
ANCHOR = "si-h264:rate=cq,chroma=420"
# Settings by scheme: PSNR in dB, or quantisers.
CURVES: dict[str, list[dict[str, Any]]] = {
    ANCHOR: [{"qp": qp} for qp in (20, 29, 38, 47)],
    "si-jp3d": [{"quality": q} for q in (17, 22, 27, 33)],
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
    """Measure, print and record."""
    asked = command_line(__doc__, scale=SCALE, scenes=("apples", "cuboid")).parse_args()
    keys = [{"scene": name, "scale": asked.scale} for name in asked.scenes]
    for key in RECORDS.todo(keys, asked.again):
        RECORDS.measure(key, lambda key=key: study(**key))
    print("\n".join(rate_table(RECORDS.rows(scale=asked.scale))))
    publish(tables())


def study(scene: str, scale: int) -> dict[str, Any]:
    """Return all results of one scene."""
    picture = render(load_scene(scene), preset("setup1", scale=scale), noise=1.0, support=()).picture
    return {
        "size": picture.size, "curves": curves(picture), "lossless_bpp": lossless(picture), "apart": apart(picture)
    }  # fmt: skip


def curves(picture: IIPicture) -> dict[str, list[tuple[float, float]]]:
    """Return (bpp, RGB PSNR) of each scheme."""
    found: dict[str, list[tuple[float, float]]] = {}
    for scheme, settings in CURVES.items():
        points = [rd_point(picture, scheme, **setting) for setting in settings]
        found[scheme] = [(point.bpp, point.q_global) for point in points]
    return found


def lossless(picture: IIPicture) -> dict[str, float]:
    """Return the rates of lossless coding, bits per pixel."""
    found = {}
    for name in LOSSLESS:
        exact = name if name.endswith("ffv1") else f"{name}{',' if ':' in name else ':'}lossless=1"
        coded = encode(picture, exact)
        assert np.array_equal(decode(coded).pixels, picture.pixels), name
        found[name] = coded.bpp
    return found


def apart(picture: IIPicture, squared_error: float = 10.0) -> dict[str, float]:
    """Return the saving of one codestream for all sub-images against one for each, at equal squared error."""
    shape = layout(picture.lenses, picture.ei_pixels, "si")
    stack = component_images(picture, "si").reshape(shape.frames, shape.height, shape.width, 3)
    planes = np.ascontiguousarray(np.moveaxis((stack.astype(np.int16) - 128) * 4, -1, 1))
    size, head, error = 0, 0, 0.0
    for slices in planes:
        stream = encode_planes(slices, 16 * squared_error, wavelet="9/7")
        whole = whole_codestream(stream, slices.shape, "int16", wavelet="9/7", lossless=False)
        size += len(whole)
        head += whole.index(b"\xff\x93")  # all headers before the data
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


def cells(scene: dict[str, Any], scheme: str) -> list[str]:
    """Return Bjøntegaard rate, spans of rate and PSNR, and lossless rate of a scheme."""
    points = scene["curves"][scheme]
    anchor, curve = (list(zip(*some, strict=True)) for some in (scene["curves"][ANCHOR], points))
    try:
        gain = f"{bd_rate(*anchor, *curve):+.0f}"
    except ValueError:
        gain = "no overlap"
    low, high = sorted((points[0], points[-1]))
    exact = scene["lossless_bpp"].get(scheme)
    return [
        gain,
        f"{low[0]:.3f}–{high[0]:.2f}",
        f"{low[1]:.1f}–{high[1]:.1f}",
        "" if exact is None else f"{exact:.2f}",
    ]


def rate_table(scenes: list[dict[str, Any]]) -> list[str]:
    """Return a row per scheme, with rates and qualities of each scene."""
    head = " | ".join(f"{scene['scene']}: rate, % | bpp | dB | lossless, bpp" for scene in scenes)
    table = [f"| scheme | {head} |", "|---|" + "---|---|---|---|" * len(scenes)]
    for scheme in dict.fromkeys(scheme for scene in scenes for scheme in scene["curves"]):
        line = [cells(scene, scheme) if scheme in scene["curves"] else [""] * 4 for scene in scenes]
        table.append(f"| `{scheme}` | " + " | ".join(chain(*line)) + " |")
    return with_commits(table, [[scene["commit"] for scene in scenes]] * (len(table) - 2))


def tables() -> Tables:
    """Return the tables of the page."""
    scenes = RECORDS.rows(scale=SCALE)
    apart_table = ["| scene | a stream each, bpp | of it headers | one stream, bpp |", "|---|---|---|---|"]
    for scene in scenes:
        a = scene["apart"]
        apart_table.append(
            f"| {scene['scene']} | {a['apart_bpp']:.3f} | {a['headers_bpp']:.3f} | {a['together_bpp']:.3f} "
            f"({100 * (a['together_bpp'] / a['apart_bpp'] - 1):+.1f} %) |"
        )
    page, told = "docs/volume.md", origin(scenes)
    return {
        (page, "rates"): [told, "", *rate_table(scenes)],
        (page, "apart"): [told, "", *with_commits(apart_table, [[scene["commit"]] for scene in scenes])],
    }


if __name__ == "__main__":
    main()
