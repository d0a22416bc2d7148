# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Roller trajectories from a topic and an action, which are followed one at a time.

While a trajectory is followed, twists are ignored. Topic and action have the names that
ros2_control's joint_trajectory_controller uses. The type of its action is in the package
control_msgs; without this package, only the equivalent action type of isotruss_msgs is offered.
"""

from __future__ import annotations

from dataclasses import replace
import importlib
import importlib.util
from typing import Any

from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_ros.core import IsotrussError, Status, TwistServo
from isotruss_ros.core.inputs import require_fresh, StampedInput
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.paths.roller_trajectory import RollerTrajectoryServo
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.nodes.conversions.messages import make_header, MessageError
from isotruss_ros.nodes.conversions.path_messages import to_duration
from isotruss_ros.nodes.conversions.trajectory_goals import read_roller_goal, RollerGoal
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.single_goal import Ending, SingleGoal
from isotruss_ros.nodes.manipulation.sparse_messages import SparseMessages
import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

TOPIC = 'joint_trajectory_controller/joint_trajectory'
ACTION = 'follow_roller_trajectory'
STANDARD_ACTION = 'joint_trajectory_controller/follow_joint_trajectory'
REPLACED_TEXT = 'a newer trajectory was received'
Result = FollowRollerTrajectory.Result
#: Result code of a trajectory that was aborted.
ABORTED_CODE = Result.PATH_TOLERANCE_VIOLATED


class TrajectoryFollowing:
    """
    Execution of one roller trajectory at a time, after which twists move the object again.

    A new trajectory replaces the current trajectory. An empty trajectory or any stop of the
    rollers ends the current trajectory, which does not resume. The result of a trajectory remains
    the status of the node until the next twist.

    :ivar follower: servo that tracks the trajectory.
    """

    def __init__(self, node: ManagedNode, servo: TwistServo) -> None:
        self._node, self._servo = node, servo
        self.follower = RollerTrajectoryServo(servo.robot, servo.settings.timeout, servo.inputs)
        self._outcome: tuple[Status, str] | None = None
        self._goals = [self._offer(kind, name) for kind, name in _offered_actions()]

    def subscribe(self) -> None:
        """Accept roller trajectories from now on."""
        self._outcome = None
        SparseMessages(self._node, JointTrajectory, TOPIC, self._receive, self._report_missing)

    def decide(self, now: float) -> Decision:
        """Return the decision of the cycle, from the active trajectory or else from twists."""
        if self.follower.trajectory is not None:
            # A twist of this time would move the object right after the end of the trajectory.
            self._servo.receive(twist=None)
            for goal in self._goals:
                if (loss := goal.client.find_loss(self._servo.settings.timeout)) is not None:
                    self.abort(loss)
        if self.follower.trajectory is None:
            return self._add_outcome(self._servo.decide(now))
        self.follower.timeout = self._servo.settings.timeout
        step = self.follower.decide(now)
        if step.failure:
            code = Result.GOAL_TOLERANCE_VIOLATED if step.at_goal else ABORTED_CODE
            self._end(Status.HALT_TRAJECTORY, f'trajectory aborted: {step.failure}', code)
        elif step.ended:
            self._end(Status.ARRIVED, 'the rollers have arrived', Result.SUCCESSFUL)
        speeds = self._servo.command(step.speeds, now)
        self._publish_feedback()
        status, message = self._outcome or (Status.FOLLOWING_TRAJECTORY, '')
        return Decision(
            RollerCommand(speeds, np.zeros(3), 1.0, status),
            np.zeros(3),
            message,
            tuple(sorted(self._servo.failed)),
        )

    def abort(self, why: str) -> bool:
        """
        Abort the active roller trajectory, if any.

        :return: whether a trajectory was active, in which case the rollers must be stopped.
        """
        if self.follower.trajectory is None:
            return False
        self.follower.trajectory = None
        self._end(Status.HALT_TRAJECTORY, f'trajectory aborted: {why}', ABORTED_CODE)
        return True

    def _receive(self, messages: list[JointTrajectory]) -> None:
        message = messages[-1]
        if not message.points:
            self.abort('an empty trajectory was received')
            return
        self._end_goals(REPLACED_TEXT)
        try:
            self._begin(self._read(FollowRollerTrajectory.Goal(trajectory=message)))
        except IsotrussError as error:
            self.follower.trajectory = None
            self._end(Status.HALT_TRAJECTORY, f'trajectory rejected: {error}', ABORTED_CODE)

    def _report_missing(self, why: str) -> None:
        """Stop, because a message that starts or ends a trajectory may have been lost."""
        if not self.abort(f'{why}: publish the trajectory again'):
            self._node.get_logger().warning(f'{why}: if it was a trajectory, publish it again')

    def _read(self, goal: Any) -> RollerGoal:
        """Return the content of a goal; raise an error if it is invalid."""
        servo, now = self._servo, self._node.now()
        if servo.inputs.halt is not None:
            raise MessageError(servo.inputs.halt[1])
        timeout = self.follower.timeout = servo.settings.timeout
        (rollers,) = require_fresh(now, timeout, joint_states=servo.inputs.rollers)
        asked = read_roller_goal(goal, servo.robot, rollers.value.positions, now, timeout)
        self.follower.check_start(asked.trajectory, now)
        return asked

    def _begin(self, asked: RollerGoal) -> None:
        """Start a roller trajectory."""
        now, (trajectory, start, _) = self._node.now(), asked
        self.follower.begin(trajectory, now, start, asked.tolerances)
        self._outcome = None
        when = '' if start is None else f', in {start - now:.1f} s'
        self._node.get_logger().info(
            f'following a trajectory of {trajectory.duration:.1f} s{when}'
        )

    def _offer(self, kind: Any, name: str) -> SingleGoal:
        """Offer an action with roller trajectories as goals."""

        def refuse(error: IsotrussError) -> Any:
            code = getattr(error, 'code', Result.INVALID_GOAL)
            # Clients of the standard expect a rejection for faults without a code.
            if code == Result.INVALID_GOAL and kind is not FollowRollerTrajectory:
                return None
            return kind.Result(error_code=code, error_string=f'trajectory rejected: {error}')

        def begin(asked: RollerGoal) -> None:
            self._end_goals(REPLACED_TEXT, spared=goal)
            self._begin(asked)

        goal = SingleGoal(
            self._node,
            kind,
            name,
            self._read,
            refuse,
            begin,
            self._cancel,
            preempted=lambda: self._end_goals(REPLACED_TEXT),
            supervised=True,
        )
        return goal

    def _cancel(self) -> None:
        self.follower.trajectory = None
        # No fault: without a twist the rollers are halted anyhow.
        words = 'trajectory cancelled by the client'
        self._end(Status.HALT_NO_TWIST, words, ABORTED_CODE, Ending.CANCELED)

    def _publish_feedback(self) -> None:
        """Publish desired and measured states of the rollers to the goal's client."""
        goal = next((goal for goal in self._goals if goal.active), None)
        trajectory, measured = self.follower.trajectory, self._servo.inputs.rollers
        if goal is None or trajectory is None or not isinstance(measured, StampedInput):
            return
        wanted = trajectory.at(self.follower.time)
        actual, robot = measured.value.positions, self._servo.robot

        def point(positions: Array, **others: Any) -> JointTrajectoryPoint:
            start = to_duration(self.follower.time)
            return JointTrajectoryPoint(
                positions=positions.tolist(), time_from_start=start, **others
            )

        goal.publish_feedback(
            lambda: goal.kind.Feedback(
                header=make_header(self._node.now(), robot.frame),
                joint_names=list(robot.roller_names),
                desired=point(wanted.positions, velocities=wanted.velocities.tolist()),
                actual=point(actual),
                error=point(wanted.positions - actual),
            )
        )

    def _end(
        self, status: Status, message: str, code: int, ending: Ending = Ending.ABORTED
    ) -> None:
        """Report the end of the trajectory, and end the goal of its action."""
        self._outcome = (status, message)
        if status is Status.HALT_TRAJECTORY:
            self._node.get_logger().warning(message)
        else:
            self._node.get_logger().info(message)
        arrived = code == Result.SUCCESSFUL
        self._end_goals(message, Ending.SUCCEEDED if arrived else ending, code)

    def _end_goals(
        self,
        text: str,
        ending: Ending = Ending.ABORTED,
        code: int = ABORTED_CODE,
        spared: SingleGoal | None = None,
    ) -> None:
        """End the goal of a finished trajectory, if the trajectory came from an action."""
        for goal in self._goals:
            if goal.active and goal is not spared:
                goal.end(ending, goal.kind.Result(error_code=code, error_string=text))

    def _add_outcome(self, decision: Decision) -> Decision:
        """Add the result of the last trajectory to a decision, until the next twist."""
        status = decision.command.status
        if self._outcome is None or status < Status.HALT_NO_TWIST:
            self._outcome = None
            return decision
        if status is not Status.HALT_NO_TWIST:
            return decision
        status, message = self._outcome
        if status is Status.HALT_TRAJECTORY:
            message = f'{message}; next step: a new twist or trajectory'
        return replace(decision, command=replace(decision.command, status=status), message=message)


def _offered_actions() -> list[tuple[type, str]]:
    """Return type and name of each trajectory action that can be offered."""
    offered = [(FollowRollerTrajectory, ACTION)]
    if importlib.util.find_spec('control_msgs') is not None:
        standard = importlib.import_module('control_msgs.action')
        offered.append((standard.FollowJointTrajectory, STANDARD_ACTION))
    return offered
