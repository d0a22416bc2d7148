# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Contact of flattening, sliding tubes with a convex object of any shape: (5) to (8).

The skin of a straight tube is uniform along the tube, so without friction it slides under a corner
without a force. Discrete points violate this: the pressures on the two faces of a corner balance
along the tube only in their integral, and a sum over few points has errors as large as friction.
Here the balance is exact: each point presses across the bent centre line of its tube, and sliding
along the tube changes only the gap. In each step the normals are taken at the surface points
nearest to the contact points, and the forces solve a linear complementarity problem.
"""

from __future__ import annotations

from dataclasses import replace

from isotruss_ros.core.contact.contact import face_tubes, guess_contact, open_gaps
from isotruss_ros.core.contact.contact_points import ContactPoints, ContactState
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.numerics.qp import solve_complementarity
from isotruss_ros.core.numerics.tolerances import (
    COINCIDENCE,
    MAX_NEWTON_ITERATIONS,
    MAX_SEARCH_STEPS,
)
import numpy as np
from scipy.linalg import lapack

#: Steepest direction of the object's tangents relative to the tube; steeper tangents are replaced
#: by this one.
STEEPEST_TANGENT = np.exp(1j * np.deg2rad(75.0))
#: Largest inclination of a normal relative to the tube's transverse direction, at a corner with
#: folded skin [rad].
MAX_FOLD_ANGLE = np.deg2rad(12.0)
#: Smallest radius of an arc that the points resolve, in spacings [-].
RESOLVED_ARC = 2.0


def solve_sliding_contact(
    contact_points: ContactPoints,
    surface: Surface,
    forces: Array | None = None,
    normals: Points | None = None,
    push: Points | None = None,
) -> ContactState:
    """
    Solve (8) for tubes that slide without friction along their axes.

    :param contact_points: candidate contact points.
    :param surface: surface that the points meet, see `find_contact_points`.
    :param forces: (c,) initial forces [N], see `solve_contact`.
    :param normals: (c,) initial normals, x + iy, see `solve_contact`.
    :param push: (c,) forces on the tubes in a similar state, x + iy [N]; None: no forces.
    :raises SolverError: the normals do not converge.
    """
    undeformed = face_tubes(contact_points, surface)
    first = undeformed if normals is None else normals
    active = None if forces is None else forces > 0.0
    found = _iterate(contact_points, surface, active, first, 0, push)
    if found is not None:
        return found
    # Full steps may cycle between a few sets of points.
    found = _iterate(contact_points, surface, None, undeformed, MAX_SEARCH_STEPS)
    # Skin beyond the far side of a small object has no contact force; this is not a solution.
    if found is None or not found.forces.any():
        raise SolverError(
            f'the contact did not converge in {2 * MAX_NEWTON_ITERATIONS} steps; the object is '
            'pressed in too deeply'
        )
    return found


def _iterate(
    contact_points: ContactPoints,
    surface: Surface,
    active: Flags | None,
    normals: Points,
    damped_steps: int,
    pushed: Points | None = None,
) -> ContactState | None:
    """Return the solved contact after damped and then full steps; None without convergence."""
    away, axis = contact_points.skin - surface.center, contact_points.axis
    side = np.where((normals * axis.conj()).imag < 0.0, -1.0, 1.0)
    neighbours = _find_neighbours(contact_points)
    displacements, bent = np.zeros_like(away), axis
    if pushed is None:
        pushed = np.zeros_like(away)
    else:
        displacements = contact_points.displacements(pushed)
        bent = _bend(contact_points, neighbours, displacements, pushed)
    normals, _ = _limit(normals, bent, side)
    still = open_gaps(away, normals, surface)
    settled = False
    for step in range(MAX_NEWTON_ITERATIONS):
        damped = step < damped_steps
        # Along and across the bent tubes.
        local = normals * bent.conj()
        push = 1j * local.imag * bent
        gaps = still + (displacements * bent.conj()).real * local.real
        if active is None:
            active = guess_contact(contact_points, gaps)
        forces = None
        if settled and not damped:
            forces = _slide(contact_points, np.flatnonzero(active), normals, push, still)
        if forces is None:
            compliance = contact_points.normal_compliance(push)
            forces, active = solve_complementarity(compliance, gaps, active)
            # If points would pull, the forces remain those for the previous sliding.
            places = np.flatnonzero(active)
            slid = None if damped else _slide(contact_points, places, normals, push, still)
            forces = forces if slid is None else slid
        push = 0.5 * (pushed + push * forces) if damped else push * forces
        pushed, displacements = push, contact_points.displacements(push)
        moved = away + displacements
        gaps, turned, radii = surface.nearest(moved)  # (5)
        bent = _bend(contact_points, neighbours, displacements, push)
        normals, steep = _limit(turned, bent, side)
        if steep.any():
            at = np.flatnonzero(steep)
            gaps[at] = open_gaps(moved[at], normals[at], surface)
        # If no other point has come into contact, the points in contact are unchanged.
        settled = bool((gaps >= -COINCIDENCE).all())
        if settled and not damped and (np.abs(gaps[active]) <= COINCIDENCE).all():
            return ContactState(forces, gaps, normals, displacements, radii, push)
        still = gaps - (displacements * normals.conj()).real
    return None


def _slide(
    contact_points: ContactPoints, places: Indices, normals: Points, push: Points, still: Array
) -> Array | None:
    """Return the forces (c,) that close the gaps of sliding tubes; None if a force is negative."""
    count, inward = len(places), contact_points.axis[places].conj()
    if count == 0:
        return None
    normal, force = normals[places] * inward, push[places] * inward
    compliance = contact_points.compliance(places).reshape(2 * count, 2 * count)
    moved = compliance[:, :count] * force.real + compliance[:, count:] * force.imag
    opened = normal.real[:, None] * moved[:count] + normal.imag[:, None] * moved[count:]
    *_, closing, failed = lapack.dgesv(opened, -still[places])
    if failed or closing.min() < 0.0:
        return None
    found = np.zeros(len(push))
    found[places] = closing
    return found


def _limit(normals: Points, bent: Points, side: Array) -> tuple[Points, Flags]:
    """Return normals (c,) with bounded inclination, and a mask of the changed normals."""
    local = normals * bent.conj()
    steep = side * local.imag < STEEPEST_TANGENT.real
    if not steep.any():
        return normals, steep
    along = np.copysign(STEEPEST_TANGENT.imag, local.real)
    return np.where(steep, bent * (along + 1j * side * STEEPEST_TANGENT.real), normals), steep


def _bend(
    points: ContactPoints, neighbours: Indices, displacements: Points, push: Points
) -> Points:
    """Return the directions (c,) of the bent centre lines, from the points' neighbours (2, c)."""
    before, after = neighbours
    moved = points.bend(displacements, push)
    along = moved[after] - moved[before]
    size: Array = np.abs(along)
    return np.divide(along, size, out=points.axis.copy(), where=size > 0.0)


def _find_neighbours(contact_points: ContactPoints) -> Indices:
    """Return both neighbours (2, c) of each point on its member; at an end, the point itself."""
    own = np.arange(len(contact_points.member))
    alike = contact_points.member[1:] == contact_points.member[:-1]
    return np.stack([own - np.append(False, alike), own + np.append(alike, False)])


def turn_at_corners(
    contact_points: ContactPoints, contact: ContactState, surface: Surface
) -> ContactState:
    """
    Return the contact with normals at corners that are independent of the points' positions.

    The skin is folded over a sharp corner and the ends of its two faces. There, the solved normal
    of a point is an arbitrary direction between the normals of the faces; only the resultant force
    is determined, and it is perpendicular to the tube. Therefore these normals are turned until
    their inclination to the resultant is at most `MAX_FOLD_ANGLE`, and the forces are adapted.

    :param contact_points: candidate contact points.
    :param contact: contact of sliding tubes.
    :param surface: surface of the object, with its sharp corners.
    """
    moved = contact_points.skin + contact.displacements - surface.center
    radii = surface.nearest(moved).radii
    sizes = np.abs(contact.push)
    # Arcs and ellipses that the points resolve are unchanged; faces and rounded corners are not.
    rounded = np.isfinite(contact.radii) & (contact.radii >= RESOLVED_ARC * contact_points.spacing)
    rounded[rounded] = np.abs(radii[rounded] / contact.radii[rounded] - 1.0) < 1e-3
    places = np.flatnonzero((sizes > 0.0) & ~rounded)
    across = contact.push[places] / sizes[places]
    lean = np.clip(
        np.angle(contact.normals[places] * across.conj()), -MAX_FOLD_ANGLE, MAX_FOLD_ANGLE
    )
    normals, forces = contact.normals.copy(), contact.forces.copy()
    normals[places] = across * np.exp(1j * lean)
    forces[places] = sizes[places] / np.cos(lean)
    return replace(contact, normals=normals, forces=forces)
