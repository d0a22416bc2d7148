# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

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
