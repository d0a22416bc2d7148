# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Closing the grasping members on an object, step by step.

Every step is admissible, so that the steps are a path: the configuration at the end of a step is
evaluated, and the step is halved where a requirement is violated there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.closing import Closing, evaluate_state, SearchState
from isotruss_ros.core.planning.closing_qp import solve_step
from isotruss_ros.core.planning.grasp_plan import Violation
import numpy as np

GAP_ROUNDING = 1e-12  # [m]
#: Gaps are brought to their targets to this [m].
GAP_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Step:
    """
    One step.

    :ivar state: at its end; that at its beginning if no step was admissible.
    :ivar evaluations: number of configurations that were computed for it.
    :ivar share: of the longest step, a good choice for the next one.
    :ivar blocked: name and value of the requirement that would be violated; None if the step was
        made.
    """

    state: SearchState
    evaluations: int
    share: float
    blocked: tuple[str, float] | None = None


def take_closing_step(
    state: SearchState, closing: Closing, targets: Sequence[float], share: float
) -> Step:
    """
    Bring the gaps of the grasping members closer to their targets.

    :param state: where the step begins.
    :param closing: what closes.
    :param targets: one for each of `closing.members` [m].
    :param share: of the longest step, 1 at first; then `Step.share` of the step before.
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
            return Step(there, halving + 1, min(1.0, larger))
    return Step(state, halvings, share, blocked)


@dataclass(frozen=True, eq=False)
class Pressing:
    """
    What came of pressing the grasping members on the object.

    :ivar config: with the indentations asked for; None if there is none.
    :ivar evaluations: number of configurations that were computed.
    :ivar violation: the requirement that stopped the motion; None if none did.
    """

    config: Configuration | None
    evaluations: int
    violation: Violation | None = None


def press(config: Configuration, closing: Closing, depths: Array) -> Pressing:
    """
    Bring the grasping members to given indentations; the object stands still.

    :param config: where to begin.
    :param closing: what closes.
    :param depths: (s,) indentation of each grasping member [m].
    :raises SolverError: a quadratic program was not solved.
    """
    state = evaluate_state(config, closing.body)
    members, share, evaluations, left = list(closing.members), 1.0, 0, np.inf
    for _ in range(closing.settings.max_press_steps):
        left = float(np.abs(state.gaps[members] + depths).max())
        if left <= GAP_TOLERANCE:
            return Pressing(state.config, evaluations)
        step = take_closing_step(state, closing, -depths, share)
        evaluations += step.evaluations
        if step.blocked:
            name, value = step.blocked
            violation = Violation(name, value, closing.bound(name), 50.0)
            return Pressing(None, evaluations, violation)
        state, share = step.state, step.share
    return Pressing(None, evaluations, Violation('reach', left, 0.0, 40.0 + left))


def _gap_bounds(state: SearchState, closing: Closing, targets: Array) -> Array:
    """Return the gaps (3m,) that a step must leave; the program is right to first order only."""
    diameter, settings = state.config.robot.description.tube_diameter, closing.settings
    bounds = np.full(len(state.gaps), settings.kept_clearance * settings.clearance * diameter)
    bounds[list(closing.members)] = targets - settings.overshoot * diameter
    return np.minimum(bounds, state.gaps - GAP_ROUNDING)
