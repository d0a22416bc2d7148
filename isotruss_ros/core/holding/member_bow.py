# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How bending draws the ends of members together, which linear statics leaves out.

A tube between two rollers keeps its length along the bent line. With w its deflection from the
chord, the chord is shorter by half the integral of w'^2. Between contacts w is a cubic; with s the
slope of a stretch of length l, and a and b the slopes at its ends against that,

    1/2 int w'^2 dx = l / 2 (s^2 + (2 a^2 - a b + 2 b^2) / 15)

(the geometrical stiffness of a beam: Przemieniecki, Theory of Matrix Structural Analysis, chapter
15). A pinned end bears no moment: there a = -b / 2. Guide rings are left out, some 4 % of it.
"""

from __future__ import annotations

from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.loaded_frame import displace_nodes
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.statics.structure import frame_layout
import numpy as np


def member_bow(grip: HeldGrip) -> Array:
    """
    Return by how much the members of a robot are shorter for an object it holds, (m,) [m].

    :param grip: how the object is held; members that do not hold it hardly bend.
    """
    state, compliance = grip.state, grip.statics.compliance
    robot, feet = grip.config.robot, state.feet
    loads, b = state.loads, frame_layout(robot).b
    bent, shear = compliance.at(feet).respond(loads), compliance.structure.frame.members.shear
    # A force across puts a kink into the line; the slope is the mean of both sides.
    kinks = -loads[:, 1] / shear[compliance.locate(feet)[0]]
    moved = displace_nodes(grip, loads[..., None])
    nodes = moved[:, 0, 0] + 1j * moved[:, 1, 0]
    shorter = np.zeros(robot.topology.n_modules)
    for member in grip.members:
        mine = np.flatnonzero(grip.contacts.members == member)
        mine = mine[feet[mine].argsort()]
        length, axis = compliance.length[mine[0]], compliance.axis[mine[0]]
        ends = nodes[[b[member], b[robot.topology.following[member]] + 1]]
        start, end = (axis.conjugate() * ends).imag
        turn, places = (end - start) / length, feet[mine]
        deflections, slopes = bent[mine, 1] - start - turn * places, bent[mine, 2] - turn
        shorter[member] = beam_bow(length, places, deflections, slopes, kinks[mine])
    return shorter


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
    stretches = np.diff(places, prepend=0.0, append=length)
    chords = np.diff(deflections, prepend=0.0, append=0.0) / stretches
    after, before = slopes + 0.5 * kinks - chords[1:], slopes - 0.5 * kinks - chords[:-1]
    begin, end = np.append(-0.5 * before[0], after), np.append(before, -0.5 * after[-1])
    bent = (2.0 * begin**2 - begin * end + 2.0 * end**2) / 15.0
    return 0.5 * float(stretches @ (chords**2 + bent))
