# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Comparison of a measured run with the model, and the parameter that explains the residuals best.

Entry points: `read_run.read_run`, `hypotheses.compare_run`, `report.describe`. Imports `core`
and `calibration`.
"""
