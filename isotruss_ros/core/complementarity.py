"""Linear complementarity: where contact is, and how hard, by principal pivoting, equation (8)."""

from __future__ import annotations

from isotruss_ros.core.errors import SolverError
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Gaps and complementarity hold to this [m]; forces to this over the stiffest point's compliance.
GAP_TOLERANCE = 1e-9
#: Exchanges of many points at once without fewer wrong ones, before single ones.
MAX_BLOCK_EXCHANGES = 10


def solve_complementarity(compliance: Array, gaps: Array, active: Flags) -> tuple[Array, Flags]:
    """
    Find forces f >= 0 with g = gaps + compliance @ f >= 0 and f g = 0.

    By exchanging all points that are wrong at once (Judice and Pires, 1994), which takes a few
    steps or goes in circles; then one by one.

    :param compliance: (c, c) symmetric positive definite [m/N].
    :param gaps: (c,) without forces [m].
    :param active: (c,) a guess of where the contact is.
    :return: forces (c,) [N] and where they act.
    :raises SolverError: the matrix is not positive definite.
    """
    active = active.copy()
    best, patience = len(gaps) + 1, MAX_BLOCK_EXCHANGES
    while True:
        forces = np.zeros(len(gaps))
        forces[active] = _closing(compliance, gaps, active)
        left = gaps + compliance @ forces
        wrong = (active & (forces < 0.0)) | (~active & (left < -0.1 * GAP_TOLERANCE))
        count = int(wrong.sum())
        if count == 0:
            return forces, active
        if count < best:
            best, patience = count, MAX_BLOCK_EXCHANGES
        elif patience == 0:
            return _one_by_one(compliance, gaps, np.maximum(forces, 0.0))
        patience -= 1
        active ^= wrong


def _one_by_one(compliance: Array, gaps: Array, forces: Array) -> tuple[Array, Flags]:
    """Do the same from any forces that are not negative (Lawson and Hanson, 1974, chapter 23)."""
    active, refused = forces > 0.0, np.zeros(len(forces), dtype=bool)
    newest = -1
    for _ in range(100 + 20 * len(gaps)):
        wanted = np.zeros(len(gaps))
        wanted[active] = _closing(compliance, gaps, active)
        pulling = active & (wanted <= 0.0)
        if newest >= 0 and pulling[newest]:
            # By rounding: it is open by next to nothing, and stays so.
            active[newest], refused[newest] = False, True
        elif pulling.any():
            # As far that way as nothing pulls: some force vanishes there.
            shares = forces[pulling] / (forces[pulling] - wanted[pulling])
            forces = np.maximum(forces + shares.min() * (wanted - forces), 0.0)
            forces[np.flatnonzero(pulling)[shares == shares.min()]] = 0.0
            active, newest = active & (forces > 0.0), -1
            continue
        else:
            forces = wanted
            refused[:] = refused & (newest < 0)
        left = np.where(active | refused, 0.0, gaps + compliance @ forces)
        newest = int(left.argmin()) if len(left) else -1
        if newest < 0 or left[newest] >= -0.1 * GAP_TOLERANCE:
            return forces, active
        active[newest] = True
    raise SolverError('the complementarity problem was not solved')


def _closing(compliance: Array, gaps: Array, active: Flags) -> Array:
    """Return the forces at the active points, of any sign, that close their gaps."""
    if not active.any():
        return np.zeros(0)
    try:
        factor = cho_factor(compliance[np.ix_(active, active)])
    except np.linalg.LinAlgError as error:
        raise SolverError('the contact compliance is not positive definite') from error
    return cho_solve(factor, -gaps[active])
