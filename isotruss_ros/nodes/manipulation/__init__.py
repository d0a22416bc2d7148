# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `manipulation`, which commands roller velocities for twists and for trajectories.

Entry point: `node`. Its other modules contain settings, emergency stop, failed rollers,
trajectories, and subscriptions that stop the robot if a message may have been lost. Imports
`nodes.framework` and the core.
"""
