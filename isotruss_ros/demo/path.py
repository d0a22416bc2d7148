# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path of the paper's Fig. 9, as twists: upward motion, rotation without translation, arc."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
import math

#: Twist (vx, vy, omega) in the robot frame [m/s, rad/s].
Twist = tuple[float, float, float]
#: Wrench (fx, fy, m) on the object about the origin of its frame [N, N m].
Wrench = tuple[float, float, float]

#: Times at which the external wrench begins and ends, relative to the duration of the phase [-].
PULL_INTERVAL = (0.4, 0.6)


@dataclass(frozen=True)
class Phase:
    """Phase of the path, with the twist as a function of time."""

    name: str  #: name of the motion
    duration: float  #: duration of the phase [s]
    twist: Callable[[float], Twist]  #: twist as a function of the time since the start [s]
    pull: Wrench | None = None  #: external wrench in the middle of the phase; None: no wrench

    def wrench(self, time: float) -> Wrench:
        """
        Return the external wrench at a time: `pull` during `PULL_INTERVAL`, otherwise zero.

        :param time: time since the start of the phase [s].
        """
        begin, end = PULL_INTERVAL
        pulled = self.pull is not None and begin <= time / self.duration < end
        return self.pull if pulled else (0.0, 0.0, 0.0)


def _progress(time: float, duration: float) -> tuple[float, float]:
    """Return the completed fraction of a motion and its rate [1/s], which is zero at both ends."""
    phase = 2.0 * math.pi * min(max(time / duration, 0.0), 1.0)
    return (phase - math.sin(phase)) / (2.0 * math.pi), (1.0 - math.cos(phase)) / duration


def translation(name: str, duration: float, dx: float, dy: float) -> Phase:
    """Return a phase with a straight motion of the object by (dx, dy) [m]."""

    def twist(time: float) -> Twist:
        _, rate = _progress(time, duration)
        return rate * dx, rate * dy, 0.0

    return Phase(name, duration, twist)


def rotation(name: str, duration: float, angle: float) -> Phase:
    """Return a rotation by an angle [rad] about the object's centre."""

    def twist(time: float) -> Twist:
        return 0.0, 0.0, _progress(time, duration)[1] * angle

    return Phase(name, duration, twist)


def arc(name: str, duration: float, radius: float, heading: float, angle: float) -> Phase:
    """
    Return a motion along a circular arc, with which the object rotates.

    :param radius: radius of the arc, positive [m].
    :param heading: direction of motion at the start [rad].
    :param angle: angle of the arc, positive for a left turn [rad].
    """

    def twist(time: float) -> Twist:
        done, rate = _progress(time, duration)
        direction = heading + done * angle
        speed = radius * rate * abs(angle)
        return speed * math.cos(direction), speed * math.sin(direction), rate * angle

    return Phase(name, duration, twist)


def figure_9(pull: Wrench | None = None) -> tuple[Phase, ...]:
    """
    Return the path of Fig. 9 for an object held at module north/Z of the nine-member robot.

    The object's angle is 0 at the start. After the rotation by 90 degrees, the object's x axis is
    normal to the arc.

    :param pull: external wrench on the object in the middle of the arc [N, N m]; None: no wrench.
    """
    quarter = 0.5 * math.pi
    return (
        translation('up', 7.0, 0.0, 0.25),
        rotation('turn in place', 8.0, quarter),
        replace(arc('arc', 16.0, 0.35, 0.0, -quarter), pull=pull),
    )
