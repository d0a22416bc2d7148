# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Find whether friction holds a grasped object, and how much more it withstands."""

from isotruss_ros import core

config = core.load_robot('nine_member').home
x, y = core.tangent_center(config, 'north/Z', 0.3)
pressed = core.ConvexObject.disc((x, y + 0.02), 0.3)

for friction in (0.4, 0.8):
    grasp = core.settle_grasp(config, pressed, friction)
    print(f'friction {friction}: {"held" if grasp.held else grasp.reason}')
    if grasp.held:
        for member, force in grasp.normal_forces.items():
            print(f'  {member} presses with {force:.1f} N')
        print(f'  slips from {grasp.slip_margin:.2f} N on')
