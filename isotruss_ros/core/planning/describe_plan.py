# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of planned grasps to plain data, to a timed path, and to text."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from isotruss_ros.core.model.description import RobotDescription
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.grasp_plan import GraspPlan, PlannedGrasp
from isotruss_ros.core.planning.violations import violation_in_words
import numpy as np

#: Roller speed near the object relative to the largest speed [-]. With unequal lags at high speed
#: one member would touch first and push the object.
NEAR_SPEED_SHARE = 0.25


def export_figures(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return the data of a grasp as a dictionary: module, members, roller positions, scores.

    The module is empty if the members meet at none; the chance needs an uncertainty.
    """
    numbers = [field.name for field in fields(grasp) if field.type == 'float']
    chance = {} if grasp.chance is None else {'chance': grasp.chance.probability}
    return (
        {
            'module': grasp.module or '',
            'members': list(grasp.members),
            'roller_positions': grasp.roller_positions.tolist(),
        }
        | {name: getattr(grasp, name) for name in numbers}
        | chance
    )


def export_path(grasp: PlannedGrasp) -> dict[str, Any]:
    """
    Return `path` (k, r) [m], `times` (k,) [s] and `touch` of a grasp as a dictionary.

    The rollers move at their largest speed, but near the row `touch` at `NEAR_SPEED_SHARE` of it.
    """
    near = np.arange(len(grasp.path) - 1) >= grasp.touch - 2
    times = path_times(grasp.path, grasp.config.robot.description, near)
    return {'path': grasp.path.tolist(), 'times': times.tolist(), 'touch': grasp.touch}


def path_times(path: Array, limits: RobotDescription, near: Array) -> Array:
    """Return the times (k,) of the waypoints (k, r) of a piecewise linear path, from 0 [s]."""
    speeds = np.where(near, NEAR_SPEED_SHARE * limits.max_speed, limits.max_speed)
    steps = np.diff(path, axis=0)
    longest = np.abs(steps).max(axis=1, initial=0.0)
    durations = np.maximum(longest / speeds, 0.01)  # [s], so that times increase
    # A segment contains half of the blends at both corners, see `RollerTrajectory`.
    while len(steps):
        slopes = np.pad(steps / durations[:, None], ((1, 1), (0, 0)))
        changes = np.abs(np.diff(slopes, axis=0)).max(axis=1)
        needed = 0.5 * (changes[1:] + changes[:-1]) / limits.max_acceleration
        if (needed <= durations).all():
            break
        # The factor ends the iteration on segments too short for the acceleration.
        durations = np.maximum(durations, 1.01 * np.sqrt(durations * needed))
    return np.append(0.0, np.cumsum(durations))


def plan_in_words(plan: GraspPlan) -> str:
    """Return a text with the best grasp, or with the violation nearest to an admissible grasp."""
    if not plan.grasps:
        violation = violation_in_words(plan.closest_violation)
        return f'no grasp found in {plan.evaluations} evaluations; {violation}'
    count = 'one grasp' if len(plan) == 1 else f'{len(plan)} grasps, the best'
    wrinkled = sum(grasp.outside_model for grasp in plan[1:])
    others = f'; a tube wrinkles in {wrinkled} of the others too'
    if not plan[0].outside_model:
        others = f'; in {wrinkled} of the others a tube wrinkles: outside of the model'
    return f'{count} {_grasp_in_words(plan[0])}{others if wrinkled else ""}'


def _grasp_in_words(grasp: PlannedGrasp) -> str:
    """Return a text with members and forces of a grasp, with a note if a tube wrinkles."""
    outside = '; a tube wrinkles, these numbers are outside of the model'
    chance = ''
    if grasp.chance is not None:
        first, second, *_ = grasp.chance.shares.items()
        shares = ', '.join(f'{name} {100.0 * share:.0f} %' for name, share in (first, second))
        chance = (
            f'; held with a chance of {grasp.chance.probability:.3g} ({grasp.chance.method}), '
            f'otherwise most probably {grasp.chance.limit} ({shares})'
        )
    where = '' if grasp.module is None else f'at {grasp.module} '
    return (
        f'{where}between {", ".join(grasp.members)}: presses with '
        f'{grasp.squeeze:.3g} N each, slips at {grasp.slip_margin:.3g} N, largest utilisation '
        f'{grasp.utilisation:.2g}, forces {100.0 * grasp.nonlinearity:.2g} % above linear tubes'
        f'{outside if grasp.outside_model else ""}{chance}'
    )
