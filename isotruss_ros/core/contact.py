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
#: Points closer than this are one, as a share of the spacing.
SAME = 1e-6
#: Forces are along normals to this, as a share of the largest.
SMOOTH = 1e-6
MAX_NORMAL_UPDATES = 30
MAX_STEPS = 300
#: More candidates than this begin where every fourth of them ends.
MANY = 300
#: Exchanges of many points at once without fewer wrong ones, before single ones.
MAX_BLOCK_EXCHANGES = 10


@dataclass(frozen=True, eq=False)
class Candidates:
    """
    Points of the tubes that an object could touch, and how the whole robot gives there.

    Displacements of the points are those of the ends of the p members that they are on, spread by
    shape functions, and those inside the members: the factors are kept, not the product.

    :ivar points: (c,) on the undeformed centre lines [m].
    :ivar member: (c,) the member (pinch to pinch) that each is on.
    :ivar spacing: length of tube that each stands for [m].
    :ivar axis: (c,) direction of the tube.
    :ivar inside: (2, c, c) compliance within members, along and across the tube [m/N].
    :ivar spread: (c, 2, 6 p) displacements in the plane by those of the members' ends.
    :ivar ends: (6 p, 6 p) compliance of the members' ends.
    """

    points: Points
    member: Indices
    spacing: float
    axis: Points
    inside: Array
    spread: Array
    ends: Array

    def __getitem__(self, places: Indices) -> Candidates:
        """Return some of the candidates."""
        inside = self.inside[:, places][:, :, places]
        return Candidates(
            self.points[places],
            self.member[places],
            self.spacing,
            self.axis[places],
            inside,
            self.spread[places],
            self.ends,
        )

    def normal_compliance(self, normals: Points) -> Array:
        """Return W = N^T S^-1 N (c, c), for unit forces along unit normals (c,) [m/N]."""
        local = self.axis.conj() * normals
        lever = normals.real[:, None] * self.spread[:, 0]
        lever += normals.imag[:, None] * self.spread[:, 1]
        matrix = lever @ self.ends @ lever.T
        matrix += np.outer(local.real, local.real) * self.inside[0]
        matrix += np.outer(local.imag, local.imag) * self.inside[1]
        return 0.5 * (matrix + matrix.T)

    def displacements(self, forces: Points) -> Points:
        """Return how all points move (c,) [m] under forces on them (c,) [N], x + iy."""
        local = self.axis.conj() * forces
        bent = self.inside[0] @ local.real + 1j * (self.inside[1] @ local.imag)
        push = forces.real @ self.spread[:, 0] + forces.imag @ self.spread[:, 1]
        moved = self.spread @ (self.ends @ push)
        return self.axis * bent + moved[:, 0] + 1j * moved[:, 1]

    @property
    def compliance(self) -> Array:
        """Return the displacements (c, 2) of all points for unit forces (c, 2), [m/N]."""
        along = _pairs(self.axis)
        across = _pairs(1j * self.axis)
        local = np.einsum('ci,cd,dj->cidj', along, self.inside[0], along)
        local += np.einsum('ci,cd,dj->cidj', across, self.inside[1], across)
        spread = self.spread.reshape(2 * len(self.points), len(self.ends))
        return local + (spread @ self.ends @ spread.T).reshape(local.shape)


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
    # A guide ring, where two pieces meet, is a point of the long one alone: twice the same point
    # would leave it open which of them takes the force.
    long = pieces[near] >= 7 * m
    first = np.ceil((low - foot)[near] / spacing - SAME * long).astype(int)
    last = np.floor((high - foot)[near] / spacing + np.where(long, SAME, -SAME)).astype(int)
    counts = last - first + 1
    member = np.repeat(np.arange(len(near)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts - first, counts)
    place = np.clip(foot[near][member] + spacing * number, 0.0, length[near][member])
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
    along = axis[near][member]
    points = start[near][member] + place * along
    # Ends move in the plane, shapes are along and across: turn in, spread, turn out.
    shapes = inside.shapes() @ frame.turned(used)[member]
    spread = np.zeros((len(place), 2, len(near), 6))
    out = np.stack([_pairs(along), _pairs(1j * along)], axis=2)
    spread[np.arange(len(place)), :, member] = out @ shapes
    return Candidates(
        points,
        owner[near][member],
        spacing,
        along,
        inside.compliance(),
        spread.reshape(len(place), 2, 6 * len(near)),
        frame.compliance(used),
    )


def _pairs(vectors: Points) -> Array:
    """Return vectors as pairs (c, 2)."""
    return np.ascontiguousarray(vectors).view(np.float64).reshape(-1, 2)


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


def solve_complementarity(compliance: Array, gaps: Array, active: Flags) -> tuple[Array, Flags]:
    """
    Find forces f >= 0 with g = gaps + compliance @ f >= 0 and f g = 0.

    By exchanging all points that are wrong at once (Judice and Pires, 1994), which takes a few
    steps or goes in circles; then one by one.

    :param compliance: (c, c) symmetric positive definite [m/N].
    :param gaps: (c,) without forces [m].
    :param active: (c,) a guess of where the contact is.
    :return: forces (c,) [N] and where they act.
    :raises SolverError: the matrix is not positive definite.
    """
    active = active.copy()
    best, patience = len(gaps) + 1, MAX_BLOCK_EXCHANGES
    while True:
        forces = np.zeros(len(gaps))
        forces[active] = _closing(compliance, gaps, active)
        left = gaps + compliance @ forces
        wrong = (active & (forces < 0.0)) | (~active & (left < -0.1 * GAP_TOLERANCE))
        count = int(wrong.sum())
        if count == 0:
            return forces, active
        if count < best:
            best, patience = count, MAX_BLOCK_EXCHANGES
        elif patience == 0:
            return _one_by_one(compliance, gaps, np.maximum(forces, 0.0))
        patience -= 1
        active ^= wrong


def _one_by_one(compliance: Array, gaps: Array, forces: Array) -> tuple[Array, Flags]:
    """Do the same from any forces that are not negative (Lawson and Hanson, 1974, chapter 23)."""
    active, refused = forces > 0.0, np.zeros(len(forces), dtype=bool)
    newest = -1
    for _ in range(100 + 20 * len(gaps)):
        wanted = np.zeros(len(gaps))
        wanted[active] = _closing(compliance, gaps, active)
        pulling = active & (wanted <= 0.0)
        if newest >= 0 and pulling[newest]:
            # By rounding: it is open by next to nothing, and stays so.
            active[newest], refused[newest] = False, True
        elif pulling.any():
            # As far that way as nothing pulls: some force vanishes there.
            shares = forces[pulling] / (forces[pulling] - wanted[pulling])
            forces = np.maximum(forces + shares.min() * (wanted - forces), 0.0)
            forces[np.flatnonzero(pulling)[shares == shares.min()]] = 0.0
            active, newest = active & (forces > 0.0), -1
            continue
        else:
            forces = wanted
            refused[:] = refused & (newest < 0)
        left = np.where(active | refused, 0.0, gaps + compliance @ forces)
        newest = int(left.argmin()) if len(left) else -1
        if newest < 0 or left[newest] >= -0.1 * GAP_TOLERANCE:
            return forces, active
        active[newest] = True
    raise SolverError('the complementarity problem was not solved')


def _closing(compliance: Array, gaps: Array, active: Flags) -> Array:
    """Return the forces at the active points, of any sign, that close their gaps."""
    if not active.any():
        return np.zeros(0)
    try:
        factor = cho_factor(compliance[np.ix_(active, active)])
    except np.linalg.LinAlgError as error:
        raise SolverError('the contact compliance is not positive definite') from error
    return cho_solve(factor, -gaps[active])
