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
    :ivar pose_gain: pose gain, which determines all gains [1/s]; None: see `choose_gain`.
    :ivar frequency: measured lowest natural frequency [rad/s]; None: computed from the masses.
    :ivar max_utilisation: bound on the utilisation of the tubes [-]. Commands that approach the
        bound are slowed; beyond the bound, only commands that decrease the utilisation are
        executed.
    :ivar load: standard deviation of loads on the object [N]; 0: the value of `EstimatorSettings`.
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

    :ivar grip: grasping members, object and friction; the object's pose is an input.
    :ivar period: time from cycle to cycle [s].
    :ivar timeout: largest age of inputs [s]; older inputs stop the rollers.
    :ivar joint: joint that twists move without an object; None: twists move the object.
    :ivar squeeze: settings of the squeeze control; None: the opening angle is kept.
    :ivar bounds: bounds of the configuration; None: no guard and no barriers.
    :ivar barriers: user-defined barriers.
    :ivar limits: user-defined limits besides those of the robot file.
    :ivar slide_along_limits: whether motion slides along limits of lengths and shapes; otherwise
        it is slowed and stops.
    :ivar max_acceleration: largest acceleration of a roller, except in halts [m/s^2]; None: the
        value of the robot file.
    :ivar failure_time: time without motion under a command after which a roller has failed [s].
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
    """Latest value of each input of the twist servo; None before the first value."""

    twist: Input = None  #: commanded twist (vx, vy, omega) in the robot frame [m/s, rad/s]
    rollers: Input = None  #: measured `RollerState`
    pose: Input = None  #: measured `Pose` of the object in the robot frame
    #: gauge pressures (t,) of the tubes for the squeeze control [Pa]; None: the pressures of the
    #: robot file
    pressures: Input = None
    estimate: Input = None  #: `EstimatedTravel` with the roller offsets
    failed: frozenset[str] = frozenset()  #: names of rollers that the client declares failed
    #: status and reason of a halt by the client; None if the client does not halt
    halt: tuple[Status, str] | None = None
