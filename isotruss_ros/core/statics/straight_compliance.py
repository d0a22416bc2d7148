# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compliance of the robot with straight tubes at points on its members, by (4).

A point's displacement is the sum of two parts: that of its piece of tube with fixed ends, and that
by the displacements of the ends. In a piece, xi is the distance from its end. The piece is a
cantilever from its end; the force (and, without a pin, the moment) at its start is redundant.
"""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.frame_pattern import member_places
from isotruss_ros.core.statics.structure import Structure
import numpy as np


def straight_compliance(structure: Structure, members: Indices, places: Array) -> Array:
    """
    Return the displacements (c, 2, c, 2) of points by unit forces at points, x and y [m/N].

    :param structure: structural model of the robot.
    :param members: (c,) indices of the points' members.
    :param places: (c,) distances of the points from the members' starts [m].
    :raises StructureError: the structure is a mechanism.
    """
    frame, count = structure.frame, len(places)
    piece, within, _ = structure.locate(members, places)
    pieces, number = np.unique(piece, return_inverse=True)
    inside, by_ends = _piece_responses(structure, piece, within)
    ends = member_places(frame.start[pieces], frame.end[pieces]).ravel()
    loads = np.zeros((3 * len(frame.points), len(ends)))
    loads[ends, np.arange(len(ends))] = 1.0
    spread = np.zeros((2, count, len(pieces), 6))
    spread[:, np.arange(count), number] = by_ends
    spread = spread.reshape(2 * count, -1)
    found = spread @ frame.rest.respond(loads)[0][ends] @ spread.T
    found = found.reshape(2, count, 2, count)
    found[0, :, 0] += inside[0]
    found[1, :, 1] += inside[1]
    x, y = frame.axis[piece].real, frame.axis[piece].imag
    turn = np.array([[x, -y], [y, x]])
    return np.einsum('xac,acbd,ybd->cxdy', turn, found, turn, optimize=True)


def _piece_responses(structure: Structure, piece: Indices, within: Array) -> tuple[Array, Array]:
    """
    Return the displacements of points in pieces of tube, along and across these.

    :return: (2, c, c) those along, then across, by unit forces while the ends are fixed [m/N]; and
        (2, c, 6) those by unit displacements (ux, uy, theta) of both ends.
    """
    frame = structure.frame
    length, (axial, flexural, shear) = frame.length[piece], frame.section[:, piece]
    xi, fixed = length - within, ~frame.pins[0][piece]
    # Cantilever: transverse displacements by unit force and moment at the start, and there.
    force, moment = xi**2 * (3.0 * length - xi) / (6.0 * flexural) + xi / shear, fixed * xi**2
    both = np.stack([force, moment / (2.0 * flexural)], axis=1)
    at_start = np.zeros((len(xi), 2, 2))
    at_start[:, 0, 0] = length**3 / (3.0 * flexural) + length / shear
    at_start[:, 0, 1] = at_start[:, 1, 0] = fixed * length**2 / (2.0 * flexural)
    at_start[:, 1, 1] = length / flexural
    redundant = (both[:, None] @ np.linalg.inv(at_start))[:, 0]
    nearer, farther = np.minimum(xi[:, None], xi), np.maximum(xi[:, None], xi)
    across = nearer**2 * (3.0 * farther - nearer) / (6.0 * flexural) + nearer / shear
    along = nearer * (length - farther) / (length * axial)
    inside = np.stack([along, across - redundant @ both.T]) * (piece[:, None] == piece)
    x, y, share = frame.axis[piece].real, frame.axis[piece].imag, within / length
    one, other = redundant.T
    rigid = one * length + other - xi
    none = np.zeros(len(xi))
    by_ends = np.array(
        [
            [(1.0 - share) * x, (1.0 - share) * y, none, share * x, share * y, none],
            [-one * y, one * x, -other, -(1.0 - one) * y, (1.0 - one) * x, rigid],
        ]
    )
    return inside, by_ends.swapaxes(1, 2)
