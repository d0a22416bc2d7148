# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What bent members do to second order, which linear statics leaves out.

A tube between two rollers keeps its length along the bent line. With w its deflection from the
chord, the chord is shorter by half the integral of w'^2. Between contacts w is a cubic; with s the
slope of a stretch of length l, and a and b the slopes at its ends against that,

    1/2 int w'^2 dx = l / 2 (s^2 + (2 a^2 - a b + 2 b^2) / 15)

(the geometrical stiffness of a beam: Przemieniecki, Theory of Matrix Structural Analysis, chapter
15). A pinned end bears no moment: there a = -b / 2. Guide rings are left out, some 4 % of it.

By the same energy a tube in tension is stiffer across, as a string is: where the axial force
differs by friction from F before a contact to F' behind it, the tube pushes back with F s - F' s'.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_frame import displace_nodes
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.structure import frame_layout
import numpy as np


class BentMembers(NamedTuple):
    """
    What bending does to the members of a robot that holds an object.

    :ivar shorter: (m,) by how much their chords are shorter [m]; members that do not hold the
        object hardly bend.
    :ivar given: (k, 3) how the contacts move by axial forces, see `ContactStatics.given`.
    """

    shorter: Array
    given: Array


def bend_members(grip: HeldGrip) -> BentMembers:
    """
    Return what linear statics leaves out as a robot holds an object.

    :param grip: how the object is held.
    """
    state, compliance = grip.state, grip.statics.compliance
    feet, structure = state.feet, compliance.structure
    loads, bent = state.loads, _bend_from_chords(grip, state.loads)
    # A force across puts a kink into the line; the slope is the mean of both sides.
    kinks = -loads[:, 1] / structure.frame.members.shear[compliance.at(feet).pieces]
    shorter, pushes = np.zeros(grip.config.robot.topology.n_modules), np.zeros_like(loads)
    for member in grip.members:
        mine = np.flatnonzero(grip.contacts.members == member)
        mine = mine[feet[mine].argsort()]
        places, length = feet[mine], compliance.length[mine[0]]
        deflections, slopes = bent[mine, 1:].T
        shorter[member] = beam_bow(length, places, deflections, slopes, kinks[mine])
        tension = -grip.end_forces[structure.pieces[0, member], 0] - np.cumsum(
            [0.0, *loads[mine, 0]]
        )
        pushes[mine, 1] = np.diff(tension * _chord_slopes(length, places, deflections)[1])
    return BentMembers(shorter, _bend_from_chords(grip, pushes))


def _bend_from_chords(grip: HeldGrip, loads: Array) -> Array:
    """Return deflections of the contacts from the chords, and slopes, behind zeros (k, 3)."""
    compliance, members = grip.statics.compliance, grip.contacts.members
    robot, feet = grip.config.robot, grip.state.feet
    moved, b = displace_nodes(grip, loads[..., None])[..., 0], frame_layout(robot).b
    at = np.array([b[members], b[robot.topology.following[members]] + 1])
    start, end = (compliance.axis.conj() * (moved[at, 0] + 1j * moved[at, 1])).imag
    turn = (end - start) / compliance.length
    bent = compliance.at(feet).respond(loads)
    zero = np.zeros_like(feet)
    return np.stack([zero, bent[:, 1] - start - turn * feet, bent[:, 2] - turn], axis=1)


def _chord_slopes(length: float, places: Array, deflections: Array) -> tuple[Array, Array]:
    """Return lengths and slopes of the stretches between contacts and ends."""
    stretches = np.diff(places, prepend=0.0, append=length)
    return stretches, np.diff(deflections, prepend=0.0, append=0.0) / stretches


def beam_bow(
    length: float, places: Array, deflections: Array, slopes: Array, kinks: Array | float = 0.0
) -> float:
    """
    Return by how much the chord of a bent beam with pinned ends is shorter [m].

    :param length: of the beam [m].
    :param places: (k,) where it is loaded, in their order from the start [m].
    :param deflections: (k,) from the chord there [m].
    :param slopes: (k,) of its line there against the chord, the mean of both sides [-].
    :param kinks: (k,) by how much the slope is more behind a place than before it [-].
    """
    stretches, chords = _chord_slopes(length, places, deflections)
    after, before = slopes + 0.5 * kinks - chords[1:], slopes - 0.5 * kinks - chords[:-1]
    begin, end = np.append(-0.5 * before[0], after), np.append(before, -0.5 * after[-1])
    bent = (2.0 * begin**2 - begin * end + 2.0 * end**2) / 15.0
    return 0.5 * float(stretches @ (chords**2 + bent))
