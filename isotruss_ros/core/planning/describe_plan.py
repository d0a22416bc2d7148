# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A planned grasp as plain numbers, names and lists, as a path in time, and in words."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.grasp_plan import GraspPlan, PlannedGrasp, Violation
import numpy as np

#: Of the largest speed, near the object: a member that touches first, since its rollers lag less
#: than others, pushes the object along.
NEAR_SHARE = 0.25
#: Of each piece of a path, so that times increase [s].
LEAST_DURATION = 0.01
#: By the name of a requirement: value of the closest candidate, and bound.
SENTENCES = {
    'free': 'the robot touches the object already: the gap between them is {value:.4g} m',
    'enclosed': 'no members go all around the object',
    'members': '{value:.0f} of the {bound:.0f} members asked for are seen from within the object',
    'opposed': 'forces of the members, within their friction cones, balance at no angle near',
    'reach': 'a member stays {value:.4g} m short of the object',
    'facing': 'members stay {value:.3g} rad from where friction holds the object between them',
    'rigidity': 'along the path the rigidity index falls to {value:.3g}; must be {bound:.3g}',
    'self_clearance': 'along the path the clearance of the robot from itself is {value:.4g} m',
    'object_clearance': 'a part that must not touch comes within {value:.4g} m of the object',
    'held': 'no pose near the object balances the forces of the members',
    'squeeze': 'limits end the closing at {value:.4g} N of each member; must be {bound:.4g} N',
    'in_place': 'the rollers cannot close and leave the object in place: it moves {value:.4g} m',
    'grip': '{value:.0f} members press on an object held fast there; must be those of the grip',
    'min_slip_margin': 'the slip margin is {value:.4g} N, and must be {bound:.4g} N',
    'force_closure': 'it takes a friction coefficient of {value:.4g}, there is {bound:.4g}',
    'min_margin': 'the closure margin is {value:.4g} N, and must be {bound:.4g} N',
    'max_contact_force': 'one member presses with {value:.4g} N; must be at most {bound:.4g} N',
    'max_total_force': 'all members press with {value:.4g} N; must be at most {bound:.4g} N',
    'max_utilisation': 'a tube bears {value:.3g} of its wrinkling moment; at most {bound:.3g}',
    'carry': 'the object can be carried {value:.0%} of its path without slipping',
}


def export_figures(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return what characterises a grasp, by name: module, members, roller positions and scores.

    The module is empty where the members of the grip do not meet at one.

    :param grasp: see `PlannedGrasp` for the figures and their units.
    """
    numbers = [field.name for field in fields(grasp) if field.type == 'float']
    return {
        'module': grasp.module or '',
        'members': list(grasp.members),
        'roller_positions': grasp.roller_positions.tolist(),
    } | {name: getattr(grasp, name) for name in numbers}


def export_path(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return the path to a grasp: `path` (k, r) [m], `times` (k,) [s], and the row `touch`.

    :param grasp: driven at the largest speed of the robot's rollers, and at `NEAR_SHARE` of it
        from two waypoints before the touch on.
    """
    near = np.arange(len(grasp.path) - 1) >= grasp.touch - 2
    times = path_times(grasp.path, grasp.config.robot.description.max_speed, near)
    return {'path': grasp.path.tolist(), 'times': times.tolist(), 'touch': grasp.touch}


def export_violation(violation: Violation | None) -> dict[str, Any]:
    """
    Return which requirement is violated, with value and bound; nothing where none is.

    :param violation: the closest one of a search.
    """
    if violation is None:
        return {}
    return {
        'violated_requirement': violation.requirement,
        'violation_value': float(violation.value),
        'violation_bound': float(violation.bound),
    }


def path_times(path: Array, max_speed: float, near: Array) -> Array:
    """
    Return when each waypoint is reached, straight between them.

    :param path: (k, r) roller positions [m].
    :param max_speed: of any roller [m/s].
    :param near: (k - 1,) pieces that are driven at `NEAR_SHARE` of the speed.
    :return: (k,) times from the start, the first 0 [s].
    """
    speeds = np.where(near, NEAR_SHARE * max_speed, max_speed)
    longest = np.abs(np.diff(path, axis=0)).max(axis=1, initial=0.0)
    return np.append(0.0, np.cumsum(np.maximum(longest / speeds, LEAST_DURATION)))


def violation_in_words(violation: Violation | None) -> str:
    """
    Return a violation in words.

    :param violation: that of the closest candidate; None if there was none.
    """
    if violation is None:
        return 'there was no grasp candidate'
    if violation.requirement not in SENTENCES:
        return f'the closest grasp candidate cannot be computed: {violation.requirement}'
    if violation.requirement == 'force_closure' and violation.value == 0.0:
        return 'force_closure: the members do not press on the object'
    sentence = SENTENCES[violation.requirement].format(**vars(violation))
    return f'{violation.requirement}: {sentence}'


def grasp_in_words(grasp: PlannedGrasp) -> str:
    """
    Return members and forces of a grasp in words, and whether they are outside of the model.

    :param grasp: the grasp.
    """
    outside = '; a tube wrinkles, these numbers are outside of the model'
    where = '' if grasp.module is None else f'at {grasp.module} '
    return (
        f'{where}between {", ".join(grasp.members)}: presses with '
        f'{grasp.squeeze:.3g} N each, slips at {grasp.slip_margin:.3g} N, closure margin held '
        f'fast {1e3 * grasp.closure_margin:.3g} mN, tubes bear {grasp.utilisation:.2g} of their '
        f'wrinkling moment{outside if grasp.outside_model else ""}'
    )


def plan_in_words(plan: GraspPlan) -> str:
    """
    Return a plan in words: the best grasp, or the closest violation.

    If tubes wrinkle in any of the grasps it says so.

    :param plan: the plan.
    """
    if not plan.grasps:
        violation = violation_in_words(plan.closest_violation)
        return f'no grasp found in {plan.evaluations} evaluations; {violation}'
    found = 'one grasp' if len(plan) == 1 else f'{len(plan)} grasps, the best'
    wrinkled = sum(grasp.outside_model for grasp in plan[1:])
    others = f'; so it is in {wrinkled} of the others'
    if not plan[0].outside_model:
        others = f'; in {wrinkled} of the others a tube wrinkles: outside of the model'
    return f'{found} {grasp_in_words(plan[0])}{others if wrinkled else ""}'
