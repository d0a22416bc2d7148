"""Motion in time: where a held object goes with the robot, commands that hold for a while."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

from isotruss_ros.core.configuration import Configuration
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.grasp import Grasp, grip_sides, GripSides, sides_at
from isotruss_ros.core.limits import Limit
from isotruss_ros.core.manipulation import RollerCommand, solve_twist
from numpy.typing import ArrayLike


class Pose(NamedTuple):
    """Position x, y [m] and angle [rad] in the robot frame."""

    x: float
    y: float
    angle: float


@dataclass(frozen=True)
class HeldObject:
    """
    An object at rest in the grasp frame, but for rolling: its pose follows from the configuration.

    No integration, so no drift: the pose is a function of where the nodes and the rollers are.

    :ivar grasp: the grasp when it was closed.
    :ivar local: the object's centre in the grasp frame [m].
    :ivar offset: its angle less that of the grasp frame and of the rolling [rad].
    """

    grasp: Grasp
    local: complex
    offset: float

    @classmethod
    def attach(cls, config: Configuration, grasp: Grasp, angle: float = 0.0) -> HeldObject:
        """
        Close the grip around an object.

        :param angle: the object's orientation in the robot frame [rad].
        :raises GraspError: no such module, or the object is not between its two sides.
        """
        sides = grip_sides(config, grasp)
        axis = sides.ahead / abs(sides.ahead)
        turned = math.atan2(axis.imag, axis.real) + _rolled(config, sides, grasp)
        arm = complex(*grasp.center) - complex(config.points[sides.nodes[0]])
        return cls(grasp, arm / axis, angle - turned)

    def pose(self, config: Configuration) -> Pose:
        """Return the object's pose in a configuration; the angle is in (-pi, pi]."""
        sides = sides_at(config, self.grasp.module)
        axis = sides.ahead / abs(sides.ahead)
        center = complex(config.points[sides.nodes[0]]) + axis * self.local
        turned = math.atan2(axis.imag, axis.real) + _rolled(config, sides, self.grasp)
        angle = math.remainder(self.offset + turned, 2.0 * math.pi)
        return Pose(center.real, center.imag, angle)

    def come_to_rest(self, config: Configuration) -> None:
        """Stay in the grip, also when the rollers stand still."""

    def grasp_in(self, config: Configuration) -> Grasp:
        """Return the grasp with the object's centre where it is in a configuration."""
        return replace(self.grasp, center=self.pose(config)[:2])


def _rolled(config: Configuration, sides: GripSides, grasp: Grasp) -> float:
    """Return the angle by which the object has rolled since home [rad], the integral of (17)."""
    driven = config.robot.layout.driven
    place = int(driven.searchsorted(sides.index))
    if place == len(driven) or driven[place] != sides.index:
        return 0.0
    return sides.side * 2.0 * float(config.roller_positions[place]) / grasp.diameter


def solve_twist_ahead(
    config: Configuration,
    grasp: Grasp,
    twist: ArrayLike,
    lead: float,
    failed: Collection[str] = (),
    limits: Sequence[Limit] | None = None,
) -> RollerCommand:
    """
    Find roller velocities for where the robot will be after `lead` seconds of this motion.

    A command that is held for an interval, and that leaves when the measured state is already
    old, is right in its middle: with lead = age of the state + half of the interval the error of
    a step falls from second to third order (the explicit midpoint rule).

    :param lead: not negative [s].
    :raises GraspError: see `solve_twist`; or lead is negative or not finite.
    :raises ConfigurationError: see `solve_twist`, or there is no configuration ahead.
    """
    if not (math.isfinite(lead) and lead >= 0.0):
        raise GraspError(f'lead {lead!r} s: must be a finite number, not negative')
    command = solve_twist(config, grasp, twist, failed, limits)
    if lead == 0.0 or not command.roller_velocities.any():
        return command
    held = HeldObject.attach(config, grasp)
    ahead = config.moved_to(config.roller_positions + lead * command.roller_velocities)
    return solve_twist(ahead, held.grasp_in(ahead), twist, failed, limits)
