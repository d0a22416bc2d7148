# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The paper's iteration (9) for contact forces, with momentum.

Forces grow by K1 times the penetration, and are driven to zero where the tube is off the object;
the tangential term of (9) is zero, because all forces are normal. The gain K1 = 1 / lambda_max(W)
is the largest at which each step reduces the energy, so nothing is tuned. Without momentum, (9)
needs a number of steps proportional to the condition number of W, which is beyond 1e6 for points
on a smooth beam; with momentum (Nesterov 1983), restarted where it points uphill (O'Donoghue and
Candes 2015), a number proportional to its square root.
"""

from __future__ import annotations

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.fixed_object.contact import ContactState, MAX_STEPS
from isotruss_ros.core.fixed_object.contact_points import ContactPoints, Surface
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Largest penetration, and largest gap of a point with force [m]; three times of it changes
#: forces by less than 1e-4 N.
MAX_GAP = 1e-11


def relax_contact(points: ContactPoints, surface: Surface) -> ContactState:
    """Solve (8) by the iteration (9)."""
    at, normals, forces = points.points, points.normals, np.zeros(len(points.points))
    for _ in range(MAX_STEPS):
        gaps, compliance = surface.open_gaps(at, normals), points.normal_compliance(normals)
        forces = _iterate(gaps, compliance, forces)
        displacements = points.displacements(forces * normals)
        distances, normals = surface.nearest(at + displacements)
        if (distances >= -MAX_GAP).all() and (distances[forces > 0.0] <= MAX_GAP).all():
            return ContactState(forces, distances, normals, displacements)
    raise SolverError(
        f'the relaxation (9) did not converge in {10 * MAX_STEPS**2} steps; the object '
        "must be pressed in less, or the method be 'exact'"
    )


def _iterate(gaps: Array, compliance: Array, forces: Array) -> Array:
    """Return the forces (c,) after the steps of (9) with fixed normals."""
    gain = 1.0 / np.linalg.eigvalsh(compliance)[-1] if len(gaps) else 1.0
    ahead, momentum = forces, 1.0
    for _ in range(10 * MAX_STEPS):
        gap = gaps + compliance @ ahead
        following = np.maximum(ahead - gain * gap, 0.0)
        step = following - forces
        if (ahead - following) @ step > 0.0:  # the momentum points uphill
            ahead, momentum = forces, 1.0
            continue
        growing = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * momentum**2))
        ahead = following + (momentum - 1.0) / growing * step
        forces, momentum = following, growing
        if np.abs(step).max(initial=0.0) <= 0.1 * MAX_GAP * gain:
            break
    return forces
