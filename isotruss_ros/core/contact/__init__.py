# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Statics of a fixed object: contact with the tubes and closure by friction, equations (5) to (10).

Entry points: `analyze_grasp.analyze_grasp`, which returns a `GraspAnalysis`.
Imports `core.statics` and the layers below it.
"""
