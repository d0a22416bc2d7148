# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Definition of a closing motion, and the state of its steps."""

from __future__ import annotations

from dataclasses import dataclass, field

from isotruss_ros.core.holding.build_statics import facing_lines
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
import numpy as np

#: Largest share of the distance from a bound used by a step [-].
BOUND_SHARE = 0.5
#: Indentation of the members from waypoint to waypoint, in tube diameters [-].
CLOSING_STEP = 0.12
#: Reduction of steps that a bound ends, and smallest share of the full step [-].
REFINEMENT, MIN_STEP_SHARE = 0.34, 0.3


@dataclass(frozen=True, eq=False)
class Closing:
    """Members and object of a closing motion, with its bounds."""

    body: ConvexObject  #: the object, at rest
    members: tuple[int, ...]  #: indices of the grasping members
    limits: tuple[Limit, ...]  #: limits of the rollers; a step is their motion in unit time
    min_rigidity: float  #: smallest rigidity index, 1 at home [-]
    friction_angle: float = 0.0  #: angle of the friction cones for an open grip [rad]
    nominal_posture: Array | None = None  #: (r,) nominal roller positions [m], if any
    facing: Points | None = None  #: (s,) desired unit normals, x + iy, if any
    tally: SearchTally = field(default_factory=SearchTally)  #: evaluated candidates so far

    def normals(self, config: Configuration) -> Points:
        """
        Return the unit normals from the object to the grasping members, (s,) x + iy.

        :param config: configuration of the robot.
        """
        return facing_lines(config, self.body, np.array(self.members))[1]


@dataclass(frozen=True, eq=False)
class SearchState:
    """A configuration with the quantities that steps depend on."""

    config: Configuration  #: the configuration
    gaps: Array  #: (3m,) gaps of members, modules, rods [m]; negative for indentation
    gaps_by_nodes: Array  #: (3m, 2n) derivatives of the gaps by the node coordinates [-]
    modes: Modes  #: smallest singular values; the first is the rigidity index
    distances: Array  #: (p,) distances of parts, see `CollisionModel` [m]

    @property
    def rigidity(self) -> float:
        """Return the rigidity index, 1 at home."""
        return float(self.modes.values[0])

    @property
    def clearance(self) -> float:
        """Return the smallest of the distances [m]."""
        return float(self.distances.min(initial=np.inf))

    def check_bounds(self, rigidity: float, clearance: float, gaps: Array) -> None:
        """
        Raise RequirementError if the configuration violates a bound.

        :param rigidity: smallest rigidity index.
        :param clearance: smallest distance of parts [m].
        :param gaps: (3m,) smallest gaps [m].
        :raises RequirementError: a bound is violated.
        """
        low = int((self.gaps - gaps).argmin())
        for name, value, bound in (
            ('rigidity', self.rigidity, rigidity),
            ('self_clearance', self.clearance, clearance),
            ('object_clearance', float(self.gaps[low]), float(gaps[low])),
        ):
            if value < bound:
                raise RequirementError(name, value, bound)


def evaluate_state(config: Configuration, body: ConvexObject) -> SearchState:
    """
    Evaluate a configuration.

    :param config: the configuration.
    :param body: the object.
    :raises ConfigurationError: the configuration is singular.
    """
    model = collision_model(config.robot)
    return SearchState(
        config,
        *model.body_distances(config, body)[:2],
        rigidity_index(config.robot).modes(config),
        model.distances(config),
    )
