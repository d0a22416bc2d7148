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
    """Utilisation of the m members of a robot under loads; zero for members out of the frame."""

    used: Array  #: (m,) largest |M| / M_w on each member; infinite if the wall has no tension
    place: Array  #: (m,) distance of this maximum from the member's start [m]
    piece: Indices  #: (m,) index of the frame's part in which the maximum is
    kind: Indices  #: (m,) 0 if the maximum is at this part's start, 1 at its end, 2 inside
    loads: Array  #: (4, m) loads of this part, see `evaluate_utilisation`
    sections: Array  #: (3, m) sections of this part, see `evaluate_utilisation`


def find_utilisation(
    structure: Structure, frame: Frame, end_forces: Array, pulls: Array
) -> Utilisation:
    """Return the utilisation of members; for `end_forces` and `pulls` see `FrameState`."""
    config, topology = structure.config, structure.config.robot.topology
    parts, member = structure.tube_parts(frame)
    radius = 0.5 * config.robot.description.tube_diameter
    by_pressure = np.pi * radius**2 * np.array(structure.pressures)[topology.tube[member]]
    ends = end_forces[parts]
    loads = np.stack([-ends[:, 2], ends[:, 5], by_pressure + ends[:, 3], pulls[parts]])
    sections = np.vstack([frame.length[parts], frame.section[1:, parts]])
    used, inner_positions = evaluate_utilisation(loads, sections, radius)
    # Positions (3, p) of the points along their members: at start, end and inner maximum.
    start, to_member = config.points[topology.b[member]], config.member_axes[member].conj()
    part_starts = ((frame.points[frame.layout.start[parts]] - start) * to_member).real
    directions = (frame.axis[parts] * to_member).real
    within = np.stack([np.zeros(len(parts)), sections[0], inner_positions])
    positions = part_starts + directions * within
    # The last point of each member in this order is the most used one.
    owner = np.tile(member, 3)
    order = np.lexsort((used.ravel(), owner))
    most_used = order[np.flatnonzero(np.diff(owner[order], append=-1))]
    kind, number = np.divmod(most_used, len(parts))

    def of_members(values: Array) -> Array:
        """Return values of the members in the frame for all members; zero for the others."""
        filled = np.zeros((*values.shape[:-1], structure.owners.shape[1]), dtype=values.dtype)
        filled[..., member[number]] = values
        return filled

    at_most_used = used[kind, number], positions[kind, number], parts[number], kind
    return Utilisation(*map(of_members, (*at_most_used, loads[:, number], sections[:, number])))


def evaluate_utilisation(loads: Array, sections: Array, radius: float) -> tuple[Array, Array]:
    """
    Return |M| / M_w (3, ...) at start, end and inner maximum (or zero), and its position [m].

    The loads (4, ...) are bending moments at start and end [N m], tension of the wall, and the
    axial force that amplifies moments [N]. The sections (3, ...) are length [m], EI [N m^2] and GA
    [N]. All of them may be complex, for derivatives by complex steps.
    """
    begin, end, wall, pull = loads
    length, flexural, shear = sections
    # M = begin cos(k x) + amplitude sin(k x), whose maximum may be inside a piece; without
    # compression the largest moment is at an end.
    wave_number = np.sqrt(np.maximum(-pull, 0.0) / flexural / (1.0 + pull / shear))
    end_phase = np.maximum(wave_number * length, ROUNDING)
    amplitude = (end - begin * np.cos(end_phase)) / np.sin(end_phase)
    crest_phase = np.arctan2(amplitude.real, begin.real) % np.pi
    is_inside = (wave_number.real > 0.0) & (crest_phase < end_phase.real)
    crest = np.where(is_inside, np.sqrt(begin * begin + amplitude * amplitude), 0.0)
    moments = np.stack([begin, end, crest])
    magnitudes = np.where(moments.real < 0.0, -moments, moments)
    used = np.full(moments.shape, np.inf, dtype=moments.dtype)
    np.divide(2.0 * magnitudes, radius * wall, out=used, where=wall.real > 0.0)
    return used, np.where(is_inside, crest_phase / end_phase * length, 0.0)
