# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The SROS 2 policy lets every node do what it does, and nothing else."""

import importlib
from pathlib import Path
import sys
from xml.etree import ElementTree

import pytest

CONFIG = Path(__file__).parents[2] / 'config'
sys.path.append(str(CONFIG.parent / 'docs' / '_ext'))

POLICY = ElementTree.parse(CONFIG / 'sros2_policy.xml').getroot()
INCLUDE = '{http://www.w3.org/2001/XInclude}include'
COMMANDS = 'roller_velocity_controller/commands'
#: Topics that a node publishes with a parameter that is not the default.
ON_REQUEST = {'simulator': {'/clock'}}
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
    return importlib.import_module('interfaces').interfaces()


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
        assert allowed(node, 'actions', 'execute') == interface.actions.keys(), node


def test_those_that_command_the_rollers_obey_the_stop():
    """One in operation, and one that checks the rollers before."""
    moving = {node for node in PROFILES if COMMANDS in allowed(node, 'topics', 'publish')}
    assert moving == {'manipulation', 'check_rollers'}
    for node in moving:
        assert 'emergency_stop' in allowed(node, 'topics', 'subscribe')
