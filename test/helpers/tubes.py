# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames in which points inside members are nodes, to compare with."""

from isotruss_ros.core.statics.equilibrium import solve, unloaded
import numpy as np


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
