# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tubes without a robot, and frames in which points inside members are nodes, to compare with."""

from types import SimpleNamespace

import frames
from isotruss_ros.core.statics.equilibrium import solve, unloaded
from isotruss_ros.core.statics.structure import Structure
import numpy as np


def bare(span, axial, flexural, shear):
    """
    Return what `find_contact_points` needs of a structure: one clamped tube from the origin.

    :param span: to its other end, x + iy.
    :param axial: EA, `flexural` and `shear` likewise.
    """
    # Besides it there is a stub, far away; one end of it is free, so that something is.
    one = np.ones(1, dtype=int)
    members = frames.Members(
        np.array([0, 2]),
        np.array([1, 3]),
        np.array([[value, 1.0] for value in (axial, flexural, shear)]),
        np.zeros(2, dtype=bool),
    )
    held = np.array([[True] * 3] * 3 + [[False] * 3])
    frame = frames.frame([0.0, span, 1e3, 1e3 + 1.0], members, held)
    topology = SimpleNamespace(
        n_modules=1, b=one - 1, c=one, end=one, following=one - 1, previous=one - 1, tube=one - 1
    )
    structure = SimpleNamespace(
        frame=frame,
        config=SimpleNamespace(
            robot=SimpleNamespace(topology=topology),
            points=frame.points[:2],
            member_lengths=np.abs(frame.points[1:2]),
            member_axes=frame.points[1:2] / np.abs(frame.points[1:2]),
        ),
        pieces=np.zeros((3, 1), dtype=int),
        owners=np.zeros((3, 1), dtype=int),
        locate=lambda members, places: (0 * members, places, 1.0 + 0.0 * places),
    )
    structure.tube_parts = lambda frame: Structure.tube_parts(structure, frame)
    return structure


def robot_with_nodes(structure, members, places):
    """Return the frame of a robot with nodes at places (c,) on its members (c,)."""
    return structure.frame.cut(*structure.locate(members, places)[:2])


def node_compliance(frame, nodes):
    """Return (c, 2, c, 2): displacements of nodes under unit forces at nodes, solve by solve."""
    rest, answer = unloaded(frame), np.empty((len(nodes), 2, len(nodes), 2))
    for c, node in enumerate(nodes):
        for axis in range(2):
            loads = np.zeros((len(frame.points), 3))
            loads[node, axis] = 1.0
            answer[:, :, c, axis] = solve(rest, loads).displacements[nodes, :2]
    return answer
