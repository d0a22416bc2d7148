# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Unilateral contact of straight tubes with a convex object: equations (5) to (9).

Points on the centre lines meet the surface of the object, offset by the tube radius. For fixed
normals the contact forces solve a linear complementarity problem; then the normals are updated at
the deformed points, and both steps are repeated until convergence.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.fixed_object.contact_points import ContactPoints, Surface
from isotruss_ros.core.numerics.arrays import Array, MAX_LOAD, Points
from isotruss_ros.core.numerics.qp import solve_complementarity
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, NEGLIGIBLE_SHARE, ROUNDING
import numpy as np
from scipy.linalg import lapack

#: Largest number of updates of the normals [-]; the normals on large discs converge slowly.
MAX_STEPS = 200
#: Largest number of steps of (9) [-]; discs pressed in by 30 mm take 30,000.
MAX_RELAXATION_STEPS = 100_000
#: Tolerances of (9): penetration, and gap of a point with force [m]; and tangential force, and
#: force off the object, relative to the largest force [-]. The sum of the forces then differs from
#: that of `solve_contact` by up to 1e-3.
RELAXED_GAP, RELAXED_FORCE_SHARE = 1e-6, 1e-5
#: Gain K1 times the largest eigenvalue of W, less than 2 [-]; and K3 times the estimated largest
#: force, divided by K1 [-]. With a third of the latter, discs pressed in by 30 mm do not converge
#: in 40,000 steps; with five times of it, those pressed in by 10 mm do not.
GAIN_SHARE, GAP_GAIN_RATIO = 1.9, 20.0


class ContactState(NamedTuple):
    """Contact points with their forces and gaps."""

    forces: Array  #: (c,) normal forces, not negative [N]
    gaps: Array  #: (c,) distances of the deformed tubes from the surface, not negative [m]
    normals: Points  #: (c,) outward unit normals of the surface, x + iy
    displacements: Points  #: (c,) displacements of the points, x + iy [m]


def solve_contact(points: ContactPoints, surface: Surface) -> ContactState:
    """Solve the contact LCP (8): nonnegative gaps and forces, complementary at each point."""
    normals = points.normals
    gaps = surface.open_gaps(points.points, normals)
    # A point beyond a tangent is outside of the object, so the solution for given normals is
    # admissible for the updated normals, whose solution has less or equal energy. Therefore the
    # steps converge, but slowly; `_settle_normals` makes them few.
    for _ in range(MAX_STEPS):
        sizes, active = solve_complementarity(points.normal_compliance(normals), gaps)
        settled = np.zeros_like(normals)
        settled[active] = _settle_normals(
            points.part(active), normals[active], sizes[active], surface
        )
        for forces in (settled, sizes * normals):
            displacements = points.displacements(forces)
            deformed_gaps, deformed_normals = surface.nearest(points.points + displacements)  # (5)
            # (6), (7): no force pulls, and none is tangential.
            along_normals = forces * deformed_normals.conj()  # its imaginary part is tangential
            tangential_tolerance = NEGLIGIBLE_SHARE * np.abs(forces).max(initial=0.0)
            if (
                (along_normals.real >= 0.0).all()
                and (np.abs(along_normals.imag) <= tangential_tolerance).all()
                and (deformed_gaps >= -ROUNDING).all()
                and (deformed_gaps[active] <= ROUNDING).all()
            ):
                return ContactState(
                    along_normals.real, deformed_gaps, deformed_normals, displacements
                )
        normals = deformed_normals
        gaps = deformed_gaps - (displacements * normals.conj()).real
    raise SolverError(
        f'the contact did not converge in {MAX_STEPS} steps; the object is pressed in too deeply'
    )


def _settle_normals(
    points: ContactPoints, normals: Points, sizes: Array, surface: Surface
) -> Points:
    """Return the forces (a,), x + iy [N], at which gaps are closed and normals are updated."""
    forces = sizes * normals
    for _ in range(MAX_NEWTON_ITERATIONS if len(normals) else 0):
        displacements = points.displacements(forces)
        deformed_gaps, deformed_normals = surface.nearest(points.points + displacements)
        change = float(np.abs(deformed_normals - normals).max())
        # The change in the next step is negligible.
        if change < 0.01 * NEGLIGIBLE_SHARE:
            break
        normals = deformed_normals
        gaps = deformed_gaps - (displacements * normals.conj()).real
        _, sizes, failed = lapack.dposv(points.normal_compliance(normals), -gaps)
        if failed:
            raise SolverError('the contact compliance is not positive definite')
        forces = sizes * normals
    return forces


class RelaxationGains(NamedTuple):
    """Gains of the paper's iteration (9)."""

    by_penetration: float  #: K1, growth of the force of a point inside the object [N/m]
    by_tangent: float = 1.0  #: K2, decay of the tangential force [-]
    by_gap: float = 0.0  #: K3, decay of the force of a point off the object [1/m]


def default_gains(points: ContactPoints, surface: Surface) -> RelaxationGains:
    """
    Return gains with which (9) converges for most grasps of the presets.

    It does not for some small discs that are pressed in by 5 mm or more.

    The error of the forces is multiplied by 1 - K1 W, so K1 must be less than 2 / lambda_max(W);
    off the object by 1 - K3 F W, with a force F of about the largest depth divided by its
    compliance.
    """
    compliance = points.normal_compliance(points.normals)
    by_penetration = GAIN_SHARE / float(np.linalg.eigvalsh(compliance)[-1])
    depths = -surface.open_gaps(points.points, points.normals)
    force = float((depths / np.diag(compliance)).max())
    by_gap = GAP_GAIN_RATIO * by_penetration / force if force > 0.0 else by_penetration
    return RelaxationGains(by_penetration, 1.0, by_gap)


def advance_forces(forces: Points, gaps: Array, normals: Points, gains: RelaxationGains) -> Points:
    """Return the forces (c,) after a step of (9), x + iy [N]."""
    by_penetration, by_tangent, by_gap = gains
    growth = by_penetration * np.maximum(-gaps, 0.0) * normals
    tangential = 1j * normals * (forces * normals.conj()).imag
    return forces + growth - by_tangent * tangential - by_gap * np.maximum(gaps, 0.0) * forces


def relax_contact(
    points: ContactPoints, surface: Surface, gains: RelaxationGains | None = None
) -> ContactState:
    """
    Solve (8) by the paper's iteration (9) until its constraints hold to within tolerances.

    The number of steps is proportional to the condition number of W, 1e5 at a spacing of 5 mm.
    """
    forces = np.zeros(len(points.points), dtype=np.complex128)
    if not len(forces):
        return solve_contact(points, surface)
    gains = gains or default_gains(points, surface)
    for _ in range(MAX_RELAXATION_STEPS):
        displacements = points.displacements(forces)
        gaps, normals = surface.nearest(points.points + displacements)  # (5)
        pushes, along = (forces * normals.conj()).real, (forces * normals.conj()).imag
        largest = np.abs(forces).max()
        if not largest < MAX_LOAD:
            break
        # (6), (7) and (8): no penetration, no tangential force, no force off the object.
        is_off = gaps > RELAXED_GAP
        rest = max(np.abs(along).max(), np.abs(pushes[is_off]).max(initial=0.0), -pushes.min())
        if gaps.min() >= -RELAXED_GAP and rest <= RELAXED_FORCE_SHARE * largest:
            return ContactState(np.maximum(pushes, 0.0), gaps, normals, displacements)
        forces = advance_forces(forces, gaps, normals, gains)
    raise SolverError(
        f'the relaxation (9) did not converge in {MAX_RELAXATION_STEPS} steps with the gains '
        f'K1 = {gains[0]:.3g} N/m, K2 = {gains[1]:.3g}, K3 = {gains[2]:.3g} 1/m: change them, '
        "press the object in less, or use the method 'exact'"
    )
