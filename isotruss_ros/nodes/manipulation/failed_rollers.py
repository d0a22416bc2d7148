# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which rollers have failed: by the topic and the parameter `failed_rollers`, or detected."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_ros.core import IsotrussError, reachable_twists, Robot, TwistServo
from isotruss_ros.core.control.inputs import StampedInput
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.topology import check_roller_names
from isotruss_ros.core.safety.roller_failure import FailureDetector
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.manipulation.sparse_messages import SparseMessages

NAME = 'failed_rollers'
SERVICE = 'reset_failed_rollers'


class FailedRollers:
    """
    Keep the rollers that the topic names and those that were detected, in every state of the node.

    :param node: subscribes and offers the service, until it is destroyed.
    :param changed: called when the topic names other rollers.
    """

    def __init__(self, node: ManagedNode, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._named: frozenset[str] = frozenset()
        #: Of the last servo; None before there was one.
        self._detector: FailureDetector | None = None
        #: Why the rollers that the topic names are not known; None if they are.
        self._unknown: str | None = None
        SparseMessages(
            node, DiagnosticArray, NAME, self._receive, self._report_missing, every=True
        )
        node.offer(SERVICE, self._reset)

    def select_named(self, robot: Robot) -> frozenset[str]:
        """
        Return the rollers that the topic names, of those that the robot has.

        :param robot: the robot.
        """
        return self._named & frozenset(robot.roller_names)

    def find_fault(self, robot: Robot) -> str | None:
        """
        Return why it is not known which rollers the topic names; None if it is.

        :param robot: whose rollers it must name.
        """
        if self._unknown is not None:
            return self._unknown
        try:
            check_roller_names(f'the topic {NAME}', self._named, robot.roller_names)
        except GraspError as error:
            return str(error)
        return None

    def follow(self, detector: FailureDetector, robot: Robot) -> None:
        """
        Give the detector of a new servo what the one before has detected, of the rollers it has.

        :param detector: of the servo.
        :param robot: of the servo.
        """
        if self._detector is not None:
            detector.failed = self._detector.failed & frozenset(robot.roller_names)
        self._detector = detector

    def _receive(self, messages: list[DiagnosticArray]) -> None:
        works = (DiagnosticStatus.OK, DiagnosticStatus.WARN)
        named = frozenset(each.name for each in messages[-1].status if each.level not in works)
        if named != self._named or self._unknown is not None:
            self._named, self._unknown = named, None
            self._changed()

    def _report_missing(self, why: str) -> None:
        self._unknown = f'{why}: publish which rollers have failed again, no status for none'
        self._changed()

    def _reset(self) -> str:
        """Use the rollers again that were detected to have failed."""
        if self._detector is None or not self._detector.failed:
            return 'no roller was detected to have failed'
        said = f'reset: {", ".join(sorted(self._detector.failed))}'
        self._detector.reset()
        return said


def describe_reachable_twists(servo: TwistServo) -> str:
    """
    Return in words which twists of the object the working rollers can bring about.

    :param servo: its inputs are where the robot and the object are.
    """
    rollers, pose = servo.rollers, servo.pose
    if not isinstance(rollers, StampedInput) or not isinstance(pose, StampedInput):
        return 'unknown without joint states and object pose'
    try:
        config = servo.robot.configuration(rollers.value.positions)
        twists = reachable_twists(config, servo.grip.moved_to(pose.value), servo.failed)
    except IsotrussError as error:
        return f'unknown: {error}'
    listed = ', '.join(f'({vx:.3g}, {vy:.3g}, {omega:.3g})' for vx, vy, omega in twists)
    return f'{len(twists)} of 3: twists (vx, vy, omega) along {listed or "none"}'
