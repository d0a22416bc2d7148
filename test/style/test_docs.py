# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names, paths, links, examples and calls in pages are valid; generated pages are up to date."""

import importlib
from pathlib import Path
import pydoc
import re
import shlex

import committed_pages
import equations
from interfaces import node_classes
from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros import executables
from isotruss_ros.core import analyze_grasp, Disc, settle_grasp
from isotruss_ros.nodes.conversions.grasp_messages import read_query
from isotruss_ros.nodes.conversions.plan_messages import read_goal
from isotruss_ros.nodes.framework.managed import ManagedNode
from node_pages import all_interfaces
from probe import ROBOT
import promises
import pytest
from ruamel.yaml import YAML

TOP = Path(__file__).parents[2]
DOCS = TOP / 'docs'
EXECUTABLES = executables.NODES
README = (TOP / 'README.md').read_text(encoding='utf-8')
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


@pytest.mark.parametrize('page', TEXTS)
def test_names_of_the_core_in_pages_exist(page):
    for name in re.findall(r'`(core\.[\w.]+)', TEXTS[page]):
        assert pydoc.locate(f'isotruss_ros.{name}') is not None, f'no {name} in isotruss_ros'


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


def test_python_example_of_the_readme_runs(capsys):
    (example,) = python_blocks(README)
    exec(compile(example, 'README.md', 'exec'), {})
    printed = capsys.readouterr().out
    shown = [line.removeprefix('# ') for line in example.splitlines() if line.startswith('# ')]
    for comment, line in zip(shown, printed.splitlines(), strict=True):
        assert line.startswith(re.split(r', in |, \.\.\.', comment)[0]), line


@pytest.mark.parametrize('page', [page for page, text in TEXTS.items() if python_blocks(text)])
def test_python_examples_of_the_pages_run(page, capsys):
    for example in python_blocks(TEXTS[page]):
        exec(compile(example, page, 'exec'), {})
        assert capsys.readouterr().out, 'the example must print its result; `py` marks others'


@pytest.mark.parametrize('page', TEXTS)
def test_named_make_targets_exist(page):
    for target in re.findall(r'(?:`|^)make ([a-z][\w-]*)', TEXTS[page], re.MULTILINE):
        assert re.search(rf'^{target}:', MAKEFILE, re.MULTILINE), f'no make {target}'


@pytest.mark.parametrize('page', TEXTS)
def test_links_have_existing_targets(page):
    for target in re.findall(r'\]\(([^)#:]+)[^):]*\)', TEXTS[page]):
        assert (TOP / page).parent.joinpath(target).exists(), f'no file {target}'


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
