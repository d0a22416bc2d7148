# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Base classes and tools that all nodes share: life cycle, parameters, cycle, inputs, goals.

Entry points: `managed.ManagedNode`, `runner.run`, `sensors.Inputs`, `parameters.Spec`. Imports
`nodes.conversions` and the core.
"""

import signal

#: Signals of Ctrl-C, of `kill` and of a closed terminal.
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: Module of each node whose module does not have the node's name.
MODULES = {
    name: f'{name}.node' for name in ('simulator', 'manipulation', 'pick_and_place', 'viewer')
} | {name: f'bring_up.{name}' for name in ('pluck', 'calibration', 'check_rollers', 'preflight')}
