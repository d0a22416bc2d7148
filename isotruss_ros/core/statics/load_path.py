# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Equilibria of a frame under increasing loads, up to the limit load.

At the limit load the stiffness is singular; at larger loads there is no stable equilibrium nearby.
Newton's method may still converge to an unstable equilibrium, which negative pivots of the
factorised stiffness indicate.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.tangent import Tangent
import numpy as np

#: Largest displacement of a node in a load step, by linear prediction [m].
MAX_DISPLACEMENT_STEP = 0.01
#: Relative tolerance of a limit load [-].
LIMIT_TOLERANCE = 1e-3


class LoadPath(NamedTuple):
    """
    Stable equilibria of a frame under increasing loads.

    :ivar factors: (s,) factors on the loads, increasing from 0.
    :ivar tangents: (s,) frames linearised about the equilibria at these factors.
    :ivar limit: factor at which the limit load is reached; infinite if the path ends before it.
    """

    factors: list[float]
    tangents: list[Tangent]
    limit: float


def follow_loads(frame: Frame, loads: Array, most: float, farthest: float = np.inf) -> LoadPath:
    """
    Compute the stable equilibria of a frame while its loads increase from zero.

    :param frame: the frame.
    :param loads: (n, 3) loads fx, fy [N], m [N m] on the nodes.
    :param farthest: the path ends if a node is displaced by more than this [m].
    """
    path = LoadPath([0.0], [frame.rest], np.inf)
    step = most
    for _ in range(400):
        factor, tangent = path.factors[-1], path.tangents[-1]
        if factor >= most or np.abs(tangent.displacements[:, :2]).max() > farthest:
            return path
        reach = np.abs(tangent.respond(loads.reshape(-1, 1))[0].reshape(-1, 3)[:, :2]).max()
        step = min(
            2.0 * step, MAX_DISPLACEMENT_STEP / reach if reach > 0.0 else np.inf, most - factor
        )
        found = _step(frame, tangent, (factor + step) * loads)
        while found is None and step > LIMIT_TOLERANCE * factor:
            step *= 0.5
            found = _step(frame, tangent, (factor + step) * loads)
        if found is None:
            return path._replace(limit=factor + step)
        path.factors.append(factor + step)
        path.tangents.append(found)
    return path


def _step(frame: Frame, tangent: Tangent, loads: Array) -> Tangent | None:
    """Return the next stable equilibrium on a load path; None if none exists nearby."""
    found = frame.bend(loads, tangent)
    return found if found is not None and found.is_stable else None
