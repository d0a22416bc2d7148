# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The files for ros2_control name the rollers of the preset and what the nodes command."""

import math
from pathlib import Path
import xml.etree.ElementTree as ElementTree

from isotruss_ros.core import load_robot
import numpy as np
import pytest
from ruamel.yaml import YAML

FOLDER = Path(__file__).parents[2] / 'config' / 'ros2_control'
ROBOT = load_robot('nine_member')


@pytest.fixture(scope='module')
def description():
    return ElementTree.parse(FOLDER / 'nine_member.urdf').getroot()


def test_the_description_is_a_tree_of_the_rollers(description):
    joints = {joint.get('name'): joint for joint in description.findall('joint')}
    assert tuple(joints) == ROBOT.roller_names
    links = [link.get('name') for link in description.findall('link')]
    children = [joint.find('child').get('link') for joint in joints.values()]
    assert links == [ROBOT.frame, *children]
    assert {joint.find('parent').get('link') for joint in joints.values()} == {ROBOT.frame}


def find_travel_limits():
    """Return the travel at which a member between roller and passive module is at a limit."""
    said = ROBOT.description
    limits = np.array([said.min_length, said.max_length])
    travel = {}
    for name, length in zip(ROBOT.member_names, ROBOT.home.member_lengths, strict=True):
        tube, _, joints = name.partition('/')
        # Travel of the module where the member begins makes it longer, of the other one shorter.
        ends = zip(joints.split('-'), (1.0, -1.0), strict=True)
        driven = {f'{tube}/{j}': sign for j, sign in ends if f'{tube}/{j}' in ROBOT.roller_names}
        if len(driven) == 1:
            ((roller, sign),) = driven.items()
            travel[roller] = sorted(sign * (limits - length))
    return travel


def test_at_the_limits_of_travel_a_member_has_its_shortest_or_longest_length(description):
    travel = find_travel_limits()
    for joint in description.findall('joint'):
        limit = joint.find('limit')
        said = [float(limit.get(side)) for side in ('lower', 'upper')]
        assert said == pytest.approx(travel[joint.get('name')], abs=1e-9)


def test_the_limits_of_speed_and_force_are_those_of_rollers_and_tube(description):
    said = ROBOT.description
    (pressure,) = {*said.pressures.values()}
    pull = pressure * math.pi / 4.0 * said.tube_diameter**2
    for limit in description.iterfind('joint/limit'):
        assert float(limit.get('velocity')) == said.max_speed
        assert float(limit.get('effort')) == pytest.approx(pull, rel=1e-3)


def test_the_hardware_takes_velocities_and_measures_travel(description):
    (system,) = description.findall('ros2_control')
    assert tuple(joint.get('name') for joint in system.findall('joint')) == ROBOT.roller_names
    for joint in system.findall('joint'):
        assert [i.get('name') for i in joint.findall('command_interface')] == ['velocity']
        states = [i.get('name') for i in joint.findall('state_interface')]
        assert states == ['position', 'velocity']


def test_the_controllers_have_the_rollers_in_order():
    said = YAML(typ='safe').load(FOLDER / 'controllers.yaml')
    manager = said['controller_manager']['ros__parameters']
    assert manager['enforce_command_limits'] is True
    assert manager['joint_state_broadcaster']['type'].endswith('/JointStateBroadcaster')
    kind = manager['roller_velocity_controller']['type']
    assert kind == 'velocity_controllers/JointGroupVelocityController'
    joints = said['roller_velocity_controller']['ros__parameters']['joints']
    assert tuple(joints) == ROBOT.roller_names
