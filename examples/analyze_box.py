# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Press two corners of a box into a corner of the robot, and analyse the grasp."""

from isotruss_ros import core

config = core.load_robot('nine_member').home
box = core.read_object(
    '{shape: polygon, vertices: [[-0.15, -0.1], [0.15, -0.1], [0.15, 0.1], [-0.15, 0.1]],'
    ' corner_radius: 0.02, friction: 0.9}'
)
pressed = box.moved_to((0.724, 0.76, -0.647))  # x, y [m] and angle [rad] of the box's own frame

grasp = core.analyze_grasp(config, pressed)
for member, length in grasp.contact_lengths.items():
    force = grasp.contact_forces[member]
    print(f'{member} presses with {force:.1f} N over {1000 * length:.0f} mm')
print('the tubes push and turn the box with', grasp.normal_wrench.round(2), '[N, N, N m]')
closed, need = grasp.closed_by_friction, round(grasp.required_friction, 2)
print('closed by friction:', closed, 'from coefficient', need)
print('grasp stiffness:\n', grasp.stiffness.round())
