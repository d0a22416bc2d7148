# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Shape guard, which prevents motion into singular and colliding configurations.

Each barrier adds rows to the quadratic program. A row bounds the rate dh/dt of a margin h from
below by a class-K function of h, to first order at one instant. A command is constant during a
sample, so the guard also evaluates the end of the sample, see `command_watch`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.limits import default_limits, Limit
from isotruss_ros.core.model.obstacle import Obstacle, OBSTACLE_CLEARANCE
from isotruss_ros.core.model.setting_ranges import check_settings
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.safety.barrier_law import Barrier, BarrierLaw, BarrierLimit
from isotruss_ros.core.safety.barriers import ClearanceBarrier, RigidityBarrier
from isotruss_ros.core.safety.command_watch import Watch
from isotruss_ros.core.safety.obstacle_barrier import ObstacleBarrier
import numpy as np

#: Unit, smallest and largest plausible value of each bound.
BOUND_RANGES = {
    'min_rigidity': ('', 0.0, 0.99),
    'min_clearance': ('m', 0.0, 1.0),
    'min_object_clearance': ('m', 0.0, 1.0),
    'min_obstacle_clearance': ('m', 0.0, 1.0),
    'rigidity_band': ('', 1e-9, 1.0),
    'clearance_band': ('m', 1e-9, 1.0),
    'rate': ('1/s', 1e-3, 1e3),
}


@dataclass(frozen=True)
class ShapeBounds:
    """
    Bounds on the configuration, and margins below which the robot is slowed.

    :ivar min_rigidity: smallest rigidity index, 1 at home; see `rigidity_index`.
    :ivar min_clearance: smallest distance between parts of the robot [m].
    :ivar min_object_clearance: smallest distance between object and robot [m].
    :ivar min_obstacle_clearance: smallest distance of robot and object from obstacles [m].
    :ivar rigidity_band: margin above `min_rigidity` below which the robot is slowed.
    :ivar clearance_band: margin above the smallest distances below which the robot is slowed [m].
    :ivar rate: largest decay rate of a small margin [1/s].
    """

    min_rigidity: float = 0.2
    min_clearance: float = 0.02
    min_object_clearance: float = 0.02
    rigidity_band: float = 0.2
    clearance_band: float = 0.1
    rate: float = 5.0
    min_obstacle_clearance: float = OBSTACLE_CLEARANCE

    def __post_init__(self) -> None:
        """Raise ConfigurationError if a bound is out of its range."""
        check_settings(self, BOUND_RANGES, ConfigurationError)


class ShapeGuard:
    """
    Barriers of a robot, which limit commands near singular and colliding configurations.

    :param robot: the robot.
    :param bounds: bounds on the configuration; None: the defaults of `ShapeBounds`.
    :param barriers: user-defined barriers in addition to those of rigidity and clearances.
    :param obstacles: obstacles at rest.
    """

    @check_kinds
    def __init__(
        self,
        robot: Mechanism,
        bounds: ShapeBounds | None = None,
        barriers: Sequence[Barrier] = (),
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        bounds = ShapeBounds() if bounds is None else bounds
        law = partial(BarrierLaw, rate=min(bounds.rate, robot.description.braking_rate))
        distance_law = partial(law, band=bounds.clearance_band, is_distance=True)
        between_parts = distance_law(bounds.min_clearance)
        to_object = distance_law(bounds.min_object_clearance)
        self._barriers: tuple[Barrier, ...] = (
            RigidityBarrier(robot, law(bounds.min_rigidity, bounds.rigidity_band)),
            ClearanceBarrier(robot, between_parts, needs_object=False),
            ClearanceBarrier(robot, to_object, needs_object=True),
            *barriers,
        )
        to_obstacles = distance_law(bounds.min_obstacle_clearance)
        self._obstacle_barriers = tuple(
            ObstacleBarrier(robot, to_obstacles, obstacles, needs_object)
            for needs_object in (False, True)
        )

    def limits(self, config: Configuration, grip: Grip | None) -> tuple[Limit, ...]:
        """
        Return the limits for `solve_twist`, those of the robot file and those of the barriers.

        :param config: configuration of the robot.
        :param grip: the grip; None without an object.
        :raises ConfigurationError: the configuration is singular.
        :raises GraspError: see `find_contacts`.
        """
        return (*default_limits(config.robot), *self.watch(config, grip).limits)

    def watch(
        self, config: Configuration, grip: Grip | None, moving: Sequence[Obstacle] = ()
    ) -> Watch:
        """
        Return limits on a command, one for each barrier with values close to its bound.

        :param config: predicted configuration at the midpoint of a command's sample.
        :param grip: grip at this midpoint; None without an object.
        :param moving: moving obstacles, at their poses at the end of the sample.
        :raises ConfigurationError: the configuration is singular.
        :raises GraspError: see `find_contacts`.
        """
        obstacles = (barrier.with_moving(moving) for barrier in self._obstacle_barriers)
        every = (*self._barriers, *(barrier for barrier in obstacles if barrier.obstacles))
        barriers = tuple(b for b in every if grip is not None or not b.needs_object)
        evaluated = [(barrier, barrier.active(config, grip)) for barrier in barriers]
        limiting = [(barrier, active) for barrier, active in evaluated if len(active.indices)]
        if not limiting:
            return Watch(config, grip, barriers, ())
        # One solution for the rows of all barriers, which are then split by barrier.
        all_rows = config.roller_rows(np.concatenate([active.node_rows for _, active in limiting]))
        ends = np.cumsum([len(active.indices) for _, active in limiting])
        parts = zip(limiting, np.split(all_rows, ends[:-1]), strict=True)
        limits = (BarrierLimit(barrier, active, rows) for (barrier, active), rows in parts)
        return Watch(config, grip, barriers, tuple(limits))
