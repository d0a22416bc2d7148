# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pages, and files for other tools of ROS, agree with the package; generated pages are new."""

import ast
import importlib
from itertools import islice
import json
from pathlib import Path
import pydoc
import re
import shlex
import xml.etree.ElementTree as ElementTree

import committed_pages
import equations
from interfaces import node_classes
from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros import executables
from isotruss_ros.core import analyze_grasp, Disc, settle_grasp
from isotruss_ros.nodes.conversions.grasp_messages import read_query
from isotruss_ros.nodes.conversions.messages import name_frame, OBJECT
from isotruss_ros.nodes.conversions.plan_messages import read_goal
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.runner import find_node
from node_pages import all_interfaces
from probe import ROBOT
import promises
import pytest
from ruamel.yaml import YAML

TOP = Path(__file__).parents[2]
DOCS = TOP / 'docs'
EXECUTABLES = executables.NODES
INTERFACE_TESTS = Path(__file__).with_name('interface_tests.yaml')
TEXTS = {
    path.relative_to(TOP).as_posix(): path.read_text(encoding='utf-8')
    for path in sorted([*TOP.glob('*.md'), *TOP.glob('docs/**/*.md')])
    if '_build' not in path.parts
}
MAKEFILE = (TOP / 'Makefile').read_text(encoding='utf-8')
COMMANDS = {'service call': 'Request', 'action send_goal': 'Goal'}


def test_every_node_has_a_page():
    index = (DOCS / 'nodes' / 'index.md').read_text(encoding='utf-8')
    for name in EXECUTABLES:
        page = (DOCS / 'nodes' / f'{name}.md').read_text(encoding='utf-8')
        assert f'```{{node-interface}} {name}\n' in page
        assert f'\n{name}\n' in index


def test_managed_nodes_await_declared_topics():
    managed = {k: v for k, v in node_classes().items() if issubclass(v, ManagedNode)}
    assert managed
    for name, kind in managed.items():
        declared = all_interfaces()[name]
        assert kind.awaited
        assert {*kind.awaited} <= declared.subscribed.keys() | declared.actions.keys(), name


def test_every_promise_has_existing_tests():
    held_by = promises.load(DOCS / 'promises.yaml')
    page = (DOCS / 'safety.md').read_text(encoding='utf-8')
    assert sorted(promises.promised(page)) == sorted(held_by)
    for name, tests in held_by.items():
        assert tests, name
        for test in tests:
            file, function = test.split('::')
            texts = [path.read_text('utf-8') for path in TOP.glob(f'test/**/{file}.py')]
            assert any(f'def {function}(' in text for text in texts), f'{name}: no test {test}'


def defined():
    """Return the text of each function, class and constant of the tests by `file::name`."""
    texts = {}
    for path in TOP.glob('test/**/*.py'):
        text = path.read_text(encoding='utf-8')
        for node in ast.parse(text).body:
            name = getattr(node, 'name', None)
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                name = node.targets[0].id
            begin = min([node.lineno, *(d.lineno for d in getattr(node, 'decorator_list', ()))])
            lines = islice(text.splitlines(), begin - 1, node.end_lineno)
            texts[f'{path.stem}::{name}'] = '\n'.join(lines)
    return texts


def message_types():
    """Return the messages of the interface package, goals and requests by `action.Goal`."""
    found = {}
    for path in TOP.glob('msg_defs/*/*.*'):
        if path.suffix in ('.msg', '.srv', '.action'):
            kind = getattr(importlib.import_module(f'isotruss_msgs.{path.parent.name}'), path.stem)
            parts = ('Goal', 'Result', 'Feedback', 'Request', 'Response')
            parts = {f'{path.stem}.{part}': getattr(kind, part, None) for part in parts}
            found |= {path.stem: kind} if path.suffix == '.msg' else parts
    return {name: kind for name, kind in found.items() if kind is not None}


def test_every_interface_and_field_is_compared_with_the_core_by_existing_tests(declared):
    listed, texts = YAML(typ='safe').load(INTERFACE_TESTS), defined()
    interfaces = {'topics': set(), 'services': set(), 'actions': set().union(*STANDARD.values())}
    for interface in declared.values():
        interfaces['topics'] |= interface.published.keys() | interface.subscribed.keys()
        interfaces['services'] |= interface.services.keys()
        interfaces['actions'] |= interface.actions.keys()
    types = message_types()
    assert {section: {*listed[section]} for section in listed} == {**interfaces, 'types': {*types}}
    for section, tests_by_name in listed.items():
        for name, tests in tests_by_name.items():
            assert tests, name
            assert not {*tests} - texts.keys(), f'{section} {name}: no such test'
            fields = types[name].get_fields_and_field_types() if section == 'types' else {}
            words = {word for test in tests for word in re.findall(r'\w+', texts[test])}
            assert not fields.keys() - words, f'{name}: no test of {fields.keys() - words}'


@pytest.mark.parametrize('page', TEXTS)
def test_names_make_targets_and_links_of_pages_exist(page):
    for name in re.findall(r'`(core\.[\w.]+)', TEXTS[page]):
        assert pydoc.locate(f'isotruss_ros.{name}') is not None, f'no {name} in isotruss_ros'
    for target in re.findall(r'(?:`|^)make ([a-z][\w-]*)', TEXTS[page], re.MULTILINE):
        assert re.search(rf'^{target}:', MAKEFILE, re.MULTILINE), f'no make {target}'
    for target in re.findall(r'\]\(([^)#:]+)[^):]*\)', TEXTS[page]):
        assert (TOP / page).parent.joinpath(target).exists(), f'no file {target}'


def test_every_equation_of_the_paper_has_a_function():
    computed = equations.equation_map(TOP / 'isotruss_ros' / 'core')
    assert list(computed) == list(equations.EQUATIONS)


def test_committed_pages_are_up_to_date():
    for path, text in committed_pages.pages().items():
        command = '.venv/bin/python docs/_ext/committed_pages.py'
        assert path.read_text(encoding='utf-8') == text, f'{path.name}: run {command}'


def places(path):
    """Return where a path of a page may lead: from the top, or from the package."""
    return TOP / path, TOP / 'isotruss_ros' / path


def python_blocks(text):
    """Return the examples of a page; what cannot run alone is marked `py`."""
    return re.findall(r'```python\n(.*?)```', text, re.DOTALL)


@pytest.mark.parametrize('page', [page for page, text in TEXTS.items() if python_blocks(text)])
def test_python_examples_of_the_pages_run(page, capsys):
    """The example in README.md states what it prints."""
    for example in python_blocks(TEXTS[page]):
        exec(compile(example, page, 'exec'), {})
        printed = capsys.readouterr().out.splitlines()
        assert printed, 'the example must print its result; `py` marks others'
        if page == 'README.md':
            comments = [line[2:] for line in example.splitlines() if line.startswith('# ')]
            for comment, line in zip(comments, printed, strict=True):
                assert line.startswith(re.split(r', in |, \.\.\.', comment)[0]), line


@pytest.mark.parametrize('page', ['README.md', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md'])
def test_named_paths_exist(page):
    named = re.findall(r'`((?:isotruss_ros/)?[\w.]+/[\w./]*)`', TEXTS[page])
    for path in named:
        if not path.startswith(('.venv', 'demo_output', 'docs/_build', 'geometry_msgs')):
            assert any(place.exists() for place in places(path)), f'no file {path}'


def test_names_of_recipes_exist_in_their_files():
    named = re.findall(r'`(\w+)` in\s+`([\w./]+)`', TEXTS['CONTRIBUTING.md'])
    assert named
    for name, path in named:
        (place,) = (place for place in places(path) if place.exists())
        assert re.search(rf'\b{name}\b', place.read_text(encoding='utf-8')), (name, path)


def calls():
    """Return type and content of every service call and goal in the documentation."""
    result = []
    for text in TEXTS.values():
        text = text.replace('--feedback ', '').replace('\\\n', ' ')
        for block in re.findall(r'^```sh\n(.*?)^```', text, re.M | re.S):
            words = shlex.split(block, comments=True)
            following = (words[place:] for place in range(6))
            for ros, verb, noun, _, kind, content in zip(*following, strict=False):
                message_name = COMMANDS.get(f'{verb} {noun}')
                if ros == 'ros2' and message_name is not None:
                    package, folder, name = kind.split('/')
                    module = importlib.import_module(f'{package}.{folder}')
                    message = getattr(getattr(module, name), message_name)()
                    result.append((message, YAML(typ='safe').load(content)))
    return result


def fill(message, values):
    """Fill a message from YAML as the ros2 command does."""
    types = message.get_fields_and_field_types()
    for name, value in values.items():
        assert name in types
        present = getattr(message, name)
        if hasattr(present, 'get_fields_and_field_types'):
            fill(present, value)
            continue
        if isinstance(value, list) and value and isinstance(value[0], dict):
            package, kind = re.fullmatch(r'sequence<(\w+)/(\w+)(?:, \d+)?>', types[name]).groups()
            element = getattr(importlib.import_module(f'{package}.msg'), kind)
            value = [fill(element(), part) for part in value]
        setattr(message, name, value)
    return message


CALLS = calls()


@pytest.mark.parametrize('number', range(len(CALLS)))
def test_every_documented_call_fills_its_message(number):
    fill(*CALLS[number])


def test_documented_grasps_are_held():
    requests = [fill(m, v) for m, v in CALLS if isinstance(m, AnalyzeGrasp.Request) and v]
    assert len(requests) >= 2
    for request in requests:
        query = read_query(request, 0.005)
        assert analyze_grasp(ROBOT.home, query.body, query.friction).contact_forces
        assert settle_grasp(ROBOT.home, query.body, query.friction).held


def test_documented_search_goals_are_accepted():
    goals = [fill(m, v) for m, v in CALLS if isinstance(m, PlanGrasp.Goal) and v]
    result = [read_goal(goal, ROBOT) for goal in goals]
    assert any(goal.requirements.members for goal in result)
    assert any(isinstance(goal.body.shape, Disc) for goal in result)


CONFIG = Path(__file__).parents[2] / 'config'
FOLDER = CONFIG / 'ros2_control'
MODULE_FRAMES = {name_frame(ROBOT.frame, name) for name in ROBOT.module_names}
POLICY = ElementTree.parse(CONFIG / 'sros2_policy.xml').getroot()
INCLUDE = '{http://www.w3.org/2001/XInclude}include'
ROLLER_COMMANDS = 'roller_velocity_controller/commands'
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
    moving = {node for node in PROFILES if ROLLER_COMMANDS in allowed(node, 'topics', 'publish')}
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
