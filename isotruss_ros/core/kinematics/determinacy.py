# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The determinacy check: supports are counted, the locked structure must be rigid."""

from __future__ import annotations

from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.model.topology import Topology
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.factorization import condition_number
import numpy as np
from scipy.sparse import csc_matrix

#: The nine-member preset has 5e2; a robot beyond this is a mechanism in double precision.
MAX_CONDITION = 1e8


def require_determinate(source: str, topology: Topology, matrix: Array | csc_matrix) -> None:
    """
    Refuse a robot whose matrix (12) at home is not square and regular.

    With the rollers locked the structure must be rigid, and no support or member may be one too
    many: each would fight the rollers.

    :param source: the robot file, for the message.
    :param topology: the robot's connections.
    :param matrix: (5m + g, 2n) derivative of the constraints at home, rows scaled alike.
    :raises RobotFileError: names what moves, or what is too many.
    """
    m, joints, grounded = topology.n_modules, len(topology.joint_names), len(topology.grounded)
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
    moving = ', '.join(_what_moves(topology, matrix))
    missing = (
        f'; {needed - grounded} more members or supports are needed' if grounded < needed else ''
    )
    raise RobotFileError(
        f'{source}: not rigid with the rollers locked: these joints can still move: '
        f'{moving}{missing}'
    )


def _what_moves(topology: Topology, matrix: Array | csc_matrix) -> list[str]:
    """Return the joints that take part in the free motions of the structure."""
    dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
    _, values, vectors = np.linalg.svd(dense)
    rank = int((values > values[0] / MAX_CONDITION).sum())
    first = min(rank, dense.shape[1] - 1)
    free = vectors[first:].reshape(-1, topology.n_nodes, 2)
    motion = np.linalg.norm(free[:, : len(topology.joint_names)], axis=2).max(axis=0)
    return [topology.joint_names[i] for i in np.flatnonzero(motion > 1e-3 * motion.max())]
