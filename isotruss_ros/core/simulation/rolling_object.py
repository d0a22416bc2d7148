# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A simulated object that rolls in a grip of any members, in the model without deformation."""

from __future__ import annotations

from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.model.pose import Pose


class RollingObject:
    """
    An object that its contacts carry and roll, as long as all its members touch it.

    From then on it lies where it was.

    :ivar rolling: the grip as it was last.
    :ivar lost: how it left the grip; None while it is in it.
    :param rolling: the grip to begin with.
    """

    def __init__(self, rolling: RollingGrip) -> None:
        self.rolling = rolling
        self.lost: str | None = None

    def pose(self, config: Configuration) -> Pose:
        """
        Return the object's pose in the robot frame; of one that has left the grip, where it lies.

        :param config: configuration of the robot.
        :raises GraspError: the object would leave the grip on the way there.
        """
        if self.lost is not None or config is self.rolling.config:
            return self.rolling.pose
        return self.rolling.moved_to(config).pose

    def follow(self, config: Configuration) -> None:
        """
        Roll with the robot to a configuration, in every step.

        :param config: configuration of the robot.
        """
        if self.lost is not None or config is self.rolling.config:
            return
        try:
            self.rolling = self.rolling.moved_to(config)
        except GraspError as error:
            self.lost = str(error)

    def come_to_rest(self, config: Configuration) -> None:
        """
        Stay in the grip; part of the interface of simulated objects.

        :param config: configuration of the robot.
        """
