# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Probability that an object is held by a robot whose parameters are uncertain.

Entry point: `uncertainty.Uncertainty`.
Imports `core.holding` and the layers below it.
"""
