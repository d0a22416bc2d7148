"""Roller trajectories on the topic of ros2_control: followed in place of twists, one at a time."""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core import Decision, IsotrussError, StampedInput, Status, TwistServo
from isotruss_ros.core.control.inputs import require_fresh
from isotruss_ros.core.control.roller_trajectory import RollerTrajectoryServo
from isotruss_ros.core.manipulation.solve_twist import RollerCommand
from isotruss_ros.nodes.conversions.messages import MessageError, read_stamp
from isotruss_ros.nodes.conversions.trajectory_messages import read_roller_trajectory
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.qos import RELIABLE
import numpy as np
from trajectory_msgs.msg import JointTrajectory

TOPIC = 'joint_trajectory_controller/joint_trajectory'


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
        self._node.create_subscription(JointTrajectory, TOPIC, self._receive, RELIABLE)

    def decide(self, now: float) -> Decision:
        """
        Return what to do in the cycle that begins now, with a trajectory or without.

        :param now: time on the clock of the inputs [s].
        """
        if not self.busy:
            return self._add_outcome(self._servo.decide(now))
        # A twist of this time would start the object as soon as the trajectory has ended.
        self._servo.twist = None
        self._follower.rollers, self._follower.timeout = self._servo.rollers, self._servo.timeout
        step = self._follower.decide(now)
        if step.failure:
            self._end(Status.HALT_TRAJECTORY, f'trajectory aborted: {step.failure}')
        elif step.ended:
            self._end(Status.ARRIVED, 'the rollers have arrived')
        self._servo.note_command(step.speeds, now)
        status, message = self._outcome or (Status.FOLLOWING_TRAJECTORY, '')
        return Decision(
            RollerCommand(step.speeds, np.zeros(3), 1.0, status),
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
        self._end(Status.HALT_TRAJECTORY, f'trajectory aborted: {why}')
        return True

    def _receive(self, message: JointTrajectory) -> None:
        if not message.points:
            self.abort('an empty trajectory was received')
            return
        now, start, servo = self._node.now(), read_stamp(message.header), self._servo
        self._follower.rollers, self._follower.timeout = servo.rollers, servo.timeout
        try:
            if servo.stopped is not None:
                raise MessageError(servo.stopped[1])
            if start:  # zero means at once
                require_fresh(now, servo.timeout, trajectory=StampedInput(None, start))
            trajectory = read_roller_trajectory(message, servo.robot)
            self._follower.begin(trajectory, now)
        except IsotrussError as error:
            self._follower.end()
            self._end(Status.HALT_TRAJECTORY, f'trajectory rejected: {error}')
            return
        self._outcome = None
        self._node.get_logger().info(f'following a trajectory of {trajectory.duration:.1f} s')

    def _end(self, status: Status, message: str) -> None:
        self._outcome = (status, message)
        if status is Status.ARRIVED:
            self._node.get_logger().info(message)
        else:
            self._node.get_logger().warning(message)

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
