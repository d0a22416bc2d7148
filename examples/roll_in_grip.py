# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Carry and turn a box between two sides that do not meet, and return it."""

from isotruss_ros import core
import numpy as np

robot = core.load_robot('nine_member')
box = core.Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], corner_radius=0.02)
sides = ('south/P-Q', 'north/R-P')  # of two tubes, with a hole between
grip = core.place_between(robot.home, sides, box, angle=0.2, indentation=0.01)
rolling = start = core.RollingGrip.attach(robot.home, grip)
print('the box is at', np.round(start.pose, 3))
print('it can be moved in', len(core.reachable_twists(robot.home, grip)), 'directions')

rate = 50.0
there = [(0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.1)]
for twist in [*there, *(-np.array(there[::-1]))]:
    for _ in range(50):
        command = core.solve_twist_ahead(rolling.config, rolling.grip, twist, 0.5 / rate)
        travel = rolling.config.roller_positions + command.roller_velocities / rate
        rolling = rolling.moved_to(rolling.config.moved_to(travel))
    print('now at', np.round(rolling.pose, 3), command.status)

off = np.hypot(rolling.pose.x - start.pose.x, rolling.pose.y - start.pose.y)
assert off < 1e-6
assert abs(rolling.pose.angle - start.pose.angle) < 1e-6
print('back within 1 um; the contacts are off by', f'{rolling.misfit:.1g} m')
