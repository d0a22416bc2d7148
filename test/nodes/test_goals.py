# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random goals on every action of every node: each is read before it is accepted, and answered."""

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import (
    FollowObjectPath,
    FollowRollerTrajectory,
    MoveObject,
    PickObject,
    PlaceObject,
    PlanGrasp,
)
from isotruss_ros.core import Pose
from isotruss_ros.core.planning.searcher import Answer, SearchOutcome
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
import joint_trajectory_action
from joint_trajectory_action import FollowJointTrajectory, tolerance
from manual_world import world
from nav_msgs.msg import Path
import numpy as np
from probe import CENTER, overrides
import pytest
from random_messages import vary
from robots import SHARE
from trajectories import AWAY, HOME, lasting, NAMES, trajectory

COUNT = max(20, round(300 * SHARE))


def path(*steps):
    """Return a path of the object from where the probe puts it."""
    made = Path()
    made.header.frame_id = 'truss'
    poses = np.cumsum([(*CENTER, 0.3), *steps], axis=0)
    made.poses = [PoseStamped(pose=to_pose_message(Pose(*pose))) for pose in poses.tolist()]
    return made


def lying():
    """Return where the object lies."""
    made = PoseStamped(pose=to_pose_message(Pose(*CENTER, 0.0)))
    made.header.frame_id = 'truss'
    return made


BOUNDS = {
    'path_tolerance': [tolerance(NAMES[0], 0.01)],
    'goal_tolerance': [tolerance(NAMES[1], 0.01)],
    'goal_time_tolerance': lasting(0.5),
}
GOALS = {
    'FollowRollerTrajectory': (
        Manipulation,
        lambda: FollowRollerTrajectory.Goal(trajectory=trajectory(HOME, AWAY), **BOUNDS),
    ),
    'FollowJointTrajectory': (
        Manipulation,
        lambda: FollowJointTrajectory.Goal(trajectory=trajectory(HOME, AWAY), **BOUNDS),
    ),
    'FollowObjectPath': (PathFollower, lambda: FollowObjectPath.Goal(path=path((0.0, 0.02, 0.0)))),
    'PlanGrasp': (GraspPlanner, lambda: PlanGrasp.Goal(object_pose=lying(), object_diameter=0.3)),
    'PickObject': (PickAndPlace, lambda: PickObject.Goal(module='north/Z', squeeze=10.0)),
    'PlaceObject': (PickAndPlace, PlaceObject.Goal),
    'MoveObject': (PickAndPlace, lambda: MoveObject.Goal(path=path((0.0, 0.02, 0.0)))),
}


@pytest.mark.parametrize('name', GOALS)
def test_random_goals_are_answered_and_do_no_harm(name, monkeypatch):
    kind, good = GOALS[name]
    joint_trajectory_action.install(monkeypatch)
    none = Answer(SearchOutcome.FAILED, 'processes would search')
    monkeypatch.setattr(GraspPlanner, '_begin', lambda node, _: node._end(none))
    rng = np.random.default_rng(7)
    with world(lambda: kind(overrides(command_timeout=1.0))) as w:
        w.spin(0.2, w.probe.send_all)
        for _ in range(COUNT):
            goal = w.send_goal(vary(good(), rng))
            w.spin(0.03, w.probe.send_all)
            if goal.accepted and not goal.ended:
                goal.cancel()
                w.spin(0.03, w.probe.send_all)
            assert w.nodes[1].active


def test_a_goal_beside_another_is_answered_with_what_is_carried_out():
    with world(lambda: PickAndPlace(overrides())) as w:
        w.spin(0.2, w.probe.send_all)
        first = w.send_goal(PickObject.Goal())
        second = w.send_goal(PlaceObject.Goal())
        w.until(lambda: second.ended, w.probe.send_all)
        assert first.accepted
        _, result = second.result()
        assert result.code == PlaceObject.Result.NOT_READY
        assert 'PickObject is carried out, for ' in result.message
