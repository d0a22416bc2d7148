# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Wrench space of contacts, and the grasp quality of Ferrari and Canny (ICRA 1992).

The structure behind the contacts does not enter: each contact exerts any force in its friction
cone whose normal component is limited, with limit 1 for the sum of all contacts (L1) or for each
contact (Linf). Moments are divided by the characteristic radius of the object.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.convex_object import check_friction
from isotruss_ros.core.model.pose import check_range, MAX_SIZE, MIN_DIAMETER
from isotruss_ros.core.numerics.arrays import Array, finite_rows
from isotruss_ros.core.numerics.tolerances import ROUNDING
import numpy as np
from numpy.typing import ArrayLike

#: Limit of the normal forces: of their sum, or of each.
Norm = Literal['L1', 'Linf']
#: Largest deviation of the length of a unit normal from 1 [-].
LENGTH_TOLERANCE = 1e-6
#: Largest number of contacts with the norm Linf, whose sum has 3^k vertices [-].
MAX_CONTACTS = 10


@dataclass(frozen=True)
class WrenchSpace:
    """Set of wrenches that contacts with limited normal forces exert on an object."""

    #: Radius of the largest ball around the origin within the set, Ferrari and Canny's epsilon:
    #: the largest wrench that contacts resist in every direction per unit of normal force [-].
    epsilon: float
    volume: float  #: volume of the set [-]

    @property
    def closed(self) -> bool:
        """Return whether the contacts alone have force closure: they resist any wrench."""
        return self.epsilon > 0.0


def wrench_space(
    points: ArrayLike, normals: ArrayLike, friction: float, arm: float, norm: Norm = 'L1'
) -> WrenchSpace:
    """
    Return the wrench space of point contacts with friction.

    :param points: (k, 2) contacts relative to the reference point of the moments [m].
    :param normals: (k, 2) unit normals away from the object [-].
    :param friction: coefficient of friction [-].
    :param arm: characteristic radius [m].
    :param norm: limit of the normal forces; `Linf` with at most `MAX_CONTACTS` contacts.
    :raises GraspError: a value is out of range; the numbers of points and normals differ, or are
        zero; or a normal has not the length 1.
    """
    from scipy.spatial import ConvexHull, QhullError

    points, normals = _check_contacts(points, normals)
    friction = check_friction(friction)
    arm = check_range(arm, 'characteristic radius', 'm', 0.5 * MIN_DIAMETER, MAX_SIZE)
    tangents = np.column_stack([-normals[:, 1], normals[:, 0]])
    # Forces with normal components of 1; axes: contact, edge of its friction cone, x and y.
    forces = -normals[:, None] + friction * np.stack([tangents, -tangents], axis=1)
    x, y = points.T[:, :, None]
    moments = (x * forces[..., 1] - y * forces[..., 0]) / arm
    wrenches = np.concatenate([forces, moments[..., None]], axis=2)
    vertices = np.zeros((1, 3))
    if norm == 'L1':
        vertices = np.vstack([vertices, wrenches.reshape(-1, 3)])
    elif norm == 'Linf':
        if len(points) > MAX_CONTACTS:
            raise GraspError(
                f"{len(points)} contacts: must be at most {MAX_CONTACTS} with the norm 'Linf'"
            )
        # Minkowski sum over the contacts, each of which exerts no force or one on its edges.
        for edges in wrenches:
            vertices = (vertices[:, None] + np.vstack([np.zeros(3), edges])).reshape(-1, 3)
    else:
        raise GraspError(f"norm {norm!r}: must be 'L1' or 'Linf'")
    try:
        hull = ConvexHull(vertices)
    except QhullError:  # all wrenches are in one plane
        return WrenchSpace(0.0, 0.0)
    # The last column has the offsets of the facets, minus their distances from the origin.
    epsilon = -float(hull.equations[:, -1].max())
    return WrenchSpace(epsilon if epsilon > ROUNDING else 0.0, float(hull.volume))


def _check_contacts(points: ArrayLike, normals: ArrayLike) -> tuple[Array, Array]:
    """Return checked points and unit normals (k, 2) of contacts."""
    at = finite_rows(points, 2, 'points [m]', GraspError, MAX_SIZE)
    normal = finite_rows(normals, 2, 'normals', GraspError)
    if not len(at) == len(normal) > 0:
        raise GraspError(
            f'{len(at)} points and {len(normal)} normals: must be equal numbers, 1 or more'
        )
    lengths = np.hypot(*normal.T)
    wrong = np.flatnonzero(np.abs(lengths - 1.0) > LENGTH_TOLERANCE)
    if len(wrong):
        first = int(wrong[0])
        raise GraspError(f'normal {first} has the length {lengths[first]:g}: must be 1')
    return at, normal
