# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""What closes on which object, and what its steps depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.holding.pressed_contacts import member_lines
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.convex_object import ConvexObject
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.planning.settings import DEFAULT, SearchSettings
from isotruss_ros.core.safety.distances import collision_model
import numpy as np


@dataclass(frozen=True, eq=False)
class Closing:
    """
    What closes on which object, within which bounds.

    :ivar body: the object, which stands still.
    :ivar members: numbers of the grasping members.
    :ivar limits: of the rollers; a step is their motion in a unit of time.
    :ivar min_rigidity: see `rigidity_index`, 1 at home [-].
    :ivar friction_angle: of the cones within which the forces of an open grip balance [rad].
    :ivar nominal_posture: (r,) roller positions that the remaining freedom is drawn to [m]; the
        present ones if None.
    :ivar facing: (s,) unit normals out of the object, x + iy, that the members are turned to face;
        they stay as they are if None.
    :ivar settings: of the search.
    """

    body: ConvexObject
    members: tuple[int, ...]
    limits: tuple[Limit, ...]
    min_rigidity: float
    friction_angle: float = 0.0
    nominal_posture: Array | None = None
    facing: Points | None = None
    settings: SearchSettings = DEFAULT

    def bound(self, requirement: str) -> float:
        """
        Return the bound of a requirement.

        :param requirement: its name.
        """
        return self.min_rigidity if requirement == 'rigidity' else 0.0


@dataclass(frozen=True, eq=False)
class SearchState:
    """
    A configuration, and the quantities that steps from it and to it depend on.

    :ivar config: the configuration.
    :ivar gaps: (3m,) between the object and members, modules, rods [m]; of members negative where
        they would be indented.
    :ivar gaps_by_nodes: (3m, 2n) derivatives of the gaps by the node coordinates [-].
    :ivar modes: its smallest singular values.
    :ivar distances: (p,) of parts that must not meet, see `CollisionModel` [m].
    """

    config: Configuration
    gaps: Array
    gaps_by_nodes: Array
    modes: Modes
    distances: Array

    @property
    def rigidity(self) -> float:
        """Return the rigidity index, 1 at home."""
        return float(self.modes.values[0])

    @property
    def clearance(self) -> float:
        """Return the smallest of the distances [m]."""
        return float(self.distances.min(initial=np.inf))


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
        *model.body_distances(config, body),
        rigidity_index(config.robot).modes(config),
        model.distances(config),
    )


def mean_member_length(config: Configuration) -> float:
    """
    Return the mean length of the members at home, which steps are measured by [m].

    :param config: a configuration of the robot.
    """
    return float(config.robot.home.member_lengths.mean())


def outward_normals(config: Configuration, closing: Closing) -> Points:
    """
    Return the directions from the object across the grasping members, (s,) x + iy.

    :param config: configuration of the robot.
    :param closing: what closes on which object.
    """
    return member_lines(config, closing.body, np.array(closing.members))[1]


def turning_rows(config: Configuration, members: Sequence[int]) -> Array:
    """
    Return how fast members turn for 1 m/s at each roller, (s, r) [rad/m].

    :param config: configuration of the robot.
    :param members: (s,) their numbers.
    :raises ConfigurationError: the configuration is singular.
    """
    topology, numbers, points = config.robot.topology, np.array(members), config.points
    starts, ends = topology.b[numbers], topology.c[topology.following[numbers]]
    turning = 1j / (points[ends] - points[starts]).conj()
    rows = np.zeros((len(numbers), len(points)), dtype=np.complex128)
    own = np.arange(len(numbers))
    rows[own, ends], rows[own, starts] = turning, -turning
    return config.roller_rows(rows.view(np.float64))
