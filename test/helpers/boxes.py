# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A box between two sides of the nine-member robot that meet at no module, for tests."""

from isotruss_ros.core import load_robot, place_between, read_object

ROBOT = load_robot('nine_member')
SIDES = ('south/P-Q', 'north/R-P')
#: Held by two corners; the line between them is almost that which halves the sides' angle.
ANGLE, DEPTH = -0.5, 0.01
BOX = (
    '{shape: polygon, vertices: [[-0.25, -0.2], [0.25, -0.2], [0.25, 0.2], [-0.25, 0.2]],'
    ' corner_radius: 0.02, mass: 0.8, friction: 0.9}'
)


def box_between(config=ROBOT.home, angle=ANGLE, depth=DEPTH):
    """Return a grip of the box between the two sides."""
    return place_between(config, SIDES, read_object(BOX).shape, angle, depth)
