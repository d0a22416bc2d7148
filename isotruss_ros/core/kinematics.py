"""Forward kinematics: node positions from roller travel, by Newton's method on the constraints."""

from __future__ import annotations

from isotruss_ros.core.constraints import Constraints, Points, Targets
from isotruss_ros.core.linear import Factor, factorize
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Constraints hold to this: [m] and [rad]. Rounding is 1e-15, hardware 1e-4.
TOLERANCE = 1e-12
MAX_ITERATIONS = 12
#: A factor is kept while each step with it shrinks the residual at least this much.
KEEP_FACTOR_BELOW = 0.1
#: A corrector longer than this share of the predictor may have left the branch.
MAX_CORRECTION = 0.5


def follow_branch(
    constraints: Constraints, points: Points, targets: Targets, factor: Factor | None = None
) -> Points | None:
    """
    Move nodes to new targets, staying on the branch that they are on.

    A tangent step (12) is followed by Newton's method with as few factorizations as it takes.

    :param points: (n,) nodes that fulfil the constraints for nearby targets [m].
    :param targets: the new lengths and ground.
    :param factor: the factored matrix at `points`, if it is at hand.
    :return: (n,) nodes, or None where the step is too long, or leads to no configuration.
    """
    tolerance = max(TOLERANCE, 64 * np.finfo(float).eps * float(np.abs(points).max()))
    residual = constraints.residual(points, targets)
    error = np.abs(residual).max()
    start, predictor = points, None
    for _ in range(MAX_ITERATIONS):
        if error <= tolerance:
            return points
        fresh = factor is None
        try:
            factor = factor or factorize(constraints.matrix(points))
        except np.linalg.LinAlgError:
            return None
        moved = points - factor.solve(residual).view(np.complex128)
        residual = constraints.residual(moved, targets)
        previous, error = error, np.abs(residual).max()
        if not error < np.inf:
            return None
        if predictor is None:
            predictor = moved
            reach = MAX_CORRECTION * np.abs(predictor - start).max()
        elif np.abs(moved - predictor).max() > reach + tolerance:
            return None
        if fresh and error > previous and error > tolerance:
            return None
        points = moved
        if error > KEEP_FACTOR_BELOW * previous:
            factor = None
    return points if error <= tolerance else None
