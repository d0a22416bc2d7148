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

from typing import NamedTuple

from isotruss_ros.core.contact.grasp_analysis import GraspAnalysis
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.numerics.arrays import Array, as_xy
from isotruss_ros.core.planning.closing import Closing, outward_normals
import numpy as np
from numpy.typing import ArrayLike


class Imbalance(NamedTuple):
    """
    What friction cannot take, in s - 1 directions for s members.

    :ivar load: (s - 1,) in these directions [N], moments over the arm of the object.
    :ivar slope: (s - 1, s) derivatives of the load by the indentations of the members [N/m].
    """

    load: Array
    slope: Array


def find_imbalance(
    config: Configuration,
    closing: Closing,
    analysis: GraspAnalysis,
    external_wrench: ArrayLike,
    depths: Array,
) -> Imbalance | None:
    """
    Return the load that friction cannot take, or None where a member does not press.

    :param config: configuration of the robot.
    :param closing: what presses on which object.
    :param analysis: of the grasp.
    :param external_wrench: (fx, fy, m) on the object [N, N m].
    :param depths: (s,) indentation of each member, positive [m].
    """
    body, names = closing.body, config.robot.member_names
    pressing = [analysis.contact_forces.get(names[i], 0.0) for i in closing.members]
    if min(pressing) <= 0.0:
        return None
    # As if each member were a spring of its own; the caller's secants correct it.
    stiffness = np.array(pressing) / depths
    inward = -outward_normals(config, closing)
    model = np.stack([inward.real * stiffness, inward.imag * stiffness, np.zeros(len(inward))])
    wrench = np.asarray(external_wrench) + analysis.normal_wrench
    load = wrench / (1.0, 1.0, body.arm)
    if len(inward) > 2:
        return Imbalance(load[:2], model[:2])
    touching = analysis.normal_forces > 0.0
    normals = analysis.normals[touching]
    arms = analysis.points[touching] - as_xy(np.array([body.center]))
    moments = (arms * normals).sum(axis=1) / body.arm
    tangents = np.column_stack([-normals[:, 1], normals[:, 0], moments])
    across = np.linalg.svd(analysis.normal_forces[touching, None] * tangents)[2][2]
    slope = across @ model
    turn = 1.0 if slope[0] >= slope[1] else -1.0  # an axis has no sign: always the same one
    return Imbalance(turn * np.array([across @ load]), turn * slope[None])
