"""Quality of decoded II-pictures, rate–distortion studies, and their charts."""

from ii_core.display.view_sheets import plot_pair, plot_views

from .against_anchor import differences, mean_differences
from .angle import q_angle_ssim, q_angle_ycbcr
from .batch import measuring
from .builtin_measures import MEASURES
from .ctc import q_ctc_psnr, q_ctc_ssim
from .depth.focus import FocusDepth, depth_from_focus
from .depth.layers import covering_layers, disparity_layers, linear_layers, logarithmic_layers
from .depth.q_depth import q_depth
from .global_angle import angle_axes, mean_q_angle, q_angle, q_global
from .measure import Measure, Needs, known_measures, register_measure
from .over_time import TakeQuality, measure_take
from .pair import PicturePair
from .plots.angle_depth import plot_depth
from .plots.depth_chart import depth_over_rate, depth_rate_chart
from .plots.error_maps import plot_error_layers
from .plots.rd_chart import rd_chart
from .plots.tables import summary_table, write_csv, write_latex
from .plots.time_chart import time_chart
from .point_log import PointLog
from .quality import AngleQuality, DepthQuality, ViewQuality
from .quality_report import Report, quality_rows, report
from .rd import bd_psnr, bd_rate, default_rates, rate_distortion
from .sheets import PLOTS, plot_all, plot_angle, plot_error_views
from .study import provenance, read_study, write_study
from .subjective import (
    OpinionScores,
    PairScale,
    Prediction,
    opinion_scores,
    pair_scale,
    predicted_scores,
    screened_observers,
    simulated_scores,
    simulated_wins,
)
from .view import error_map, q_view

__all__ = [
    "MEASURES",
    "PLOTS",
    "AngleQuality",
    "DepthQuality",
    "FocusDepth",
    "Measure",
    "Needs",
    "OpinionScores",
    "PairScale",
    "PicturePair",
    "PointLog",
    "Prediction",
    "Report",
    "TakeQuality",
    "ViewQuality",
    "angle_axes",
    "bd_psnr",
    "bd_rate",
    "covering_layers",
    "default_rates",
    "depth_from_focus",
    "depth_over_rate",
    "depth_rate_chart",
    "differences",
    "disparity_layers",
    "error_map",
    "known_measures",
    "linear_layers",
    "logarithmic_layers",
    "mean_differences",
    "mean_q_angle",
    "measure_take",
    "measuring",
    "opinion_scores",
    "pair_scale",
    "plot_all",
    "plot_angle",
    "plot_depth",
    "plot_error_layers",
    "plot_error_views",
    "plot_pair",
    "plot_views",
    "predicted_scores",
    "provenance",
    "q_angle",
    "q_angle_ssim",
    "q_angle_ycbcr",
    "q_ctc_psnr",
    "q_ctc_ssim",
    "q_depth",
    "q_global",
    "q_view",
    "quality_rows",
    "rate_distortion",
    "rd_chart",
    "read_study",
    "register_measure",
    "report",
    "screened_observers",
    "simulated_scores",
    "simulated_wins",
    "summary_table",
    "time_chart",
    "write_csv",
    "write_latex",
    "write_study",
]
