# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What ends the motion of a held object in place, and what is said of it."""

from dataclasses import replace
import functools
import math
from types import SimpleNamespace

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    GraspRequirements,
    load_robot,
    plan_grasps,
    Polygon,
    Status,
    tangent_center,
)
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.manipulation.limits import RollerSpeedLimit
from isotruss_ros.core.planning import motion_in_place, surrounding
from isotruss_ros.core.planning.closing import Closing
from isotruss_ros.core.planning.motion_in_place import MotionInPlace
from isotruss_ros.core.planning.release import plan_release
from isotruss_ros.core.planning.settings import DEFAULT
from isotruss_ros.core.planning.surrounding import squeeze_around
import numpy as np
import pytest

HOME = load_robot('nine_member').home
MODULE = 'north/Z'
BODY = ConvexObject.disc(tangent_center(HOME, MODULE, 0.3, 0.01), 0.3)
SLOW = RollerSpeedLimit(1e-6)
BOX = ((-0.12, -0.09), (0.12, -0.09), (0.12, 0.09), (-0.12, 0.09))


def pair(**fields):
    """Return a motion of a disc between two members, and how these hold it."""
    number = HOME.robot.module_names.index(MODULE)
    members = (number, int(HOME.robot.topology.previous[number]))
    closing = replace(Closing(BODY, members, (), 0.15), **fields)
    grasp = attach_grip(HOME, BODY, np.array(members))
    return MotionInPlace(replace(closing, body=grasp.body)), grasp


@functools.cache
def planned():
    """Plan a grip of a disc by three members of different tubes."""
    body = ConvexObject(Disc(0.6), (0.716, -0.4134, 0.2))
    needs = GraspRequirements(count=1, squeeze=12.0)
    few = replace(DEFAULT, max_grips=1, max_rounds=1)
    return plan_grasps(HOME, body, needs, settings=few)[0]


def three(**fields):
    """Return a motion of a disc between three members, and how these hold it."""
    names, body = planned().grip.members, planned().grip.body
    members = tuple(HOME.robot.member_names.index(name) for name in names)
    closing = replace(Closing(body, members, (), 0.15), **fields)
    grasp = attach_grip(planned().config, body, np.array(members))
    return MotionInPlace(replace(closing, body=grasp.body)), grasp


def said(motion):
    """Return requirement, value and bound of what ended a motion."""
    violation = motion.closest_violation
    return violation.requirement, violation.value, violation.bound


def squeeze_pair(motion, grasp, force):
    """Change the squeeze of two members."""
    return motion.squeeze(grasp, force)


BOTH = pytest.mark.parametrize(
    ('held', 'squeeze'), [(pair, squeeze_pair), (three, squeeze_around)]
)


@BOTH
def test_the_squeeze_becomes_what_is_wanted_in_place(held, squeeze):
    motion, grasp = held()
    force = 1.1 * grasp.squeeze
    found = squeeze(motion, grasp, force)
    assert found.squeeze == pytest.approx(force, rel=1e-3)
    assert math.dist(found.pose[:2], grasp.pose[:2]) < 2e-5
    assert motion.evaluations > 0
    assert motion.closest_violation is None


@BOTH
def test_a_squeeze_that_is_right_to_a_thousandth_is_left(held, squeeze):
    motion, grasp = held()
    assert squeeze(motion, grasp, 1.0008 * grasp.squeeze) is grasp
    assert squeeze(motion, grasp, 1.0012 * grasp.squeeze) is not grasp


@pytest.mark.parametrize(
    ('away', 'turned'), [(5e-4, False), (0.02, True), (2.0 * math.pi, False), (6.3, True)]
)
def test_what_has_been_turned_comes_back(away, turned):
    body = ConvexObject(Polygon(BOX, 0.02), (0.6, 0.3, 0.3))
    needs = GraspRequirements(module=MODULE, squeeze=10.0, count=1)
    found = plan_grasps(HOME, body, needs, settings=replace(DEFAULT, max_rounds=1))[0]
    members = tuple(HOME.robot.member_names.index(name) for name in found.grip.members)
    closing = Closing(found.grip.body, members, (), 0.15)
    grasp = attach_grip(found.config, found.grip.body, np.array(members))
    x, y, angle = grasp.pose
    motion = MotionInPlace(replace(closing, body=body.moved_to((x, y, angle + away))))
    placed = motion.squeeze(grasp, grasp.squeeze)
    assert (placed is not grasp) == turned
    assert math.remainder(placed.pose.angle - angle - away, 2.0 * math.pi) == pytest.approx(
        0.0, abs=1e-3
    )


def test_a_command_that_limits_scale_down_is_not_followed(monkeypatch):
    motion, grasp = pair()
    still = np.zeros(len(HOME.roller_positions))
    for scale, followed in ((0.9995, True), (0.95, False)):
        command = SimpleNamespace(status=Status.OK, scale=scale, roller_velocities=still)
        monkeypatch.setattr(MotionInPlace, '_command', lambda *_, own=command: own)
        assert (motion.open_grip(grasp, 1e-3) is not None) == followed


def test_where_the_object_cannot_be_turned_its_place_is_kept(monkeypatch):
    motion, grasp = pair()
    asked = []

    def solve(config, held, twist, **options):
        asked.append(np.array(twist))
        status = Status.UNREACHABLE if twist[2] else Status.OK
        return SimpleNamespace(status=status)

    monkeypatch.setattr(motion_in_place, 'solve_twist', solve)
    assert motion._command(grasp, np.array([1.0, 2.0, 3.0]), 0.1).status is Status.OK
    assert [twist.tolist() for twist in asked] == [[1.0, 2.0, 3.0], [1.0, 2.0, 0.0]]


@BOTH
def test_limits_end_the_squeeze(held, squeeze):
    motion, grasp = held(limits=(SLOW,))
    force = 1.1 * grasp.squeeze
    assert squeeze(motion, grasp, force) is None
    assert said(motion) == ('squeeze', pytest.approx(grasp.squeeze), force)
    assert motion.evaluations == 0


@BOTH
def test_a_squeeze_that_is_not_reached_is_told(held, squeeze, monkeypatch):
    motion, grasp = held()
    for module in (motion_in_place, surrounding):
        monkeypatch.setattr(module, 'MAX_CORRECTIONS', 1)
    force = 0.7 * grasp.squeeze
    assert squeeze(motion, grasp, force) is None
    name, value, bound = said(motion)
    assert (name, bound) == ('squeeze', force)
    assert value < grasp.squeeze
    assert abs(value - force) > 1e-3 * force


def test_a_place_that_is_not_reached_is_told(monkeypatch):
    motion, grasp = pair()
    monkeypatch.setattr(motion_in_place, 'MAX_CORRECTIONS', 0)
    x, y, angle = grasp.pose
    for away, found in ((1e-3, None), (1e-5, grasp)):
        motion.closing = replace(motion.closing, body=grasp.body.moved_to((x + away, y, angle)))
        assert motion.squeeze(grasp, grasp.squeeze) is found
        assert said(motion) == ('in_place', pytest.approx(1e-3), 2e-5)


@pytest.mark.parametrize('share', [0.2, 0.3])
def test_a_grip_of_few_rollers_takes_the_object_along_a_little(share, monkeypatch):
    motion, grasp = pair()
    still = np.zeros(len(HOME.roller_positions))
    unreachable = SimpleNamespace(status=Status.UNREACHABLE, scale=1.0, roller_velocities=still)
    monkeypatch.setattr(MotionInPlace, '_command', lambda *_: unreachable)
    x, y, angle = grasp.pose
    tube = HOME.robot.description.tube_diameter
    motion.closing = replace(
        motion.closing, body=grasp.body.moved_to((x + share * tube, y, angle))
    )
    found = motion.squeeze(grasp, grasp.squeeze)
    if share < 0.25:
        assert found.pose == pytest.approx(grasp.pose)
    else:
        assert found is None
        assert said(motion) == (
            'in_place',
            pytest.approx(share * tube),
            pytest.approx(0.25 * tube),
        )


def fail(*arguments):
    """Stand for what has no configuration."""
    raise ConfigurationError('no configuration')


def test_what_is_beyond_a_bound_ends_the_motion(monkeypatch):
    motion, grasp = pair()
    still = np.zeros(len(HOME.roller_positions))
    assert motion.move(grasp, still).squeeze == pytest.approx(grasp.squeeze)
    assert motion.open_grip(grasp, 1e-3) is not None
    assert motion.evaluations == 2
    slow, _ = pair(limits=(SLOW,))
    assert slow.open_grip(grasp, 0.1) is None
    assert said(slow) == ('squeeze', grasp.squeeze, 0.0)
    assert slow.evaluations == 1
    stiff, _ = pair(min_rigidity=100.0)
    assert stiff.move(grasp, still) is None
    assert said(stiff) == ('rigidity', pytest.approx(1.0), 100.0)
    with monkeypatch.context() as patched:
        patched.setattr(motion_in_place, 'roll_grip', lambda *_: None)
        motion, _ = pair()
        assert motion.move(grasp, still) is None
        assert said(motion) == ('held', 0.0, 1.0)
    monkeypatch.setattr(Configuration, 'moved_to', fail)
    for act in (lambda one: one.move(grasp, still), lambda one: one.open_grip(grasp, 1e-3)):
        motion, _ = pair()
        assert act(motion) is None
        assert said(motion) == ('rigidity', 0.0, 0.15)


@pytest.mark.parametrize('name', ['squeeze', 'open_grip'])
def test_a_release_that_cannot_be_moved_says_so(name, monkeypatch):
    monkeypatch.setattr(MotionInPlace, name, lambda *_: None)
    found = plan_release(HOME, BODY, members_at(HOME.robot, MODULE), 0.05)
    violation = found.violation
    assert (violation.requirement, violation.value, violation.bound) == ('held', 0.0, 1.0)
    assert found.path.shape == (0, len(HOME.roller_positions))


def test_what_is_not_held_cannot_be_let_go():
    aside = plan_release(HOME, BODY, ('south/P-Q', 'south/Q-X'), 0.05)
    assert aside.violation.requirement == 'held'
    assert (aside.violation.value, aside.violation.bound) == (0.0, 1.0)
