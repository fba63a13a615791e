"""Quality of decoded II-pictures, rate–distortion studies, and their charts."""

from ii_core.depth.focus import FocusDepth, depth_from_focus
from ii_core.depth.layers import covering_layers, disparity_layers, linear_layers, logarithmic_layers
from ii_core.display.view_sheets import plot_pair, plot_views

from .measures.angle import q_angle_ssim, q_angle_ycbcr
from .measures.batch import measuring
from .measures.builtin_measures import MEASURES
from .measures.ctc import q_ctc_psnr, q_ctc_ssim
from .measures.depth_errors import depth_errors, depth_regions
from .measures.global_angle import angle_axes, mean_q_angle, q_angle, q_global
from .measures.measure import Measure, Needs, known_measures, register_measure
from .measures.over_time import TakeQuality, measure_take
from .measures.pair import PicturePair
from .measures.q_depth import q_depth
from .measures.quality import AngleQuality, DepthQuality, ViewQuality
from .measures.view import error_map, q_view
from .observers.subjective import (
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
from .plots.angle_depth import plot_depth
from .plots.depth_chart import depth_over_rate, depth_rate_chart
from .plots.error_maps import plot_error_layers
from .plots.rd_chart import rd_chart
from .plots.tables import summary_table, write_csv, write_latex
from .plots.time_chart import time_chart
from .rates.against_anchor import differences, mean_differences
from .rates.rd import bd_psnr, bd_rate, default_rates, rate_distortion
from .reports.point_log import PointLog
from .reports.quality_report import Report, quality_rows, report
from .reports.sheets import PLOTS, plot_all, plot_angle, plot_error_views
from .reports.study import provenance, read_study, write_study

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
    "depth_errors",
    "depth_from_focus",
    "depth_over_rate",
    "depth_rate_chart",
    "depth_regions",
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
