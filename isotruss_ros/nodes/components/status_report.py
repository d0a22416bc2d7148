# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""What the manipulation node reports of every cycle: status, diagnostics and log."""

from __future__ import annotations

from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import Status
from isotruss_ros.core.control.twist_servo import Decision
from isotruss_ros.nodes.conversions.messages import stamp_header, to_twist_message
from isotruss_ros.nodes.framework.diagnostics import Level, WarningThrottle
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.qos import RELIABLE
from rclpy.time import Time

#: Statuses that are no warning: no motion is commanded, or all is well.
NORMAL = frozenset(
    {Status.OK, Status.IDLE, Status.FOLLOWING_TRAJECTORY, Status.ARRIVED, Status.HALT_NO_TWIST}
)


class StatusReport:
    """
    Report the decisions of the servo; created whenever the node is configured.

    :ivar status: of the last cycle.
    :param node: publishes.
    :param frame: the robot's frame.
    """

    def __init__(self, node: ManagedNode, frame: str) -> None:
        self._publisher = node.create_lifecycle_publisher(
            ManipulationStatus, 'manipulation/status', RELIABLE
        )
        self._frame, self._node, self._gain = frame, node, 0.0
        self._throttle = WarningThrottle(node.get_logger())
        self.status = Status.OK

    def publish(self, decision: Decision, now: Time) -> None:
        """
        Publish a decision; log it where the twist is not carried out as commanded.

        :param decision: of this cycle.
        :param now: time of the cycle.
        """
        command, cycle = decision.command, self._node.cycle
        status = self.status = command.status
        message = ManipulationStatus(
            code=int(status),
            message=decision.message,
            commanded=to_twist_message(decision.twist),
            achieved=to_twist_message(command.achieved_twist),
            scale=command.scale,
            reachable_dof=command.reachable_dof,
            failed_rollers=decision.failed,
            cycle_time=0.0 if cycle is None else cycle.duration,
            frequency=decision.frequency,
            pose_gain=decision.pose_gain,
            squeeze=decision.squeeze[0],
            squeeze_deviation=decision.squeeze[1],
        )
        stamp_header(message.header, now, self._frame)
        self._publisher.publish(message)
        self._log_gain(decision)
        level = Level.WARN if status < Status.HALT_NO_TWIST else Level.ERROR
        if status in NORMAL:
            level = Level.WARN if decision.failed else Level.OK
        text = decision.message or status.name
        if decision.failed:
            text = f'failed rollers: {", ".join(decision.failed)}; {text}'
        self._node.diagnostics.set_status(level, text)
        if level is not Level.OK:
            self._throttle.warn(status.name, f'{status}: {text}')

    def _log_gain(self, decision: Decision) -> None:
        """Log the gain, and the frequency from which it follows, when an object is taken."""
        before, self._gain = self._gain, decision.pose_gain
        if decision.pose_gain and not before:
            known = f'{decision.frequency:.3g} rad/s' if decision.frequency else 'not known'
            self._node.get_logger().info(
                f'lowest frequency of the held object: {known}; pose gain {self._gain:.3g} 1/s'
            )
