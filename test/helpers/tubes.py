# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tubes without a robot, and frames in which points inside members are nodes, to compare with."""

from types import SimpleNamespace

from isotruss_ros.core.statics.beam import local_stiffness
from isotruss_ros.core.statics.frame import Frame
from isotruss_ros.core.statics.frame_pattern import Members
import numpy as np


def bare(starts, ends, axial, flexural, shear, held=None):
    """
    Return what `find_contact_points` needs of a structure: clamped tubes, and nothing else.

    :param starts: (m,) x + iy of each tube.
    :param ends: (m,) the same.
    :param axial: EA, `flexural` and `shear` likewise; one for all tubes, or (m,).
    :param held: (m, 2, 3) which of ux, uy, theta are held at starts and ends; all if None.
    """
    m = len(starts)
    # A robot has six members per module, of which the last kind are the long pieces of tube.
    # The others are stubs, far away; one end of each is free, so that something is.
    stubs = 1e3 + np.arange(5 * m) * 1j
    points = np.concatenate([starts, ends, stubs, stubs + 1.0])
    fixed = np.ones((2 * m, 3), dtype=bool)
    if held is not None:
        fixed = np.concatenate([held[:, 0], held[:, 1]])
    fixed = np.concatenate(
        [fixed, np.ones((5 * m, 3), dtype=bool), np.zeros((5 * m, 3), dtype=bool)]
    )
    number = np.arange(5 * m)
    section_stiffness = (
        np.concatenate([np.ones(5 * m), np.broadcast_to(value, m)])
        for value in (axial, flexural, shear)
    )
    members = Members(
        np.concatenate([2 * m + number, np.arange(m)]),
        np.concatenate([7 * m + number, m + np.arange(m)]),
        *section_stiffness,
        np.zeros(6 * m, dtype=bool),
        np.zeros(6 * m, dtype=bool),
    )
    frame = Frame(points, members, fixed, [str(i) for i in range(len(points))])
    topology = SimpleNamespace(
        n_modules=m, previous=np.roll(np.arange(m), 1), tube=np.zeros(m, dtype=int)
    )
    return SimpleNamespace(
        frame=frame,
        config=SimpleNamespace(robot=SimpleNamespace(topology=topology)),
        pieces=np.arange(3 * m, 6 * m).reshape(3, -1),
        owners=np.stack([np.arange(m), topology.previous, np.arange(m)]),
    )


def with_nodes(frame, held, rows, points):
    """
    Return a frame with nodes at points on its members, and their numbers.

    :param held: (n, 3) of the frame.
    :param rows: its constraints.
    :param points: (c,) x + iy, each on a member.
    """
    old = frame.members
    start, end = frame.points[old.start], frame.points[old.end]
    length = np.abs(end - start)
    along = (points[:, None] - start) * ((end - start) / length).conj()
    # The tubes come last and may lie along stiff parts: the last member that fits.
    fits = (np.abs(along.imag) < 1e-9) & (along.real > -1e-9) & (along.real < length + 1e-9)
    on = fits.shape[1] - 1 - fits[:, ::-1].argmax(axis=1)
    assert fits.any(axis=1).all()
    place = along.real[np.arange(len(points)), on]
    numbers = np.empty(len(points), dtype=int)
    new_points, pieces = list(frame.points), []
    for member in range(len(length)):
        node, last = old.start[member], False
        here = np.flatnonzero(on == member)
        chain = [node]
        for c in here[np.argsort(place[here])]:
            if place[c] < 1e-9:
                numbers[c] = node
            elif place[c] > length[member] - 1e-9:
                numbers[c] = old.end[member]
            else:
                numbers[c] = len(new_points)
                new_points.append(points[c])
                chain.append(numbers[c])
        chain.append(old.end[member])
        for i in range(len(chain) - 1):
            first, last = i == 0, i == len(chain) - 2
            pieces.append((chain[i], chain[i + 1], member, first, last))
    start, end, member, first, last = map(np.array, zip(*pieces, strict=True))
    members = Members(
        start,
        end,
        old.axial[member],
        old.flexural[member],
        old.shear[member],
        old.pinned_start[member] & first,
        old.pinned_end[member] & last,
    )
    extra = len(new_points) - len(frame.points)
    held = np.concatenate([held, np.zeros((extra, 3), dtype=bool)])
    names = [str(i) for i in range(len(new_points))]
    return Frame(np.array(new_points), members, held, names, rows), numbers


def robot_with_nodes(structure, points):
    """Return the frame of a robot with nodes at points on its tubes, and their numbers."""
    return with_nodes(structure.frame, structure._layout.held, structure.frame._rows, points)


def largest_utilisation(structure, pressure, ends, inside):
    """
    Return the largest |M| / M_w of each member of a robot in whose tubes points are nodes.

    :param ends: (k, 6) forces on the members of that frame, see `FrameState.end_forces`.
    :param inside: (c,) the members of the robot's own frame that have the points inside.
    """
    m = len(structure.config.member_lengths)
    radius = 0.5 * structure.config.robot.description.tube_diameter
    cuts = 1 + np.bincount(inside, minlength=len(structure.frame.members.start))
    piece = np.repeat(np.arange(len(cuts)), cuts)
    largest = np.zeros(m)
    for number, member in zip(structure.pieces.ravel(), structure.owners.ravel(), strict=True):
        here = ends[piece == number]
        pull = pressure[member] * np.pi * radius**2 - here[:, 0]
        moment = np.abs(here[:, [2, 5]]).max(axis=1)
        used = np.where(pull > 0.0, 2.0 * moment / radius / pull, np.inf)
        largest[member] = max(largest[member], used.max())
    return largest


def node_compliance(frame, nodes):
    """Return (c, 2, c, 2): displacements of nodes under unit forces at nodes, solve by solve."""
    answer = np.empty((len(nodes), 2, len(nodes), 2))
    for c, node in enumerate(nodes):
        for axis in range(2):
            loads = np.zeros((len(frame.points), 3))
            loads[node, axis] = 1.0
            answer[:, :, c, axis] = frame.solve(loads).displacements[nodes, :2]
    return answer


def cut_member(length, axial, flexural, shear, pinned, places):
    """
    Return the stiffness of one member that has nodes at places, by its own element matrices.

    :param pinned: whether start and end turn freely.
    :return: (3 n, 3 n), nodes in order along the member, start and end included.
    """
    cuts = np.concatenate([[0.0], places, [length]])
    matrix = np.zeros((3 * len(cuts), 3 * len(cuts)))
    for i, piece in enumerate(np.diff(cuts)):
        both = slice(3 * i, 3 * i + 6)
        values = (np.full(1, value) for value in (piece, axial, flexural, shear))
        matrix[both, both] += local_stiffness(*values)[0]
    for rotation, free in ((2, pinned[0]), (len(matrix) - 1, pinned[1])):
        if free:
            column = matrix[:, rotation].copy()
            matrix -= np.outer(column, column) / column[rotation]
            matrix[rotation] = matrix[:, rotation] = 0.0
    return matrix


def plane_compliance(contact_points):
    """Return the displacements (c, 2) in the plane for unit forces (c, 2) on contact points."""
    axis = contact_points.axis
    turn = np.array([[axis.real, -axis.imag], [axis.imag, axis.real]])
    return np.einsum(
        'ikc,kcld,jld->cidj',
        turn,
        contact_points.compliance(np.arange(len(axis))),
        turn,
        optimize=True,
    )
