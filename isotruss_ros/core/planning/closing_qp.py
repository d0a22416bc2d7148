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

    minimize    1/2 |g + (dg/dphi) u - target|^2 + 1/2 a^2 |turn - facing|^2 + 1/2 w |u - n|^2
    subject to  limits, gaps of all that must not touch, rigidity, clearance,  |u| <= longest step

u is the roller travel of the step, n that to the nominal posture, a the turning arm and w the
motion weight of `SearchSettings`.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.planning.closing import (
    Closing,
    mean_member_length,
    outward_normals,
    SearchState,
    turning_rows,
)
from isotruss_ros.core.safety.distances import collision_model
import numpy as np


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


def solve_step(state: SearchState, closing: Closing, targets: Array, share: float) -> Array:
    """
    Return the motion of the rollers (r,) in one step [m].

    :param state: where the step begins.
    :param closing: what closes.
    :param targets: (s,) gaps of the grasping members [m].
    :param share: of the longest step.
    :raises SolverError: the quadratic program was not solved.
    """
    config, settings = state.config, closing.settings
    size = share * mean_member_length(config)
    members = list(closing.members)
    separation = _separation(state, closing, targets)
    matrix = separation.matrix[members]
    aim = np.maximum(targets - state.gaps[members], -settings.max_gap_step * size)
    if closing.facing is not None:
        turned = np.angle(closing.facing * outward_normals(config, closing).conj())
        turned = np.clip(turned, -settings.max_turn_step, settings.max_turn_step)
        matrix = np.concatenate([matrix, settings.turning_arm * turning_rows(config, members)])
        aim = np.append(aim, settings.turning_arm * turned)
    limits = (Part(*limit.rows(config)) for limit in closing.limits)
    parts = [separation, _shape(state, closing), *limits]
    longest = settings.max_step * size
    nominal = np.zeros(len(config.roller_positions))
    if closing.nominal_posture is not None:
        nominal = np.clip(closing.nominal_posture - config.roller_positions, -longest, longest)
    weight = settings.motion_weight
    hessian = matrix.T @ matrix + weight * np.eye(len(nominal))
    return _solve(hessian, -matrix.T @ aim - weight * nominal, parts, longest)


def _separation(state: SearchState, closing: Closing, targets: Array) -> Part:
    """Return bounds on the gaps: by targets for grasping members, a clearance for others."""
    gaps, members, settings = state.gaps, list(closing.members), closing.settings
    clearance = settings.clearance * state.config.robot.description.tube_diameter
    lower = settings.bound_share * (clearance - gaps)
    lower[members] = targets - gaps[members]
    rows = state.gaps_by_nodes @ state.config.node_jacobian
    return Part(rows, np.minimum(0.0, lower), np.full(len(lower), np.inf))


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
