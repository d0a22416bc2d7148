"""
Where the rollers go in one step of closing on an object: a quadratic program.

    minimize    1/2 |g + (dg/dphi) u - target|^2 + 1/2 w (opening too wide)^2 + 1/2 r |u - pull|^2
    subject to  limits, and gaps of all that is not to touch,  |u| <= longest step
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.clearance import bodies
from isotruss_ros.core.closing import Closing, Place, scale
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.program import installed_solvers
from isotruss_ros.core.shape_rigidity import Modes, shape_rigidity
import numpy as np
from numpy.typing import NDArray
import qpsolvers

Array = NDArray[np.float64]

#: Longest step of a roller, and of a gap, against the mean length of members at home.
LONGEST_STEP, LONGEST_CLOSING = 0.035, 0.027
#: What is not to touch keeps this distance, against the diameter of the tube.
CLEARANCE = 0.1
#: Parts of the robot that are nearer than this are watched, and do not come closer than that,
#: against the mean length of members at home.
NEAR, CLEAR = 0.15, 0.01
#: The least rigid ways to move that are watched.
MODES = 2
#: In one step a bound is approached by this share of the distance at most.
APPROACH = 0.5
#: Cost of the rollers' motion against that of the gaps.
MOTION_COST = 1e-4
#: A gap of 1 m counts as much as a radian of opening times this [m].
OPENING_ARM = 0.3
#: The opening shrinks by this at most in one step [rad].
LONGEST_TURN = 0.1


class Part(NamedTuple):
    """Some constraints of the program, lower <= matrix u <= upper: (k, r) and (k,)."""

    matrix: Array
    lower: Array
    upper: Array


def solve_step(place: Place, closing: Closing, targets: Array, share: float) -> Array:
    """
    Return the motion of the rollers (r,) in one step [m].

    :param targets: gaps of the touching sides (s,) [m].
    :param share: of the longest step.
    :raises SolverError: the program was not solved.
    """
    config, gaps = place.config, place.gaps
    size = share * scale(config)
    sides = list(closing.sides)
    by_members, _, by_openings = np.split(gaps.by_rollers, 3)
    too_wide = float(gaps.openings[closing.module]) - closing.opening
    turning = OPENING_ARM * by_openings[[closing.module]]
    matrix = by_members[sides]
    aim = np.maximum(targets - gaps.members[sides], -LONGEST_CLOSING * size)
    parts = [*_apart(place, closing, targets), _shape(place, closing)]
    if too_wide > 0.0:
        matrix = np.concatenate([matrix, turning])
        aim = np.append(aim, -OPENING_ARM * min(too_wide, LONGEST_TURN))
    else:
        parts.append(Part(turning, np.array([-np.inf]), np.array([-OPENING_ARM * too_wide])))
    parts += [Part(*limit.rows(config)) for limit in closing.limits]
    longest = LONGEST_STEP * size
    pull = np.zeros(len(config.roller_positions))
    if closing.pull is not None:
        pull = np.clip(closing.pull - config.roller_positions, -longest, longest)
    hessian = matrix.T @ matrix + MOTION_COST * np.eye(len(pull))
    return _solve(hessian, -matrix.T @ aim - MOTION_COST * pull, parts, longest)


def _apart(place: Place, closing: Closing, targets: Array) -> list[Part]:
    """Return what keeps all but the touching sides away, and these from going beyond targets."""
    gaps, sides = place.gaps, list(closing.sides)
    clearance = CLEARANCE * place.config.robot.description.tube_diameter
    by_members, by_modules, _ = np.split(gaps.by_rollers, 3)
    lower = APPROACH * (clearance - gaps.members)
    lower[sides] = targets - gaps.members[sides]
    lower = np.concatenate([lower, APPROACH * (clearance - gaps.modules)])
    rows = np.concatenate([by_members, by_modules])
    return [Part(rows, np.minimum(0.0, lower), np.full(len(lower), np.inf))]


def _shape(place: Place, closing: Closing) -> Part:
    """Return what keeps the shape rigid and apart from itself."""
    config, modes = place.config, place.modes
    robot = config.robot
    few = Modes(modes.values[:MODES], modes.rows[:, :MODES], modes.nodes[:, :MODES])
    near = np.flatnonzero(place.distances < NEAR * scale(config))
    rows = np.concatenate(
        [
            shape_rigidity(robot).gradients(config, few),
            bodies(robot).gradients(config, near),
        ]
    )
    left = np.concatenate(
        [few.values - closing.min_rigidity, place.distances[near] - CLEAR * scale(config)]
    )
    matrix = config.module_rows(rows)[:, robot.layout.driven]
    return Part(matrix, np.minimum(0.0, -APPROACH * left), np.full(len(left), np.inf))


def _solve(hessian: Array, linear: Array, parts: list[Part], longest: float) -> Array:
    matrix = np.concatenate([part.matrix for part in parts])
    lower = np.concatenate([part.lower for part in parts])
    upper = np.concatenate([part.upper for part in parts])
    below, above = np.isfinite(lower), np.isfinite(upper)
    bounds = np.full(len(linear), longest)
    for solver in installed_solvers():
        found = qpsolvers.solve_qp(
            hessian,
            linear,
            np.concatenate([matrix[above], -matrix[below]]),
            np.concatenate([upper[above], -lower[below]]),
            lb=-bounds,
            ub=bounds,
            solver=solver,
        )
        if found is not None:
            return found
    raise SolverError(
        f'{", ".join(installed_solvers())} found no step of the rollers; '
        'the configuration is probably next to a singular one'
    )
