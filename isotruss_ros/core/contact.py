"""
Unilateral contact of tubes with a cylinder: equations (5) to (8).

The tubes' centre lines meet a disc of radius (d + tube diameter) / 2. Candidate points on them
give by a compliance that is condensed to these points; for fixed normals the contact forces solve
a linear complementarity problem, and the normals follow the deformed points until they settle.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.interior import InteriorPoints
from isotruss_ros.core.structure import Structure
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Points = NDArray[np.complex128]

#: Gaps and complementarity hold to this [m]; forces to this over the stiffest point's compliance.
GAP_TOLERANCE = 1e-9
MAX_NORMAL_UPDATES = 100
#: Block exchanges before single ones, which are slow but end (Judice and Pires, 1994).
MAX_BLOCK_EXCHANGES = 10


@dataclass(frozen=True, eq=False)
class Candidates:
    """
    Points of the tubes that an object could touch.

    :ivar points: (c,) on the undeformed centre lines [m].
    :ivar member: (c,) the member (pinch to pinch) that each is on.
    :ivar spacing: length of tube that each stands for [m].
    :ivar compliance: (c, 2, c, 2) displacements for unit forces [m/N]; the whole robot gives.
    """

    points: Points
    member: Indices
    spacing: float
    compliance: Array


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


def find_candidates(
    structure: Structure, center: complex, radius: float, spacing: float
) -> Candidates:
    """
    Place candidates on every tube piece that comes within reach of a disc.

    :param center: of the object [m].
    :param radius: of the disc that centre lines meet [m].
    :param spacing: distance along the tube [m].
    """
    layout, frame = structure.config.robot.layout, structure.frame
    m = layout.n_modules
    # The tube pieces are the last three of the eight kinds of members: BD, CE, DE'.
    pieces = np.arange(5 * m, 8 * m)
    owner = np.concatenate([np.arange(m), layout.previous, np.arange(m)])
    start, end = frame.points[frame.members.start[pieces]], frame.points[frame.members.end[pieces]]
    length = np.abs(end - start)
    axis = (end - start) / length
    foot = ((center - start) * axis.conj()).real
    aside = ((center - start) * axis.conj()).imag
    # A tube that gives elsewhere may come into contact beyond the chord of the disc.
    reach = radius + 2.0 * spacing
    chord = np.sqrt(np.maximum(0.0, reach**2 - aside**2))
    low, high = np.maximum(0.0, foot - chord), np.minimum(length, foot + chord)
    near = np.flatnonzero((high > low) & (np.abs(aside) < reach))
    # Counted from the foot of the centre, where contact begins: what is symmetric stays so.
    first = np.ceil((low - foot)[near] / spacing).astype(int)
    counts = np.floor((high - foot)[near] / spacing).astype(int) - first + 1
    member = np.repeat(np.arange(len(near)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts - first, counts)
    place = foot[near][member] + spacing * number
    used = pieces[near]
    inside = InteriorPoints(
        member,
        place,
        length[near],
        frame.members.axial[used],
        frame.members.flexural[used],
        frame.members.shear[used],
        np.stack([frame.members.pinned_start[used], frame.members.pinned_end[used]], axis=1),
    )
    points = start[near][member] + place * axis[near][member]
    compliance = _compliance(structure, used, inside, axis[near])
    return Candidates(points, owner[near][member], spacing, compliance)


def _compliance(
    structure: Structure, used: Indices, inside: InteriorPoints, axis: Points
) -> Array:
    """Condense the robot to the points: what the ends of their members give, and the members."""
    c, p = len(inside.place), len(used)
    shapes = inside.shapes()
    along = axis[inside.member]
    turn = np.stack(
        [np.stack([along.real, along.imag], 1), np.stack([-along.imag, along.real], 1)], 1
    )  # (c, 2, 2): plane to member
    shapes = np.einsum('cai,cab->cib', turn, shapes)
    spread = np.zeros((c, 2, p, 6))
    spread[np.arange(c), :, inside.member] = shapes @ structure.frame.turned(used)[inside.member]
    spread = spread.reshape(2 * c, 6 * p)
    local = np.einsum('cai,acd,daj->cidj', turn, inside.compliance(), turn)
    ends = structure.frame.compliance(used)
    return local + (spread @ ends @ spread.T).reshape(c, 2, c, 2)


def solve_contact(
    candidates: Candidates, center: complex, radius: float, start: Array | None = None
) -> ContactState:
    """
    Solve (8): gaps and forces not negative, and one of them zero everywhere.

    :param start: (c,) forces of a similar problem, to begin with.
    :raises SolverError: the normals do not settle.
    """
    c = len(candidates.points)
    forces = np.zeros(c) if start is None else start
    away = candidates.points - center
    moved = away
    normals = unit(away)
    active = forces > 0.0
    for _ in range(MAX_NORMAL_UPDATES):
        gaps, pushed, compliance = linearize(candidates, away, normals, radius)
        forces, active = solve_complementarity(compliance, gaps, active)
        displacements = np.einsum('cid,d->ci', pushed, forces)
        moved = away + displacements[:, 0] + 1j * displacements[:, 1]
        turned = unit(moved)
        settled = np.abs(turned - normals).max(initial=0.0) * radius < 0.1 * GAP_TOLERANCE
        normals = turned
        if settled:
            return ContactState(forces, np.abs(moved) - radius, normals, moved - away)
    raise SolverError(
        f'the contact normals did not settle in {MAX_NORMAL_UPDATES} steps; '
        'the object is pressed in too deeply'
    )


def linearize(
    candidates: Candidates, away: Points, normals: Points, radius: float
) -> tuple[Array, Array, Array]:
    """
    Return the contact problem for fixed normals.

    :param away: (c,) candidates as seen from the object's centre [m].
    :param normals: (c,) unit normals.
    :return: gaps (c,) without forces [m]; displacements (c, 2, c) and compliance W = N^T S^-1 N
        (c, c) for unit normal forces [m/N].
    """
    directions = normals.view(np.float64).reshape(-1, 2)
    pushed = np.einsum('cidj,dj->cid', candidates.compliance, directions)
    compliance = np.einsum('ci,cid->cd', directions, pushed)
    return (away * normals.conj()).real - radius, pushed, 0.5 * (compliance + compliance.T)


def unit(vectors: Points) -> Points:
    """Return directions; that of a point at the very centre is any, say upward."""
    sizes = np.abs(vectors)
    return np.where(sizes > 0.0, vectors / np.where(sizes > 0.0, sizes, 1.0), 1.0j)


def solve_complementarity(compliance: Array, gaps: Array, active: Flags) -> tuple[Array, Flags]:
    """
    Find forces f >= 0 with g = gaps + compliance @ f >= 0 and f g = 0, by principal pivoting.

    :param compliance: (c, c) symmetric positive definite [m/N].
    :param gaps: (c,) without forces [m].
    :param active: (c,) a guess of where the contact is.
    :return: forces (c,) [N] and where they act.
    :raises SolverError: the matrix is not positive definite.
    """
    c = len(gaps)
    active = active.copy()
    best, patience = c + 1, MAX_BLOCK_EXCHANGES
    for _ in range(100 + 20 * c):
        forces = np.zeros(c)
        places = np.flatnonzero(active)
        if len(places):
            try:
                factor = cho_factor(compliance[np.ix_(places, places)])
            except np.linalg.LinAlgError as error:
                raise SolverError('the contact compliance is not positive definite') from error
            forces[places] = cho_solve(factor, -gaps[places])
        left = gaps + compliance @ forces
        wrong = (active & (forces < 0.0)) | (~active & (left < -0.1 * GAP_TOLERANCE))
        count = int(wrong.sum())
        if count == 0:
            return forces, active
        if count < best:
            best, patience = count, MAX_BLOCK_EXCHANGES
        elif patience > 0:
            patience -= 1
        else:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        active ^= wrong
    raise SolverError('the complementarity problem was not solved')
