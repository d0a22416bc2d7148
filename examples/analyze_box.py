# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Press two corners of a box into a corner of the robot, and settle the grasp."""

from isotruss_ros import core

config = core.load_robot('nine_member').home
box = core.read_object(
    '{shape: polygon, vertices: [[-0.15, -0.1], [0.15, -0.1], [0.15, 0.1], [-0.15, 0.1]],'
    ' corner_radius: 0.02, friction: 0.9}'
)
pressed = box.moved_to((0.724, 0.76, -0.647))  # x, y [m] and angle [rad] of the box's own frame

grasp = core.settle_grasp(config, pressed)
for member, length in grasp.contact_lengths.items():
    force = grasp.normal_forces[member]
    print(f'{member} presses with {force:.1f} N over {1000 * length:.0f} mm')
print('the box moves by', (1e3 * grasp.displacement[:2]).round(1), 'mm')
print('held:', grasp.hold.value, '- from a coefficient of', round(grasp.required_friction, 2))
print('grasp stiffness:\n', grasp.stiffness.round())
