# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Unilateral contact of tubes with a convex object: equations (5) to (8).

Points of the tubes meet a surface: those of the skin, where tubes flatten, the object's own; in
the paper's model those of the centre lines one that is farther out by the tube's radius. They give
by a compliance that is condensed to these points; for fixed normals the contact forces solve a
linear complementarity problem, and the normals follow the deformed points until they settle.
"""

from __future__ import annotations

from isotruss_ros.core.contact.contact_points import ContactGuess, ContactPoints, ContactState
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.lcp import GAP_TOLERANCE, solve_complementarity
import numpy as np
from scipy.linalg import lapack

#: Forces are along normals to this, as a share of the largest.
SMOOTH = 1e-6
MAX_NORMAL_UPDATES = 30
MAX_STEPS = 300
#: Where a member flattens, contact is about as wide as what is this share of the largest depth.
WIDE = 0.7
#: More contact points than this begin where every fourth of them ends.
MANY = 300


def solve_contact(
    contact_points: ContactPoints, surface: Surface, start: ContactGuess | None = None
) -> ContactState:
    """
    Solve (8): gaps and forces not negative, and one of them zero everywhere.

    :param contact_points: points that the object could touch.
    :param surface: what the points meet, see `find_contact_points`.
    :param start: what to begin with; found out if None.
    :raises SolverError: the normals do not settle.
    """
    away = contact_points.skin - surface.center
    normals, active = _begin(contact_points, surface, start)
    # Outside of the tangent at a point's foot is outside of the object: what solves the problem
    # for some normals is admissible for the next ones, which can but take less energy. These steps
    # settle therefore, if slowly; following the normals of those in contact makes them few.
    for _ in range(MAX_STEPS):
        gaps = open_gaps(away, normals, surface)
        forces, active = solve_complementarity(
            contact_points.normal_compliance(normals), gaps, active
        )
        places = np.flatnonzero(active)
        ahead = np.zeros_like(away)
        ahead[places] = _settle_normals(contact_points, places, normals, surface)
        for push in (ahead, forces * normals):
            displacements = contact_points.displacements(push)
            gaps, turned, radii = surface.nearest(away + displacements)  # (5)
            # (6), (7): no force pulls, and none is tangential.
            pressing, sizes = push * turned.conj(), np.abs(push)
            if (
                (pressing.real >= 0.0).all()
                and (np.abs(pressing.imag) <= SMOOTH * sizes.max(initial=0.0)).all()
                and (gaps >= -GAP_TOLERANCE).all()
                and (gaps[places] <= GAP_TOLERANCE).all()
            ):
                normal = pressing.real * turned
                return ContactState(pressing.real, gaps, turned, displacements, radii, normal)
        normals = turned
    raise SolverError(
        f'the contact did not settle in {MAX_STEPS} steps; the object is pressed in too deeply'
    )


def _begin(
    contact_points: ContactPoints, surface: Surface, start: ContactGuess | None
) -> tuple[Points, Flags]:
    """Return the normals (c,) and where there is contact (c,), to begin the search with."""
    away = contact_points.skin - surface.center
    # Those of the centre lines: the skin may be beyond the centre of a small object.
    normals = surface.facing(contact_points.points - surface.center, contact_points.axis)
    if start is not None:
        return normals if start.normals is None else start.normals, start.forces > 0.0
    if len(away) <= MANY:
        return normals, guess_contact(contact_points, open_gaps(away, normals, surface))
    few = np.arange(0, len(away), 4)
    coarse = solve_contact(contact_points[few], surface)
    push = np.zeros_like(away)
    push[few] = coarse.forces * coarse.normals
    found = surface.nearest(away + contact_points.displacements(push))
    return found.normals, found.gaps < 0.0


def estimate_contact(contact_points: ContactPoints, surface: Surface) -> ContactState:
    """
    Solve (8) for the normals of the undeformed tubes; the normals of the answer are new ones.

    :param contact_points: points that the object could touch.
    :param surface: what the points meet.
    :raises SolverError: the contact problem was not solved.
    """
    away = contact_points.skin - surface.center
    normals = surface.facing(contact_points.points - surface.center, contact_points.axis)
    gaps = open_gaps(away, normals, surface)
    compliance = contact_points.normal_compliance(normals)
    forces, _ = solve_complementarity(compliance, gaps, guess_contact(contact_points, gaps))
    displacements = contact_points.displacements(forces * normals)
    gaps += compliance @ forces
    _, turned, radii = surface.nearest(away + displacements)
    return ContactState(forces, gaps, turned, displacements, radii, forces * turned)


def open_gaps(away: Points, normals: Points, surface: Surface) -> Array:
    """
    Return the gaps along normals that there are without forces, (c,) [m].

    :param away: (c,) points, from the surface's centre, x + iy [m].
    :param normals: (c,) outward unit normals, x + iy.
    :param surface: what the points meet.
    """
    return (away * normals.conj()).real - surface.support(normals)


def guess_contact(contact_points: ContactPoints, gaps: Array) -> Flags:
    """
    Return where contact is likely: where each member is deepest, and as deep if it flattens.

    :param contact_points: points that the object could touch.
    :param gaps: (c,) without forces [m].
    """
    member = contact_points.member
    deepest = np.full(int(member.max(initial=-1)) + 1, np.inf)
    np.minimum.at(deepest, member, gaps)
    if contact_points.dents.any():
        deepest = np.where(deepest < 0.0, WIDE * deepest, deepest)
    return gaps <= deepest[member]


def _settle_normals(
    contact_points: ContactPoints, places: Indices, normals: Points, surface: Surface
) -> Points:
    """Return the forces (a,), x + iy [N], that close gaps (a,), along normals that follow."""
    count = len(places)
    if count == 0:
        return np.zeros(0, dtype=np.complex128)
    axis = contact_points.axis[places]
    away, local = (
        axis.conj() * (contact_points.skin[places] - surface.center),
        axis.conj() * normals[places],
    )
    # Few points, and several steps: the whole matrix is cheaper than its factors.
    compliance = contact_points.compliance(places).reshape(2 * count, 2 * count)
    for _ in range(MAX_NORMAL_UPDATES):
        along, across = local.real, local.imag
        moving = compliance[:, :count] * along + compliance[:, count:] * across
        gaps = (away * local.conj()).real - surface.support(axis * local)
        normal = along[:, None] * moving[:count] + across[:, None] * moving[count:]
        _, pressing, failed = lapack.dposv(normal, -gaps)
        if failed:
            raise SolverError('the contact compliance is not positive definite')
        moved = moving @ pressing
        met = axis * (away + moved[:count] + 1j * moved[count:])
        turned = axis.conj() * surface.nearest(met).normals
        forces = pressing * local
        change = float(np.abs(turned - local).max())
        local = turned
        if change < 0.01 * SMOOTH:
            break
    return axis * forces
