# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Roller trajectories by topic and by action: followed in place of twists, one at a time.

Topic and action are those of ros2_control's joint_trajectory_controller. The package control_msgs
has the type of its action; where it is not installed only our own type is offered, which means the
same.
"""

from __future__ import annotations

from dataclasses import replace
import importlib
import importlib.util
from typing import Any

from isotruss_msgs.action import FollowRollerTrajectory
from isotruss_ros.core import IsotrussError, Status, TwistServo
from isotruss_ros.core.control.decision import Decision
from isotruss_ros.core.control.inputs import require_fresh, StampedInput
from isotruss_ros.core.control.roller_trajectory import RollerTrajectoryServo
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.nodes.conversions.messages import MessageError
from isotruss_ros.nodes.conversions.path_messages import to_roller_feedback
from isotruss_ros.nodes.conversions.trajectory_goals import read_roller_goal, RollerGoal
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.single_goal import Ending, SingleGoal
from isotruss_ros.nodes.manipulation.sparse_messages import SparseMessages
import numpy as np
from trajectory_msgs.msg import JointTrajectory

TOPIC = 'joint_trajectory_controller/joint_trajectory'
ACTION = 'follow_roller_trajectory'
STANDARD_ACTION = 'joint_trajectory_controller/follow_joint_trajectory'
REPLACED = 'a newer trajectory was received'
Result = FollowRollerTrajectory.Result
#: Of all that ends a trajectory on its way.
VIOLATED = Result.PATH_TOLERANCE_VIOLATED


class TrajectoryFollowing:
    """
    Follow one trajectory at a time; twists count again once it has ended.

    A new trajectory replaces the old one, an empty one ends it; what stops the rollers ends it
    too, and no trajectory resumes by itself. How one ended is the status until the next twist.

    :param node: subscribes while it is active.
    :param servo: of the twists; its roller positions count, and it learns what is commanded.
    """

    def __init__(self, node: ManagedNode, servo: TwistServo) -> None:
        self._node, self._servo = node, servo
        self._follower = RollerTrajectoryServo(servo.robot, servo.timeout)
        self._outcome: tuple[Status, str] | None = None
        self._goals = [self._offer(kind, name) for kind, name in _offered_actions()]

    @property
    def busy(self) -> bool:
        """Return whether there is a trajectory to follow."""
        return self._follower.busy

    @property
    def time(self) -> float:
        """Return the time of the trajectory at which the rollers are [s]."""
        return self._follower.time

    def subscribe(self) -> None:
        """Accept trajectories from now on."""
        self._outcome = None
        SparseMessages(self._node, JointTrajectory, TOPIC, self._receive, self._report_missing)

    def decide(self, now: float) -> Decision:
        """
        Return what to do in the cycle that begins now, with a trajectory or without.

        :param now: time on the clock of the inputs [s].
        """
        if self.busy:
            # A twist of this time would start the object as soon as the trajectory has ended.
            self._servo.twist = None
            for goal in self._goals:
                if (loss := goal.find_loss(self._servo.timeout)) is not None:
                    self.abort(loss)
        if not self.busy:
            return self._add_outcome(self._servo.decide(now))
        self._follower.rollers, self._follower.timeout = self._servo.rollers, self._servo.timeout
        step = self._follower.decide(now)
        if step.failure:
            code = Result.GOAL_TOLERANCE_VIOLATED if step.at_goal else VIOLATED
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
        Give up the trajectory, if there is one.

        :param why: the reason.
        :return: whether there was one: the rollers have to be told to stop.
        """
        if not self.busy:
            return False
        self._follower.end()
        self._end(Status.HALT_TRAJECTORY, f'trajectory aborted: {why}', VIOLATED)
        return True

    def _receive(self, messages: list[JointTrajectory]) -> None:
        message = messages[-1]
        if not message.points:
            self.abort('an empty trajectory was received')
            return
        self._end_goals(REPLACED)
        try:
            self._begin(self._read(FollowRollerTrajectory.Goal(trajectory=message)))
        except IsotrussError as error:
            self._follower.end()
            self._end(Status.HALT_TRAJECTORY, f'trajectory rejected: {error}', VIOLATED)

    def _report_missing(self, why: str) -> None:
        """Stop: what was lost may have been a trajectory in place of this one, or its end."""
        if not self.abort(f'{why}: publish again what is to be followed'):
            self._node.get_logger().warning(f'{why}: if it was a trajectory, publish it again')

    def _read(self, goal: Any) -> RollerGoal:
        """Return what a goal asks for; raise why it cannot be followed."""
        servo, follower, now = self._servo, self._follower, self._node.now()
        if servo.stopped is not None:
            raise MessageError(servo.stopped[1])
        follower.rollers, follower.timeout = servo.rollers, servo.timeout
        (rollers,) = require_fresh(now, servo.timeout, joint_states=servo.rollers)
        here = rollers.value.positions
        asked = read_roller_goal(goal, servo.robot, here, now, servo.timeout)
        follower.check_start(asked.trajectory, now)
        return asked

    def _begin(self, asked: RollerGoal) -> None:
        """Follow a trajectory that was read just now."""
        now, (trajectory, start, _) = self._node.now(), asked
        self._follower.begin(trajectory, now, start, asked.tolerances)
        self._outcome = None
        when = '' if start is None else f', in {start - now:.1f} s'
        words = f'following a trajectory of {trajectory.duration:.1f} s{when}'
        self._node.get_logger().info(words)

    def _offer(self, kind: Any, name: str) -> SingleGoal:
        """Offer an action; its goals are trajectories like those of the topic."""

        def refuse(error: IsotrussError) -> Any:
            code = getattr(error, 'code', Result.INVALID_GOAL)
            # Clients of the standard expect a rejection where it has no code.
            if code == Result.INVALID_GOAL and kind is not FollowRollerTrajectory:
                return None
            return kind.Result(error_code=code, error_string=f'trajectory rejected: {error}')

        goal = SingleGoal(
            self._node,
            kind,
            name,
            self._read,
            refuse,
            lambda asked: self._take_over(goal, asked),
            self._cancel,
            preempted=lambda: self._end_goals(REPLACED),
            supervised=True,
        )
        return goal

    def _take_over(self, goal: SingleGoal, asked: RollerGoal) -> None:
        """Follow the trajectory of a goal in place of any other."""
        self._end_goals(REPLACED, spared=goal)
        self._begin(asked)

    def _cancel(self) -> None:
        self._follower.end()
        # No fault: without a twist the rollers are halted as ever.
        words = 'trajectory cancelled by the client'
        self._end(Status.HALT_NO_TWIST, words, VIOLATED, Ending.CANCELED)

    def _publish_feedback(self) -> None:
        """Publish where the rollers are and should be, to the client of the goal."""
        goal = next((goal for goal in self._goals if goal.active), None)
        wanted, measured = self._follower.wanted, self._servo.rollers
        if goal is None or wanted is None or not isinstance(measured, StampedInput):
            return
        robot, when, now = self._servo.robot, self._follower.time, self._node.now()
        goal.publish_feedback(
            lambda: to_roller_feedback(
                goal.kind.Feedback, robot, wanted, measured.value, when, now
            )
        )

    def _end(
        self, status: Status, message: str, code: int, ending: Ending = Ending.ABORTED
    ) -> None:
        """Report how the trajectory ended, and end the goal that it came by."""
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
        code: int = VIOLATED,
        spared: SingleGoal | None = None,
    ) -> None:
        """End the goal whose trajectory is over, if it came by an action."""
        for goal in self._goals:
            if goal.active and goal is not spared:
                goal.end(ending, goal.kind.Result(error_code=code, error_string=text))

    def _add_outcome(self, decision: Decision) -> Decision:
        """Return a decision that tells how the last trajectory ended, until a twist is there."""
        status = decision.command.status
        if self._outcome is None or status < Status.HALT_NO_TWIST:
            self._outcome = None
            return decision
        if status is not Status.HALT_NO_TWIST:
            return decision
        status, message = self._outcome
        return replace(decision, command=replace(decision.command, status=status), message=message)


def _offered_actions() -> list[tuple[type, str]]:
    """Return type and name of the actions that follow trajectories."""
    offered = [(FollowRollerTrajectory, ACTION)]
    if importlib.util.find_spec('control_msgs') is not None:
        standard = importlib.import_module('control_msgs.action')
        offered.append((standard.FollowJointTrajectory, STANDARD_ACTION))
    return offered
