# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Answers of the public calls to recorded questions, each question a plain mapping.

They were recorded before the short forms of the core went; `test_recorded_answers` compares.
"""

import functools
import gzip
import json
from pathlib import Path
import tempfile

from isotruss_ros import core
from isotruss_ros.core import ConvexObject, Disc, Ellipse, load_robot, Polygon
from isotruss_ros.core.control.inputs import RollerState, StampedInput
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
import numpy as np

DATA = Path(__file__).parents[1] / 'data' / 'answers.json.gz'
SHAPES = {'disc': Disc, 'ellipse': Ellipse, 'polygon': Polygon}


def find_robot(question):
    """Return the robot of a question: a preset, or one whose file it holds."""
    given = question['robot']
    return load_robot(given) if isinstance(given, str) else read_robot(json.dumps(given))


@functools.cache
def read_robot(text):
    """Return the robot of a file; JSON is YAML."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'robot.yaml')
        path.write_text(text, encoding='utf-8')
        return load_robot(str(path))


def make_body(question):
    """Return the object of a question in its place."""
    kind, size = question['shape']
    return ConvexObject(SHAPES[kind](size), question['pose'])


def make_grip(robot, question):
    """Return the grip of a question."""
    members = question.get('members')
    if members is None:
        i = robot.module_names.index(question['module'])
        before = int(robot.topology.previous[i])
        members = (robot.member_names[i], robot.member_names[before])
    return core.Grip(tuple(members), make_body(question), question.get('friction', 0.5))


def answer_twist(question):
    """Return the roller velocities and the achieved twist."""
    robot = find_robot(question)
    config = robot.configuration(question['travel'])
    command = core.solve_twist(
        config,
        make_grip(robot, question),
        question['twist'],
        question['failed'],
        handling=LimitHandling(question['slide'], question['period']),
    )
    numbers = [*command.roller_velocities, *command.achieved_twist, command.scale]
    return command.status.name, numbers


def answer_analysis(question):
    """Return what `analyze_grasp` says, as numbers."""
    robot = find_robot(question)
    found = core.analyze_grasp(
        robot.configuration(question['travel']),
        make_body(question),
        question['friction'],
        question['wrench'],
        question['method'],
        flattening=question['flattening'],
    )
    numbers = [
        *found.normal_wrench,
        found.closure_residual,
        min(found.required_friction, 1e3),
        found.closure_margin,
        *found.contact_lengths.values(),
        *found.contact_forces.values(),
        *found.utilisation.values(),
        *found.stiffness.ravel(),
    ]
    return str(found.force_closure), numbers


def answer_settled(question):
    """Return what `settle_grasp` says, as numbers."""
    robot = find_robot(question)
    found = core.settle_grasp(
        robot.configuration(question['travel']),
        make_body(question),
        question['friction'],
        question['wrench'],
        members=question.get('members'),
    )
    if found.pose is None:
        return 'none', []
    numbers = [
        *found.pose,
        *found.displacement,
        *found.normal_forces.values(),
        *found.friction_forces.values(),
        min(found.required_friction, 1e3),
        found.slip_margin,
    ]
    if found.stiffness is not None:
        numbers += [*found.stiffness.ravel()]
    return str(found.held), numbers


def answer_walk(question):
    """Return roller travel and pose along a path of the servo."""
    robot = find_robot(question)
    names = make_grip(robot, question).members
    servo = core.TwistServo(robot, question['module'], question['shape'][1], 0.01, 0.2)
    config = robot.configuration(question['travel'])
    held = core.RollingGrip.attach(config, make_grip(robot, question))
    positions, now, numbers = np.array(question['travel']), 0.0, []
    assert len(names) == 2
    for step in range(question['steps']):
        servo.twist = StampedInput(np.array(question['twist']), now)
        servo.rollers = StampedInput(RollerState(positions, np.zeros(len(positions))), now)
        servo.pose = StampedInput(held.pose, now)
        decision = servo.decide(now)
        positions = positions + 0.01 * decision.command.roller_velocities
        held = held.moved_to(robot.configuration(positions))
        now += 0.01
        if step % 10 == 9:
            numbers += [*positions, *held.pose]
    return decision.command.status.name, numbers


def answer_plan(question):
    """Return how many grasps a plan lists: which ones the search ends at depends on rounding."""
    robot = find_robot(question)
    plan = core.plan_grasps(robot.configuration(question['travel']), make_body(question))
    return str(len(plan)), []


ANSWERS = {
    'twist': answer_twist,
    'analysis': answer_analysis,
    'settled': answer_settled,
    'walk': answer_walk,
    'plan': answer_plan,
}


def answer(question):
    """Return a word and numbers: the answer, or the kind of the error."""
    try:
        return ANSWERS[question['call']](question)
    except core.IsotrussError as error:
        return type(error).__name__, []


def load():
    """Return the recorded questions, each with its answer."""
    with gzip.open(DATA, 'rt', encoding='utf-8') as file:
        return json.load(file)
