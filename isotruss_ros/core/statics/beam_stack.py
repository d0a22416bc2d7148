# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Two-node beams in many shapes: the entries of (2) without matrices of 6 x 6 for each."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.numerics.arrays import Array, Flags, Points
import numpy as np


class Beams(NamedTuple):
    """
    Stiffness of members in many shapes, each (k, n): rows of (2) in the members' own frames.

    :ivar direction: unit vectors from start to end.
    :ivar length: [m].
    :ivar axial: force along for 1 m along [N/m].
    :ivar transverse: force across for 1 m across [N/m].
    :ivar to_start: moment at the start for 1 m across [N]; zero where that is pinned.
    :ivar to_end: moment at the end for 1 m across [N].
    :ivar start: moment at the start for 1 rad there [N m].
    :ivar end: moment at the end for 1 rad there [N m].
    :ivar far: moment at one for 1 rad at the other [N m].
    """

    direction: Points
    length: Array
    axial: Array
    transverse: Array
    to_start: Array
    to_end: Array
    start: Array
    end: Array
    far: Array

    def entries(self) -> Array:
        """Return what stands in the matrices, (10, k, n), in the order of `frame_groups.PLACE`."""
        c, s = self.direction.real, self.direction.imag
        between = self.axial - self.transverse
        return np.stack(
            [
                self.transverse + between * c * c,
                between * c * s,
                self.transverse + between * s * s,
                -s * self.to_start,
                c * self.to_start,
                -s * self.to_end,
                c * self.to_end,
                self.start,
                self.far,
                self.end,
            ]
        )


def beam_stack(span: Points, sections: Array, pinned: Flags) -> Beams:
    """
    Return (2) of members in many shapes, the starts of some of which turn freely.

    :param span: (k, n) from start to end, x + iy [m].
    :param sections: (3, k, n) EA [N], EI [N m^2], GA [N].
    :param pinned: (k, 1) whether the start transmits no moment.
    """
    axial, flexural, shear = sections
    length = np.abs(span)
    flexibility = 12.0 * flexural / (shear * length**2)
    bend = flexural / ((1.0 + flexibility) * length)
    force, moment = 12.0 * bend / length**2, 6.0 * bend / length
    near, far = (4.0 + flexibility) * bend, (2.0 - flexibility) * bend
    return Beams(
        span / length,
        length,
        axial / length,
        np.where(pinned, force - moment**2 / near, force),
        np.where(pinned, 0.0, moment),
        np.where(pinned, moment - moment * far / near, moment),
        np.where(pinned, 0.0, near),
        np.where(pinned, near - far**2 / near, near),
        np.where(pinned, 0.0, far),
    )
