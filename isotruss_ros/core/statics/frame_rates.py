# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Derivatives of the robot's structural model with respect to roller travel and pressures.

Only rest lengths and sections of the tubes depend on these parameters. The displaced positions of
the nodes, the constraints (3) and the supports are constant.
"""

from __future__ import annotations

from isotruss_ros.core.numerics.arrays import Array, Points
from isotruss_ros.core.statics.bent_tubes import BentTubes
from isotruss_ros.core.statics.structure import frame_layout
from isotruss_ros.core.statics.wrinkling import tube_pieces
import numpy as np


def section_rates(tubes: BentTubes, moved: Points, inflated: Array) -> Array:
    """
    Return the changes (4, c, p) of the members' sections for p changes of the parameters.

    The four rows are rest length [m], EA [N], EI [N m^2] and GA [N]. The c members are those of
    the cut frame. Sections of modules and positions of cuts along the members are constant.

    :param moved: (N, p) changes of the positions of the configuration's nodes, x + iy [m].
    :param inflated: (t, p) changes of the gauge pressures of the tubes [Pa].
    """
    structure, frame = tubes.structure, tubes.frame
    topology = structure.config.robot.topology
    start, end = topology.b, topology.c[topology.following]
    side = structure.config.points[end] - structure.config.points[start]
    longer = ((moved[end] - moved[start]) / side[:, None]).real * np.abs(side)[:, None]
    pressures = np.array(structure.pressures)[topology.tube]
    lengths = structure.config.member_lengths
    by_length, by_pressure = structure.tube.flexibility_rates(lengths, pressures)
    softer = by_length[:, :, None] * longer + by_pressure[:, :, None] * inflated[topology.tube]
    pieces, member = tube_pieces(structure, frame)
    found = np.zeros((4, len(frame.length), moved.shape[1]))
    stiff = np.stack(frame.members[2:5])[:, pieces, None]
    found[1:, pieces] = -(stiff**2) * softer[:, member]
    # If a member becomes longer, the nodes C and E at its end shift along it; CE runs backward.
    shifts, b = (
        np.zeros((len(frame.points), moved.shape[1])),
        frame_layout(structure.config.robot).b,
    )
    shifts[b + 1] = shifts[b + 3] = longer[topology.previous]
    ahead = np.where(np.isin(frame.whole[pieces], structure.pieces[1]), -1.0, 1.0)
    ends, starts = frame.members.end[pieces], frame.members.start[pieces]
    found[0, pieces] = ahead[:, None] * (shifts[ends] - shifts[starts])
    return found
