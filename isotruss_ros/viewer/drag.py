# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The twist by which what is dragged follows its handle."""

from __future__ import annotations

import math

#: Speed for a distance [1/s], and the distance that counts as reached [m].
GAIN, REACHED = 2.0, 0.001


def drag_twist(
    position: tuple[float, float], target: tuple[float, float], max_speed: float
) -> tuple[float, float]:
    """
    Return the velocity (vx, vy) toward a target [m/s], zero once it is reached.

    :param position: (x, y) of what is dragged [m].
    :param target: (x, y) of the handle [m].
    :param max_speed: largest speed [m/s].
    """
    dx, dy = target[0] - position[0], target[1] - position[1]
    distance = math.hypot(dx, dy)
    if distance < REACHED:
        return 0.0, 0.0
    speed = min(GAIN * distance, max_speed)
    return speed * dx / distance, speed * dy / distance
