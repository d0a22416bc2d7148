# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bending moments of straight tubes under contact forces, relative to the wrinkling moment."""

from __future__ import annotations

from isotruss_ros.core.fixed_object.straight_compliance import StraightPoints
from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.beam_column import end_forces
import numpy as np


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
    changes, _ = structure.rest.force_changes(moved)
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
