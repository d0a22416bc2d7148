# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files for other tools of ROS have the interfaces of the nodes and the rollers."""

import importlib
import json
from pathlib import Path
import re
import xml.etree.ElementTree as ElementTree

from isotruss_ros.core import load_robot
from isotruss_ros.nodes.conversions.messages import name_frame, OBJECT
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.runner import find_node
from node_pages import all_interfaces
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
FOXGLOVE = json.loads((CONFIG / 'foxglove.json').read_text(encoding='utf-8'))
PANELS = FOXGLOVE['configById']


def profile(enclave):
    (result,) = enclave.iter('profile')
    return result


PROFILES = {profile(enclave).get('node'): enclave for enclave in POLICY.iter('enclave')}


def allowed(node, kind, action):
    """Return the names that a node is allowed to publish, subscribe, reply to and so on."""
    parts = profile(PROFILES[node]).findall(kind)
    return {name.text for part in parts if part.get(action) == 'ALLOW' for name in part}


@pytest.fixture(scope='module')
def declared():
    return all_interfaces()


def test_every_node_has_an_enclave_of_its_name(declared):
    assert PROFILES.keys() == declared.keys() | {'operator'}
    for node, enclave in PROFILES.items():
        assert enclave.get('path') == f'/isotruss/{node}'
        assert profile(enclave).find(INCLUDE).get('href') == 'sros2_node.xml'
    assert ElementTree.parse(CONFIG / 'sros2_node.xml').getroot().tag == 'profile'


def test_permissions_are_the_interfaces_of_the_nodes(declared):
    for node, interface in declared.items():
        published = interface.published.keys() | ON_REQUEST.get(node, set())
        assert allowed(node, 'topics', 'publish') == published, node
        subscribed = interface.subscribed.keys() | COMMON.get(node, set())
        assert allowed(node, 'topics', 'subscribe') == subscribed, node
        assert allowed(node, 'services', 'reply') == interface.services.keys(), node
        offered = interface.actions.keys() | STANDARD.get(node, set())
        assert allowed(node, 'actions', 'execute') == offered, node


def test_nodes_that_command_the_rollers_subscribe_to_the_stop():
    moving = {node for node in PROFILES if COMMANDS in allowed(node, 'topics', 'publish')}
    assert moving == {'manipulation', 'check_rollers'}
    for node in moving:
        assert 'emergency_stop' in allowed(node, 'topics', 'subscribe')


@pytest.fixture(scope='module')
def description():
    return ElementTree.parse(FOLDER / 'nine_member.urdf').getroot()


def test_links_of_the_description_are_the_broadcast_frames(description):
    joints = description.findall('joint')
    assert {joint.find('parent').get('link') for joint in joints} == {ROBOT.frame}
    floating = {j.find('child').get('link') for j in joints if j.get('type') == 'floating'}
    assert floating == {*MODULE_FRAMES, name_frame(ROBOT.frame, OBJECT)}


def test_description_and_controllers_have_the_rollers_of_the_robot(description):
    rollers = [j for j in description.findall('joint') if j.get('type') == 'prismatic']
    (system,) = description.findall('ros2_control')
    controllers = YAML(typ='safe').load(FOLDER / 'controllers.yaml')
    controlled = controllers['roller_velocity_controller']['ros__parameters']['joints']
    assert tuple(joint.get('name') for joint in rollers) == ROBOT.roller_names
    assert tuple(joint.get('name') for joint in system.findall('joint')) == ROBOT.roller_names
    assert tuple(controlled) == ROBOT.roller_names
    for joint in rollers:
        limit = {name: float(value) for name, value in joint.find('limit').attrib.items()}
        assert limit['velocity'] == ROBOT.description.max_speed
        assert limit['lower'] < 0.0 < limit['upper']


@pytest.fixture(scope='module')
def topics():
    """Return the types of all topics that the nodes publish, by their absolute name."""
    return {'/diagnostics': 'diagnostic_msgs/DiagnosticArray'} | {
        '/' + name.lstrip('/'): entity.types[0]
        for interface in all_interfaces().values()
        for name, entity in interface.published.items()
    }


def message(kind):
    """Return a message of a type such as sensor_msgs/JointState."""
    package, name = kind.split('/')[0], kind.split('/')[-1]
    return getattr(importlib.import_module(f'{package}.msg'), name)()


def check_path(path, topics):
    """Check that a path such as /grasp/state.squeeze[0] leads to a field of a topic."""
    topic, *fields = path.split('.')
    assert topic in topics, path
    value = message(topics[topic])
    for field in fields:
        name, indexed = re.fullmatch(r'(\w+)(\[\d+\])?', field).groups()
        assert hasattr(value, name), path
        value = getattr(value, name)
        assert not indexed or hasattr(value, '__len__'), path


def test_foxglove_shows_existing_topics_fields_and_services(topics):
    for panel in PANELS.values():
        for line in panel.get('paths', []):
            check_path(line['value'], topics)
        shown = [*panel.get('topics', {}), panel.get('topicPath'), panel.get('topicToRender')]
        assert {*filter(None, shown)} <= topics.keys()
    services = {name for part in all_interfaces().values() for name in part.services}
    assert PANELS['CallService!stop']['serviceName'].lstrip('/') in services


def test_plotjuggler_plots_existing_topics(topics):
    text = (CONFIG / 'plotjuggler.xml').read_text(encoding='utf-8')
    for curve in re.findall(r'<curve name="([^"]+)"', text):
        assert any(curve.startswith(f'{topic}/') for topic in topics), curve


def test_rviz_shows_relative_topics_of_the_nodes():
    layout = YAML(typ='safe').load((CONFIG / 'isotruss.rviz').read_text('utf-8'))
    displays = layout['Visualization Manager']['Displays']
    shown = {display['Topic']['Value'] for display in displays if 'Topic' in display}
    # RViz resolves relative names in its namespace, as the nodes do.
    published = set().union(*(interface.published for interface in all_interfaces().values()))
    assert 'grasp/markers' in shown
    assert shown <= published


def test_aggregator_has_every_managed_node_in_one_group():
    file = YAML(typ='safe').load(CONFIG / 'nodes' / 'diagnostic_aggregator.yaml')
    groups = [g for g in file['/**']['ros__parameters'].values() if isinstance(g, dict)]
    assert {group['type'] for group in groups} == {'diagnostic_aggregator/GenericAnalyzer'}
    names = [name for group in groups for name in group['contains']]
    managed = {name for name in all_interfaces() if issubclass(find_node(name), ManagedNode)}
    assert sorted(names) == sorted(managed - {'calibration'})
