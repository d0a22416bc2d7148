# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Letting go: on the elastic plant the planned path leaves the object where it is held."""

import functools
import itertools
import re

from isotruss_ros.core import (
    ConvexObject,
    ElasticObject,
    GraspRequirements,
    load_robot,
    plan_grasps,
    RollerFaults,
    SimulatedRobot,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.planning.release import plan_release
from isotruss_ros.core.safety.margins import object_distances
import numpy as np
import pytest

HOME = load_robot('nine_member').home
MODULE, CLEARANCE, CENTER = 'north/Z', 0.05, (0.6, 0.3)
MEMBERS = members_at(HOME.robot, MODULE)


class Plant:
    """
    An elastic plant that has picked up an object.

    :param angle: at which the object lies.
    """

    def __init__(self, diameter, module=MODULE, angle=0.0):
        self.grasp = grasped(diameter, module)
        body = ConvexObject.disc(CENTER, diameter).moved_to((*CENTER, angle))
        self.object = ElasticObject(body, 0.5)
        self.robot = SimulatedRobot(HOME, self.object, RollerFaults())
        self.drive(self.grasp.path)

    def drive(self, path, parts=30):
        """Follow a path; return the configuration at its end."""
        for begin, end in itertools.pairwise(path):
            self.robot.command((end - begin) / parts)
            for _ in range(parts):
                self.robot.advance(1.0)
        return self.robot.config


@functools.lru_cache(maxsize=8)
def grasped(diameter, module=MODULE):
    """Return a planned grasp."""
    needs = GraspRequirements(module=module, squeeze=15.0, count=1)
    return plan_grasps(HOME, ConvexObject.disc(CENTER, diameter), needs, thorough=False)[0]


@pytest.mark.parametrize(
    ('diameter', 'module', 'angle'),
    [
        (0.2, MODULE, 0.0),
        (0.3, 'north/R', 0.7),
        pytest.param(0.3, MODULE, 2.5, marks=pytest.mark.nightly),
        pytest.param(0.2, 'north/P', -3.1, marks=pytest.mark.nightly),
    ],
)
def test_the_object_stays_where_it_is_let_go(diameter, module, angle):
    plant = Plant(diameter, module, angle)
    held = plant.robot.object_pose
    body = ConvexObject.disc(CENTER, diameter).moved_to(held)
    release = plan_release(plant.robot.config, body, plant.grasp.grip.members, CLEARANCE)
    assert release.violation is None
    squeezes = [plant.object.grasp.squeeze]
    for piece in itertools.pairwise(release.path[: release.apart]):
        plant.drive(piece)
        squeezes.append(plant.object.grasp.squeeze)
        assert np.array(plant.robot.object_pose) == pytest.approx(np.array(held), abs=1e-4)
    assert (np.diff(squeezes) < 0.0).all()
    shares = np.array(squeezes[1:10]) / squeezes[0]
    assert shares == pytest.approx(np.linspace(0.9, 0.1, 9), rel=0.03)
    assert squeezes[-1] < 0.01 * squeezes[0]
    apart = release.apart
    plant.drive([release.path[apart - 1], release.path[apart]])
    assert plant.object.grasp is None
    config = plant.drive(release.path[apart:])
    lies = plant.robot.object_pose
    assert np.hypot(lies.x - held.x, lies.y - held.y) < 2e-4
    assert abs(lies.angle - held.angle) < 1e-3
    gaps = object_distances(config, ConvexObject.disc(lies[:2], diameter))
    names = config.robot.member_names
    ours = [names.index(name) for name in plant.grasp.members]
    assert gaps[ours] == pytest.approx(CLEARANCE, abs=1e-3)
    assert gaps.min() > 0.01


def test_a_squeeze_that_is_right_does_not_overshoot_while_the_object_is_brought_back():
    rollers = [-0.1916, 0.0704, 0.1637, 0.1456, 0.2097, -0.3699]  # it was carried to there
    held = ConvexObject.disc((0.6002, 0.4007), 0.2)
    release = plan_release(
        HOME.robot.configuration(rollers), held, members_at(HOME.robot, 'north/P'), CLEARANCE
    )
    assert release.violation is None


def test_an_object_that_nothing_presses_on_is_left_at_once():
    held = grasped(0.2)
    body = ConvexObject.disc(CENTER, 0.2)
    first = plan_release(held.config, body, MEMBERS, CLEARANCE)
    config = held.config
    for row in first.path[1:]:
        config = config.moved_to(row)
    again = plan_release(config, body, MEMBERS, 1.5 * CLEARANCE)
    assert again.violation is None
    assert again.apart == 1


def test_an_object_that_is_barely_touched_is_left_at_once():
    plant = Plant(0.2)
    touch = plant.grasp.path[plant.grasp.touch]
    config = HOME.robot.configuration(touch)
    release = plan_release(config, ConvexObject.disc(CENTER, 0.2), MEMBERS, CLEARANCE)
    assert release.violation is None
    assert release.apart == 1


def test_other_members_do_not_hold_it():
    held = grasped(0.2)
    other = members_at(HOME.robot, 'south/P')
    release = plan_release(held.config, ConvexObject.disc(CENTER, 0.2), other, CLEARANCE)
    violation = release.violation
    assert (violation.requirement, violation.value, violation.bound) == ('held', 0.0, 1.0)
    assert len(release.path) == 0


@pytest.mark.parametrize('clearance', [0.0, -1.0, np.inf, np.nan, 1e160])
def test_a_clearance_is_positive_and_within_the_robot(clearance):
    held = grasped(0.2)
    with pytest.raises(GraspError, match=re.escape(f'clearance {clearance:.6g} m')):
        plan_release(held.config, ConvexObject.disc(CENTER, 0.2), MEMBERS, clearance)


def test_members_that_cannot_open_so_far_do_not_let_go():
    body = ConvexObject.disc(CENTER, 0.3)
    near, far = (plan_release(HOME, body, MEMBERS, away) for away in (0.03, 3.0))
    assert near.violation is None
    assert far.violation is not None
    assert len(far.path) == 0
