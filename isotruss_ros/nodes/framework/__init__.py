# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Framework of all nodes: life cycle, parameters, cycle, inputs, goals, frames, commands, launch.

Entry points: `managed.ManagedNode`, `runner.run`, `sensors.Inputs`, `parameters.Spec`. Imports
`nodes.conversions` and the core.
"""

#: Modules of the nodes whose module has another name than the node.
MODULES = {
    name: f'{name}.node' for name in ('simulator', 'manipulation', 'pick_and_place', 'viewer')
} | {name: f'bring_up.{name}' for name in ('pluck', 'calibration', 'check_rollers', 'preflight')}
