# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Picking up and letting go: any convex object, on the elastic plant, by planned paths."""

import itertools

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    ElasticObject,
    GraspRequirements,
    load_robot,
    plan_grasps,
    Polygon,
    RollerFaults,
    SimulatedRobot,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.planning.release import plan_release
from isotruss_ros.core.safety.margins import object_distances
import numpy as np
import pytest

HOME = load_robot('nine_member').home
BOX = Polygon([(-0.15, -0.1), (0.15, -0.1), (0.15, 0.1), (-0.15, 0.1)], corner_radius=0.02)
CLEARANCE = 0.03


def drive(robot, path, parts=10):
    """Follow a path."""
    for begin, end in itertools.pairwise(path):
        robot.command((end - begin) / parts)
        for _ in range(parts):
            robot.advance(1.0)


#: Of different tubes, around the hole between them.
THREE = ('south/P-Q', 'east/Q-R', 'north/R-P')


@pytest.mark.parametrize(
    ('body', 'count'),
    [
        (ConvexObject(BOX, (0.716, 0.5, 0.2)), 2),
        pytest.param(ConvexObject(Disc(0.6), (0.716, -0.4134, 0.2)), 3, marks=pytest.mark.nightly),
    ],
)
def test_what_was_picked_up_is_held_and_let_go_where_it_is(body, count):
    needs = GraspRequirements(squeeze=8.0, count=1, members=THREE if count == 3 else None)
    (grasp,) = plan_grasps(HOME, body, needs, max_rounds=1, thorough=False)
    assert len(grasp.grip.members) == count
    thing = ElasticObject(body, needs.friction)
    robot = SimulatedRobot(HOME, thing, RollerFaults())
    drive(robot, grasp.path)
    assert isinstance(thing.grasp, HeldGrip)
    assert set(thing.grasp.member_names) == set(grasp.grip.members)
    assert thing.grasp.squeeze == pytest.approx(8.0, rel=0.25)
    held = np.array(robot.object_pose)
    assert np.hypot(*(held - body.pose)[:2]) < 3e-3

    release = plan_release(robot.config, body.moved_to(held), grasp.grip.members, CLEARANCE)
    assert release.violation is None
    drive(robot, release.path)
    assert thing.grasp is None
    left = np.array(robot.object_pose)
    assert np.hypot(*(left - held)[:2]) < 3e-3
    assert abs(left[2] - held[2]) < 0.02
    members = [HOME.robot.member_names.index(name) for name in grasp.grip.members]
    gaps = object_distances(robot.config, body.moved_to(held))
    assert gaps[members] == pytest.approx(CLEARANCE, abs=5e-3)


def test_only_members_of_the_robot_let_go():
    with pytest.raises(GraspError, match='south/P-X'):
        plan_release(HOME, ConvexObject(BOX), ('south/P-Q', 'south/P-X'), CLEARANCE)
