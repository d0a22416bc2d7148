# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
One step of closing the grasping members on an object: a quadratic program (QP).

    minimize    1/2 |g + (dg/dphi) u - target|^2 + 1/2 a^2 (opening excess)^2 + 1/2 w |u - n|^2
    subject to  limits, gaps of all that must not touch, rigidity, clearance,  |u| <= longest step

u is the roller travel of the step, n that to the nominal posture, a the opening arm and w the
motion weight of `SearchSettings`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.manipulation.limits import Limit
from isotruss_ros.core.model.convex_object import ConvexObject

as_convex_object = lambda b: b
Cylinder = type(None)
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.planning.settings import DEFAULT, SearchSettings
from isotruss_ros.core.safety.distances import collision_model, object_gaps, ObjectGaps
import numpy as np


@dataclass(frozen=True, eq=False)
class Closing:
    """
    What closes on which object, within which bounds.

    :ivar body: the object, which stands still.
    :ivar module: number of the grip module; None where the members are any.
    :ivar members: numbers of the grasping members: the two at the module, and perhaps others.
    :ivar opening: largest angle between the two members at the module [rad]; of any members, from
        the line of the forces between them to the normals, that of the friction cones.
    :ivar limits: of the rollers; a step is their motion in a unit of time.
    :ivar min_rigidity: see `rigidity_index`, 1 at home [-].
    :ivar nominal_posture: (r,) roller positions that the remaining freedom is drawn to [m]; the
        present ones if None.
    :ivar settings: of the search.
    :ivar facing: (s,) unit normals out of the object, x + iy, that the members are turned to face;
        they stay as they are if None.
    """

    body: Cylinder | ConvexObject
    module: int | None
    members: tuple[int, ...]
    opening: float
    limits: tuple[Limit, ...]
    min_rigidity: float
    nominal_posture: Array | None = None
    settings: SearchSettings = DEFAULT
    facing: Points | None = None

    def bound(self, requirement: str) -> float:
        """
        Return the bound of a requirement.

        :param requirement: its name.
        """
        return {'rigidity': self.min_rigidity, 'opening': self.opening}.get(requirement, 0.0)


@dataclass(frozen=True, eq=False)
class SearchState:
    """
    A configuration, and the quantities that steps from it and to it depend on.

    :ivar config: the configuration.
    :ivar gaps: between it and the object.
    :ivar modes: its smallest singular values.
    :ivar distances: (p,) of parts that must not meet, see `CollisionModel` [m].
    """

    config: Configuration
    gaps: ObjectGaps
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


class Part(NamedTuple):
    """
    Some constraints of the QP, lower <= matrix u <= upper.

    :ivar matrix: (k, r).
    :ivar lower: (k,).
    :ivar upper: (k,).
    """

    matrix: Array
    lower: Array
    upper: Array


def evaluate_state(config: Configuration, body: Cylinder | ConvexObject) -> SearchState:
    """
    Evaluate a configuration.

    :param config: the configuration.
    :param body: the object.
    :raises ConfigurationError: it is singular.
    """
    return SearchState(
        config,
        object_gaps(config, body),
        rigidity_index(config.robot).modes(config),
        collision_model(config.robot).distances(config),
    )


def mean_member_length(config: Configuration) -> float:
    """
    Return the mean length of the members at home, which steps are measured by [m].

    :param config: a configuration of the robot.
    """
    return float(config.robot.home.member_lengths.mean())


def solve_step(state: SearchState, closing: Closing, targets: Array, share: float) -> Array:
    """
    Return the motion of the rollers (r,) in one step [m].

    :param state: where the step begins.
    :param closing: what closes.
    :param targets: (s,) gaps of the grasping members [m].
    :param share: of the longest step.
    :raises SolverError: the quadratic program was not solved.
    """
    config, gaps, settings = state.config, state.gaps, closing.settings
    size = share * mean_member_length(config)
    members = list(closing.members)
    by_members, _, _, by_openings = np.split(gaps.by_rollers, 4)
    matrix = by_members[members]
    aim = np.maximum(targets - gaps.members[members], -settings.max_gap_step * size)
    parts = [*_separation(state, closing, targets), _shape(state, closing)]
    excess, turning = 0.0, np.zeros((1, matrix.shape[1]))
    if closing.module is not None:
        excess = float(gaps.openings[closing.module]) - closing.opening
        turning = settings.opening_arm * by_openings[[closing.module]]
    if closing.facing is not None:
        turned = np.angle(closing.facing * outward_normals(config, closing).conj())
        longest = settings.max_opening_step
        matrix = np.concatenate([matrix, settings.opening_arm * turning_rows(config, members)])
        aim = np.append(aim, settings.opening_arm * np.clip(turned, -longest, longest))
    elif excess > 0.0:
        matrix = np.concatenate([matrix, turning])
        aim = np.append(aim, -settings.opening_arm * min(excess, settings.max_opening_step))
    elif closing.module is not None:
        upper = np.array([-settings.opening_arm * excess])
        parts.append(Part(turning, np.array([-np.inf]), upper))
    parts += [Part(*limit.rows(config)) for limit in closing.limits]
    longest = settings.max_step * size
    nominal = np.zeros(len(config.roller_positions))
    if closing.nominal_posture is not None:
        nominal = np.clip(closing.nominal_posture - config.roller_positions, -longest, longest)
    weight = settings.motion_weight
    hessian = matrix.T @ matrix + weight * np.eye(len(nominal))
    return _solve(hessian, -matrix.T @ aim - weight * nominal, parts, longest)


def outward_normals(config: Configuration, closing: Closing) -> Points:
    """
    Return the directions from the object across the grasping members, (s,) x + iy.

    :param config: configuration of the robot.
    :param closing: what closes on which object.
    """
    starts, spans = _spans(config, np.array(closing.members))
    axes = spans / np.abs(spans)
    aside = (axes.conj() * (as_convex_object(closing.body).middle - starts)).imag
    return -1j * np.where(aside < 0.0, -axes, axes)


def turning_rows(config: Configuration, members: Sequence[int]) -> Array:
    """
    Return how fast members turn for 1 m/s at each roller, (s, r) [rad/m].

    :param config: configuration of the robot.
    :param members: (s,) their numbers.
    :raises ConfigurationError: the configuration is singular.
    """
    topology, numbers = config.robot.topology, np.array(members)
    turning = 1j / _spans(config, numbers)[1].conj()
    rows = np.zeros((len(numbers), len(config.points)), dtype=np.complex128)
    own = np.arange(len(numbers))
    rows[own, topology.c[topology.following[numbers]]] = turning
    rows[own, topology.b[numbers]] = -turning
    return config.module_rows(rows.view(np.float64))[:, topology.driven]


def _spans(config: Configuration, members: Indices) -> tuple[Points, Points]:
    """Return starts and spans of members, (s,) each [m]."""
    topology, points = config.robot.topology, config.points
    starts = points[topology.b[members]]
    return starts, points[topology.c[topology.following[members]]] - starts


def _separation(state: SearchState, closing: Closing, targets: Array) -> list[Part]:
    """Return bounds on the gaps: by targets for grasping members, a clearance for others."""
    gaps, members, settings = state.gaps, list(closing.members), closing.settings
    clearance = settings.clearance * state.config.robot.description.tube_diameter
    lower = settings.bound_share * (clearance - gaps.members)
    lower[members] = targets - gaps.members[members]
    others = np.concatenate([gaps.modules, gaps.rods])
    lower = np.concatenate([lower, settings.bound_share * (clearance - others)])
    rows = gaps.by_rollers[: len(lower)]
    return [Part(rows, np.minimum(0.0, lower), np.full(len(lower), np.inf))]


def _shape(state: SearchState, closing: Closing) -> Part:
    """Return bounds on the rigidity and on the clearance of the robot from itself."""
    config, modes, settings = state.config, state.modes, closing.settings
    robot, length = config.robot, mean_member_length(config)
    count = settings.modes
    few = Modes(modes.values[:count], modes.rows[:, :count], modes.nodes[:, :count])
    near = np.flatnonzero(state.distances < settings.near * length)
    rows = np.concatenate(
        [
            rigidity_index(robot).gradients(config, few),
            collision_model(robot).gradients(config, near),
        ]
    )
    left = np.concatenate(
        [
            few.values - closing.min_rigidity,
            state.distances[near] - settings.self_clearance * length,
        ]
    )
    matrix = config.roller_rows(rows)
    lower = np.minimum(0.0, -settings.bound_share * left)
    return Part(matrix, lower, np.full(len(left), np.inf))


def _solve(hessian: Array, linear: Array, parts: list[Part], longest: float) -> Array:
    matrix = np.concatenate([part.matrix for part in parts])
    lower = np.concatenate([part.lower for part in parts])
    upper = np.concatenate([part.upper for part in parts])
    bounds = np.full(len(linear), longest)
    found = solve_qp(
        QuadraticProgram(
            hessian,
            linear,
            np.concatenate([matrix, -matrix]),
            np.concatenate([upper, -lower]),
            -bounds,
            bounds,
        )
    )
    if found is not None:
        return found
    raise SolverError(
        'no step of the rollers keeps the bounds; '
        'the configuration is probably close to a singular one'
    )
