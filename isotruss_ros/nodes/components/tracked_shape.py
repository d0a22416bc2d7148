# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The configuration of the robot by its joint states; it depends on the path of the rollers."""

from __future__ import annotations

import contextlib

from isotruss_ros.core import Configuration, Robot
from isotruss_ros.core.control.inputs import Input, require_fresh, StampedInput
from isotruss_ros.core.errors import ConfigurationError
from isotruss_ros.core.kinematics.configuration import ConfigurationTracker


class TrackedShape:
    """
    Follows the shape of the robot.

    :ivar timeout: largest age of an input [s].
    :ivar rollers: the latest joint states, a StampedInput of a RollerState.
    :ivar estimate: input of the `EstimatedTravel` whose offsets these have; None without one.
    :param robot: at home when the first joint states come.
    :param timeout: see above.
    """

    def __init__(self, robot: Robot, timeout: float) -> None:
        self.timeout = timeout
        self.rollers: Input = None
        self.estimate: Input = None
        self._shapes = ConfigurationTracker(robot.home)
        self._tracked: Input = None

    def track(self) -> None:
        """Take note of the latest joint states."""
        if self.rollers is self._tracked:
            return
        self._tracked = self.rollers
        if isinstance(self.rollers, StampedInput):
            # The next request reports a configuration that does not exist.
            with contextlib.suppress(ConfigurationError):
                self._shapes.configuration(self.rollers.value.positions)

    def configuration(self, now: float) -> Configuration:
        """
        Return the configuration of the latest joint states.

        :param now: time on the clock of the inputs [s].
        :raises InputError: they are missing, stale or invalid.
        :raises ConfigurationError: no configuration fits them.
        """
        (given,) = require_fresh(now, self.timeout, joint_states=self.rollers)
        return self._shapes.configuration(given.value.positions)
