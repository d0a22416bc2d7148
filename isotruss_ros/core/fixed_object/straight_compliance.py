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
from isotruss_ros.core.statics.beam_column import end_forces
from isotruss_ros.core.statics.equilibrium import solve_unloaded
from isotruss_ros.core.statics.structure import Structure
from isotruss_ros.core.statics.tangent import Tangent
import numpy as np


class StraightPoints(NamedTuple):
    """Points on straight tubes, with the pieces of tube in which they are."""

    structure: Structure  #: structural model of the robot
    tangent: Tangent  #: its frame, linearised without loads
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
    tangent, ends, response = _respond(structure, tuple(pieces.tolist()))
    shapes = by_piece.reshape(2 * count, len(ends))
    compliance = shapes @ response[ends] @ shapes.T
    same_piece = number[:, None] == number
    across, softer = np.where(same_piece, (across, along - across), 0.0)
    directions = np.array([axes.real, axes.imag])
    along_axes = (directions[:, :, None] * softer)[:, :, None] * directions
    compliance += along_axes.reshape(2 * count, 2 * count)
    compliance[:count, :count] += across
    compliance[count:, count:] += across
    return StraightPoints(structure, tangent, pieces, number, within, shapes, response, compliance)


@functools.lru_cache(maxsize=16)
def _respond(structure: Structure, pieces: tuple[int, ...]) -> tuple[Tangent, Indices, Array]:
    """
    Return the frame without loads and its response to loads on the ends of pieces.

    Indices (6 p,) are those of the ends' motions; the response is all motions (3 n, 6 p).
    """
    frame, rows = structure.frame, structure.frame.layout.numbering.rows
    nodes = np.stack([frame.layout.start[list(pieces)], frame.layout.end[list(pieces)]], axis=1)
    ends = (3 * nodes[:, :, None] + np.arange(3)).ravel()
    loads = np.zeros((3 * len(frame.points), len(ends)))
    loads[ends, np.arange(len(ends))] = 1.0
    tangent, _, response = solve_unloaded(frame, loads)
    return tangent, ends, response[rows:]


def clamped_pieces(
    length: Array, section: Array, within: Array, pinned_start: Flags
) -> tuple[Array, Array, Array]:
    """
    Return shape functions and compliances of n points, each on a piece whose ends are fixed.

    The shape functions (6, n) are displacements, along + i across the piece, per displacement of
    its ends; the compliances (n, n) along and across are for two points on one piece [m/N].
    """
    axial, flexural, shear = section
    beyond, turning = length - within, np.where(pinned_start, 0.0, 0.5 / flexural)

    def cantilever(one: Array, other: Array) -> Array:
        near, far = np.minimum(one, other), np.maximum(one, other)
        return near**2 * (3.0 * far - near) / (6.0 * flexural) + near / shear

    # Distances are from the clamped end.
    released = np.stack([cantilever(beyond, length), -turning * beyond**2], axis=1)
    coupling = -turning * length**2
    redundant = np.array([[cantilever(length, length), coupling], [coupling, length / flexural]])
    follows = np.linalg.solve(redundant.transpose(2, 0, 1), released[..., None])[..., 0]
    across = cantilever(beyond[:, None], beyond) - follows @ released.T
    along = (np.minimum(beyond[:, None], beyond) - np.outer(beyond, beyond / length)) / axial
    shift, rotation = 1j * follows.T
    # The rigid motion of the clamped end, and the start's motion relative to it.
    ending = within / length, 1j - shift, length * shift - rotation - 1j * beyond
    return np.array([beyond / length, shift, rotation, *ending]), along, across


def find_utilisation(tubes: StraightPoints, forces: Points) -> Array:
    """
    Return the largest |M| / M_w (m,) of each member under contact forces (c,), x + iy [N].

    In straight tubes the moment is largest at a contact force or at an end of a piece of tube.
    M_w = (p pi R^2 + N) R / 2 with the smaller tension N beside a force, see `wrinkling`.
    """
    structure, frame = tubes.structure, tubes.structure.frame
    robot, first = structure.config.robot, structure.pieces[0, 0]
    equivalent = np.concatenate([forces.real, forces.imag]) @ tubes.shapes
    piece, moved = tubes.pieces - first, (tubes.response @ equivalent).reshape(-1, 3, 1)
    changes, _ = tubes.tangent.force_changes(moved)
    ends = end_forces(changes[first:, :, 0], frame.length[first:])
    _, shear, start, tension, _, end = ends.T
    pull = np.stack([tension, tension])
    # Forces of the nodes on a piece are those of its motion less the equivalent loads.
    axis = np.repeat(frame.axis[tubes.pieces], 2).conj()
    x, y, couple = equivalent.reshape(-1, 3).T
    local = (axis * (x + 1j * y)).reshape(-1, 2)
    pull[0, piece] += local.real[:, 0]
    pull[1, piece] -= local.real[:, 1]
    shear[piece] -= local.imag[:, 0]
    start[piece] -= couple[::2]
    end[piece] -= couple[1::2]
    # Points with contact forces, then starts and ends of all pieces.
    pressing = np.flatnonzero(forces)
    number, within = tubes.number[pressing], tubes.within[pressing]
    at, push = piece[number], frame.axis[tubes.pieces][number].conj() * forces[pressing]
    ahead = (number[:, None] == number) & (within[:, None] > within)
    arms = np.where(ahead, within[:, None] - within, 0.0)
    before = pull[0][at] - ahead @ push.real
    tension = np.concatenate([np.minimum(before, before - push.real), *pull])
    moment = np.concatenate([shear[at] * within - start[at] + arms @ push.imag, -start, end])
    owner = structure.owners.ravel()
    member = np.concatenate([owner[at], owner, owner])
    radius = 0.5 * robot.description.tube_diameter
    wall = np.array(structure.pressures)[robot.topology.tube[member]] * np.pi * radius**2 + tension
    used = np.full(len(moment), np.inf)
    np.divide(2.0 * np.abs(moment), radius * wall, out=used, where=wall > 0.0)
    most = np.zeros(len(structure.config.member_lengths))
    np.maximum.at(most, member, used)
    return most
