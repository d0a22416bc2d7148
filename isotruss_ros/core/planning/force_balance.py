# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The load that friction cannot balance in a grip, and its derivative by the indentations.

Two places of contact: the wrenches that friction can bring about lie in a plane, next to flat, so
what matters is the load across it. Three: the resultant force of all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from isotruss_ros.core.grasping.analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration

Cylinder = type(None)
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.safety.distances import nearest_on_segment
import numpy as np
from numpy.typing import ArrayLike


class Imbalance(NamedTuple):
    """
    What friction cannot take, in s - 1 directions for s members.

    :ivar load: (s - 1,) in these directions [N], moments over d/2.
    :ivar width: (s - 1,) what friction takes of it all the same, not negative [N].
    :ivar slope: (s - 1, s) derivatives of the load by the indentations of the members [N/m].
    """

    load: Array
    width: Array
    slope: Array


def imbalance(
    config: Configuration,
    cylinder: Cylinder,
    analysis: GraspAnalysis,
    external_wrench: ArrayLike,
    members: Sequence[int],
    depths: Array,
    friction: float,
) -> Imbalance | None:
    """
    Return the load that friction cannot take, or None where a member does not press.

    :param config: configuration of the robot.
    :param cylinder: the object.
    :param analysis: of the grasp.
    :param external_wrench: (fx, fy, m) on the object [N, N m].
    :param members: the s grasping members.
    :param depths: (s,) indentation of each, positive [m].
    :param friction: coefficient.
    """
    topology, points = config.robot.topology, config.points
    pressing = [analysis.contact_forces.get(config.robot.member_names[i], 0.0) for i in members]
    if min(pressing) <= 0.0:
        return None
    numbers = list(members)
    begin, end = points[topology.b[numbers]], points[topology.c[topology.following[numbers]]]
    inward = nearest_on_segment(complex(*cylinder.center), begin, end).normal
    # As if each member were a spring of its own; the caller's secants correct it.
    stiffness = np.array(pressing) / depths
    model = np.stack([inward.real * stiffness, inward.imag * stiffness, np.zeros(len(members))])

    touching = analysis.normal_forces > 0.0
    normals, forces = analysis.normals[touching], analysis.normal_forces[touching]
    wrench = np.asarray(external_wrench) / (1.0, 1.0, 0.5 * cylinder.diameter)
    load = wrench - np.append(forces @ normals, 0.0)
    if len(members) > 2:
        return Imbalance(load[:2], np.zeros(2), model[:2])
    tangents = np.column_stack([-normals[:, 1], normals[:, 0], np.ones(len(forces))])
    segments = forces[:, None] * tangents
    across = np.linalg.svd(segments)[2][2]
    slope = across @ model
    turn = 1.0 if slope[0] >= slope[1] else -1.0  # an axis has no sign: always the same one
    width = friction * np.abs(segments @ across).sum()
    return Imbalance(turn * np.array([across @ load]), np.array([width]), turn * slope[None])
