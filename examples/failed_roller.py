# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Move the object with a failed roller, and list the reachable motions."""

from isotruss_ros import core

home = core.load_robot('nine_member').home
body = core.ConvexObject.disc(core.tangent_center(home, 'north/Z', 0.3), 0.3)
grip = core.Grip.at_module(home.robot, 'north/Z', body)
twist = (0.0, 0.02, 0.0)

south_and_east = ('south/P', 'south/Q', 'east/Q', 'east/R')
for failed in ((), ('east/R',), south_and_east):
    command = core.solve_twist(home, grip, twist, failed=failed)
    left = core.reachable_twists(home, grip, failed=failed)
    print(f'failed: {", ".join(failed) or "none"}: {len(left)} independent motions left')
    print('  ', command.status, command.achieved_twist.round(4) + 0.0)
