# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The search for grasps over many robots and objects, on a Dask cluster; no ROS.

Needs `distributed`, the extra `sweep` of this package.
Entry points: `sweep`, `python -m isotruss_ros.cli.sweep`.
Imports `core`.
"""

from isotruss_ros.cli.sweep.evaluation import evaluate, SweepResult
from isotruss_ros.cli.sweep.sweeping import sweep

__all__ = ['SweepResult', 'evaluate', 'sweep']
