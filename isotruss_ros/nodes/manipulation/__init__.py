# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `manipulation`: roller velocities for twists of the held object and trajectories.

Entry point: `node`. Other modules: settings, emergency stop, failed rollers, trajectories, and
topics of which a lost message stops the robot. Imports `nodes.framework` and the core.
"""
