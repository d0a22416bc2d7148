# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Result of `analyze_grasp`."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.records import Record


@dataclass(frozen=True, eq=False, repr=False)
class GraspAnalysis(
    Record,
    headline=(
        'closed_by_friction',
        'required_friction',
        'closure_margin',
        'contact_forces',
        'utilisation',
    ),
):
    """
    Contact and closure of an object held fast, with k contact points: the paper's (5) to (10).

    :ivar points: (k, 2) deformed points on the centre lines of the tubes, robot frame [m].
    :ivar members: (k,) index of the member of each point in `Robot.member_names`.
    :ivar places: (k,) distance of each point from the member's start [m].
    :ivar gaps: (k,) distances of the tube's skin from the object, not negative [m].
    :ivar normals: (k, 2) outward unit normals of the object's surface.
    :ivar normal_forces: (k,) normal forces along `normals`, not negative [N].
    :ivar friction_forces: (k,) friction on the object along its tangents, counter-clockwise [N].
    :ivar normal_wrench: wrench (fx, fy, m) of the tubes on the object without friction, about the
        origin of the object's frame [N, N m].
    :ivar closed_by_friction: whether the object has contact and friction balances the normal
        forces and the external wrench, equation (10). For a free object see `SettledGrasp`.
    :ivar closure_residual: norm of the wrench that friction does not balance [N]; moments are
        about the centroid and divided by half of the object's mean width, d/2 of a cylinder.
    :ivar closure_tolerance: largest residual that counts as closure [N].
    :ivar required_friction: smallest coefficient of friction with closure; infinite if none.
    :ivar closure_margin: largest norm of an additional wrench that friction balances in every
        direction, with moments divided by half of the object's mean width [N]; negative without
        closure.
    :ivar contact_lengths: length of tube in contact, for each member in contact [m].
    :ivar contact_forces: sum of the normal forces, for each member in contact [N].
    :ivar utilisation: largest ratio of bending moment to wrinkling moment, for each member [-]. At
        1 and above the tube wrinkles, and the model no longer holds.
    """

    points: Array
    members: Indices
    places: Array
    gaps: Array
    normals: Array
    normal_forces: Array
    friction_forces: Array
    normal_wrench: Array
    closed_by_friction: bool
    closure_residual: float
    closure_tolerance: float
    required_friction: float
    closure_margin: float
    contact_lengths: dict[str, float]
    contact_forces: dict[str, float]
    utilisation: dict[str, float]
