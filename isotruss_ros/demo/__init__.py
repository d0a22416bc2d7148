# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Demonstration that runs the nodes and carries an object along the path of the paper's Fig. 9.

Entry points: `python -m isotruss_ros.demo`, `view.main`.
Imports `core`, `nodes` and `plotting`.
"""

#: Sensors of the demonstration.
PERFECT, REAL = 'perfect', 'real'
