# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all nodes share: life cycle, parameters, subscriptions, diagnostics."""

#: Nodes of the package `nodes.bring_up`; all others are modules of `nodes`.
BRING_UP = ('pluck', 'calibration', 'check_rollers', 'preflight')
