# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Press an object into a corner of the robot and analyse the grasp."""

from isotruss_ros import core

config = core.load_robot('nine_member').home
x, y = core.tangent_center(config, 'north/Z', 0.3)
pressed = core.ConvexObject.disc((x, y + 0.01), 0.3)  # 1 cm deeper into the corner

grasp = core.analyze_grasp(config, pressed, friction=0.5)
print(f'{len(grasp.normal_forces)} contact points, {grasp.normal_forces.sum():.1f} N in all')
for member, length in grasp.contact_lengths.items():
    print(f'{member} touches over {1000 * length:.0f} mm')
print('normal forces add up to', grasp.normal_wrench, '[N, N, N m]')
print('force closure:', grasp.force_closure, 'from friction', grasp.required_friction)
print('grasp stiffness:\n', grasp.stiffness)
