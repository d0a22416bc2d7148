# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A stand-in for control_msgs/FollowJointTrajectory, with its fields: there is no wheel of it."""

from importlib.machinery import ModuleSpec
import sys
from types import ModuleType

from builtin_interfaces.msg import Duration
from isotruss_msgs.action import FollowRollerTrajectory
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

#: Fields of the goal, each with what makes its default.
FIELDS = {
    'trajectory': JointTrajectory,
    'multi_dof_trajectory': MultiDOFJointTrajectory,
    'path_tolerance': list,
    'component_path_tolerance': list,
    'goal_tolerance': list,
    'component_goal_tolerance': list,
    'goal_time_tolerance': Duration,
}


class Goal:
    """A goal of the standard action; RollerTolerance has the fields of JointTolerance."""

    def __init__(self, **fields):
        for name, make in FIELDS.items():
            setattr(self, name, fields.pop(name, None) or make())
        assert not fields, fields


class FollowJointTrajectory(FollowRollerTrajectory):
    """Type of the standard action."""

    Goal = Goal


def install(monkeypatch):
    """Let control_msgs be found."""
    for name in ('control_msgs', 'control_msgs.action'):
        module = ModuleType(name)
        module.__spec__ = ModuleSpec(name, None)
        module.FollowJointTrajectory = FollowJointTrajectory
        monkeypatch.setitem(sys.modules, name, module)
