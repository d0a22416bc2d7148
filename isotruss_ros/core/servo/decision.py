# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decision of one cycle of the twist servo: a roller command, or a halt and its reason."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.errors import GraspError, IsotrussError
from isotruss_ros.core.estimation.state_estimate import is_squeeze_known
from isotruss_ros.core.inputs import InputError, InputFault
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.numerics.arrays import Array


@dataclass(frozen=True)
class Decision:
    """
    Roller command or halt that is decided in one control cycle.

    :ivar command: velocities of the rollers (zero in a halt), achieved twist, scale of the
        commanded twist, and status.
    :ivar twist: (3,) commanded twist vx, vy [m/s], omega [rad/s] of the object or joint; zero
        without a command.
    :ivar message: sentence that names the fault and its remedy; empty without a fault.
    :ivar failed: names of the failed rollers, which are held at zero velocity.
    :ivar frequency: lowest natural frequency of the held object [rad/s]; 0 if unknown.
    :ivar pose_gain: gain of the pose control [1/s]; 0 without pose control.
    :ivar squeeze: mean normal force of the members and its standard deviation [N]; None without an
        object.
    :ivar pose_delay: estimated time by which measured poses are older than their stamps say [s].
    :ivar desired_pose: desired pose (x, y, angle) of the held object in the robot frame, half a
        period after the decision [m, rad]: the pose at the start of the motion plus the executed
        part of all twists. None at rest, and without squeeze control.
    """

    command: RollerCommand
    twist: Array
    message: str
    failed: tuple[str, ...] = ()
    frequency: float = 0.0
    pose_gain: float = 0.0
    squeeze: tuple[float, float] | None = None
    pose_delay: float = 0.0
    desired_pose: Pose | None = None


def describe_squeeze(squeeze: float, deviation: float, is_assumed: bool = False) -> str:
    """
    Return a text with the squeeze and its deviation [N], and a remedy if it is unknown.

    :param is_assumed: whether the equilibrium is assumed, see `GripTracker.searched`.
    """
    words = f'{squeeze:.1f} N, deviation {deviation:.1f} N'
    if is_assumed:
        remedy = 'close the grip further before carrying, calibrate home, or use markers on joints'
        return f'squeeze unknown: {words}, assumed without an equilibrium; {remedy}'
    if is_squeeze_known(squeeze, deviation):
        return f'squeeze {words}'
    remedy = 'calibrate home, use markers on joints, or calibrate the stiffness of the tubes'
    return f'squeeze unknown: {words}; {remedy}'


class HaltError(IsotrussError):
    """Error that stops the rollers with a given status."""

    def __init__(self, status: Status, message: str) -> None:
        super().__init__(message)
        self.status = status


def halt_for(error: IsotrussError) -> Status:
    """Return the status of the halt that an error causes."""
    if isinstance(error, HaltError):
        return error.status
    if isinstance(error, InputError):
        # If the twist is stale, the client has stopped sending twists.
        is_stale_twist = error.name == 'twist' and error.fault is InputFault.STALE
        is_absent = error.fault is InputFault.MISSING or is_stale_twist
        return Status[f'HALT_{"NO" if is_absent else error.fault.name}_{error.name.upper()}']
    return Status.HALT_NO_GRASP if isinstance(error, GraspError) else Status.HALT_KINEMATICS


def describe(command: RollerCommand, keeps_contacts: bool) -> str:
    """
    Return a text on the deviation of a command from the commanded twist, empty if none.

    :param keeps_contacts: True for the twist of an object; false for the velocity of a joint.
    """
    parts: list[str] = []
    if command.status >= Status.HALT_NO_TWIST:
        return ''
    vx, vy, omega = command.achieved_twist
    velocity = f'({vx:.4g}, {vy:.4g}) m/s, {omega:.4g} rad/s'
    if command.status is Status.UNREACHABLE:
        fault, closest = 'is unreachable', 'reachable one'
        if keeps_contacts:
            fault, closest = f'{fault} or would break contacts', 'one that keeps the contacts'
        parts.append(f'the twist {fault}; the closest {closest} is {velocity}')
    if command.scale < 1.0:
        is_sliding = command.status is Status.SLIDING
        change = 'sliding with' if is_sliding else 'slowed to'
        cause = ': more would need roller speeds out of proportion to the motion'
        if command.limiting:
            cause = f' by the limits of {", ".join(command.limiting)}'
        percent = 100.0 * command.scale
        share = f'{percent:.3g}' if percent >= 1.0 else 'less than 1'
        along = f', along {velocity}' if is_sliding else ''
        parts.append(f'{change} {share} %{along}{cause}')
    return '; '.join(parts)
