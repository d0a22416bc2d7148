# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data of a closing motion of members on an object, and the state of its search."""

from __future__ import annotations

from dataclasses import dataclass, field

from isotruss_ros.core.chance.uncertainty import Uncertainty
from isotruss_ros.core.holding.pressed_contacts import facing_lines
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.distances import collision_model
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
import numpy as np

#: Largest step of a quantity toward its bound, relative to the distance from the bound [-].
BOUND_SHARE = 0.5
#: Depth of the object in each grasping member at first contact, in tube diameters [-].
FIRST_INDENTATION = 1e-3


@dataclass(frozen=True, eq=False)
class Closing:
    """Object, grasping members, bounds and targets of a closing motion."""

    body: ConvexObject  #: the object, which does not move
    members: tuple[int, ...]  #: indices of the grasping members
    limit: Limit  #: limit on a step, which is regarded as a motion of 1 s
    min_rigidity: float  #: smallest rigidity index, 1 at home [-]
    friction_angle: float = 0.0  #: half angle of the friction cones that may be used [rad]
    #: (r,) roller positions toward which rollers move if the closing leaves them free [m]; None:
    #: no such positions
    nominal_posture: Array | None = None
    #: (s,) desired unit vectors from the object to the members, x + iy; None: no desired rotation,
    #: after the approach
    facing: Points | None = None
    uncertainty: Uncertainty | None = None  #: grasps are ranked by the chance; None: by measure
    #: counts of the search, and the violation of the candidate closest to an admissible grasp
    tally: SearchTally = field(default_factory=SearchTally)

    def normals(self, config: Configuration) -> Points:
        """Return unit vectors from the object to the grasping members, (s,) x + iy."""
        return facing_lines(config, self.body, np.array(self.members))[1]


@dataclass(frozen=True, eq=False)
class SearchState:
    """Configuration with all quantities that are bounded while the members close on the object."""

    config: Configuration  #: the configuration
    #: (3m,) gaps between the object and the members, modules and rods [m]; negative in an overlap
    gaps: Array
    gaps_by_nodes: Array  #: (3m, 2n) derivatives of the gaps with respect to node coordinates [-]
    modes: Modes  #: smallest singular values, see `Modes`; the first is the rigidity index
    rigidity: float  #: rigidity index of the configuration, 1 at home
    distances: Array  #: (p,) distances of the pairs of `CollisionModel` [m]
    clearance: float  #: smallest one of these distances [m]

    def check_bounds(self, rigidity: float, clearance: float, gaps: Array) -> None:
        """Raise RequirementError if rigidity, clearance [m] or a gap (3m,) [m] is too small."""
        low = int((self.gaps - gaps).argmin())
        for name, value, bound in (
            ('rigidity', self.rigidity, rigidity),
            ('self_clearance', self.clearance, clearance),
            ('object_clearance', float(self.gaps[low]), float(gaps[low])),
        ):
            if value < bound:
                raise RequirementError(name, value, bound)


def evaluate_state(config: Configuration, body: ConvexObject) -> SearchState:
    """Return a configuration with all quantities that are bounded while the members close."""
    model, modes = collision_model(config.robot), rigidity_index(config.robot).modes(config)
    gaps, by_nodes, _ = model.body_distances(config, body)
    distances, rigidity = model.distances(config), float(modes.values[0])
    clearance = float(distances.min(initial=np.inf))
    return SearchState(config, gaps, by_nodes, modes, rigidity, distances, clearance)
