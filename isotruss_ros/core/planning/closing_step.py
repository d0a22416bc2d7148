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
motion weight of `SearchSettings`. Steps are a path: the configuration at the end of each is
evaluated, and the step is halved where a requirement is violated there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.errors import ConfigurationError, SolverError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.rigidity import Modes, rigidity_index
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.qp import QuadraticProgram, solve_qp
from isotruss_ros.core.planning.closing import (
    Closing,
    evaluate_state,
    mean_member_length,
    outward_normals,
    SearchState,
    turning_rows,
)
from isotruss_ros.core.planning.grasp_plan import SearchTally
from isotruss_ros.core.safety.distances import collision_model
import numpy as np

GAP_ROUNDING = 1e-12  # [m]
#: Gaps are brought to their targets to this [m].
GAP_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Step:
    """
    One step.

    :ivar state: at its end; that at its beginning if no step was admissible.
    :ivar share: of the longest step, a good choice for the next one.
    :ivar blocked: name and value of the requirement that would be violated; None if the step was
        made.
    """

    state: SearchState
    share: float
    blocked: tuple[str, float] | None = None


def press(
    config: Configuration, closing: Closing, depths: Array, tally: SearchTally
) -> Configuration | None:
    """
    Bring the grasping members to given indentations; the object stands still.

    :param config: where to begin.
    :param closing: what closes.
    :param depths: (s,) indentation of each grasping member [m].
    :param tally: of the search.
    :return: None where a requirement stops the motion; the tally has it.
    :raises SolverError: a quadratic program was not solved.
    """
    state = evaluate_state(config, closing.body)
    members, share, left = list(closing.members), 1.0, np.inf
    for _ in range(closing.settings.max_press_steps):
        left = float(np.abs(state.gaps[members] + depths).max())
        if left <= GAP_TOLERANCE:
            return state.config
        step = take_closing_step(state, closing, -depths, share, tally)
        if step.blocked:
            name, value = step.blocked
            tally.record(name, value, closing.bound(name), 50.0)
            return None
        state, share = step.state, step.share
    tally.record('reach', left, 0.0, 40.0 + left)
    return None


def take_closing_step(
    state: SearchState,
    closing: Closing,
    targets: Sequence[float],
    share: float,
    tally: SearchTally,
) -> Step:
    """
    Bring the gaps of the grasping members closer to their targets.

    :param state: where the step begins.
    :param closing: what closes.
    :param targets: one for each of `closing.members` [m].
    :param share: of the longest step, 1 at first; then `Step.share` of the step before.
    :param tally: of the search.
    :raises SolverError: the quadratic program was not solved.
    """
    aims = np.asarray(targets)
    move = solve_step(state, closing, aims, share)
    least = min(closing.min_rigidity, state.rigidity)
    room = min(0.0, state.clearance)
    bounds = _gap_bounds(state, closing, aims)
    config, halvings = state.config, closing.settings.max_halvings
    blocked = ('reach', float((state.gaps[list(closing.members)] - aims).max()))
    for halving in range(halvings):
        tally.evaluations += 1
        try:
            moved = config.moved_to(config.roller_positions + 0.5**halving * move)
            there = evaluate_state(moved, closing.body)
        except ConfigurationError:
            blocked = ('rigidity', 0.0)
            continue
        low = int((there.gaps - bounds).argmin())
        if there.rigidity < least:
            blocked = ('rigidity', there.rigidity)
        elif there.clearance < room:
            blocked = ('self_clearance', there.clearance)
        elif there.gaps[low] < bounds[low]:
            blocked = ('object_clearance', float(there.gaps[low]))
        else:
            larger = 2.0 * share if halving == 0 else share * 0.5**halving
            return Step(there, min(1.0, larger))
    return Step(state, share, blocked)


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
    matrix = (state.gaps_by_nodes @ config.node_jacobian)[members]
    aim = np.maximum(targets - state.gaps[members], -settings.max_gap_step * size)
    if closing.facing is not None:
        turned = np.angle(closing.facing * outward_normals(config, closing).conj())
        turned = np.clip(turned, -settings.max_turn_step, settings.max_turn_step)
        matrix = np.concatenate([matrix, settings.turning_arm * turning_rows(config, members)])
        aim = np.append(aim, settings.turning_arm * turned)
    longest = settings.max_step * size
    nominal = np.zeros(len(config.roller_positions))
    if closing.nominal_posture is not None:
        nominal = np.clip(closing.nominal_posture - config.roller_positions, -longest, longest)
    weight, bounds = settings.motion_weight, np.full(len(nominal), longest)
    rows, least = bound_rows(state, closing, targets)
    found = solve_qp(
        QuadraticProgram(
            matrix.T @ matrix + weight * np.eye(len(nominal)),
            -matrix.T @ aim - weight * nominal,
            -rows,
            -least,
            -bounds,
            bounds,
        )
    )
    if found is None:
        raise SolverError(
            'no step of the rollers keeps the bounds; '
            'the configuration is probably close to a singular one'
        )
    return found


def bound_rows(state: SearchState, closing: Closing, targets: Array) -> tuple[Array, Array]:
    """
    Return the bounds of a step u as rows (k, r) and least values (k,): rows u >= least.

    They are those of gaps, by targets for grasping members, by a clearance for others; of the
    rigidity; of distances of near parts of the robot; and the limits.

    :param state: where the step begins.
    :param closing: what closes.
    :param targets: (s,) gaps of the grasping members [m].
    """
    config, settings, members = state.config, closing.settings, list(closing.members)
    robot, length = config.robot, mean_member_length(config)
    gaps = settings.bound_share * (
        settings.clearance * robot.description.tube_diameter - state.gaps
    )
    gaps[members] = targets - state.gaps[members]
    values, rows, nodes = state.modes
    few = Modes(values[: settings.modes], rows[:, : settings.modes], nodes[:, : settings.modes])
    near = np.flatnonzero(state.distances < settings.near * length)
    left = np.append(
        few.values - closing.min_rigidity,
        state.distances[near] - settings.self_clearance * length,
    )
    shape = np.concatenate(
        [
            rigidity_index(robot).gradients(config, few),
            collision_model(robot).gradients(config, near),
        ]
    )
    matrices = [state.gaps_by_nodes @ config.node_jacobian, config.roller_rows(shape)]
    least = [np.minimum(0.0, gaps), np.minimum(0.0, -settings.bound_share * left)]
    for limit in closing.limits:
        matrix, lower, upper = limit.rows(config)
        matrices += [matrix, -matrix]
        least += [lower, -upper]
    return np.concatenate(matrices), np.concatenate(least)


def _gap_bounds(state: SearchState, closing: Closing, targets: Array) -> Array:
    """Return the gaps (3m,) that a step must leave; the program is right to first order only."""
    diameter, settings = state.config.robot.description.tube_diameter, closing.settings
    bounds = np.full(len(state.gaps), settings.kept_clearance * settings.clearance * diameter)
    bounds[list(closing.members)] = targets - settings.overshoot * diameter
    return np.minimum(bounds, state.gaps - GAP_ROUNDING)
