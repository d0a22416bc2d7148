# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What an optimiser can choose of a grasp: the parameters of gradients."""

from __future__ import annotations

from typing import NamedTuple

from isotruss_ros.core.kinematics.configuration import Configuration


class GraspParameters(NamedTuple):
    """
    Places of the p parameters among the columns of a gradient.

    :ivar rollers: travel of the r rollers [m].
    :ivar place: x, y, angle of the pose at which the object is set down [m, rad].
    :ivar pressures: gauge, of the t tubes in the order of the robot file [Pa].
    :ivar friction: coefficient.
    :ivar wrench: fx, fy, m on the object [N, N m].
    :ivar stiffness: that of robot and tubes against the model's [-].
    :ivar size: p.
    """

    rollers: slice
    place: slice
    pressures: slice
    friction: int
    wrench: slice
    stiffness: int
    size: int

    @classmethod
    def of(cls, config: Configuration) -> GraspParameters:
        """
        Return those of grasps by a robot.

        :param config: configuration of the robot.
        """
        rollers = len(config.roller_positions)
        tubes = rollers + 3 + len(config.robot.description.pressures)
        return cls(
            rollers=slice(0, rollers),
            place=slice(rollers, rollers + 3),
            pressures=slice(rollers + 3, tubes),
            friction=tubes,
            wrench=slice(tubes + 1, tubes + 4),
            stiffness=tubes + 4,
            size=tubes + 5,
        )
