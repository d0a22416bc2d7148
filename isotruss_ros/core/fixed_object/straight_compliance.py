# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Compliance of the robot at points on its straight tubes, by the direct stiffness method (1) to (4).

A load inside a tube piece acts on the frame by its equivalent loads on the ends of the piece, and
deforms the piece itself while these ends are fixed:

    C = B S^-1 B^T + G,

with the stiffness S of the frame (4), the shape functions B, and the compliance G of a piece with
fixed ends. B and G follow from the force method (Przemieniecki, chapter 5): a piece is a
cantilever that is clamped at its end; its redundants are the force and, unless the start is
pinned, the moment at its start.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.structure import Structure
import numpy as np


class StraightPoints(NamedTuple):
    """Points on straight tubes, with the pieces of tube in which they are."""

    structure: Structure  #: structural model of the robot
    pieces: Indices  #: (p,) indices of the pieces with points among the frame's members
    number: Indices  #: (c,) piece of each point, as index of `pieces`
    within: Array  #: (c,) distance of each point from the start of its piece [m]
    shapes: (
        Array  #: (2 c, 6 p) displacements x, then y, of the points per displacement of the ends
    )
    response: Array  #: (3 n, 6 p) displacements of the frame's nodes per load on the ends [m/N]
    compliance: Array  #: (2 c, 2 c) displacements x, then y, of the points per force x, y [m/N]


def straight_points(structure: Structure, members: Indices, positions: Array) -> StraightPoints:
    """Return points (c,) at distances from the starts of members [m], with their compliance."""
    frame, count = structure.frame, len(members)
    piece, within, _ = structure.locate(members, positions)
    pieces, number = np.unique(piece, return_inverse=True)
    node = np.stack([frame.members.start[pieces], frame.members.end[pieces]], axis=1)
    ends = (3 * node[:, :, None] + np.arange(3)).ravel()
    shapes = np.zeros((2, count, len(pieces), 6))
    inside = np.zeros((2, count, 2, count))
    for k, index in enumerate(pieces.tolist()):
        here = np.flatnonzero(number == k)
        section = frame.members.section[:, index].tolist()
        pinned = bool(frame.members.pinned_start[index])
        local, along, across = clamped_piece(
            float(frame.length[index]), section, within[here], pinned
        )
        x, y = frame.axis[index].real, frame.axis[index].imag
        turn = np.array([[x, -y], [y, x]])  # from the axes of the piece to x, y
        ends_turned = np.eye(6)
        ends_turned[:2, :2] = ends_turned[3:5, 3:5] = turn.T
        shapes[:, here, k] = np.tensordot(turn, local @ ends_turned, 1)
        both = np.stack([along, across])
        inside[np.ix_([0, 1], here, [0, 1], here)] = np.einsum('in,nab,jn->iajb', turn, both, turn)
    unit = np.zeros((3 * len(frame.points), len(ends)))
    unit[ends, np.arange(len(ends))] = 1.0
    rows = frame.layout.numbering.rows
    response = structure.rest.respond(unit)[rows:]
    spread = shapes.reshape(2 * count, len(ends))
    compliance = spread @ response[ends] @ spread.T + inside.reshape(2 * count, 2 * count)
    return StraightPoints(structure, pieces, number, within, spread, response, compliance)


def clamped_piece(
    length: float, section: list[float], within: Array, pinned_start: bool = False
) -> tuple[Array, Array, Array]:
    """
    Return shape functions and compliances of n points on a piece whose ends are fixed.

    The shape functions (2, n, 6) are displacements along and across the piece per displacement
    (ux, uy, theta) of start and end; the compliances (n, n) are along and across [m/N].
    """
    axial, flexural, shear = section
    beyond = length - within  # distance from the clamped end

    def cantilever(one: Array, other: Array | float) -> Array:
        near, far = np.minimum(one, other), np.maximum(one, other)
        return near**2 * (3.0 * far - near) / (6.0 * flexural) + near / shear

    released = np.stack([cantilever(beyond, length), -(beyond**2) / (2.0 * flexural)], axis=1)
    coupling = -(length**2) / (2.0 * flexural)
    redundant = np.array(
        [[float(cantilever(np.array(length), length)), coupling], [coupling, length / flexural]]
    )
    count = 1 if pinned_start else 2
    follows = np.linalg.solve(redundant[:count, :count], released[:, :count].T).T
    across = cantilever(beyond[:, None], beyond) - follows @ released[:, :count].T
    along = (np.minimum(beyond[:, None], beyond) - np.outer(beyond, beyond) / length) / axial
    shapes = np.zeros((2, len(within), 6))
    shapes[0, :, 0], shapes[0, :, 3] = beyond / length, within / length
    # The rigid motion of the clamped end, and the start's motion relative to it.
    shapes[1, :, 4], shapes[1, :, 5] = 1.0, -beyond
    shapes[1, :, 1] = follows[:, 0]
    shapes[1, :, 4] -= follows[:, 0]
    shapes[1, :, 5] += length * follows[:, 0]
    if not pinned_start:
        shapes[1, :, 2] = follows[:, 1]
        shapes[1, :, 5] -= follows[:, 1]
    return shapes, along, across
