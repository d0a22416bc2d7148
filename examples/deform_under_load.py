# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Load a joint of the robot and read displacements, support reactions and rotations."""

from isotruss_ros import core

config = core.load_robot('triangle').home
load = (0.0, -20.0)  # [N] on the joint T
deformation = core.deform(config, joint_loads={'T': load})

ux, uy, angle = deformation.displacement('T')
print(f'T: {1000 * ux:.2f} mm, {1000 * uy:.2f} mm, {angle:.4f} rad')
for joint, (rx, ry) in deformation.reactions.items():
    print(f'{joint} carries {rx:+.2f} N, {ry:+.2f} N')
assert abs(sum(ry for _, ry in deformation.reactions.values()) - 20.0) < 1e-6
