# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Nodes that bring up a robot: checks before it moves, and calibration.

Entry points: `preflight`, `check_rollers`, `calibration`, `pluck`. Beside them are the joint
markers that they gather. Imports `nodes.framework`, `calibration` and the core.
"""
