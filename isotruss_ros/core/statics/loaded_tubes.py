# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tubes under forces inside their pieces: how the frame moves."""

from __future__ import annotations

from functools import cached_property

from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.interior import InteriorPoints
import numpy as np


class LoadedTubes:
    """
    A frame with forces at points inside its members.

    :ivar piece: (c,) number of the member of the frame that each force acts on.
    :ivar place: (c,) distance from that member's start [m].
    :ivar forces: (c,) x + iy [N].
    :param frame: the robot's.
    """

    def __init__(self, frame: Frame, piece: Indices, place: Array, forces: Points) -> None:
        self._frame = frame
        self.piece = piece
        self.place = place
        self.forces = forces

    @cached_property
    def local_forces(self) -> Points:
        """Return the forces along and across their members, (c,) [N]."""
        return self.forces * self._frame.axis[self.piece].conj()

    @cached_property
    def displacements(self) -> Array:
        """
        Return the displacements of the nodes, as `FrameState.displacements`, (n, 3).

        :raises StructureError: the robot is a mechanism.
        """
        frame, local = self._frame, self.local_forces
        shapes = interior_points(
            frame, self.piece, np.arange(len(self.piece)), self.place
        ).shapes()
        # What moves the ends of the members as the forces do.
        carried = local.real[:, None] * shapes[:, 0] + local.imag[:, None] * shapes[:, 1]
        loads = np.zeros((len(frame.points), 3))
        pushed = np.einsum('cji,cj->ci', frame.to_member_frame(self.piece), carried)
        np.add.at(loads, frame.members.start[self.piece], pushed[:, :3])
        np.add.at(loads, frame.members.end[self.piece], pushed[:, 3:])
        return frame.solve(loads).displacements


def interior_points(
    frame: Frame, pieces: Indices, member: Indices, place: Array
) -> InteriorPoints:
    """
    Return points on members of a frame.

    :param frame: the frame.
    :param pieces: (p,) numbers of the members.
    :param member: (c,) which of these each point is on.
    :param place: (c,) distance from its start [m].
    """
    members = frame.members
    return InteriorPoints(
        member,
        place,
        frame.length[pieces],
        members.axial[pieces],
        members.flexural[pieces],
        members.shear[pieces],
        np.stack([members.pinned_start[pieces], members.pinned_end[pieces]], axis=1),
    )
