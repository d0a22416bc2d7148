# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Command a twist beyond the limits of the rollers: scaled or projected."""

from isotruss_ros import core

robot = core.load_robot('nine_member')
home = robot.home
body = core.ConvexObject.disc(core.tangent_center(home, 'north/Z', 0.3), 0.3)
grip = core.Grip.at_module(robot, 'north/Z', body)

fast = core.solve_twist(home, grip, twist=(0.5, 0.0, 0.0))
print(f'too fast: {fast.status} scale {fast.scale:.3f}')
assert fast.status is core.Status.SLOWED_ROLLER_SPEED
assert 0.0 < fast.scale < 1.0

# The joint X is grounded, so most twists at the module south/X are only partly reachable.
body = core.ConvexObject.disc(core.tangent_center(home, 'south/X', 0.3), 0.3)
grounded = core.Grip.at_module(robot, 'south/X', body)
part = core.solve_twist(home, grounded, twist=(0.02, 0.0, 0.0))
print('out of reach:', part.status, 'achieved', part.achieved_twist.round(4))
print('reachable twists:', core.reachable_twists(home, grounded, failed=()).round(3))
