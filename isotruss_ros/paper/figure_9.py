"""Fig. 9: an object is carried along a path, and how exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from isotruss_ros.core import (
    Configuration,
    Grasp,
    HeldObject,
    load_robot,
    Pose,
    snug_center,
    solve_twist_ahead,
    Status,
)
from isotruss_ros.demo.path import figure_9, Phase
from isotruss_ros.paper.figure_9_drawing import draw
from isotruss_ros.paper.item import Advance, Item, Report
from isotruss_ros.paper.tables import number, Table
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Where the object is held, and its diameter [m].
MODULE, DIAMETER = 'north/Z', 0.3
#: Commands per second.
RATE = 50.0


@dataclass(frozen=True)
class Part:
    """
    One part of the path; the first has one pose, the start.

    :ivar name: what the object does.
    :ivar config: the robot at its end.
    :ivar poses: (n, 3) x, y [m], angle [rad] of the object after each command.
    :ivar exact: (n, 3) where the twists take it, by integration.
    :ivar statuses: how the twists were answered.
    """

    name: str
    config: Configuration
    poses: Array
    exact: Array
    statuses: frozenset[Status]

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
class Carried:
    """
    The path, twice.

    :ivar parts: start and the parts of the path, with commands for the middle of their interval.
    :ivar plain: the same with commands for its beginning.
    :ivar diameter: of the object [m].
    """

    parts: Sequence[Part]
    plain: Sequence[Part]
    diameter: float = DIAMETER


def compute(advance: Advance, rate: float = RATE) -> Carried:
    """
    Carry the object along the path.

    :param rate: of the commands [Hz].
    """
    ahead = carry(0.5 / rate, rate, lambda done: advance(0.5 * done))
    plain = carry(0.0, rate, lambda done: advance(0.5 + 0.5 * done))
    return Carried(ahead, plain)


def carry(lead: float, rate: float, advance: Advance) -> list[Part]:
    """
    Command twists, one after the other, and let the robot go where they take it.

    :param lead: how far ahead commands look [s].
    """
    robot = load_robot('nine_member')
    config = robot.home
    held = HeldObject.attach(
        config, Grasp(MODULE, snug_center(config, MODULE, DIAMETER), DIAMETER)
    )
    exact = np.array(held.pose(config))
    parts = [Part('start', config, exact[None], exact[None], frozenset())]
    phases = figure_9()
    for phase in phases:
        poses: list[Pose] = []
        goals: list[Array] = []
        statuses = set()
        for k in range(round(phase.duration * rate)):
            start, end = k / rate, (k + 1) / rate
            twist = phase.twist(0.5 * (start + end))
            command = solve_twist_ahead(config, held.grasp_in(config), twist, lead)
            travel = config.roller_positions + command.roller_velocities / rate
            config = config.moved_to(travel)
            exact = exact + _integral(phase, start, end)
            poses.append(held.pose(config))
            goals.append(exact)
            statuses.add(command.status)
            advance((len(parts) - 1 + end / phase.duration) / len(phases))
        parts.append(
            Part(phase.name, config, np.array(poses), np.array(goals), frozenset(statuses))
        )
    return parts


def _integral(phase: Phase, start: float, end: float) -> Array:
    """Return what the twists of an interval add up to, by Simpson's rule."""
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


def report(result: Carried) -> Report:
    """Return the errors of path and orientation."""
    moves = result.parts[1:]
    worst = max(part.position_error for part in moves)
    turned = max(part.angle_error for part in moves)
    plain = max(part.position_error for part in result.plain)
    return Report(
        heading='Fig. 9: an object carried along a path',
        picture='Four shapes of the nine-member robot with the object at its top: at the start, '
        'moved up, turned in place, and moved along a circular arc to which its orientation '
        'stays normal; the path is drawn behind it',
        stated='A simulated robot of nine members holds an object, moves it up, turns it in '
        'place and takes it along a circular arc to which the orientation stays normal. No '
        'lengths, angles or errors are given.',
        computed='The same three motions: 20 cm up, 90° in place, a quarter of a circle of 25 cm '
        f'radius, {RATE:g} commands per second. The object leaves the path by at most '
        f'{number(1e6 * worst, 2)} µm and the orientation by at most '
        f'{number(math.degrees(turned), 2)}°; nothing is integrated in the robot, so its '
        'constraints hold throughout. Commands that look ahead by half of their interval do '
        f'this; without, the path is left by {number(1e3 * plain, 2)} mm.',
        difference='The motions are those of the paper; sizes and durations are ours, and so '
        'are the errors, of which the paper states none.',
        assumption='Lengths and angles are chosen so that the robot keeps its limits; the object '
        'of 30 cm is held at the top module, whose roller turns it. As in the paper, the '
        'robot is rigid here and the object between the two sides. Path errors are those of '
        'holding each command for its interval; `make demo` does the same with the real nodes.',
        tables=(_errors(result),),
    )


def _errors(result: Carried) -> Table:
    rows = []
    for before, part, plain in zip(result.parts, result.parts[1:], result.plain[1:], strict=False):
        dx, dy, turn = part.exact[-1] - before.exact[-1]
        is_arc = abs(turn) > 0.0 and math.hypot(dx, dy) > 1e-9
        rows.append(
            (
                part.name,
                ', '.join(number(1e3 * round(value, 6)) for value in (dx, dy)),
                number(math.degrees(turn)),
                number(1e6 * part.position_error, 2),
                number(math.degrees(part.angle_error), 2),
                number(math.degrees(normal_error(part, before)), 2) if is_arc else '',
                number(1e3 * plain.position_error, 2),
            )
        )
    headings = (
        'part',
        'moved by dx, dy [mm]',
        'turned by [deg]',
        'largest path error [µm]',
        'largest orientation error [deg]',
        'orientation off the normal [deg]',
        'path error without looking ahead [mm]',
    )
    return Table('figure_9', 'Errors along the path', headings, rows)


ITEM = Item('figure_9', compute, report, draw)
