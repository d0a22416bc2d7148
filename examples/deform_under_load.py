# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Load a joint of the robot and read displacements, support reactions and rotations."""

from isotruss_ros import core

config = core.load_robot('triangle').home
load = (0.0, -20.0)  # [N] on the joint T
deformation = core.deform(config, joint_loads={'T': load})

ux, uy, angle = deformation.displacement('T')
print(f'T: {1000 * ux:.2f} mm, {1000 * uy:.2f} mm, {angle:.4f} rad')
for joint, (rx, ry) in deformation.reactions.items():
    print(f'{joint} carries {abs(rx):.2f} N, {ry:.2f} N')
assert abs(sum(ry for _, ry in deformation.reactions.values()) - 20.0) < 1e-6
