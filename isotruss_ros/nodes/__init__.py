# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
ROS nodes, which connect `isotruss_ros.core` to topics, services and actions.

Entry points: one module or package for each node, run by `isotruss_ros.executables`. In all
modules `now` is the time of the node's clock [s]. Imports `core` and the packages above `nodes` in
the order of CONTRIBUTING.md.
"""

import os

# Set before NumPy is loaded, for small matrices: in a run of 12 s at 200 Hz busy-waiting BLAS
# threads took 8.6 s of kernel time, without them 0.13 s.
for _variable in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_variable, '1')
