# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What a load at one place of a beam with clamped ends does at another place of it.

A Timoshenko beam between its ends deforms as a cantilever from the start whose far end is brought
to where it is held; what a load does to the tip of the cantilever follows by reciprocity.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array
import numpy as np


class BeamPiece(NamedTuple):
    """
    A straight beam between its ends.

    :ivar length: [m].
    :ivar axial: EA [N].
    :ivar flexural: EI [N m^2].
    :ivar shear: GA [N].
    :ivar pinned: whether the start transmits no moment.
    """

    length: float
    axial: float
    flexural: float
    shear: float
    pinned: bool


def beam_between(beam: BeamPiece, x: float, y: float) -> tuple[Array, Array, Array]:
    """
    Return displacement along and across and slope at x for unit loads at y, the ends held.

    :param beam: the beam.
    :param x: place of the responses, from the start [m].
    :param y: place of force along, force across and moment, another one [m].
    :return: (3, 3), and its derivatives by x and by y.
    """
    ei, ga, length = 1.0 / beam.flexural, 1.0 / beam.shear, beam.length
    tip = np.array(
        [
            [length**3 * ei / 3.0 + length * ga, 0.5 * length**2 * ei],
            [0.5 * length**2 * ei, length * ei],
        ]
    )
    held = np.linalg.inv(tip)
    # Deflection, slope of the line and rotation of the section of the cantilever by its tip.
    here, here_rate = _by_tip(length, ei, ga, x)
    there, there_rate = _by_tip(length, ei, ga, y)
    near, far, moved = x < y, min(x, y), max(x, y)
    own, by_x, by_y = _cantilever(ei, ga, x, y)
    found = own - here[:2] @ held @ there[::2].T
    rate_x = by_x - here_rate[:2] @ held @ there[::2].T
    rate_y = by_y - here[:2] @ held @ there_rate[::2].T
    if beam.pinned:
        # The start turns so that it takes no moment.
        arm = np.array([-length, -1.0])
        turned, turned_rate = _by_start(here @ held @ arm, x), here_rate @ held @ arm
        other, other_rate = _by_start(there @ held @ arm, y), there_rate @ held @ arm
        turned_rate[0] += 1.0
        other_rate[0] += 1.0
        stiffness = arm @ held @ arm
        found = found + np.outer(turned[:2], other[::2]) / stiffness
        rate_x = rate_x + np.outer(turned_rate[:2], other[::2]) / stiffness
        rate_y = rate_y + np.outer(turned[:2], other_rate[::2]) / stiffness
    matrices = np.zeros((3, 3, 3))
    matrices[:, 1:, 1:] = found, rate_x, rate_y
    scale = 1.0 / (beam.axial * length)
    matrices[0, 0, 0] = far * (length - moved) * scale
    matrices[1, 0, 0] = (length - moved if near else -far) * scale
    matrices[2, 0, 0] = (-far if near else length - moved) * scale
    return matrices[0], matrices[1], matrices[2]


def _by_start(by_tip: Array, x: float) -> Array:
    """Return deflection, slope and rotation at x as the start turns by 1 rad, the tip held."""
    return by_tip + np.array([x, 1.0, 1.0])


def _by_tip(length: float, ei: float, ga: float, x: float) -> tuple[Array, Array]:
    """Return deflection, slope and rotation at x by force and moment at the tip, (3, 2), rates."""
    turn = (length * x - 0.5 * x**2) * ei
    sink = x**2 * (3.0 * length - x) * ei / 6.0 + x * ga
    rate = (length - x) * ei
    return (
        np.array([[sink, 0.5 * x**2 * ei], [turn + ga, x * ei], [turn, x * ei]]),
        np.array([[turn + ga, x * ei], [rate, ei], [rate, ei]]),
    )


def _cantilever(ei: float, ga: float, x: float, y: float) -> tuple[Array, Array, Array]:
    """Return deflection and slope at x by force and moment at y, (2, 2), and derivatives."""
    if x < y:
        turn = y * x - 0.5 * x**2
        return (
            np.array(
                [
                    [x**2 * (3.0 * y - x) * ei / 6.0 + x * ga, 0.5 * x**2 * ei],
                    [turn * ei + ga, x * ei],
                ]
            ),
            np.array([[turn * ei + ga, x * ei], [(y - x) * ei, ei]]),
            np.array([[0.5 * x**2 * ei, 0.0], [x * ei, 0.0]]),
        )
    turn = x * y - 0.5 * y**2
    return (
        np.array(
            [
                [y**2 * (3.0 * x - y) * ei / 6.0 + y * ga, turn * ei],
                [0.5 * y**2 * ei, y * ei],
            ]
        ),
        np.array([[0.5 * y**2 * ei, y * ei], [0.0, 0.0]]),
        np.array([[turn * ei + ga, (x - y) * ei], [y * ei, ei]]),
    )
