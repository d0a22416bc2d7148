# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The paper's analysis of an object held fast: linear statics, straight tubes, round sections.

Entry point: `analyze_grasp`. In the order of the equations: `straight_compliance` (1) to (4),
`contact_points` (5), `contact` (6) to (9), `friction_closure` (10). Imports
`core.statics`.
"""
