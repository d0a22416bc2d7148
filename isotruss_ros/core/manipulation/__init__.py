# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Inverse kinematics: roller velocities for a twist of the object, equations (11), (14) to (20).

Entry points: `solve_twist.solve_twist`, `grip.Grip`, `rolling_grip.RollingGrip`, `limits`.
Imports `core.statics` and the layers below it, not `core.contact`.
"""
