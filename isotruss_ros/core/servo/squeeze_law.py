# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Law of the squeeze control: commands from the estimated equilibrium of the held object.

The opening of the grip determines the squeeze: it changes by some newtons per millimetre. The
opening rate is the right-hand side of the fourth row of (19). An additional twist corrects the
displacement of the object on the elastic tubes. The gains follow from the lowest natural frequency
of the held object, see `swing_watch`. The `outputs` (4,) are pose [m, m, rad] and squeeze [N]
behind the filters.
"""

from __future__ import annotations

from collections.abc import Callable
import math

from isotruss_ros.core.estimation.grip_belief import GripBelief
from isotruss_ros.core.estimation.state_estimate import is_squeeze_known
from isotruss_ros.core.holding.held_grip import MIN_RELATIVE_MARGIN
from isotruss_ros.core.manipulation.status import RollerCommand, Status
from isotruss_ros.core.model.pose import pose_difference
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.frozen import replace
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.servo.swing_watch import MAX_SQUEEZE_GAIN
import numpy as np

#: Largest rate of change of the squeeze [N/s].
MAX_FORCE_RATE = 10.0
#: Largest number of solutions for the scale of a twist at a limit [-], and smallest share of the
#: opening rate there [-]; at a limit of a single roller, the second solution is exact.
MAX_SCALE_STEPS, MIN_OPENING_SHARE = 4, 0.99
#: Statuses of motions in another direction than that of the twist.
CHANGED = (Status.UNREACHABLE, Status.SLIDING)
#: Function that solves the quadratic program for a twist (3,) and an opening rate of the grip
#: [m/s].
Solve = Callable[[Array, float], RollerCommand]


def pass_filters(first: Array, second: Array, phase: float) -> Array:
    """
    Return the corrections (2, 4) in two low-pass filters after a time, relative to their constant.

    Corrections by poses reach the control behind them, because the loop is stable only then.
    """
    remaining = math.exp(-phase)
    return remaining * np.array([first, second + (1.0 - remaining) * first])


def find_opening_rate(
    belief: GripBelief, outputs: Array, force: float, excess: float, gain: float
) -> float:
    """
    Return the opening rate of the grip by proportional control of the squeeze [m/s].

    While the squeeze would be unknown even with an exact stiffness, the `excess` of the first
    estimate over the desired `force` is added [N]: opening the grip could release the object, and
    the measured pose would not show the loss until the object is moved.
    """
    if excess > 0.0 and not is_squeeze_known(force, belief.geometric_deviation):
        force += excess
    error = force - float(outputs[3])
    force_rate = min(MAX_SQUEEZE_GAIN, gain) * error - belief.cache.drift[3]
    bounded_rate = max(-MAX_FORCE_RATE, min(force_rate, MAX_FORCE_RATE))
    return bounded_rate / belief.held.squeeze_stiffness()


def find_correction(
    belief: GripBelief, outputs: Array, reference: Array, gain: float, duration: float
) -> Array:
    """
    Return the twist (3,) that corrects the pose error and the motion that (19) neglects.

    A command that is valid for a long `duration` must not overshoot [s].
    """
    error = pose_difference(reference, outputs[:3])
    return min(gain, 0.5 / duration) * error - belief.cache.drift[:3]


def solve_with_margins(
    belief: GripBelief,
    outputs: Array,
    twist: Array,
    correction: Array,
    opening_rate: float,
    solve: Solve,
    period: float,
    max_utilisation: float,
) -> RollerCommand:
    """
    Return the command for a twist (3,) of the object with its correction.

    Limits on slip margin and utilisation reduce only the twist. The command is valid for a period
    [s].
    """
    command = solve_within_limits(twist + correction, opening_rate, solve)
    if command.status in CHANGED and not twist.any():
        # Contacts or limits do not admit the correction of the pose.
        command = replace(command, status=Status.OK, scale=1.0)
    usage = belief.cache.usage.rolled(belief.cache.travel)
    excess_margin = belief.slip_margin - MIN_RELATIVE_MARGIN * float(outputs[3])
    share = usage.margin_share(command, period, excess_margin)
    if share < 1.0 and twist.any():
        slowed = solve_within_limits(share * twist + correction, opening_rate, solve)
        scale, status = share * slowed.scale, Status.SLOWED_SLIP_MARGIN
        limiting = (*slowed.limiting, 'the slip margin')
        command = replace(slowed, scale=scale, status=status, limiting=limiting)
    return usage.limit_utilisation(command, period, max_utilisation)


def solve_within_limits(twist: Array, opening_rate: float, solve: Solve) -> RollerCommand:
    """Return the command for a twist and an opening rate; limits reduce only the twist."""
    command = solve(twist, opening_rate)
    if not Status.SLOWED_ROLLER_SPEED <= command.status <= Status.SLOWED_BARRIER:
        return command
    # The limits have scaled both. The excess of the scaled twist over the limits is a convex
    # function of its scale, so the secant method approaches the largest scale from above.
    larger, scale, slowed = 1.0, command.scale, command
    for _ in range(MAX_SCALE_STEPS):
        slowed_before, slowed = slowed, solve(scale * twist, opening_rate)
        if slowed.scale >= MIN_OPENING_SHARE or scale == 0.0:
            break
        excess, excess_before = (1.0 / max(c.scale, ROUNDING) for c in (slowed, slowed_before))
        change = (excess - 1.0) * (larger - scale) / max(excess_before - excess, ROUNDING)
        larger, scale = scale, max(scale - change, 0.0)
    else:
        scale, slowed = 0.0, solve(np.zeros(3), opening_rate)
    return replace(slowed, scale=scale, status=command.status, limiting=command.limiting)
