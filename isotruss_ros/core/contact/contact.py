# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Unilateral contact of tubes with a convex object: equations (5) to (9).

Points on the skin of flattening tubes meet the surface of the object. In the paper's model, points
on the centre lines meet the surface offset by the tube radius. The compliance of the structure is
condensed to these points. For fixed normals the contact forces solve a linear complementarity
problem; then the normals are updated at the deformed points, and both steps are repeated until
convergence. The paper's relaxation (9) of the forces has the same solution; its gains follow from
the compliance.
"""

from __future__ import annotations

from isotruss_ros.core.contact.contact_points import ContactPoints, ContactState
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.qp import solve_complementarity
from isotruss_ros.core.numerics.tolerances import (
    MAX_NEWTON_ITERATIONS,
    NEGLIGIBLE_SHARE,
    ROUNDING,
    SMALLEST_NORMAL,
)
import numpy as np
from scipy.linalg import lapack

#: Largest number of updates of the normals [-]; the normals on large discs converge slowly.
MAX_STEPS = 200
#: Largest gap of a contact [m]; forces that remain in (9) at larger gaps are set to zero.
MAX_CONTACT_GAP = 1e-7
#: Steps of (9) between checks of convergence with updated normals [-].
STEPS_PER_CHECK = 1000


def solve_contact(
    contact_points: ContactPoints,
    surface: Surface,
    forces: Array | None = None,
    normals: Points | None = None,
    _push: Points | None = None,
) -> ContactState:
    """
    Solve the contact LCP (8): nonnegative gaps and forces, complementary at each point.

    :param contact_points: candidate contact points.
    :param surface: surface that the points meet, see `find_contact_points`.
    :param forces: (c,) forces of a similar problem [N]. The iteration starts with contact at the
        points with positive force. If None, it starts with contact at the deepest points.
    :param normals: (c,) initial normals, x + iy; None: the normals at the undeformed tubes.
    :raises SolverError: the normals do not converge.
    """
    away = contact_points.skin - surface.center
    if normals is None:
        normals = face_tubes(contact_points, surface)
    gaps = open_gaps(away, normals, surface)
    active = guess_contact(contact_points, gaps) if forces is None else forces > 0.0
    # A point beyond a tangent is outside of the object, so the solution for given normals is
    # admissible for the updated normals, whose solution has less or equal energy. Therefore the
    # steps converge, but slowly; `_settle_normals` makes them few.
    for step in range(MAX_STEPS):
        pushes = []
        # Points in contact in a similar problem are mostly in contact in this one.
        if step > 0 or forces is None:
            pressing, active = solve_complementarity(
                contact_points.normal_compliance(normals), gaps, active
            )
            pushes.append(pressing * normals)
        places = np.flatnonzero(active)
        ahead = np.zeros_like(away)
        ahead[places] = _settle_normals(contact_points, places, normals, gaps[places], surface)
        for push in (ahead, *pushes):
            displacements = contact_points.displacements(push)
            left, turned, radii = surface.nearest(away + displacements)  # (5)
            # (6), (7): no force pulls, and none is tangential.
            pressing, sizes = push * turned.conj(), np.abs(push)
            if (
                (pressing.real >= 0.0).all()
                and (np.abs(pressing.imag) <= NEGLIGIBLE_SHARE * sizes.max(initial=0.0)).all()
                and (left >= -ROUNDING).all()
                and (left[places] <= ROUNDING).all()
            ):
                normal = pressing.real * turned
                return ContactState(pressing.real, left, turned, displacements, radii, normal)
        normals, gaps = turned, left - (displacements * turned.conj()).real
    raise SolverError(
        f'the contact did not converge in {MAX_STEPS} steps; the object is pressed in too deeply'
    )


def _settle_normals(
    contact_points: ContactPoints, places: Indices, normals: Points, gaps: Array, surface: Surface
) -> Points:
    """Return the forces (a,), x + iy [N], that close the gaps (a,) and have updated normals."""
    count = len(places)
    if count == 0:
        return np.zeros(0, dtype=np.complex128)
    axis = contact_points.axis[places]
    away, local = (
        axis.conj() * (contact_points.skin[places] - surface.center),
        axis.conj() * normals[places],
    )
    # For few points and several steps, the full matrix is cheaper than its low-rank factors.
    compliance = contact_points.compliance(places).reshape(2 * count, 2 * count)
    for _ in range(MAX_NEWTON_ITERATIONS):
        along, across = local.real, local.imag
        moving = compliance[:, :count] * along + compliance[:, count:] * across
        normal = along[:, None] * moving[:count] + across[:, None] * moving[count:]
        _, pressing, failed = lapack.dposv(normal, -gaps)
        if failed:
            raise SolverError('the contact compliance is not positive definite')
        given = moving @ pressing
        moved = given[:count] + 1j * given[count:]
        left, turned, _ = surface.nearest(axis * (away + moved))
        turned = axis.conj() * turned
        forces = pressing * local
        change = float(np.abs(turned - local).max())
        local, gaps = turned, left - (moved * turned.conj()).real
        # The change in the next step is negligible.
        if change < 0.01 * NEGLIGIBLE_SHARE:
            break
    return axis * forces


def estimate_contact(contact_points: ContactPoints, surface: Surface) -> ContactState:
    """
    Solve (8) once with the normals at the undeformed tubes, then update the normals.

    :param contact_points: candidate contact points.
    :param surface: surface that the points meet, see `find_contact_points`.
    :raises SolverError: the contact problem was not solved.
    """
    away = contact_points.skin - surface.center
    normals = face_tubes(contact_points, surface)
    gaps = open_gaps(away, normals, surface)
    compliance = contact_points.normal_compliance(normals)
    forces, _ = solve_complementarity(compliance, gaps, guess_contact(contact_points, gaps))
    displacements = contact_points.displacements(forces * normals)
    gaps += compliance @ forces
    _, turned, radii = surface.nearest(away + displacements)
    return ContactState(forces, gaps, turned, displacements, radii, forces * turned)


def face_tubes(contact_points: ContactPoints, surface: Surface) -> Points:
    """
    Return the outward normals (c,) of the surface at the undeformed tubes, x + iy.

    The normals point at the centre lines of the tubes and not at their skin, because the skin
    may be beyond the centre of a small object.

    :param contact_points: candidate contact points.
    :param surface: surface that the points meet, see `find_contact_points`.
    """
    return surface.facing(contact_points.points - surface.center, contact_points.axis)


def open_gaps(away: Points, normals: Points, surface: Surface) -> Array:
    """
    Return the distances (c,) of points from the surface along given normals [m].

    :param away: (c,) points relative to the surface's centre, x + iy [m].
    :param normals: (c,) outward unit normals, x + iy.
    :param surface: surface that the points meet, see `find_contact_points`.
    """
    return (away * normals.conj()).real - surface.support(normals)


def guess_contact(contact_points: ContactPoints, gaps: Array) -> Flags:
    """
    Return a mask (c,) that is true for the deepest points of each member in the object.

    :param contact_points: candidate contact points.
    :param gaps: (c,) gaps of the undeformed tubes [m].
    """
    member = contact_points.member
    deepest = np.full(int(member.max(initial=-1)) + 1, np.inf)
    np.minimum.at(deepest, member, gaps)
    return gaps <= deepest[member]


def relax_contact(
    contact_points: ContactPoints,
    surface: Surface,
    forces: Array | None = None,
    normals: Points | None = None,
    _push: Points | None = None,
) -> ContactState:
    """
    Solve (8) by the relaxation (9): forces grow at negative gaps and decrease at positive gaps.

    The tangential term of (9) is zero, because all forces are normal. The gains are K1 = 0.9 * 2 /
    lambda_max(W) and K3 = K1 / (largest force), so forces decrease no faster than they grow.

    :param contact_points: candidate contact points.
    :param surface: surface that the points meet, see `find_contact_points`.
    :param forces: (c,) initial forces [N]; None: zero.
    :param normals: (c,) initial normals, x + iy; None: the normals at the undeformed tubes.
    :raises SolverError: no convergence within `MAX_STEPS` updates of the normals.
    """
    away = contact_points.skin - surface.center
    if normals is None:
        normals = face_tubes(contact_points, surface)
    forces = np.zeros(len(away)) if forces is None else forces.copy()
    for _ in range(MAX_STEPS):
        gaps = open_gaps(away, normals, surface)
        compliance = contact_points.normal_compliance(normals)
        # Points without force and contact are left out, so they do not bound the gain.
        part = np.flatnonzero((forces > 0.0) | (gaps + compliance @ forces < 0.0))
        if len(part):
            forces[part] = _steps(gaps[part], compliance[np.ix_(part, part)], forces[part])
        largest = forces.max(initial=SMALLEST_NORMAL)
        forces = np.where(forces > ROUNDING * largest, forces, 0.0)
        displacements = contact_points.displacements(forces * normals)
        gap, normals, radii = surface.nearest(away + displacements)
        left = np.maximum(gap, 0.0) * forces / largest
        if (gap > -0.01 * ROUNDING).all() and (left < 0.01 * ROUNDING).all():
            touching = np.where(gap < MAX_CONTACT_GAP, forces, 0.0)
            push = touching * normals
            return ContactState(touching, gap, normals, displacements, radii, push)
    raise SolverError(
        f'the relaxation (9) did not converge in {MAX_STEPS * STEPS_PER_CHECK} steps; the object '
        "must be pressed in less, or the method be 'exact'"
    )


def _steps(gaps: Array, compliance: Array, forces: Array) -> Array:
    """Return the forces (c,) after `STEPS_PER_CHECK` steps of (9) with fixed normals."""
    # Beyond 2 / lambda_max(W) the iteration diverges.
    grow = 0.9 * 2.0 / np.linalg.eigvalsh(compliance)[-1]
    for _ in range(STEPS_PER_CHECK):
        gap = gaps + compliance @ forces
        fade = grow / max(forces.max(), ROUNDING)
        forces = forces + grow * np.maximum(-gap, 0.0) - fade * np.maximum(gap, 0.0) * forces
    return forces
