# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random goals on every action of every node: each is read before it is accepted, and answered."""

import contextlib
import copy
import math

from geometry_msgs.msg import PoseStamped
from isotruss_msgs.action import (
    FollowObjectPath,
    FollowRollerTrajectory,
    MoveObject,
    PickObject,
    PlaceObject,
    PlanGrasp,
)
from isotruss_msgs.msg import RollerTolerance
from isotruss_ros.core import Pose
from isotruss_ros.core.planning.grasp_plan import GraspPlan
from isotruss_ros.nodes.conversions.messages import to_pose_message
from isotruss_ros.nodes.conversions.path_messages import to_duration
from isotruss_ros.nodes.grasp.searcher import Searcher
from isotruss_ros.nodes.grasp_planner import GraspPlanner
from isotruss_ros.nodes.manipulation.node import Manipulation
from isotruss_ros.nodes.path_follower import PathFollower
from isotruss_ros.nodes.pick_and_place.node import PickAndPlace
from manual_world import world
from nav_msgs.msg import Path
import numpy as np
from probe import CENTER, overrides
import pytest
from robots import SHARE
from std_msgs.msg import Header
from trajectories import AWAY, FollowJointTrajectory, HOME, NAMES, trajectory

NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-9, 1e6, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf)
INTEGERS = (0, 1, -1, 2**31 - 1, -(2**31))
TEXTS = ('', 'nobody', 'x' * 1000, 'ö/☃', 'north/Z', 'north/R-P', 'truss')
IN_TRUSS = Header(frame_id='truss')
COUNT = max(20, round(300 * SHARE))


def is_message(value):
    return hasattr(value, 'get_fields_and_field_types')


def leaves(message):
    """Yield the messages and the names of the fields that contain numbers, texts or lists."""
    for name in message.get_fields_and_field_types() if is_message(message) else vars(message):
        value = getattr(message, name)
        for part in value if isinstance(value, list) else [value]:
            if is_message(part):
                yield from leaves(part)
        if not is_message(value):
            yield message, name


def change(value, rng):
    """Return another value of the same type; an empty list, a list twice, or another element."""
    chosen = {str: TEXTS, bool: (True, False), int: INTEGERS, float: NUMBERS}.get(type(value))
    if chosen is not None:
        return type(value)(rng.choice(chosen))
    values = value.tolist() if hasattr(value, 'tolist') else value.copy()
    how = 2 if isinstance(value, np.ndarray) else rng.integers(4)  # arrays have one length
    if how > 1 and values and not is_message(values[0]):
        place = rng.integers(len(values))
        values[place] = change(values[place], rng)
        return values
    return how % 2 * 2 * values


def vary(message, rng):
    """Return a copy of a message with one to three fields, however deep, replaced."""
    changed = copy.deepcopy(message)
    for _ in range(rng.integers(1, 4)):
        fields = list(leaves(changed))
        owner, name = fields[rng.integers(len(fields))]
        # The type of the message may refuse the value.
        with contextlib.suppress(AssertionError, ValueError):
            setattr(owner, name, change(getattr(owner, name), rng))
    return changed


class IdlePlanner(GraspPlanner):
    """Planner whose searches find nothing, at once and without processes."""

    searcher_type = staticmethod(
        lambda _: Searcher(1, lambda *_, **__: GraspPlan((), True, None, 0, 0, 0.0))
    )


def path(*steps):
    poses = np.cumsum([(*CENTER, 0.3), *steps], axis=0)
    poses = [PoseStamped(pose=to_pose_message(Pose(*pose))) for pose in poses.tolist()]
    return Path(header=IN_TRUSS, poses=poses)


LYING = PoseStamped(header=IN_TRUSS, pose=to_pose_message(Pose(*map(float, CENTER), 0.0)))
FOLLOWED = {
    'trajectory': trajectory(HOME, AWAY),
    'path_tolerance': [RollerTolerance(name=NAMES[0], position=0.01)],
    'goal_tolerance': [RollerTolerance(name=NAMES[1], position=0.01)],
    'goal_time_tolerance': to_duration(0.5),
}
GOALS = {
    'FollowRollerTrajectory': (Manipulation, lambda: FollowRollerTrajectory.Goal(**FOLLOWED)),
    'FollowJointTrajectory': (Manipulation, lambda: FollowJointTrajectory.Goal(**FOLLOWED)),
    'FollowObjectPath': (PathFollower, lambda: FollowObjectPath.Goal(path=path((0.0, 0.02, 0.0)))),
    'PlanGrasp': (IdlePlanner, lambda: PlanGrasp.Goal(object_pose=LYING, object_diameter=0.3)),
    'PickObject': (PickAndPlace, lambda: PickObject.Goal(module='north/Z', squeeze=10.0)),
    'PlaceObject': (PickAndPlace, PlaceObject.Goal),
    'MoveObject': (PickAndPlace, lambda: MoveObject.Goal(path=path((0.0, 0.02, 0.0)))),
}


@pytest.mark.parametrize('name', GOALS)
def test_random_goals_are_answered_and_nodes_continue(name, monkeypatch):
    kind, good = GOALS[name]
    FollowJointTrajectory.install(monkeypatch)
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


def test_a_second_goal_is_refused_with_the_name_of_the_active_one():
    with world(lambda: PickAndPlace(overrides())) as w:
        w.spin(0.2, w.probe.send_all)
        first = w.send_goal(PickObject.Goal())
        second = w.send_goal(PlaceObject.Goal())
        _, result = w.finish(second, w.probe.send_all)
        assert first.accepted
        assert result.code == PlaceObject.Result.NOT_READY
        assert 'PickObject has been executed for ' in result.message
