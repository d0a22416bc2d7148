# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Rare cases of the plant: nothing to be computed, nowhere to be pushed, another object."""

from grips import gripped
from isotruss_ros.core import (
    ConvexObject,
    Disc,
    ElasticObject,
    load_robot,
    place_between,
    Polygon,
    Pose,
    RigidObject,
    RollerFaults,
    SimulatedRobot,
)
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.kinematics.depths import push_out
from isotruss_ros.core.model.segment_gaps import segment_gaps
from isotruss_ros.core.simulation import rigid_object
import numpy as np
import pytest

CONFIG, CYLINDER = gripped(35.0, squeeze=0.06)
HOME = load_robot('nine_member').home
SIDES = ('south/P-Q', 'north/R-P')
GRASPING = {'north/P-Z', 'north/Z-R'}
BOX = Polygon([(-0.25, -0.2), (0.25, -0.2), (0.25, 0.2), (-0.25, 0.2)], 0.02)
BETWEEN = place_between(HOME, SIDES, BOX, -0.5, 0.01).body


def not_solved(*arguments, **options):
    """Solve nothing."""
    raise SolverError('not solved')


def test_a_load_is_kept_until_another_one_comes():
    simulated = ElasticObject(CYLINDER, 0.5)
    assert simulated.external_wrench.tolist() == [0.0, 0.0, 0.0]
    simulated.external_wrench = (0.5, -1.0, 0.1)
    assert simulated.external_wrench.tolist() == [0.5, -1.0, 0.1]


def test_forces_that_cannot_be_computed_let_no_disc_go(monkeypatch):
    held = RigidObject(CYLINDER, 0.5)
    held.come_to_rest(CONFIG)
    assert set(held.members) == GRASPING
    pose = held.pose(CONFIG)
    monkeypatch.setattr(rigid_object, 'settle_grasp', not_solved)
    held.come_to_rest(CONFIG)
    assert set(held.members) == GRASPING
    assert held.pose(CONFIG) == pose


def test_forces_that_cannot_be_computed_hold_no_box(monkeypatch):
    simulated = RigidObject(BETWEEN, 1.0)
    with monkeypatch.context() as patch:
        patch.setattr(rigid_object, 'settle_grasp', not_solved)
        simulated.come_to_rest(HOME)
    assert simulated.members == ()
    assert simulated.pose(HOME) == pytest.approx(BETWEEN.pose)
    simulated.come_to_rest(HOME)
    assert set(simulated.members) == set(SIDES)


def test_a_box_lies_where_it_lost_the_members():
    simulated = RigidObject(BETWEEN, 1.0)
    simulated.come_to_rest(HOME)
    there = simulated.pose(HOME)
    far = HOME.moved_to([0.25, -0.3, 0.3, 0.2, -0.3, 0.25])
    simulated.follow(far)
    assert simulated.members == ()
    assert simulated.pose(far) == pytest.approx(there)
    # It does not go back into the grip by itself.
    simulated.follow(HOME)
    assert simulated.members == ()


def test_an_object_that_fits_nowhere_stays_where_it_was_pushed_last():
    """Three members enclose a disc that is too large for them."""
    triangle = load_robot('triangle').home
    topology = triangle.robot.topology
    begin, end = triangle.points[topology.b], triangle.points[topology.c[topology.following]]
    center, diameter = np.mean(begin), 0.9
    body = ConvexObject(Disc(diameter), (center.real, center.imag, 0.2))
    pushed = push_out(triangle, body)
    assert pushed.pose.angle == 0.2
    assert segment_gaps(pushed, begin, end).gaps.min() < 0.0
    assert abs(pushed.center - center) < diameter


def test_another_object_takes_the_place_of_the_one_before():
    robot = SimulatedRobot(CONFIG, RigidObject(CYLINDER, 0.5), RollerFaults())
    robot.advance(0.1)
    robot.replace_object(RigidObject(ConvexObject(BOX, Pose(5.0, 4.0, 0.3)), 1.0))
    assert robot.object_pose == pytest.approx((5.0, 4.0, 0.3))
    robot.advance(0.1)
    # The robot has been at rest, and looks once more for what it holds.
    again = RigidObject(CYLINDER, 0.5)
    robot.replace_object(again)
    assert again.members == ()
    robot.advance(0.1)
    assert set(again.members) == GRASPING
    assert robot.config is CONFIG
