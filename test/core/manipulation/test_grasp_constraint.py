# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The fundamental grasp constraint J_h(q) qdot = G^T nu (Murray, Li and Sastry) against the rows.

With contacts that neither slip nor lift the object's surface moves as the tubes' material does
where they touch. For a cylinder between the two members of one module that is what the paper's
rows say, in the model without deformation.
"""

from grips import disc_grip
from isotruss_ros.core import load_robot, solve_twist
from isotruss_ros.core.manipulation.grip_rows import grip_jacobian
import numpy as np
import pytest
import robots

DIAMETER = 0.3


def contact_rows(config, module, center):
    """
    Return hand Jacobian and grasp map of both contacts, independently of the rows of (19).

    :return: J_h (4, r) velocity of the tubes' skin at the contacts by the rollers, G^T (4, 3) that
        of the object's surface by its twist; along the normal and the tangent of each contact.
    """
    topology, points = config.robot.topology, config.points
    i = config.robot.module_names.index(module)
    radius = 0.5 * DIAMETER
    hand, grasp = [], []
    units = np.eye(len(config.robot.roller_names))
    velocities = list(config.node_jacobian.T.copy().view(complex))
    for start, end, flow in (
        (topology.b[i], topology.c[topology.following[i]], 1.0),
        (topology.c[i], topology.b[topology.previous[i]], -1.0),
    ):
        span = points[end] - points[start]
        axis = span / abs(span)
        foot = points[start] + axis * (axis.conjugate() * (center - points[start])).real
        normal = (foot - center) / abs(foot - center)
        # The tube has the radius 0 here: its skin is where its centre line is.
        for direction in (normal, axis):
            arm = radius * normal
            turning = (direction.conjugate() * 1j * arm).real
            grasp.append([direction.real, direction.imag, turning])
            row = []
            for unit, velocity in zip(units, velocities, strict=True):
                turn = ((velocity[end] - velocity[start]) / span).imag
                skin = velocity[start] + 1j * turn * (center + arm - points[start])
                # The material runs through the pinch point with the roller of the module.
                travel = np.zeros(topology.n_modules)
                travel[topology.driven] = unit
                skin += flow * travel[i] * axis
                row.append((direction.conjugate() * skin).real)
            hand.append(row)
    return np.array(hand), np.array(grasp)


@pytest.mark.parametrize('module', ['north/Z', 'south/Q', 'east/R', 'north/R'])
def test_the_papers_rows_follow_from_the_grasp_constraint(module):
    robot, rng = load_robot('nine_member'), np.random.default_rng(0)
    config = robots.random_state(robot, rng)
    grip = disc_grip(config, module, DIAMETER)
    hand, grasp = contact_rows(config, module, grip.center)
    rows = grip_jacobian(config, grip)
    # Any motion of the rollers that keeps all four rows of the constraint for some twist ...
    free = np.linalg.svd(np.hstack([hand, -grasp]))[2][4:]
    assert len(free) == len(robot.roller_names) - 1
    for motion in free:
        rollers, twist = motion[:-3], motion[-3:]
        # ... moves the object so (15), (18), and keeps the distance of the contacts (14).
        assert rows[:3] @ rollers == pytest.approx(twist, abs=1e-9)
        assert rows[3] @ rollers == pytest.approx(0.0, abs=1e-9)
    # And the other way around: the twist program keeps the constraint.
    wanted = np.array([0.01, 0.02, -0.1])
    command = solve_twist(config, grip, wanted)
    left = hand @ command.roller_velocities - grasp @ command.achieved_twist
    assert left == pytest.approx(0.0, abs=1e-9)
