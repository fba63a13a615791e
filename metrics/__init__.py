"""How much of a picture survives coding: quality, rate–distortion, and charts of it."""

from .angle import AngleQuality, q_angle_ssim, q_angle_ycbcr
from .chart import rd_chart
from .depth import DepthQuality, q_depth
from .focus import FocusDepth, depth_from_focus
from .layers import linear_layers, logarithmic_layers
from .plots import PLOTS, plot_all, plot_angle, plot_depth, plot_pair, plot_views
from .psnr import angle_axes, mean_q_angle, q_angle, q_global
from .rd import bd_psnr, bd_rate, rate_distortion
from .study import provenance, read_study, summary_table, write_csv, write_study
from .view import ViewQuality, q_view

__all__ = [
    "PLOTS",
    "AngleQuality",
    "DepthQuality",
    "FocusDepth",
    "ViewQuality",
    "angle_axes",
    "bd_psnr",
    "bd_rate",
    "depth_from_focus",
    "linear_layers",
    "logarithmic_layers",
    "mean_q_angle",
    "plot_all",
    "plot_angle",
    "plot_depth",
    "plot_pair",
    "plot_views",
    "provenance",
    "q_angle",
    "q_angle_ssim",
    "q_angle_ycbcr",
    "q_depth",
    "q_global",
    "q_view",
    "rate_distortion",
    "rd_chart",
    "read_study",
    "summary_table",
    "write_csv",
    "write_study",
]
