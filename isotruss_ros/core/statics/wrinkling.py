# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Utilisation of inflated tubes, which is the bending moment divided by the wrinkling moment.

Under the gauge pressure p and a compression N the wall carries the tension p pi R^2 - N. At the
bending moment M_w = (p pi R^2 - N) R / 2 one side of the wall is slack and begins to wrinkle; at 2
M_w the tube folds (Comer and Levy, AIAA Journal 1 (1963) 1652-1655). Beyond M_w the beam model is
not valid.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.numerics.tolerances import ROUNDING
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.structure import Structure
import numpy as np

#: Largest recommended utilisation of a tube [-].
MAX_UTILISATION = 0.8


class Utilisation(NamedTuple):
    """Utilisation of the m members of a robot under loads; zero for those without moments."""

    used: Array  #: (m,) largest |M| / M_w on each member; infinite if the wall has no tension
    place: Array  #: (m,) distance of this maximum from the member's start [m]
    piece: Indices  #: (m,) index of the frame's part in which the maximum is; -1 for none
    kind: Indices  #: (m,) 0 if the maximum is at this part's start, 1 at its end, 2 inside


def find_utilisation(
    structure: Structure, frame: Frame, end_forces: Array, pulls: Array
) -> Utilisation:
    """Return the utilisation of members; for `end_forces` and `pulls` see `FrameState`."""
    config, topology = structure.config, structure.config.robot.topology
    pieces, member = structure.tube_parts(frame)
    radius = 0.5 * config.robot.description.tube_diameter
    # Tension p pi R^2 of the wall without axial force, and with the force at start and end.
    wall = np.pi * radius**2 * np.array(structure.pressures)[topology.tube[member]]
    ends, length = end_forces[pieces], frame.length[pieces]
    begun, ended = wall - ends[:, 0], wall + ends[:, 3]
    used, inside = evaluate_utilisation(
        (
            -ends[:, 2],
            ends[:, 5],
            np.stack([begun, ended, np.minimum(begun, ended)]),
            pulls[pieces],
        ),
        np.vstack([length, frame.section[1:, pieces]]),
        radius,
    )
    start, along = config.points[topology.b[member]], config.member_axes[member].conj()
    origin = ((frame.points[frame.layout.start[pieces]] - start) * along).real
    ahead = (frame.axis[pieces] * along).real
    positions = origin + ahead * np.stack([np.zeros(len(pieces)), length, inside])
    last = find_most_used(used.ravel(), np.tile(member, 3))
    kind, piece = np.divmod(last, len(pieces))
    count, owner = structure.owners.shape[1], member[piece]
    usage = Utilisation(np.zeros(count), np.zeros(count), np.full(count, -1), np.zeros(count, int))
    values = used.ravel()[last], positions.ravel()[last], pieces[piece], kind
    for of_members, of_present in zip(usage, values, strict=True):
        of_members[owner] = of_present
    return usage


def evaluate_utilisation(
    loads: Array | tuple[Array, ...], sections: Array, radius: float
) -> tuple[Array, Array]:
    """
    Return |M| / M_w (3, ...) at start, end and inner maximum (or zero), and its position [m].

    The loads are bending moments at start and end [N m], tension of the wall, at one or three
    points, and the axial force that amplifies moments [N]. The sections are length [m], EI [N m^2]
    and GA [N]. All of them may be complex, for derivatives by complex steps.
    """
    begin, end, moment_capacity, pull = loads
    length, flexural, shear = sections
    # M = begin cos(k x) + sine sin(k x), whose maximum may be inside a piece; without compression
    # the largest moment is at an end.
    wave = np.sqrt(np.maximum(-pull, 0.0) / flexural / (1.0 + pull / shear))
    turned = np.maximum(wave * length, ROUNDING)
    sine = (end - begin * np.cos(turned)) / np.sin(turned)
    crest = np.arctan2(sine.real, begin.real) % np.pi
    within = (wave.real > 0.0) & (crest < turned.real)
    peak = np.where(within, np.sqrt(begin * begin + sine * sine), 0.0)
    moments = np.stack([begin, end, peak])
    moments = np.where(moments.real < 0.0, -moments, moments)
    used = np.full(moments.shape, np.inf, dtype=moments.dtype)
    np.divide(2.0 * moments, radius * moment_capacity, out=used, where=moment_capacity.real > 0.0)
    return used, np.where(within, crest / turned * length, 0.0)


def find_most_used(used: Array, member: Indices) -> Indices:
    """Return the index (m,) of the most utilised of the points (c,) of each member."""
    order = np.lexsort((used, member))
    return order[np.flatnonzero(np.diff(member[order], append=-1))]
