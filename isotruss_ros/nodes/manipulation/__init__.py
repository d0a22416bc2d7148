# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `manipulation`: roller velocities for twists of the held object and for trajectories.

Entry point: `node`. Other modules: settings, emergency stop, failed rollers, trajectories, and
topics whose lost messages stop the robot. Imports `nodes.framework` and the core.
"""
