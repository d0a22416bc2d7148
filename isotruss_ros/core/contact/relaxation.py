# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The paper's relaxation of the contact forces, equation (9), with gains from the compliance."""

from __future__ import annotations

from isotruss_ros.core.contact.contact_points import ContactGuess, ContactPoints, ContactState
from isotruss_ros.core.contact.surfaces import Surface
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.numerics.lcp import GAP_TOLERANCE
import numpy as np

#: K1 as a share of 2 / lambda_max(W), beyond which the iteration diverges.
GAIN = 0.9
MAX_STEPS = 2_000_000
#: Where the gap is larger than this, what is left of the force is no contact [m].
TOUCHING = 1e-7
#: A force that has faded to this share of the largest is none.
NEGLIGIBLE = 1e-9
#: Below this is nothing: keeps divisions defined before the first contact.
TINY = 1e-300
SMALL_FORCE = 1e-100
#: Normals follow the deformed points, and the end is looked for, every so many steps.
STEPS_BETWEEN_LOOKS = 200
#: Complementarity holds to this, gap [m] and force as a share of the largest.
TOLERANCE = 1e-2 * GAP_TOLERANCE


def relax_contact(
    contact_points: ContactPoints, surface: Surface, start: ContactGuess | None = None
) -> ContactState:
    """
    Solve (8) by (9): forces grow where the gap is negative and fade where it is positive.

    The tangential term of (9) is not needed: forces are normal from the start. K1 = 0.9 * 2 /
    lambda_max(W), and K3 = K1 / (largest force), so that fading is never quicker than growing.

    :param contact_points: points that the object could touch.
    :param surface: what the points meet, see `find_contact_points`.
    :param start: its forces are those to begin with; none if None.
    :raises SolverError: no rest within two million steps.
    """
    away = contact_points.skin - surface.center
    normals = surface.facing(contact_points.points - surface.center, contact_points.axis)
    forces = np.zeros(len(away)) if start is None else start.forces.copy()
    for _ in range(MAX_STEPS // STEPS_BETWEEN_LOOKS):
        gaps = (away * normals.conj()).real - surface.support(normals)
        compliance = contact_points.normal_compliance(normals)
        # Points without force that are not touched take no part: they do not bound the gain.
        part = np.flatnonzero((forces > 0.0) | (gaps + compliance @ forces < 0.0))
        if len(part):
            forces[part] = _steps(gaps[part], compliance[np.ix_(part, part)], forces[part])
        largest = forces.max(initial=TINY)
        forces = np.where(forces > NEGLIGIBLE * largest, forces, 0.0)
        displacements = contact_points.displacements(forces * normals)
        gap, normals, radii = surface.nearest(away + displacements)
        left = np.maximum(gap, 0.0) * forces / largest
        if (gap > -TOLERANCE).all() and (left < TOLERANCE).all():
            touching = np.where(gap < TOUCHING, forces, 0.0)
            push = touching * normals
            return ContactState(touching, gap, normals, displacements, radii, push)
    raise SolverError(f'the relaxation of the contact forces did not rest in {MAX_STEPS} steps')


def _steps(gaps: Array, compliance: Array, forces: Array) -> Array:
    """Return the forces (c,) after some steps of (9) with fixed normals."""
    grow = GAIN * 2.0 / np.linalg.eigvalsh(compliance)[-1]
    for _ in range(STEPS_BETWEEN_LOOKS):
        gap = gaps + compliance @ forces
        fade = grow / max(forces.max(), SMALL_FORCE)
        forces = forces + grow * np.maximum(-gap, 0.0) - fade * np.maximum(gap, 0.0) * forces
    return forces
