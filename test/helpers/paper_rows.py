# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The rows of (19) for a disc between the two members that meet at a module, as the paper does."""

import numpy as np


def paper_rows(config, grip, ends):
    """
    Return the object's twist (3, r) and the rate of the angle between the members (r,).

    :param grip: of a disc at a module.
    :param ends: B, B', C and C' there, as of `robots.side_ends`.
    """
    robot = config.robot
    velocities = config.node_jacobian.T.copy().view(complex)
    b, b_next, c, c_prev = (velocities[:, (config.points == end).argmax()] for end in ends)
    ahead, back = ends[1] - ends[0], ends[3] - ends[2]
    # (16), the rate of the direction angle of B -> B'; and of C -> C'.
    turning, turning_back = ((b_next - b) / ahead).imag, ((c_prev - c) / back).imag
    # (15): the object is at rest in the frame of B -> B'.
    center = b + 1j * turning * (grip.center - ends[0])
    # (17): the object rolls with the tube at the grip's module, unless that is passive.
    module = grip.members[0].split('-')[0]
    side = np.sign((ahead.conjugate() * (grip.center - ends[0])).imag)
    rolling = np.array(
        [side * 2.0 / grip.body.shape.diameter * (n == module) for n in robot.roller_names]
    )
    # (14), its derivative, counted from the member ahead to the one behind through the corner.
    return np.array([center.real, center.imag, turning + rolling]), side * (turning_back - turning)
