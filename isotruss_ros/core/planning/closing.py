# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What closes on which object, and what its steps depend on."""

from __future__ import annotations

from dataclasses import dataclass, field

from isotruss_ros.core.holding.build_statics import AS_MODELLED, facing_lines
from isotruss_ros.core.holding.contact_statics import TubeModel
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
import numpy as np

#: A step uses at most this share of the distance from a bound.
BOUND_SHARE = 0.5
#: Members close by so much from waypoint to waypoint, in diameters of the tube; ...
CLOSING_STEP = 0.12
#: ... steps become shorter by this factor where a bound ends them, while longer than this share.
REFINEMENT, LEAST_SHARE = 0.34, 0.3


@dataclass(frozen=True, eq=False)
class Closing:
    """What closes on which object, within which bounds."""

    body: ConvexObject  #: the object, which stands still
    members: tuple[int, ...]  #: numbers of the grasping members
    limits: tuple[Limit, ...]  #: of the rollers; a step is their motion in a unit of time
    min_rigidity: float  #: see `rigidity_index`, 1 at home [-]
    friction_angle: float = 0.0  #: of the cones in which an open grip balances [rad]
    nominal_posture: Array | None = None  #: (r,) roller positions to be drawn to [m], if any
    facing: Points | None = None  #: (s,) unit normals, x + iy, to be turned to, if any
    tubes: TubeModel = AS_MODELLED  #: what is assumed of them
    tally: SearchTally = field(default_factory=SearchTally)  #: what was looked at so far

    def normals(self, config: Configuration) -> Points:
        """
        Return the directions from the object across the grasping members, (s,) x + iy.

        :param config: configuration of the robot.
        """
        return facing_lines(config, self.body, np.array(self.members))[1]


@dataclass(frozen=True, eq=False)
class SearchState:
    """A configuration, and the quantities that steps from it and to it depend on."""

    config: Configuration  #: the configuration
    gaps: Array  #: (3m,) of members, modules, rods [m]; negative where indented
    gaps_by_nodes: Array  #: (3m, 2n) derivatives of the gaps by the node coordinates [-]
    modes: Modes  #: its smallest singular values; the first is the rigidity index, 1 at home
    distances: Array  #: (p,) of parts that must not meet, see `CollisionModel` [m]

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
        Check that the configuration keeps its bounds.

        :param rigidity: smallest rigidity index.
        :param clearance: smallest distance of parts that must not meet [m].
        :param gaps: (3m,) smallest ones [m].
        :raises RequirementError: it does not.
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
    :raises ConfigurationError: it is singular.
    """
    model = collision_model(config.robot)
    return SearchState(
        config,
        *model.body_distances(config, body)[:2],
        rigidity_index(config.robot).modes(config),
        model.distances(config),
    )
