# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the twist servo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.inputs import PRESSURE_TIMEOUT
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.numerics.arrays import MAX_MAGNITUDE
from isotruss_ros.core.safety.barrier_law import Barrier
from isotruss_ros.core.safety.shape_guard import ShapeBounds

DEFAULT_BOUNDS = ShapeBounds()
#: Settings that may be infinite.
UNBOUNDED = ('max_utilisation', 'failure_time')


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
        _check_numbers(self, ('pose_gain', 'frequency', 'max_utilisation'))
        _check_numbers(self, ('force', 'load', 'zero_deviation'), zero=True)


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

    def __post_init__(self) -> None:
        """Raise ConfigurationError if a time is out of its range."""
        _check_numbers(self, ('period', 'timeout', 'pressure_timeout', 'failure_time'))


def _check_numbers(settings: Any, names: Sequence[str], zero: bool = False) -> None:
    """Raise ConfigurationError unless settings are None, positive or, if `zero`, zero."""
    for name in names:
        value = getattr(settings, name)
        is_unbounded = name in UNBOUNDED and value == math.inf
        if value is None or is_unbounded or (zero and value == 0.0):
            continue
        if not 0.0 < value <= MAX_MAGNITUDE:
            bounds = f'{"zero or positive" if zero else "positive"}, at most {MAX_MAGNITUDE:g}'
            raise ConfigurationError(f'{name} {value!r}: must be {bounds}')
