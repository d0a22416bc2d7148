# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the twist servo."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.estimation.state_estimate import EstimatorSettings
from isotruss_ros.core.inputs import MAX_TIMEOUT, PRESSURE_TIMEOUT
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.setting_ranges import check_settings
from isotruss_ros.core.numerics.argument_kinds import check_kind
from isotruss_ros.core.safety.barrier_law import Barrier
from isotruss_ros.core.safety.shape_guard import ShapeBounds

DEFAULT_BOUNDS = ShapeBounds()
#: Largest age of moving obstacles [s]; at 0.3 m/s an obstacle moves by 0.15 m meanwhile.
OBSTACLE_TIMEOUT = 0.5
#: Largest acceleration of the object [m/s^2]: 5 mm/s in a cycle of 10 ms.
MAX_OBJECT_ACCELERATION = 0.5
#: Unit, smallest and largest plausible value of each number, as of the parameters of the node.
SQUEEZE_RANGES = {
    'force': ('N', 0.0, 1e3),
    'pose_gain': ('1/s', 1e-6, 1e3),
    'frequency': ('rad/s', 1e-6, 1e3),
    'max_utilisation': ('', 1e-6, math.inf),
    'load': ('N', 0.0, 1e3),
    'zero_deviation': ('m', 0.0, 1.0),
}
SERVO_RANGES = {
    'period': ('s', 1e-9, 1.0),
    'timeout': ('s', 1e-3, MAX_TIMEOUT),
    'failure_time': ('s', 1e-3, math.inf),
    'pressure_timeout': ('s', 1e-3, 3600.0),
    'obstacle_timeout': ('s', 1e-3, MAX_TIMEOUT),
    'max_object_acceleration': ('m/s^2', 1e-3, math.inf),
}


@dataclass(frozen=True)
class SqueezeSettings:
    """
    Desired squeeze, and settings of the squeeze control.

    :ivar force: mean normal force of the grasping members, not negative [N].
    :ivar pose_gain: pose gain, from which all other gains follow [1/s]; None: `GAIN_SHARE`
        times the frequency.
    :ivar frequency: measured lowest natural frequency of the held object [rad/s]; None: it is
        computed from the masses.
    :ivar max_utilisation: upper bound on the utilisation of the tubes [-]. Motion toward the bound
        is slowed; beyond the bound, only motion that decreases the utilisation is executed.
    :ivar load: standard deviation of loads on the object [N]; 0: that of `EstimatorSettings`.
    :ivar zero_deviation: standard deviation of the roller offsets [m], used if no estimator
        provides it; None: that of the robot file, or 10 mm if home was not calibrated.
    """

    force: float
    pose_gain: float | None = None
    frequency: float | None = None
    max_utilisation: float = 1.0
    load: float = 0.0
    zero_deviation: float | None = None

    def __post_init__(self) -> None:
        """Raise ConfigurationError if a number is out of its range."""
        check_settings(self, SQUEEZE_RANGES, ConfigurationError)

    def prior(self, description: RobotDescription) -> EstimatorSettings:
        """Return the prior standard deviations of a belief of the grip."""
        prior = EstimatorSettings().calibrated(description, self.zero_deviation)
        return replace(prior, load=self.load or prior.load)


@dataclass(frozen=True)
class ServoSettings:
    """
    Settings of the twist servo.

    :ivar grip: grasping members, object and friction; the measured pose replaces the pose of this
        object.
    :ivar period: time from cycle to cycle [s].
    :ivar timeout: largest age of inputs [s]; older inputs stop the rollers.
    :ivar joint: name of the joint that twists move; None: twists move the object.
    :ivar squeeze: settings of the squeeze control; None: the opening angle of the grip is held
        constant instead.
    :ivar bounds: bounds on the configuration, enforced by barriers; None: no barriers.
    :ivar barriers: user-defined barriers.
    :ivar limits: user-defined limits in addition to those of the robot file.
    :ivar slide_along_limits: True if motion continues along limits of member lengths and of the
        configuration; otherwise motion is slowed until it stops at the limits.
    :ivar failure_time: a commanded roller that does not move for this time has failed [s].
    :ivar pressure_timeout: largest age of measured pressures [s]; older pressures stop the
        rollers.
    :ivar obstacles: obstacles at rest, from which barriers keep robot and object.
    :ivar obstacle_timeout: largest age of moving obstacles [s]; an older one stops the rollers.
    :ivar max_object_acceleration: largest acceleration of the object by commands [m/s^2], in the
        norm |v|^2 + |omega d/2|^2. Limits of the configuration may require a faster stop.
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
    failure_time: float = math.inf
    pressure_timeout: float = PRESSURE_TIMEOUT
    obstacles: tuple[Obstacle, ...] = ()
    obstacle_timeout: float = OBSTACLE_TIMEOUT
    max_object_acceleration: float = MAX_OBJECT_ACCELERATION

    def __post_init__(self) -> None:
        """Raise ConfigurationError if a time is out of its range, or ArgumentError for a kind."""
        check_settings(self, SERVO_RANGES, ConfigurationError)
        check_kind('grip', self.grip, 'Grip')
        check_kind('squeeze', self.squeeze, 'SqueezeSettings', 'None')
        check_kind('bounds', self.bounds, 'ShapeBounds', 'None')
        check_kind('barriers', self.barriers, 'Sequence[Barrier]')
        check_kind('limits', self.limits, 'Sequence[Limit]')
        check_kind('obstacles', self.obstacles, 'Sequence[Obstacle]')
