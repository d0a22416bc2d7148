"""
Twist servo: in every cycle, move or halt, by what is known and how old it is.

Each cycle starts from the measured state. A measurement is old when it is used: since then the
rollers have gone where they were sent, so that is where the robot is taken to be. What was sent
before the measurement says nothing, so motion resumes from wherever robot and object are.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.drive import working_rollers
from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.failure_detector import FailureDetector
from isotruss_ros.core.grasp import Grasp
from isotruss_ros.core.manipulation import default_limits, RollerCommand, solve_twist
from isotruss_ros.core.motion import HeldObject
from isotruss_ros.core.robot import Robot
from isotruss_ros.core.samples import (
    aged,
    Doubt,
    Input,
    InputError,
    require_fresh,
    RollerState,
    Sample,
    ShapeTracker,
)
from isotruss_ros.core.sent import SentSpeeds
from isotruss_ros.core.shape_guard import ShapeBounds, ShapeGuard
from isotruss_ros.core.status import Status
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Rollers that go no further than this have led the nodes there to first order, to 0.1 mm [m].
FIRST_ORDER = 3e-3


@dataclass(frozen=True)
class Decision:
    """
    What the rollers are to do in this cycle.

    :ivar command: velocities (zero when halted), achieved twist, scale and status.
    :ivar twist: (3,) the twist asked for, zero if there is none to go by.
    :ivar message: what is wrong and what would be right; empty when all is well.
    :ivar failed: the rollers that are held at zero because they have failed, in their order.
    """

    command: RollerCommand
    twist: Array
    message: str
    failed: tuple[str, ...] = ()


class HaltError(IsotrussError):
    """
    The rollers must stop.

    :ivar status: which of the ways of being stopped it is.
    """

    def __init__(self, status: Status, message: str) -> None:
        super().__init__(message)
        self.status = status


#: The status for each doubt about an input.
TWIST = {
    Doubt.MISSING: Status.HALT_NO_TWIST,
    Doubt.STALE: Status.HALT_NO_TWIST,
    Doubt.INVALID: Status.HALT_INVALID_TWIST,
}
JOINT_STATES = {
    Doubt.MISSING: Status.HALT_NO_JOINT_STATES,
    Doubt.STALE: Status.HALT_STALE_JOINT_STATES,
    Doubt.INVALID: Status.HALT_INVALID_JOINT_STATES,
}
OBJECT_POSE = {
    Doubt.MISSING: Status.HALT_NO_OBJECT_POSE,
    Doubt.STALE: Status.HALT_STALE_OBJECT_POSE,
    Doubt.INVALID: Status.HALT_INVALID_OBJECT_POSE,
}


class TwistServo:
    """
    State of the control loop: the latest inputs, each a sample, a refusal, or None for none yet.

    :ivar twist: sample of (vx, vy, omega) in the robot frame [m/s, rad/s].
    :ivar rollers: sample of the `RollerState`.
    :ivar center: sample of (x, y), the measured centre of the object in the robot frame [m].
    :ivar stopped: why the rollers stand still whatever the inputs say; None if they need not.
    :ivar guard: what keeps the robot within good shapes; None for nothing but the robot file.
    :ivar slide: along limits of lengths and shapes, rather than stop at them.
    :ivar detector: what tells which rollers have failed; None for nothing.
    :param robot: the robot.
    :param grip_module: the module `t/j` that holds the object.
    :param object_diameter: the object's own diameter [m].
    :param period: time from cycle to cycle [s].
    :param timeout: inputs older than this stop the rollers [s].
    """

    def __init__(
        self,
        robot: Robot,
        grip_module: str,
        object_diameter: float,
        period: float,
        timeout: float,
    ) -> None:
        self.robot = robot
        self.grip_module = grip_module
        self.object_diameter = object_diameter
        self.period = period
        self.timeout = timeout
        self.twist: Input = None
        self.rollers: Input = None
        self.center: Input = None
        self.stopped: tuple[Status, str] | None = None
        self.guard: ShapeGuard | None = ShapeGuard(robot, ShapeBounds())
        self.slide = False
        self.detector: FailureDetector | None = None
        self._failed: frozenset[str] = frozenset()
        self._limits = default_limits(robot)
        self._sent = SentSpeeds(len(robot.roller_names))
        self._detected: float | None = None  # the time of the rollers that were compared last
        self._shape = ShapeTracker(robot)

    @property
    def failed(self) -> frozenset[str]:
        """Return the rollers that failed: those somebody named and those that were detected."""
        return self._failed if self.detector is None else self._failed | self.detector.failed

    @failed.setter
    def failed(self, names: Collection[str]) -> None:
        """
        Name the rollers that have failed; what was detected stays until `detector.forgive`.

        :raises GraspError: the robot has no such roller.
        """
        working_rollers(self.robot, frozenset(names))
        self._failed = frozenset(names)

    def decide(self, now: float) -> Decision:
        """
        Return what the rollers are to do in the cycle that begins now.

        Never raises for an input: whatever is wrong becomes a halt with a status and a message.

        :param now: time on the clock of the samples [s].
        """
        twist = np.zeros(3)
        self.twist, self.rollers, self.center = (
            aged(given, now) for given in (self.twist, self.rollers, self.center)
        )
        self._sent.keep(now, self.timeout + 2.0 * self.period)
        self._detect()
        failed = self.failed
        try:
            if self.stopped is not None:
                raise HaltError(*self.stopped)
            twist = np.asarray(self._fresh('twist', self.twist, now, TWIST).value)
            rollers = self._fresh('joint states', self.rollers, now, JOINT_STATES)
            center = self._fresh('object pose', self.center, now, OBJECT_POSE)
            command = self._solve(rollers, center, twist, now, failed)
            message = _remark(command)
        except HaltError as halt:
            stopped = np.zeros(len(self.robot.roller_names))
            command = RollerCommand(stopped, np.zeros(3), 0.0, halt.status)
            message = str(halt)
        self._sent.note(now, command.roller_velocities)
        names = tuple(name for name in self.robot.roller_names if name in failed) if failed else ()
        return Decision(command, twist, message, names)

    def _detect(self) -> None:
        """Compare what the rollers were told with what they did."""
        if self.detector is None or not isinstance(self.rollers, Sample):
            return
        state, time = self.rollers
        told, before = np.zeros(len(state.positions)), self._detected
        if before is not None and time > before:
            told = self._sent.travel(before, time, told) / (time - before)
        self._detected = time
        self.detector.update(state.positions, time, told)

    def _fresh(self, what: str, given: Input, now: float, statuses: dict[Doubt, Status]) -> Sample:
        """Return an input that can be relied on."""
        try:
            return require_fresh(what, given, now, self.timeout)
        except InputError as error:
            raise HaltError(statuses[error.doubt], str(error)) from error

    def _solve(
        self, rollers: Sample, center: Sample, twist: Array, now: float, failed: frozenset[str]
    ) -> RollerCommand:
        """
        Solve for where the robot will be in the middle of the cycle that the command is for.

        A command for the measured state, which is older, would be wrong in first order.
        """
        state: RollerState = rollers.value
        before, way, last = self._ways(rollers, center.time, now, failed)
        try:
            config = self._shape.configuration(state.positions)
            x, y = center.value
            grasp = Grasp(self.grip_module, (x, y), self.object_diameter)
            if before.any() or way.any():
                held = HeldObject.attach(_moved(config, before), grasp)
                config = _moved(config, way)
                grasp = held.grasp_in(config)
            watch = None if self.guard is None else self.guard.watch(config, grasp)
            limits = self._limits if watch is None else (*self._limits, *watch.limits)
            command = solve_twist(config, grasp, twist, failed, limits, self.slide, self.period)
            return command if watch is None else watch.keep(command, last, self.period)
        except GraspError as error:
            raise HaltError(Status.HALT_NO_GRASP, str(error)) from error
        except IsotrussError as error:
            raise HaltError(Status.HALT_KINEMATICS, str(error)) from error

    def _ways(
        self, rollers: Sample, pose_time: float, now: float, failed: frozenset[str]
    ) -> tuple[Array, Array, Array]:
        """
        Return how far the rollers go from their measurement on.

        They go where they are sent, failed ones nowhere. Measured speeds count for the time from
        before this servo sent anything: somebody else may have moved them.

        :return: (r,) each: travel until the object was measured, until the middle of the cycle
            that begins now [m], and the speeds with which they get from now to there [m/s].
        """
        measured = rollers.value.velocities
        last = measured if self._sent.last is None else self._sent.last
        way = self._sent.travel(rollers.time, now, measured)
        way = way + 0.5 * self.period * last
        before = np.zeros(len(way))
        if pose_time != rollers.time:
            before = self._sent.travel(rollers.time, pose_time, measured)
        if failed:
            stuck = [name in failed for name in self.robot.roller_names]
            last = np.where(stuck, 0.0, last)
            before[stuck] = way[stuck] = 0.0
        return before, way, last


def _moved(config: Configuration, way: Array) -> Configuration:
    """Return where the robot is after some travel of its rollers (r,) [m]."""
    if not way.any():
        return config
    if np.abs(way).max() <= FIRST_ORDER:
        return config.extrapolated(way, 1.0)
    return config.moved_to(config.roller_positions + way)


def _remark(command: RollerCommand) -> str:
    """Return what a user should know of a command that is not as asked."""
    parts = []
    if command.status is Status.UNREACHABLE:
        vx, vy, omega = command.achieved_twist
        parts.append(
            f'the twist is out of reach; the nearest is '
            f'({vx:.4g}, {vy:.4g}) m/s, {omega:.4g} rad/s'
        )
    if command.scale < 1.0:
        how = 'sliding with' if command.status is Status.SLIDING else 'slowed to'
        why = ': the rest would take more rolling than it is worth'
        if command.limiting:
            why = f' by the limits of {", ".join(command.limiting)}'
        parts.append(f'{how} {100 * command.scale:.3g} %{why}')
    return '; '.join(parts)
