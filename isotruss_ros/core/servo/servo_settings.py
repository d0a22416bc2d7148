# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings and inputs of the twist servo."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

from isotruss_ros.core.inputs import Input, PRESSURE_TIMEOUT
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.safety.barrier_law import Barrier
from isotruss_ros.core.safety.shape_guard import ShapeBounds

DEFAULT_BOUNDS = ShapeBounds()


@dataclass(frozen=True)
class SqueezeSettings:
    """
    Desired squeeze and settings of its control.

    :ivar force: mean normal force of the grasping members, positive [N].
    :ivar pose_gain: gain of the pose, from which the others follow; None for that of the
        frequency, see `choose_gain` [1/s].
    :ivar frequency: measured lowest natural frequency of the held object; None to compute it from
        the masses [rad/s].
    :ivar max_utilisation: bound on the utilisation of tubes: commands toward it are slowed, and
        beyond it only those away from it are executed [-].
    :ivar load: standard deviation of loads on the object; 0 for that of `EstimatorSettings` [N].
    :ivar zeros: standard deviation of the roller offsets without an estimator [m].
    """

    force: float
    pose_gain: float | None = None
    frequency: float | None = None
    max_utilisation: float = 1.0
    load: float = 0.0
    zeros: float = 0.01


@dataclass(frozen=True)
class ServoSettings:
    """
    Settings of the twist servo.

    :ivar grip: members, object and friction; the pose of the object is an input.
    :ivar period: time from cycle to cycle [s].
    :ivar timeout: largest age of inputs, beyond which the rollers stop [s].
    :ivar joint: joint that twists move without an object; None for the object.
    :ivar squeeze: settings of the squeeze control; None keeps the opening angle of the grip (14).
    :ivar bounds: bounds of the configuration; None for no guard, and no barriers.
    :ivar barriers: user-defined barriers.
    :ivar limits: user-defined limits, in addition to those of the robot file.
    :ivar slide_along_limits: slide along limits of lengths and shapes, or stop there.
    :ivar max_acceleration: largest acceleration of a roller, except in halts; None for that of the
        robot file [m/s^2].
    :ivar failure_time: commanded time without motion after which a roller has failed [s].
    :ivar pressure_timeout: largest age of pressures [s].
    """

    grip: Grip
    period: float
    timeout: float
    joint: str | None = None
    squeeze: SqueezeSettings | None = None
    bounds: ShapeBounds | None = DEFAULT_BOUNDS
    barriers: tuple[Barrier, ...] = ()
    limits: tuple[Limit, ...] = ()
    slide_along_limits: bool = True
    max_acceleration: float | None = None
    failure_time: float = math.inf
    pressure_timeout: float = PRESSURE_TIMEOUT


class ServoInputs(NamedTuple):
    """
    Latest inputs of the twist servo.

    :ivar twist: input of (vx, vy, omega) in the robot frame [m/s, rad/s].
    :ivar rollers: input of the measured `RollerState`.
    :ivar pose: input of the measured `Pose` of the object, robot frame.
    :ivar pressures: input of the gauge pressures (t,) of the tubes for the squeeze control; None
        for those of the robot file [Pa].
    :ivar estimate: input of the `EstimatedTravel` with the offsets of the rollers; None without.
    :ivar failed: names of failed rollers, in addition to detected ones.
    :ivar halt: status and reason of a halt by the client; None without one.
    """

    twist: Input = None
    rollers: Input = None
    pose: Input = None
    pressures: Input = None
    estimate: Input = None
    failed: frozenset[str] = frozenset()
    halt: tuple[Status, str] | None = None
