"""The points of the tubes that an object could touch, and how the whole robot gives there."""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.arrays import pairs
from isotruss_ros.core.interior import InteriorPoints
from isotruss_ros.core.structure import Structure
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Points = NDArray[np.complex128]

#: Points closer than this are one, as a share of the spacing.
SAME = 1e-6


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
        along = pairs(self.axis)
        across = pairs(1j * self.axis)
        local = np.einsum('ci,cd,dj->cidj', along, self.inside[0], along)
        local += np.einsum('ci,cd,dj->cidj', across, self.inside[1], across)
        spread = self.spread.reshape(2 * len(self.points), len(self.ends))
        return local + (spread @ self.ends @ spread.T).reshape(local.shape)


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
    out = np.stack([pairs(along), pairs(1j * along)], axis=2)
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
