# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Gauge pressures of the tubes in messages: `sensor_msgs/JointState`, `effort` by tube."""

from __future__ import annotations

from isotruss_ros.core import Robot
from isotruss_ros.core.errors import quote, StructureError
from isotruss_ros.core.statics.section import tube_pressures
from isotruss_ros.nodes.conversions.messages import MessageError
from sensor_msgs.msg import JointState


def read_tube_pressures(message: JointState, robot: Robot) -> tuple[float, ...]:
    """
    Return the gauge pressures (t,) of the tubes, in the order of the robot file [Pa].

    :param message: of the topic `tube_pressures`: all tubes in `name`, pressures in `effort`.
    :param robot: whose tubes they are.
    :raises MessageError: a tube is missing, unknown or named twice, there are not as many
        pressures as names, or one is not a positive number.
    """
    known, names = tuple(robot.description.pressures), message.name
    if sorted(names) != sorted(known):
        raise MessageError(
            f'tube pressures of {quote(", ".join(names))}: must be of {", ".join(known)}, each '
            'once'
        )
    if len(message.effort) != len(names):
        raise MessageError(
            f'tube pressures: {len(message.effort)} values in effort for {len(names)} names; must '
            'be as many'
        )
    try:
        values = dict(zip(names, message.effort, strict=True))
        return tube_pressures(robot.description, values)
    except StructureError as error:
        raise MessageError(f'tube pressures: {error}') from error
