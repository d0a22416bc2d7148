# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Forces on the joints of a robot that holds an object."""

from boxes import box_between, SIDES
from grips import gripped
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.holding.joint_loads import joint_compliance
from isotruss_ros.core.holding.roll_grip import roll_grip
from isotruss_ros.core.statics.structure import structure_of
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.1)
BOX = box_between(depth=0.02).body
HOME = CONFIG.robot.home
SIDE_NUMBERS = np.array([HOME.robot.member_names.index(name) for name in SIDES])
GRIPS = [attach_grip(CONFIG, CYLINDER), attach_grip(HOME, BOX, SIDE_NUMBERS)]


@pytest.mark.parametrize('grip', GRIPS)
def test_joints_give_as_the_frame_does_under_forces_on_its_nodes(grip):
    frame, found = structure_of(grip.config).frame, joint_compliance(grip).own
    for i in range(len(found)):
        loads = np.zeros((len(frame.points), 3))
        loads[i // 2, i % 2] = 1.0
        moved = frame.solve(loads).displacements[: len(found) // 2, :2].ravel()
        assert found[:, i] == pytest.approx(moved, abs=1e-12)


@pytest.mark.parametrize('grip', GRIPS)
def test_object_and_joints_move_as_the_response_says(grip):
    joints, even = joint_compliance(grip), np.array([1.0, 1.0, grip.arm])
    forces = 1e-3 * np.random.default_rng(0).normal(size=len(joints.own))
    loaded = roll_grip(joints.load(grip, forces), grip.config)

    def places(held, of_joints):
        return np.append(even * np.array(held.pose), joints.joints(held, of_joints))

    moved = places(loaded, forces) - places(grip, 0.0 * forces)
    expected = joints.response(grip)[:, 3:] @ forces
    assert moved == pytest.approx(expected, abs=0.01 * np.abs(expected).max())


@pytest.mark.parametrize('grip', GRIPS)
def test_what_a_force_on_a_joint_does_to_the_object_the_object_does_to_the_joint(grip):
    response = joint_compliance(grip).response(grip)
    assert response == pytest.approx(response.T, abs=0.02 * np.abs(response).max())
