"""
Unilateral contact of tubes with a cylinder: equations (5) to (8).

The tubes' centre lines meet a disc of radius (d + tube diameter) / 2. Candidate points on them
give by a compliance that is condensed to these points; for fixed normals the contact forces solve
a linear complementarity problem, and the normals follow the deformed points until they settle.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.candidates import Candidates
from isotruss_ros.core.complementarity import GAP_TOLERANCE, solve_complementarity
from isotruss_ros.core.errors import SolverError
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Points = NDArray[np.complex128]

#: Forces are along normals to this, as a share of the largest.
SMOOTH = 1e-6
MAX_NORMAL_UPDATES = 30
MAX_STEPS = 300
#: More candidates than this begin where every fourth of them ends.
MANY = 300


@dataclass(frozen=True, eq=False)
class ContactState:
    """
    Where and how hard the object is touched.

    :ivar forces: (c,) normal forces, not negative [N].
    :ivar gaps: (c,) distances of the deformed centre line from the disc, not negative [m].
    :ivar normals: (c,) unit normals of the object's surface, outward.
    :ivar displacements: (c,) of the candidates [m].
    """

    forces: Array
    gaps: Array
    normals: Points
    displacements: Points


def solve_contact(
    candidates: Candidates, center: complex, radius: float, start: Array | None = None
) -> ContactState:
    """
    Solve (8): gaps and forces not negative, and one of them zero everywhere.

    :param start: (c,) forces of a similar problem, to begin with.
    :raises SolverError: the normals do not settle.
    """
    away = candidates.points - center
    normals = unit(away)
    if start is not None:
        active = start > 0.0
    elif len(away) <= MANY:
        active = _deepest(candidates.member, np.abs(away))
    else:
        few = np.arange(0, len(away), 4)
        coarse = solve_contact(candidates[few], center, radius)
        push = np.zeros_like(away)
        push[few] = coarse.forces * coarse.normals
        moved = away + candidates.displacements(push)
        normals, active = unit(moved), np.abs(moved) < radius
    # Outside of the tangent at a point's foot is outside of the disc: what solves the problem for
    # some normals is admissible for the next ones, which can but take less energy. These steps
    # settle therefore, if slowly; following the normals of those in contact makes them few.
    for _ in range(MAX_STEPS):
        gaps = (away * normals.conj()).real - radius
        forces, active = solve_complementarity(candidates.normal_compliance(normals), gaps, active)
        places = np.flatnonzero(active)
        ahead = np.zeros_like(away)
        ahead[places] = _settle_normals(candidates[places], normals[places], center, radius)
        for push in (ahead, forces * normals):
            displacements = candidates.displacements(push)
            turned = unit(away + displacements)
            gaps = np.abs(away + displacements) - radius
            pressing, sizes = push * turned.conj(), np.abs(push)
            if (
                pressing.real.min(initial=0.0) >= 0.0
                and np.abs(pressing.imag).max(initial=0.0) <= SMOOTH * sizes.max(initial=0.0)
                and gaps.min(initial=0.0) >= -GAP_TOLERANCE
                and gaps[places].max(initial=0.0) <= GAP_TOLERANCE
            ):
                return ContactState(pressing.real, gaps, turned, displacements)
        normals = turned
    raise SolverError(
        f'the contact did not settle in {MAX_STEPS} steps; the object is pressed in too deeply'
    )


def _deepest(member: Indices, distance: Array) -> Flags:
    """Return where each member is nearest to the object: contact is there, if anywhere."""
    order = np.lexsort((distance, member))
    _, first = np.unique(member[order], return_index=True)
    nearest = np.zeros(len(member), dtype=bool)
    nearest[order[first]] = True
    return nearest


def _settle_normals(
    touching: Candidates, normals: Points, center: complex, radius: float
) -> Points:
    """Return the forces (a,), x + iy [N], that close all gaps, along normals that follow."""
    away = touching.points - center
    forces = np.zeros_like(away)
    for _ in range(MAX_NORMAL_UPDATES):
        gaps = (away * normals.conj()).real - radius
        forces = np.linalg.solve(touching.normal_compliance(normals), -gaps) * normals
        turned = unit(away + touching.displacements(forces))
        change = float(np.abs(turned - normals).max(initial=0.0))
        normals = turned
        if change * radius < 0.01 * GAP_TOLERANCE:
            break
    return forces


def unit(vectors: Points) -> Points:
    """Return directions; that of a point at the very centre is any, say upward."""
    sizes = np.abs(vectors)
    return np.where(sizes > 0.0, vectors / np.where(sizes > 0.0, sizes, 1.0), 1.0j)
