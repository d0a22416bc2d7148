# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The node `manipulation`: turns twists of the held object, and trajectories, into roller velocities.

Entry point: `node`. Beside it are its settings, the emergency stop, failed rollers, trajectories,
and topics on which a lost message stops the robot. Imports `nodes.framework` and the core.
"""
