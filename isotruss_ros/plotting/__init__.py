# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Drawings of robots, grasps and fits with Matplotlib.

Entry points: `plot_robot`, `plot_grasp`, `fit_figure`.
Imports `core`, `calibration` and Matplotlib.
"""

from isotruss_ros.plotting.grasp_drawing import plot_grasp
from isotruss_ros.plotting.robot_drawing import plot_robot

__all__ = ['plot_grasp', 'plot_robot']
