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
from trajectories import AWAY, FollowJointTrajectory, HOME, lasting, NAMES, trajectory

NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-9, 1e6, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf)
INTEGERS = (0, 1, -1, 2**31 - 1, -(2**31))
TEXTS = ('', 'nobody', 'x' * 1000, 'ö/☃', 'north/Z', 'north/R-P', 'truss')


def vary(message, rng):
    """Return a copy of a message with one to three fields, however deep, replaced."""
    changed = copy.deepcopy(message)
    for _ in range(rng.integers(1, 4)):
        _replace(changed, rng)
    return changed


def _replace(message, rng):
    types = getattr(message, 'get_fields_and_field_types', lambda: vars(message))
    name = str(rng.choice(list(types())))
    value = getattr(message, name)
    if hasattr(value, 'get_fields_and_field_types'):
        _replace(value, rng)
        return
    if not isinstance(value, str | bool | int | float):
        value = _replace_list(list(value), rng, isinstance(value, np.ndarray))
    # The type of the message may refuse the value.
    with contextlib.suppress(AssertionError, ValueError):
        setattr(message, name, _replace_value(value, rng))


def _replace_value(value, rng):
    """Return another value of the same type; a list as it is."""
    choices = {str: TEXTS, bool: (not value,), int: INTEGERS, float: NUMBERS}
    chosen = choices.get(type(value))
    return value if chosen is None else type(value)(rng.choice(chosen))


def _replace_list(values, rng, fixed_size):
    """Return an empty list, the list twice, or one with another element."""
    how = 2 if fixed_size else rng.integers(4)
    if how < 2 or not values:
        return how * 2 * values
    place = rng.integers(len(values))
    if hasattr(values[place], 'get_fields_and_field_types'):
        _replace(values[place], rng)
    else:
        values[place] = _replace_value(values[place], rng)
    return values


class NoSearch(Searcher):
    """Search without processes, which fails at once."""

    def __init__(self, _workers):
        super().__init__(1, lambda *_, **__: GraspPlan((), True, None, 0, 0, 0.0))


class IdlePlanner(GraspPlanner):
    """Planner that finds nothing."""

    searcher_type = NoSearch


IN_TRUSS = Header(frame_id='truss')
COUNT = max(20, round(300 * SHARE))


def path(*steps):
    poses = np.cumsum([(*CENTER, 0.3), *steps], axis=0)
    poses = [PoseStamped(pose=to_pose_message(Pose(*pose))) for pose in poses.tolist()]
    return Path(header=IN_TRUSS, poses=poses)


OBJECT_POSE = PoseStamped(header=IN_TRUSS, pose=to_pose_message(Pose(*CENTER, 0.0)))
BOUNDS = {
    'path_tolerance': [RollerTolerance(name=NAMES[0], position=0.01)],
    'goal_tolerance': [RollerTolerance(name=NAMES[1], position=0.01)],
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
    'PlanGrasp': (
        IdlePlanner,
        lambda: PlanGrasp.Goal(object_pose=OBJECT_POSE, object_diameter=0.3),
    ),
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
