# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The frames of one robot in many shapes, solved together: equations (1), (2) and (4).

Tubes meet only in joints. The unknowns of each tube are eliminated first, which leaves a small
system of the joints: two stacks of small matrices in place of large ones. Arrays over shapes have
these last, until matrices are stacked.
"""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array, Indices, Points
from isotruss_ros.core.statics.beam_stack import beam_stack, Beams
from isotruss_ros.core.statics.frame_groups import frame_groups, FrameGroups
from isotruss_ros.core.statics.structure import (
    bisection_gradients,
    frame_layout,
    frame_points,
    section_values,
    tube_pieces,
)
from isotruss_ros.core.statics.tube_stiffness import tube_stiffness
import numpy as np

#: What answers one probing load by more than this, stiffness scaled to 1, may be a mechanism.
SUSPICIOUS = 1e8


class FrameStack:
    """
    The frames of a robot in n shapes.

    :param robot: the robot.
    :param nodes: (N, n) nodes as in `Configuration.points` [m].
    :param pressures: (t,) gauge, of each tube [Pa].
    :ivar points: (p, n) nodes of the frames [m].
    :ivar lengths: (m, n) of the members of the robot [m].
    :ivar sections: (3, 6 m, n) EA [N], EI [N m^2], GA [N] of the members of the frames.
    :ivar beams: of the members of the frames.
    :raises StructureError: the stiffness model has no stiffness for a length and pressure.
    """

    def __init__(self, robot: Robot, nodes: Points, pressures: tuple[float, ...]) -> None:
        topology, layout = robot.topology, frame_layout(robot)
        self.robot = robot
        self.points = frame_points(robot, nodes)
        self.lengths = np.abs(nodes[topology.c[topology.following]] - nodes[topology.b])
        tube = tube_stiffness(robot.description)
        self.sections = section_values(robot, tube, pressures, self.lengths)
        span = self.points[layout.end] - self.points[layout.start]
        pinned = layout.pinned_start[:, None]
        self.beams = beam_stack(span, self.sections, pinned)

    def load(self, shape: Indices, piece: Indices, slot: Indices) -> LoadedStack:
        """
        Return how the frames give under loads at the ends of some members.

        :param shape: (q,) in which of the shapes.
        :param piece: (q,) the members that are loaded.
        :param slot: (q,) number that a loaded member has among those of its shape.
        :raises LinAlgError: a matrix is singular.
        """
        groups, n = frame_groups(self.robot), self.points.shape[1]
        slots = 1 + int(slot.max(initial=0))
        values = np.concatenate(
            [
                self.beams.entries().reshape(-1, n),
                bisection_gradients(self.robot, self.points),
                np.ones((1, n)),
            ]
        )
        inner, rim, joints = groups.assemble(values)
        width, loads = rim.shape[3], 6 * slots
        right = np.zeros((*rim.shape[:3], width + loads + 1))
        rim = np.ascontiguousarray(rim)
        right[..., :width] = rim
        right[..., -1] = groups.probe
        unknown = groups.unknowns[groups.places[piece]]
        column = width + 6 * slot[:, None] + np.arange(6)
        tube, row = np.divmod(groups.position[unknown], rim.shape[2])
        right[shape[:, None], tube, row, column] = groups.scale[unknown]
        solved = np.linalg.solve(inner, right)
        count = joints.shape[1]
        # One row more, for joints that a tube with fewer of them does not have.
        schur, rest = np.zeros((n, count + 1, count + 1)), np.zeros((n, count + 1, loads + 1))
        schur[:, :count, :count] = joints
        rest[:, :count, -1] = 1.0
        for t, own in enumerate(groups.joints):
            taken = rim[:, t].transpose(0, 2, 1) @ solved[:, t]
            schur[:, own[:, None], own] -= taken[:, :, :width]
            rest[:, own] -= taken[:, :, width:]
        moved = np.zeros_like(rest)
        moved[:, :count] = np.linalg.solve(schur[:, :count, :count], rest[:, :count])
        response = Response(groups, solved[..., :width], solved[..., width:], moved)
        probed = np.zeros((n, loads + 1))
        probed[:, -1] = 1.0
        suspicious = ~(np.abs(response.to(probed)).max(axis=1) < SUSPICIOUS)
        ends = np.zeros((n, slots, 6, loads))
        ends[shape, slot] = response.at(shape, tube, row) * groups.scale[unknown][:, :, None]
        return LoadedStack(self, response, ends.reshape(n, loads, loads), suspicious)


class Response(NamedTuple):
    """
    Unknowns for unit loads l, the last one of which is the probe; see `FrameGroups`.

    :ivar groups: which unknowns there are.
    :ivar rim: (n, t, d, w) those of tubes for unit motions of their joints.
    :ivar held: (n, t, d, l) those of tubes for unit loads, joints held.
    :ivar joints: (n, j + 1, l) those of joints for unit loads.
    """

    groups: FrameGroups
    rim: Array
    held: Array
    joints: Array

    def at(self, shape: Indices, tube: Indices, row: Indices) -> Array:
        """
        Return some unknowns of tubes for unit loads but the probe, (q, 6, l - 1).

        :param shape: (q,) in which of the shapes.
        :param tube: (q, 6) of which tube, the same one for each six.
        :param row: (q, 6) which of its unknowns.
        """
        which = shape[:, None], tube, row
        joints = self.joints[shape[:, None], self.groups.joints[tube[:, 0]], :-1]
        return self.held[which][:, :, :-1] - self.rim[which] @ joints

    def to(self, loads: Array) -> Array:
        """
        Return all unknowns, in the order of the matrices, (n, t d + j).

        :param loads: (n, l) the probe included.
        """
        joints = (self.joints @ loads[:, :, None])[:, :, 0]
        inner = self.held @ loads[:, None, :, None]
        inner -= self.rim @ joints[:, self.groups.joints, None]
        return np.concatenate([inner.reshape(len(loads), -1), joints[:, :-1]], axis=1)


class LoadedStack(NamedTuple):
    """
    How the frames of a robot give under loads at the ends of some members, s for each shape.

    :ivar stack: the frames.
    :ivar response: all unknowns for unit loads x, y [N] and moment [N m] at start and end of each
        loaded member, scaled.
    :ivar ends: (n, 6 s, 6 s) displacements there alone.
    :ivar suspicious: (n,) which of the frames may be mechanisms.
    """

    stack: FrameStack
    response: Response
    ends: Array
    suspicious: Array

    def tube_forces(self, loads: Array) -> Array:
        """
        Return the forces of the nodes on the pieces of tube.

        :param loads: (n, 6 s) on the ends of the loaded members, in the plane [N, N m].
        :return: (6, 3 m, n) along, across [N] and moment [N m] at start, then at the end.
        """
        stack, groups = self.stack, self.response.groups
        displacements = np.zeros((3 * len(stack.points), len(loads)))
        moved = self.response.to(np.pad(loads, ((0, 0), (0, 1))))[:, groups.position]
        free = len(groups.solved)
        displacements[groups.solved] = (moved * groups.scale)[:, :free].T
        pieces = tube_pieces(stack.robot.topology.n_modules).ravel()
        ends = displacements[groups.places[pieces]].transpose(1, 0, 2)
        beams = Beams(*(values[pieces] for values in stack.beams))
        apart = (ends[0] + 1j * ends[1] - ends[3] - 1j * ends[4]) * beams.direction.conj()
        along = beams.axial * apart.real
        across = beams.transverse * apart.imag + beams.to_start * ends[2] + beams.to_end * ends[5]
        return np.stack(
            [
                along,
                across,
                beams.to_start * apart.imag + beams.start * ends[2] + beams.far * ends[5],
                -along,
                -across,
                beams.to_end * apart.imag + beams.far * ends[2] + beams.end * ends[5],
            ]
        )
