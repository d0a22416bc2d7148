# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Failed rollers, named by the topic or parameter `failed_rollers` or detected by the node."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from isotruss_ros.core import IsotrussError, reachable_twists, Robot, TwistServo
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.manipulation.sparse_messages import SparseMessages

NAME = 'failed_rollers'
SERVICE = 'reset_failed_rollers'


class FailedRollers:
    """
    Record of the named and of the detected failed rollers, in any state of the node.

    :ivar named: rollers that the last message names as failed, known to the robot or not.
    """

    def __init__(self, node: ManagedNode, changed: Callable[[], None]) -> None:
        self._changed = changed
        self.named: frozenset[str] = frozenset()
        #: Last servo, which detects failures; None before the first one.
        self._servo: TwistServo | None = None
        #: Reason why the rollers that the topic names are unknown; None if they are known.
        self._unknown: str | None = None
        SparseMessages(
            node, DiagnosticArray, NAME, self._receive, self._report_missing, every=True
        )
        node.offer(SERVICE, self._reset)

    def find_fault(self, robot: Robot) -> str | None:
        """Return the reason why rollers named by the topic are unknown; None if all are known."""
        if self._unknown is not None:
            return self._unknown
        try:
            check_names(f'the topic {NAME}: rollers', self.named, robot.roller_names)
        except GraspError as error:
            return str(error)
        return None

    def follow(self, servo: TwistServo) -> None:
        """Copy detected failures from the previous servo to the new one."""
        if self._servo is not None:
            servo.take_failures(self._servo)
        self._servo = servo

    def _receive(self, messages: list[DiagnosticArray]) -> None:
        works = (DiagnosticStatus.OK, DiagnosticStatus.WARN)
        named = frozenset(
            status.name for status in messages[-1].status if status.level not in works
        )
        if named != self.named or self._unknown is not None:
            self.named, self._unknown = named, None
            self._changed()

    def _report_missing(self, why: str) -> None:
        self._unknown = f'{why}: publish which rollers have failed again, no status for none'
        self._changed()

    def _reset(self) -> str:
        """Regard the rollers with detected failures as working again."""
        failed = frozenset() if self._servo is None else self._servo.memory.detector.failed
        if not failed:
            return 'no roller was detected to have failed'
        self._servo.reset_failures()
        return f'reset: {", ".join(sorted(failed))}'


def describe_reachable_twists(servo: TwistServo) -> str:
    """Return a text about the twists of the object that the working rollers can produce."""
    rollers, pose = servo.inputs.rollers, servo.inputs.pose
    if not isinstance(rollers, StampedInput) or not isinstance(pose, StampedInput):
        return 'unknown without joint states and object pose'
    try:
        config = servo.robot.configuration(rollers.value.positions)
        grip = servo.settings.grip.moved_to(pose.value)
        twists = reachable_twists(config, grip, servo.failed)
    except IsotrussError as error:
        return f'unknown: {error}'
    listed = ', '.join(f'({vx:.3g}, {vy:.3g}, {omega:.3g})' for vx, vy, omega in twists)
    return f'{len(twists)} of 3: twists (vx, vy, omega) along {listed or "none"}'
