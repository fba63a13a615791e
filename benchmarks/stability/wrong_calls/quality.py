"""Good calls of `metrics`."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import metrics
from ii_core import IIPicture

from .good import CAMERA, CURVE, DEPTH, FRONT, HIGH, LOW, MASK, PAIR, PICTURE, Call

SCORES = [[1.0, 2.0], [3.0, 4.0]]


def encode(picture: IIPicture, scheme: str, bpp: float) -> Any:
    """Act as a coder without work, so that a study takes no time."""
    return SimpleNamespace(bpp=bpp, nbytes=1, encode_seconds=0.0, reached=True)


def metrics_calls(folder: Path) -> dict[str, Call]:
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
        "q_ctc_psnr": (m.q_ctc_psnr, {**PAIR, "structure": None}),
        "q_ctc_ssim": (m.q_ctc_ssim, {**PAIR, "structure": None}),
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
        "opinion_scores": (m.opinion_scores, {"scores": SCORES, "confidence": 0.95}),
        "screened_observers": (m.screened_observers, {"scores": SCORES}),
        "pair_scale": (m.pair_scale, {"wins": SCORES, "model": "thurstone", "confidence": 0.95}),
        "predicted_scores": (m.predicted_scores, {"measure": [*CURVE, 5.0], "mos": [*CURVE, 6.0],
            "half_width": [0.1] * 5}),
        "simulated_scores": (m.simulated_scores, {"quality": CURVE, "observers": 3, "bias": 0.5, "spread": 0.7,
            "seed": 0}),
        "simulated_wins": (m.simulated_wins, {"scale": CURVE, "comparisons": 3, "model": "thurstone", "seed": 0}),
    }  # fmt: skip
    return {name: Call(*call) for name, call in named.items()}
