# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What all nodes have: life cycle, parameters, cycle, inputs, goals, frames, commands, launching.

Entry points: `managed.ManagedNode`, `runner.run`, `sensors.Inputs`, `parameters.Spec`. Imports
`nodes.conversions` and the core.
"""

#: The module of each node that is not a module of its own name in `nodes`.
MODULES = {
    name: f'{name}.node' for name in ('simulator', 'manipulation', 'pick_and_place', 'viewer')
} | {name: f'bring_up.{name}' for name in ('pluck', 'calibration', 'check_rollers', 'preflight')}
