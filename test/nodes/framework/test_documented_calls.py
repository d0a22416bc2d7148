# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the documentation has one type: its calls fill requests and goals, and these are taken."""

import importlib
from pathlib import Path
import re
import shlex

from isotruss_msgs.action import PlanGrasp
from isotruss_msgs.srv import AnalyzeGrasp
from isotruss_ros.core import analyze_grasp, Disc, settle_grasp
from isotruss_ros.nodes.conversions.grasp_messages import read_query
from isotruss_ros.nodes.conversions.plan_messages import read_goal
from probe import ROBOT
import pytest
from ruamel.yaml import YAML

TOP = Path(__file__).parents[3]
COMMANDS = {'service call': 'Request', 'action send_goal': 'Goal'}


def calls():
    """Return type and content of every service call and goal in the documentation."""
    result = []
    for path in sorted([TOP / 'README.md', *TOP.glob('docs/**/*.md')]):
        if '_build' in path.parts:
            continue
        text = path.read_text(encoding='utf-8').replace('--feedback ', '').replace('\\\n', ' ')
        for block in re.findall(r'^```sh\n(.*?)^```', text, re.M | re.S):
            words = shlex.split(block, comments=True)
            following = (words[place:] for place in range(6))
            for ros, verb, noun, _, kind, content in zip(*following, strict=False):
                message_name = COMMANDS.get(f'{verb} {noun}')
                if ros == 'ros2' and message_name is not None:
                    package, folder, name = kind.split('/')
                    module = importlib.import_module(f'{package}.{folder}')
                    message = getattr(getattr(module, name), message_name)()
                    result.append((path.name, message, YAML(typ='safe').load(content)))
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
    _, message, values = CALLS[number]
    fill(message, values)


def test_documented_grasps_are_held():
    requests = [fill(m, v) for _, m, v in CALLS if isinstance(m, AnalyzeGrasp.Request) and v]
    assert len(requests) >= 2
    for request in requests:
        query = read_query(request, 0.005)
        assert analyze_grasp(ROBOT.home, query.body, query.friction).contact_forces
        assert settle_grasp(ROBOT.home, query.body, query.friction).held


def test_documented_search_goals_are_accepted():
    goals = [fill(m, v) for _, m, v in CALLS if isinstance(m, PlanGrasp.Goal) and v]
    result = [read_goal(goal, ROBOT) for goal in goals]
    assert any(goal.requirements.members for goal in result)
    assert any(isinstance(goal.body.shape, Disc) for goal in result)
