"""Pictures of docs/metrics.md: the charts that `measure` and `study` write.

    python -m benchmarks run metrics_gallery

*Apples* with sensor noise at a quarter of setup 1's lenses: SI-PVS at 0.15 bit per pixel for the pictures of one
coded picture, three schemes at five rates for Q_depth over rate; true depth. The numbers are kept in
``benchmarks/results/metrics_study.json``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.pages.pictures import write_picture
from benchmarks.records import ROOT
from codec import decode, encode, timed_decode
from ii_core import preset
from ii_core.picture.view import camera_of
from metrics import (
    depth_rate_chart,
    linear_layers,
    measuring,
    plot_angle,
    plot_error_layers,
    plot_error_views,
    plot_views,
    q_depth,
    rate_distortion,
    read_study,
    write_study,
)
from raytrace_ii import load_scene, render

IMAGES, STUDY = ROOT / "docs/images/metrics", ROOT / "benchmarks/results/metrics_study.json"
SCHEMES, RATES = ("si-h264", "ei-h264", "jpeg2000"), (0.08, 0.15, 0.4, 1.0, 2.0)


def main() -> None:
    """Render, code, measure and draw."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    shot = render(load_scene("apples"), preset("setup1", scale=4), noise=1.0, support=("depth",))
    picture, decoded = shot.picture, decode(encode(shot.picture, "si-h264", bpp=0.15))
    plot_angle(picture, decoded, IMAGES / "q_angle.png")
    photograph("views.webp", lambda path: plot_views(picture, decoded, path))
    photograph("errors_views.jpg", lambda path: plot_error_views(picture, decoded, path))
    truth: Any = {"depth": shot.depth, "layers_mm": linear_layers(camera_of(picture))}
    quality = q_depth(picture, decoded, **truth)
    photograph("errors_depth.webp", lambda path: plot_error_layers(picture, quality, path))
    measure = measuring(picture, ["q_depth_min", "q_depth_mean", "q_depth_max", "q_view"], **truth)
    records = rate_distortion(picture, SCHEMES, RATES, encode=encode, decode=timed_decode, measure=measure)
    write_study(STUDY, "Apples", records, {"scale": 4, "noise": 1.0}, picture=picture)
    depth_rate_chart(read_study(STUDY), IMAGES / "q_depth_rate.png")
    for path in sorted(IMAGES.glob("*.png")):
        write_picture(path, path)


def photograph(name: str, draw: Callable[[Path], Any]) -> None:
    """Write a figure that holds photographs."""
    with TemporaryDirectory() as folder:
        drawn = Path(folder) / "figure.png"
        draw(drawn)
        write_picture(IMAGES / name, drawn)
