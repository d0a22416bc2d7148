# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Who follows whom along the tubes, by the names in the robot's file."""

from isotruss_ros.core import load_robot
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.topology import check_roller_names
import numpy as np
import pytest
import robots


@pytest.mark.parametrize('name', robots.PRESETS)
def test_a_roller_feeds_the_member_that_leaves_it_and_takes_from_the_one_before(name):
    topology = load_robot(name).topology
    wanted = np.zeros((len(topology.member_names), len(topology.roller_names)))
    for column, roller in enumerate(topology.roller_names):
        tube, joint = roller.split('/')
        for row, member in enumerate(topology.member_names):
            own, ends = member.split('/')
            start, end = ends.split('-')
            if own == tube:
                wanted[row, column] = (start == joint) - (end == joint)
    assert topology.incidence.tolist() == wanted.tolist()
    before = (topology.incidence == -1.0).argmax(axis=0)
    assert topology.before_driven.tolist() == before.tolist()
    assert topology.following[topology.before_driven].tolist() == topology.driven.tolist()


@pytest.mark.parametrize('name', robots.PRESETS)
def test_grounded_coordinates_are_x_and_y_of_the_supported_joints(name):
    robot = load_robot(name)
    found = {
        (robot.topology.joint_names[number // 2], 'xy'[number % 2])
        for number in robot.topology.grounded.tolist()
    }
    supports = robot.description.supports
    assert found == {(joint, axis) for joint, axes in supports.items() for axis in axes}
    assert len(robot.topology.grounded) == len(found)


def test_names_of_no_rollers_are_refused():
    names = load_robot('triangle').roller_names
    check_roller_names('these', names[:1], names)
    with pytest.raises(GraspError, match=f'these: .*nobody.* its rollers are {names[0]}'):
        check_roller_names('these', ['nobody'], names)
