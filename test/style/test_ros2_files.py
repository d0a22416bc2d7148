# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files for SROS 2 and ros2_control name what the nodes do and the rollers of the preset."""

import math
from pathlib import Path
import xml.etree.ElementTree as ElementTree

from isotruss_ros.core import load_robot
from isotruss_ros.nodes.conversions.messages import name_frame, OBJECT
from node_pages import all_interfaces
import numpy as np
import pytest
from ruamel.yaml import YAML

CONFIG = Path(__file__).parents[2] / 'config'
FOLDER = CONFIG / 'ros2_control'
ROBOT = load_robot('nine_member')
MODULE_FRAMES = {name_frame(ROBOT.frame, name) for name in ROBOT.module_names}
POLICY = ElementTree.parse(CONFIG / 'sros2_policy.xml').getroot()
INCLUDE = '{http://www.w3.org/2001/XInclude}include'
COMMANDS = 'roller_velocity_controller/commands'
#: Topics that a node publishes with a parameter that is not the default.
ON_REQUEST = {'simulator': {'/clock'}}
#: Actions that a node offers where control_msgs is installed.
STANDARD = {'manipulation': {'joint_trajectory_controller/follow_joint_trajectory'}}
#: What all nodes publish, and one records.
COMMON = {'record': {'/diagnostics'}}


def profile(enclave):
    """Return the one profile of an enclave."""
    (found,) = enclave.iter('profile')
    return found


PROFILES = {profile(enclave).get('node'): enclave for enclave in POLICY.iter('enclave')}


def allowed(node, kind, action):
    """Return the names that a node is allowed to publish, subscribe, reply to and so on."""
    parts = profile(PROFILES[node]).findall(kind)
    return {name.text for part in parts if part.get(action) == 'ALLOW' for name in part}


@pytest.fixture(scope='module')
def declared():
    """Return what the nodes declare."""
    return all_interfaces()


def test_every_node_has_an_enclave_of_its_name(declared):
    assert PROFILES.keys() == declared.keys() | {'operator'}
    for node, enclave in PROFILES.items():
        assert enclave.get('path') == f'/isotruss/{node}'
        assert profile(enclave).find(INCLUDE).get('href') == 'sros2_node.xml'
    assert ElementTree.parse(CONFIG / 'sros2_node.xml').getroot().tag == 'profile'


def test_nodes_may_do_what_they_do_and_nothing_else(declared):
    for node, interface in declared.items():
        published = interface.published.keys() | ON_REQUEST.get(node, set())
        assert allowed(node, 'topics', 'publish') == published, node
        subscribed = interface.subscribed.keys() | COMMON.get(node, set())
        assert allowed(node, 'topics', 'subscribe') == subscribed, node
        assert allowed(node, 'services', 'reply') == interface.services.keys(), node
        offered = interface.actions.keys() | STANDARD.get(node, set())
        assert allowed(node, 'actions', 'execute') == offered, node


def test_those_that_command_the_rollers_obey_the_stop():
    """One in operation, and one that checks the rollers before."""
    moving = {node for node in PROFILES if COMMANDS in allowed(node, 'topics', 'publish')}
    assert moving == {'manipulation', 'check_rollers'}
    for node in moving:
        assert 'emergency_stop' in allowed(node, 'topics', 'subscribe')


@pytest.fixture(scope='module')
def description():
    return ElementTree.parse(FOLDER / 'nine_member.urdf').getroot()


def rollers_of(description):
    """Return the joints of the rollers."""
    return [joint for joint in description.findall('joint') if joint.get('type') == 'prismatic']


def test_the_description_is_a_tree_of_the_rollers(description):
    joints = {joint.get('name'): joint for joint in rollers_of(description)}
    assert tuple(joints) == ROBOT.roller_names
    links = [link.get('name') for link in description.findall('link')]
    children = [joint.find('child').get('link') for joint in description.findall('joint')]
    assert links == [ROBOT.frame, *children]
    parents = {joint.find('parent').get('link') for joint in description.findall('joint')}
    assert parents == {ROBOT.frame}


def test_the_other_links_are_frames_that_are_broadcast(description):
    floating = [j for j in description.findall('joint') if j.get('type') == 'floating']
    links = {joint.find('child').get('link') for joint in floating}
    assert links == {*MODULE_FRAMES, name_frame(ROBOT.frame, OBJECT)}
    shown = {
        link.get('name') for link in description.findall('link') if link.find('visual') is not None
    }
    assert shown == MODULE_FRAMES


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
    for joint in rollers_of(description):
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
