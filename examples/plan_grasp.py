# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Search for a grasp of a free object and print the path of the rollers to it."""

from isotruss_ros import core

robot = core.load_robot('nine_member')
item = core.ConvexObject.disc((0.715, 0.42), 0.3)
needs = core.GraspRequirements(friction=0.5, max_contact_force=60.0, count=1)

plan = core.plan_grasps(robot.home, item, needs, seed=0)
if plan:
    grasp = plan[0]
    print(grasp.module, 'by', *grasp.members)
    print(f'squeeze {grasp.squeeze:.1f} N, slip margin {grasp.slip_margin:.1f} N')
    print(len(grasp.path), 'waypoints')
    for name, travel in zip(robot.roller_names, grasp.path[-1], strict=True):
        print(f'{name:8} {travel:+.3f} m')
else:
    print('none found; closest violation:', plan.closest_violation)
