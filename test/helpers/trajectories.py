# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories of the rollers as messages, and a stand-in for the standard trajectory action."""

from importlib.machinery import ModuleSpec
import sys
from types import ModuleType

from builtin_interfaces.msg import Duration
from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_ros.nodes.conversions.path_messages import to_duration
import numpy as np
from probe import N, ROBOT
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint, MultiDOFJointTrajectory

NAMES = list(ROBOT.roller_names)
HOME = np.zeros(N)
AWAY = np.array([0.02, -0.01, 0.0, 0.015, 0.01, -0.02])
TOPIC = 'joint_trajectory_controller/joint_trajectory'


def trajectory(*rows, times=None, names=NAMES):
    """Return a trajectory; 0.4 s from row to row unless told otherwise."""
    times = 0.4 * np.arange(len(rows)) if times is None else times
    points = [
        JointTrajectoryPoint(positions=[float(v) for v in row], time_from_start=to_duration(when))
        for row, when in zip(rows, times, strict=True)
    ]
    return JointTrajectory(joint_names=list(names), points=points)


#: Fields of a goal of the standard action, each with what makes its default.
FIELDS = {
    'trajectory': JointTrajectory,
    'multi_dof_trajectory': MultiDOFJointTrajectory,
    'path_tolerance': list,
    'component_path_tolerance': list,
    'goal_tolerance': list,
    'component_goal_tolerance': list,
    'goal_time_tolerance': Duration,
}


class FollowJointTrajectory(FollowRollerTrajectory):
    """Stand-in for the action of control_msgs, of which there is no wheel."""

    class Goal:
        """Goal of the standard action; RollerTolerance has the fields of JointTolerance."""

        def __init__(self, **fields):
            for name, make in FIELDS.items():
                setattr(self, name, fields.pop(name, None) or make())
            assert not fields, fields

    @classmethod
    def install(cls, monkeypatch):
        """Let control_msgs be found, with this action."""
        for name in ('control_msgs', 'control_msgs.action'):
            module = ModuleType(name)
            module.__spec__ = ModuleSpec(name, None)
            module.FollowJointTrajectory = cls
            monkeypatch.setitem(sys.modules, name, module)
