# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Springs between the rigid segments into which a tube is divided.

A long tube piece DE' of length L is divided into N segments of length l = L / N, each with one
elastic joint in its middle. The compliance of a segment as a Timoshenko beam is diagonal if it is
taken about its middle: l / EA, l / GA + l^3 / (12 EI), l / EI. So the compliance at the end of a
member is exact for any N. The guide arms BD and CE, of length g, are pinned at B and C; a unit
moment at D or E rotates an arm by g / (3 EI) + 1 / (GA g). The axial compliance of the arms is
added to the first and the last segment.
"""

from __future__ import annotations

from dataclasses import dataclass

from isotruss_ros.core.kinematics.mechanism import Mechanism
from isotruss_ros.core.numerics.arrays import Array, Indices
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np


@dataclass(frozen=True, eq=False)
class Springs:
    """Stiffnesses of the elastic joints and length of the segments of each member."""

    segment: Array  #: (m,) length of a segment of each member [m]
    middle_slide: Array  #: (m,) axial stiffness of the inner joints [N/m]
    end_slide: Array  #: (m,) axial stiffness of the first and last joint [N/m]
    shear: Array  #: (m,) transverse stiffness of each joint [N/m]
    bend: Array  #: (m,) stiffness of the hinges inside the tube piece [N m/rad]
    ring: Array  #: (m,) stiffness of the hinges at D and E' [N m/rad]


def springs_of(robot: Mechanism, lengths: Array, segments: Indices) -> Springs:
    """
    Return the springs in all members for given member lengths.

    :param robot: robot with its stiffness model.
    :param lengths: (m,) unloaded lengths of the members between their pinch points [m].
    :param segments: (m,) number of segments of each member.
    :raises StructureError: the stiffness model is invalid for a length.
    """
    file = robot.description
    pressure = np.array(list(file.pressures.values()))[robot.topology.tube]
    tube = tube_stiffness(file).section_stiffness(lengths, pressure)
    ring = file.module.guide_ring_distance
    segment = (lengths - 2.0 * ring) / segments
    return Springs(
        segment=segment,
        middle_slide=tube.axial / segment,
        end_slide=tube.axial / (0.5 * segment + ring),
        shear=1.0 / (segment / tube.shear + segment**3 / (12.0 * tube.flexural)),
        bend=tube.flexural / segment,
        ring=1.0 / (ring / (3.0 * tube.flexural) + 1.0 / (tube.shear * ring)),
    )
