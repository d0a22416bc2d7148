# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fig. 9: motion of an object along a path, with its errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from isotruss_ros.core import (
    Configuration,
    ConvexObject,
    Grip,
    load_robot,
    Pose,
    RollingGrip,
    solve_twist_ahead,
    Status,
    tangent_center,
)
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.demo.path import figure_9, Phase
import numpy as np
from studies.paper.item import Advance, Report
from studies.paper.tables import number, Table

#: Module that holds the object, and diameter of the object [m].
MODULE, DIAMETER = 'north/Z', 0.3
#: Rate of the commands [Hz].
RATE = 50.0


@dataclass(frozen=True)
class Part:
    """
    One part of the path; the first part consists of the initial pose only.

    :ivar name: name of the object's motion.
    :ivar config: configuration of the robot at the end of the part.
    :ivar poses: (n, 3) poses x, y [m], angle [rad] of the object after each command.
    :ivar exact: (n, 3) commanded poses, the integral of the twists.
    :ivar statuses: statuses of the roller commands.
    :ivar roller_speed: largest speed of any roller [m/s].
    """

    name: str
    config: Configuration
    poses: Array
    exact: Array
    statuses: frozenset[Status]
    roller_speed: float

    @property
    def position_error(self) -> float:
        """Return the largest distance from the path [m]."""
        return float(np.hypot(*(self.poses - self.exact)[:, :2].T).max())

    @property
    def angle_error(self) -> float:
        """Return the largest error of the orientation [rad]."""
        turned = (self.poses - self.exact)[:, 2]
        return float(np.abs(np.remainder(turned + math.pi, 2.0 * math.pi) - math.pi).max())


@dataclass(frozen=True)
class Moved:
    """
    Motion of the object along the path, computed with two kinds of commands.

    :ivar parts: parts of the path with commands for the configuration at the midpoint of their
        interval.
    :ivar plain: parts of the path with commands for the configuration at the begin of their
        interval.
    :ivar diameter: diameter of the object [m].
    """

    parts: Sequence[Part]
    plain: Sequence[Part]
    diameter: float = DIAMETER


def compute(advance: Advance, rate: float = RATE) -> Moved:
    """
    Move the object along the path.

    :param advance: callback with the completed share of the work.
    :param rate: rate of the commands [Hz].
    """
    ahead = follow_path(0.5 / rate, rate, lambda done: advance(0.5 * done))
    plain = follow_path(0.0, rate, lambda done: advance(0.5 + 0.5 * done))
    return Moved(ahead, plain)


def follow_path(lead: float, rate: float, advance: Advance) -> list[Part]:
    """
    Compute the commands for the twists of the path, and integrate the roller velocities.

    :param lead: time from the beginning of an interval to the moment for which its command is
        computed [s].
    :param rate: rate of the commands [Hz].
    :param advance: callback that receives the completed fraction of the work.
    """
    robot = load_robot('nine_member')
    body = ConvexObject.disc(tangent_center(robot.home, MODULE, DIAMETER), DIAMETER)
    held = RollingGrip.attach(robot.home, Grip.at_module(robot, MODULE, body))
    exact = np.array(held.pose)
    parts = [Part('start', held.config, exact[None], exact[None], frozenset(), 0.0)]
    phases = figure_9()
    for phase in phases:
        poses: list[Pose] = []
        goals: list[Array] = []
        statuses = set()
        speed = 0.0
        for k in range(round(phase.duration * rate)):
            start, end = k / rate, (k + 1) / rate
            twist = phase.twist(0.5 * (start + end))
            command = solve_twist_ahead(held.config, held.grip, twist, lead)
            travel = held.config.roller_positions + command.roller_velocities / rate
            held = held.moved_to(held.config.moved_to(travel))
            exact = exact + _integral(phase, start, end)
            poses.append(held.pose)
            goals.append(exact)
            statuses.add(command.status)
            speed = max(speed, float(np.abs(command.roller_velocities).max()))
            advance((len(parts) - 1 + end / phase.duration) / len(phases))
        carried = np.array(poses), np.array(goals)
        parts.append(Part(phase.name, held.config, *carried, frozenset(statuses), speed))
    return parts


def _integral(phase: Phase, start: float, end: float) -> Array:
    """Return the integral of the twists over an interval, by Simpson's rule."""
    first, middle, last = (
        np.array(phase.twist(time)) for time in (start, 0.5 * (start + end), end)
    )
    return (end - start) / 6.0 * (first + 4.0 * middle + last)


def normal_error(arc: Part, before: Part) -> float:
    """Return the largest angle between the orientation and the normal of the arc [rad]."""
    # The orientation at the start of the arc is normal to it: it points away from its centre.
    x, y, angle = before.exact[-1]
    radius = abs(complex(*(arc.exact[-1] - before.exact[-1])[:2])) / math.sqrt(2.0)
    center = complex(x, y) - radius * complex(math.cos(angle), math.sin(angle))
    outward = arc.poses[:, 0] + 1j * arc.poses[:, 1] - center
    return float(np.abs(np.angle(outward * np.exp(-1j * arc.poses[:, 2]))).max())


def report(result: Moved) -> Report:
    """Return the errors of path and orientation."""
    moves = result.parts[1:]
    worst = max(part.position_error for part in moves)
    turned = max(part.angle_error for part in moves)
    plain = max(part.position_error for part in result.plain)
    (_, up, _), (right, _, _) = _motion(result.parts, 0), _motion(result.parts, 2)
    fastest = max(moves, key=lambda part: part.roller_speed)
    return Report(
        heading='Fig. 9: an object carried along a path',
        picture='The robot with the object at its top: at the start, moved up, turned in place, '
        'moved along an arc; its path in blue',
        stated='A simulated robot moves an object up, turns it in place and moves it along an '
        'arc, while the orientation stays normal to the arc.',
        computed=f'The object moves {number(1e2 * up)} cm up, turns by 90° in place, and follows '
        f'a quarter of a circle of {number(1e2 * right)} cm radius, with {RATE:g} commands per '
        f'second. The largest error is {number(1e6 * worst, 2)} µm in position and '
        f'{number(math.degrees(turned), 2)}° in orientation. Each command is computed for the '
        f'middle of its interval; for the beginning, the error is {number(1e3 * plain, 2)} mm. '
        f'The largest roller speed, in the part {fastest.name!r}, is '
        f'{number(1e3 * fastest.roller_speed, 2)} mm/s of the allowed 100 mm/s.',
        difference='The sizes and durations are chosen here.',
        assumption='The object of 30 cm is held at the top module. The robot is rigid, and the '
        'object rolls without slip. Friction alone would hold it in this grip only with a '
        'coefficient above 0.59; the default of the package is 0.5.',
        tables=(_errors(result),),
    )


def _motion(parts: Sequence[Part], i: int) -> Array:
    """Return the commanded motion (dx, dy, dangle) of part i + 1 [m, rad]."""
    return parts[i + 1].exact[-1] - parts[i].exact[-1]


def _errors(result: Moved) -> Table:
    rows = []
    for i, (part, plain) in enumerate(zip(result.parts[1:], result.plain[1:], strict=True)):
        dx, dy, turn = _motion(result.parts, i)
        is_arc = abs(turn) > 0.0 and math.hypot(dx, dy) > 1e-9
        off_normal = normal_error(part, result.parts[i]) if is_arc else 0.0
        rows.append(
            (
                part.name,
                ', '.join(number(1e3 * round(value, 6)) for value in (dx, dy)),
                number(math.degrees(turn)),
                number(1e3 * part.roller_speed, 2),
                number(1e6 * part.position_error, 2),
                number(math.degrees(part.angle_error), 2),
                number(math.degrees(off_normal), 2) if is_arc else '',
                number(1e3 * plain.position_error, 2),
            )
        )
    headings = (
        'part',
        'moved by dx, dy [mm]',
        'turned by [deg]',
        'largest roller speed [mm/s]',
        'largest position error [µm]',
        'largest orientation error [deg]',
        'orientation off the normal [deg]',
        'position error, commands for the beginning [mm]',
    )
    return Table('figure_9', 'Errors along the path', headings, rows)
