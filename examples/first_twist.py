# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compute roller velocities for a twist of the held object, and apply them for half a second."""

from isotruss_ros import core

robot = core.load_robot('nine_member')  # or the path of a robot file
config = robot.home
center = core.tangent_center(config, 'north/Z', 0.3)  # an object 0.3 m wide touches both sides
grip = core.Grip.at_module(robot, 'north/Z', core.ConvexObject.disc(center, 0.3))

command = core.solve_twist(config, grip, twist=(0.0, 0.02, 0.1))  # vx, vy [m/s], omega [rad/s]
for name, velocity in zip(robot.roller_names, command.roller_velocities, strict=True):
    print(f'{name:8} {velocity:+.4f} m/s')
print(command.status, f'{command.scale:.2f}', command.achieved_twist.round(4) + 0.0)

after = robot.configuration(0.5 * command.roller_velocities)  # half a second later
moved = after.nodes[robot.node_names.index('Z')] - robot.home.nodes[5]
print('Z moved by', moved.round(4), 'm')
