# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coefficient of friction and external wrench of a grasped object, checked where they come in."""

from __future__ import annotations

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.convex_object import check_friction, ConvexObject
from isotruss_ros.core.numerics.arrays import Array, load_array
from numpy.typing import ArrayLike

#: Name of the external wrench in messages.
EXTERNAL_WRENCH = 'the external wrench (fx, fy [N], m [N m])'


def check_load(
    body: ConvexObject, friction: float | None, external_wrench: ArrayLike
) -> tuple[float, Array]:
    """
    Return the friction, see `ConvexObject.friction_or`, and the external wrench (3,), checked.

    The wrench (fx, fy, m) is about the origin of the object's frame [N, N m].
    """
    mu = check_friction(body.friction_or(friction))
    return mu, load_array(external_wrench, 3, EXTERNAL_WRENCH, GraspError)
