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

import functools
from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Indices, Points
from isotruss_ros.core.statics.frame import end_forces
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import solve_unloaded
import numpy as np


class StraightPoints(NamedTuple):
    """Points on straight tubes, with the pieces of tube in which they are."""

    structure: Structure  #: structural model of the robot
    pieces: Indices  #: (p,) indices of the pieces with points among the frame's members
    number: Indices  #: (c,) piece of each point, as index of `pieces`
    within: Array  #: (c,) distance of each point from the start of its piece [m]
    #: (2 c, 6 p) displacements x, then y, of the points per displacement of the ends
    shapes: Array
    response: Array  #: (3 n, 6 p) displacements of the frame's nodes per load on the ends [m/N]
    compliance: Array  #: (2 c, 2 c) displacements x, then y, of the points per force x, y [m/N]


def straight_points(structure: Structure, members: Indices, positions: Array) -> StraightPoints:
    """Return points (c,) at distances from the starts of members [m], with their compliance."""
    frame, count = structure.frame, len(members)
    piece, within, _ = structure.locate(members, positions)
    pieces, number = np.unique(piece, return_inverse=True)
    section, pinned = frame.section[:, piece], frame.layout.pinned[piece]
    local, along, across = clamped_pieces(frame.length[piece], section, within, pinned)
    axes = frame.axis[piece]
    # Displacements x + iy of the points, for displacements x, y and rotations of the ends.
    motions = axes * local
    motions[0::3], motions[1::3] = (
        motions[0::3] * axes.real - motions[1::3] * axes.imag,
        motions[0::3] * axes.imag + motions[1::3] * axes.real,
    )
    by_piece = np.zeros((2, count, len(pieces), 6))
    by_piece[:, np.arange(count), number] = motions.real.T, motions.imag.T
    ends, response = _respond(structure, tuple(pieces.tolist()))
    shapes = by_piece.reshape(2 * count, len(ends))
    compliance = shapes @ response[ends] @ shapes.T
    same_piece = number[:, None] == number
    across, softer = np.where(same_piece, (across, along - across), 0.0)
    directions = np.array([axes.real, axes.imag])
    along_axes = (directions[:, :, None] * softer)[:, :, None] * directions
    compliance += along_axes.reshape(2 * count, 2 * count)
    compliance[:count, :count] += across
    compliance[count:, count:] += across
    return StraightPoints(structure, pieces, number, within, shapes, response, compliance)


@functools.lru_cache(maxsize=16)
def _respond(structure: Structure, pieces: tuple[int, ...]) -> tuple[Indices, Array]:
    """Return indices (6 p,) of motions of pieces' ends; all motions (3 n, 6 p) by loads there."""
    frame, rows = structure.frame, structure.frame.layout.numbering.rows
    nodes = np.stack([frame.layout.start[list(pieces)], frame.layout.end[list(pieces)]], axis=1)
    ends = (3 * nodes[:, :, None] + np.arange(3)).ravel()
    loads = np.zeros((3 * len(frame.points), len(ends)))
    loads[ends, np.arange(len(ends))] = 1.0
    _, response = solve_unloaded(structure.straight, loads)
    return ends, response[rows:]


def clamped_pieces(
    length: Array, section: Array, within: Array, pinned_start: Flags
) -> tuple[Array, Array, Array]:
    """
    Return shape functions and compliances of n points, each on a piece whose ends are fixed.

    The shape functions (6, n) are displacements, along + i across the piece, per displacement of
    its ends; the compliances (n, n) along and across are for two points on one piece [m/N].
    """
    axial, flexural, shear = section
    to_end = length - within

    def deflection(point: Array, loaded: Array) -> Array:
        """Return the deflection of a cantilever per force, at distances from its clamped end."""
        nearer, farther = np.minimum(point, loaded), np.maximum(point, loaded)
        return nearer**2 * (3.0 * farther - nearer) / (6.0 * flexural) + nearer / shear

    # The redundants (n, 2) of a unit force at a point hold the start of the cantilever in place.
    per_moment = np.where(pinned_start, 0.0, -0.5 / flexural)
    released = np.stack([deflection(to_end, length), per_moment * to_end**2], axis=1)
    coupling = per_moment * length**2
    at_start = np.array([[deflection(length, length), coupling], [coupling, length / flexural]])
    redundants = np.linalg.solve(at_start.transpose(2, 0, 1), released[..., None])[..., 0]
    across = deflection(to_end[:, None], to_end) - redundants @ released.T
    along = (np.minimum(to_end[:, None], to_end) - np.outer(to_end, to_end / length)) / axial
    # By reciprocity, the redundants are the deflections by unit motions of the start. A motion of
    # the end is a rigid motion of the piece less that motion of its start.
    by_shift, by_rotation = 1j * redundants.T
    by_start = to_end / length, by_shift, by_rotation
    by_end = within / length, 1j - by_shift, length * by_shift - by_rotation - 1j * to_end
    return np.array([*by_start, *by_end]), along, across


def find_utilisation(tubes: StraightPoints, forces: Points) -> Array:
    """
    Return the largest |M| / M_w (m,) of each member under contact forces (c,), x + iy [N].

    In straight tubes the moment is largest at a contact force or at an end of a piece of tube.
    M_w = (p pi R^2 + N) R / 2 with the smaller tension N beside a force, see `wrinkling`.
    """
    structure, frame = tubes.structure, tubes.structure.frame
    axis, first_piece = frame.axis[tubes.pieces], structure.pieces[0, 0]
    # Forces of the nodes on all tube pieces are those of the ends' motions, less the equivalent
    # loads on the pieces with points.
    equivalent = np.concatenate([forces.real, forces.imag]) @ tubes.shapes
    changes, _ = structure.straight.force_changes((tubes.response @ equivalent).reshape(-1, 3, 1))
    # Columns: along, across and moment at the start, then at the end; compression is positive at
    # the start, tension at the end.
    at_ends = end_forces(changes[first_piece:, :, 0], frame.length[first_piece:])
    x, y, couple = equivalent.reshape(-1, 2, 3).transpose(2, 0, 1)
    load, loaded = axis[:, None].conj() * (x + 1j * y), tubes.pieces - first_piece
    at_ends[loaded] -= np.stack([load.real, load.imag, couple], axis=2).reshape(-1, 6)
    start_tension, end_tension = -at_ends[:, 0], at_ends[:, 3]
    shear, start_moment, end_moment = at_ends[:, 1], at_ends[:, 2], at_ends[:, 5]
    # Contact forces, along + i across their pieces, and the arms of those before each of them.
    pressed = np.flatnonzero(forces)
    number, within = tubes.number[pressed], tubes.within[pressed]
    piece, push = loaded[number], axis[number].conj() * forces[pressed]  # among all tube pieces
    beyond = np.maximum(within[:, None] - within, 0.0)
    arms = np.where(number[:, None] == number, beyond, 0.0)
    # Smaller tensions and moments at contact forces, at starts and at ends of pieces.
    tension_before = start_tension[piece] - (arms > 0.0) @ push.real
    tension_at = np.minimum(tension_before, tension_before - push.real)
    moment_at = shear[piece] * within - start_moment[piece] + arms @ push.imag
    tension = np.concatenate([tension_at, start_tension, end_tension])
    moment = np.abs(np.concatenate([moment_at, start_moment, end_moment]))
    owner = structure.owners.ravel()
    member = np.concatenate([owner[piece], owner, owner])
    robot = structure.config.robot
    radius, tube = 0.5 * robot.description.tube_diameter, robot.topology.tube[member]
    wall_tension = np.array(structure.pressures)[tube] * np.pi * radius**2 + tension
    # A wall without tension wrinkles under any moment.
    ratios = np.full(len(moment), np.inf)
    np.divide(2.0 * moment, radius * wall_tension, out=ratios, where=wall_tension > 0.0)
    largest = np.zeros(len(structure.config.member_lengths))
    np.maximum.at(largest, member, ratios)
    return largest
