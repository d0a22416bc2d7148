# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where the joints of a robot that holds an object are."""

from carries import Carry, GRASPS, make_robot
from isotruss_ros.core.holding.loaded_frame import held_joints
from mujoco_worlds import needs_mujoco
from nightly import some_now
import numpy as np
import pytest

ROBOT = make_robot()
NAMES = ROBOT.topology.joint_names


@needs_mujoco
@pytest.mark.parametrize('name', some_now(reversed(GRASPS), 2))
def test_joints_are_where_mujoco_has_them_but_for_what_bending_shortens(name):
    """The statics is linear: a member bent by w is shorter by some w^2 over its length."""
    carry = Carry(name)
    carry.run(2.0)
    grip = carry.control.grasp
    at_rest = grip.config.nodes[: len(NAMES)]
    measured = carry.plant.nodes[: len(NAMES)] - at_rest
    assert held_joints(grip) - at_rest == pytest.approx(measured, abs=1.6e-3)


@needs_mujoco
def test_joints_between_tubes_far_apart_move_as_in_mujoco():
    carry = Carry('box')
    carry.run(2.0)
    grip = carry.control.grasp
    at_rest = grip.config.nodes[: len(NAMES)]
    measured = carry.plant.nodes[: len(NAMES)] - at_rest
    found = held_joints(grip) - at_rest
    assert np.abs(measured).max() > 7e-3
    assert np.linalg.norm(found - measured) < 0.15 * np.linalg.norm(measured)
