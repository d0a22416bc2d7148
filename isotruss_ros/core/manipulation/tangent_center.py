# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where an object touches both grasping members of a module."""

from __future__ import annotations

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.grip import find_members, members_at
from isotruss_ros.core.model.shapes import Disc
from isotruss_ros.core.numerics.arrays import finite_array
import numpy as np


def tangent_center(
    config: Configuration, module: str, diameter: float, indentation: float = 0.0
) -> tuple[float, float]:
    """
    Return the centre at which an object is tangent to both grasping members of a module.

    :param config: configuration of the robot.
    :param module: name `t/j` of the module.
    :param diameter: the object's own diameter [m].
    :param indentation: how much closer to the corner of the two members the centre is [m].
    :return: (x, y) in the robot frame [m].
    :raises GraspError: no such module, diameter not positive, indentation not finite, or the
        object would have to be behind the module or beyond the end of a member.
    """
    (depth,) = finite_array([indentation], 1, 'indentation [m]', GraspError)
    nodes, points = find_members(config.robot, members_at(config.robot, module)), config.points
    # The member ahead starts at the module's B, the one behind ends at its C.
    b, c = points.item(nodes.starts[0]), points.item(nodes.ends[1])
    ahead, back = points.item(nodes.ends[0]) - b, points.item(nodes.starts[1]) - c
    side = 1.0 if (ahead.conjugate() * back).imag > 0.0 else -1.0
    own_radius = 0.5 * Disc(diameter).diameter
    reach = own_radius + 0.5 * config.robot.description.tube_diameter
    normals = np.array([1j * side * ahead / abs(ahead), -1j * side * back / abs(back)])
    # Distance from both lines is `reach`: Re(conj(normal) (center - foot)) = reach.
    right = (normals.conj() * np.array([b, c])).real + reach
    x, y = np.linalg.solve(normals.view(np.float64).reshape(2, 2), right)
    center = complex(x, y) - depth * complex(normals.sum() / abs(normals.sum()))
    along = np.array(
        [
            (ahead.conjugate() * (center - b)).real / abs(ahead) ** 2,
            (back.conjugate() * (center - c)).real / abs(back) ** 2,
        ]
    )
    if along.min() < 0.0 or along.max() > 1.0:
        raise GraspError(
            f'an object of diameter {diameter} m does not fit between the members at module '
            f'{module}: it would touch them at {along.round(3).tolist()} of their lengths; '
            'take another diameter, module or configuration'
        )
    return center.real, center.imag
