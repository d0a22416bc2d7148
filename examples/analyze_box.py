# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Press a box with two of its corners into the corner of the robot, and analyse the grasp."""

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
print('force closure:', grasp.force_closure, 'from friction', round(grasp.required_friction, 2))
print('grasp stiffness:\n', grasp.stiffness.round())
