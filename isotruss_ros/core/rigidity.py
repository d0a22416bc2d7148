"""Tell whether a robot stands: supports counted, rigidity of the locked structure measured."""

from __future__ import annotations

from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.layout import Layout
from isotruss_ros.core.linear import condition_number
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

Array = NDArray[np.float64]

#: The nine-member preset has 7e2; a robot beyond this is a mechanism in double precision.
MAX_CONDITION = 1e8


def require_rigid(source: str, layout: Layout, matrix: Array | csc_matrix) -> None:
    """
    Refuse a robot whose matrix (12) at home is not square and regular.

    With the rollers locked the structure must be rigid, and no support or member may be one too
    many: each would fight the rollers.

    :param matrix: (5m + g, 2n) derivative of the constraints at home, rows scaled alike.
    :raises RobotFileError: says what moves, or what is too many.
    """
    m, joints, grounded = layout.n_modules, len(layout.joint_names), len(layout.grounded)
    needed = 2 * joints - m
    if grounded == needed and condition_number(matrix) < MAX_CONDITION:
        return
    if needed < 3:
        raise RobotFileError(
            f'{source}: tubes: {m} members between {joints} joints; must be at most '
            f'{2 * joints - 3}: with more of them the rollers would work against each other'
        )
    if grounded < 3:
        raise RobotFileError(
            f'{source}: supports: too few: {grounded} grounded coordinates; '
            f'must be {needed}, for example [x, y] of one joint and [y] of another'
        )
    if grounded > needed:
        raise RobotFileError(
            f'{source}: supports: too many: {grounded} grounded coordinates; must be {needed} '
            f'(2 for each of {joints} joints, less one for each of {m} members): with more of '
            'them the supports would work against the rollers'
        )
    moving = ', '.join(_what_moves(layout, matrix))
    missing = (
        f'; {needed - grounded} more members or supports are needed' if grounded < needed else ''
    )
    raise RobotFileError(
        f'{source}: not rigid with the rollers locked: these joints can still move: '
        f'{moving}{missing}'
    )


def _what_moves(layout: Layout, matrix: Array | csc_matrix) -> list[str]:
    """Return the joints that take part in the free motions of the structure."""
    dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
    _, values, vectors = np.linalg.svd(dense)
    rank = int((values > values[0] / MAX_CONDITION).sum())
    first = min(rank, dense.shape[1] - 1)
    free = vectors[first:].reshape(-1, layout.n_nodes, 2)
    motion = np.linalg.norm(free[:, : len(layout.joint_names)], axis=2).max(axis=0)
    return [layout.joint_names[i] for i in np.flatnonzero(motion > 1e-3 * motion.max())]
