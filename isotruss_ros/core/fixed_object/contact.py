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
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.numerics.qp import solve_complementarity
from isotruss_ros.core.numerics.tolerances import MAX_NEWTON_ITERATIONS, NEGLIGIBLE_SHARE, ROUNDING
import numpy as np
from scipy.linalg import lapack

#: Largest number of updates of the normals [-]; the normals on large discs converge slowly.
MAX_STEPS = 200
#: Largest penetration, and largest gap of a point with force [m]; three times of it changes
#: forces by less than 1e-4 N.
MAX_GAP = 1e-11


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


def relax_contact(points: ContactPoints, surface: Surface) -> ContactState:
    """
    Solve (8) by the paper's iteration (9), with momentum.

    Forces grow by K1 times the penetration, and are driven to zero where the tube is off the
    object; the tangential term of (9) is zero, because all forces are normal. The gain K1 = 1 /
    lambda_max(W) is the largest at which each step reduces the energy, so nothing is tuned.
    Without momentum, (9) needs a number of steps proportional to the condition number of W, which
    is beyond 1e6 for points on a smooth beam; with momentum (Nesterov 1983), restarted where it
    points uphill (O'Donoghue and Candes 2015), a number proportional to its square root.
    """
    normals, forces = points.normals, np.zeros(len(points.points))
    for _ in range(MAX_STEPS):
        gaps = surface.open_gaps(points.points, normals)
        forces = _iterate(gaps, points.normal_compliance(normals), forces)
        displacements = points.displacements(forces * normals)
        deformed_gaps, normals = surface.nearest(points.points + displacements)
        if (deformed_gaps >= -MAX_GAP).all() and (deformed_gaps[forces > 0.0] <= MAX_GAP).all():
            return ContactState(forces, deformed_gaps, normals, displacements)
    raise SolverError(
        f'the relaxation (9) did not converge in {10 * MAX_STEPS**2} steps; the object '
        "must be pressed in less, or the method be 'exact'"
    )


def _iterate(gaps: Array, compliance: Array, forces: Array) -> Array:
    """Return the forces (c,) after the steps of (9) with fixed normals."""
    gain = 1.0 / np.linalg.eigvalsh(compliance)[-1] if len(gaps) else 1.0
    extrapolated, momentum = forces, 1.0
    for _ in range(10 * MAX_STEPS):
        deformed_gaps = gaps + compliance @ extrapolated
        updated = np.maximum(extrapolated - gain * deformed_gaps, 0.0)
        step = updated - forces
        if (extrapolated - updated) @ step > 0.0:  # the momentum points uphill
            extrapolated, momentum = forces, 1.0
            continue
        next_momentum = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * momentum**2))
        extrapolated = updated + (momentum - 1.0) / next_momentum * step
        forces, momentum = updated, next_momentum
        if np.abs(step).max(initial=0.0) <= 0.1 * MAX_GAP * gain:
            break
    return forces
