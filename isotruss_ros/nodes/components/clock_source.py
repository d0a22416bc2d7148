# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Simulated time that a simulator publishes: faster or slower than the wall's."""

from __future__ import annotations

from isotruss_ros.nodes.framework.cycle import create_steady_timer
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import ParameterError, Spec
from isotruss_ros.nodes.framework.qos import RELIABLE
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage

CLOCK_SPEED = Spec(
    'clock_speed',
    0.0,
    'Simulated seconds that are published on /clock in a second; 0 where another node does',
    bounds=(0.0, 1000.0),
    read_only=True,
)


class ClockSource:
    """
    Publishes `/clock` in equal steps as long as the node is active.

    A node that is too slow for the speed slows the time: no step is left out.

    :param node: publishes; its own clock follows like all others.
    :param rate: steps in a simulated second [Hz].
    :param speed: simulated seconds in a second, positive.
    :raises ParameterError: the node's own time is not simulated.
    """

    def __init__(self, node: ManagedNode, rate: float, speed: float) -> None:
        if not node.get_parameter('use_sim_time').value:
            raise ParameterError(
                f'parameter clock_speed: {speed:g}: must be 0 where use_sim_time is false'
            )
        self._step = round(1e9 / rate)
        # From where the clock stopped when the node was active before.
        self._now = node.get_clock().now().nanoseconds
        self._publisher = node.create_publisher(ClockMessage, '/clock', RELIABLE)
        create_steady_timer(node, 1.0 / (rate * speed), self._tick)

    def _tick(self) -> None:
        self._now += self._step
        self._publisher.publish(ClockMessage(clock=Time(nanoseconds=self._now).to_msg()))
