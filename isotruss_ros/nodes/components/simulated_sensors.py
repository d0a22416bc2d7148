# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What sensors of a simulated robot measure: joint markers and the object's pose, with faults."""

from __future__ import annotations

from isotruss_ros.core import Pose, Robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.nodes.conversions.marker_messages import to_joint_markers
from isotruss_ros.nodes.conversions.messages import stamp_header
from isotruss_ros.nodes.framework import parameters as params
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import Parameters
from isotruss_ros.nodes.framework.qos import RELIABLE
import numpy as np
from rclpy.time import Time
from sensor_msgs.msg import MultiDOFJointState

MARKER_RATE = params.Spec(
    'marker_rate', 0.0, 'Messages of joint_markers in a second; none if 0 [Hz]', (0.0, 1000.0)
)
MARKER_NOISE = params.Spec(
    'marker_noise', 0.0, 'Standard deviation of a coordinate of a marker [m]', (0.0, 0.1)
)
MARKER_DROPOUTS = params.Spec(
    'marker_dropouts', 0.0, 'Share of the markers that a message lacks', (0.0, 1.0)
)
POSE_NOISE = params.Spec(
    'pose_noise', 0.0, "Standard deviation of x and y of the object's pose [m]", (0.0, 0.1)
)
ANGLE_NOISE = params.Spec('angle_noise', 0.0, 'Standard deviation of its angle [rad]', (0.0, 1.0))
SENSOR_SPECS = (MARKER_RATE, MARKER_NOISE, MARKER_DROPOUTS, POSE_NOISE, ANGLE_NOISE)


class SimulatedSensors:
    """
    Measure a simulated robot and its object.

    :param node: publishes `joint_markers`.
    :param robot: whose joints they are.
    :param values: of `SENSOR_SPECS`.
    :param seed: of the noise.
    """

    def __init__(self, node: ManagedNode, robot: Robot, values: Parameters, seed: int) -> None:
        self._robot, self._values = robot, values
        self._rng = np.random.default_rng(seed)
        self._markers = node.create_lifecycle_publisher(
            MultiDOFJointState, 'joint_markers', RELIABLE
        )
        self._due = 0.0

    def measure_pose(self, pose: Pose) -> Pose:
        """
        Return the pose of the object as it is measured.

        :param pose: where it is.
        """
        values = self._values
        noise = self._rng.normal(size=3)
        noise *= (values[POSE_NOISE], values[POSE_NOISE], values[ANGLE_NOISE])
        return Pose(*(np.array(pose) + noise).tolist())

    def publish_markers(self, joints: Array, now: Time) -> None:
        """
        Publish the joints as they are measured, where the next message is due.

        :param joints: (j, 2) where they are [m].
        :param now: time of the simulated robot.
        """
        rate, seconds = self._values[MARKER_RATE], 1e-9 * now.nanoseconds
        if rate == 0.0 or 0.0 < self._due - seconds < 1.0 / rate:
            return
        self._due = seconds + 1.0 / rate
        measured = joints + self._values[MARKER_NOISE] * self._rng.normal(size=joints.shape)
        seen = self._rng.random(len(joints)) >= self._values[MARKER_DROPOUTS]
        names = np.array(self._robot.topology.joint_names)[seen].tolist()
        message = to_joint_markers(dict(zip(names, measured[seen], strict=True)))
        stamp_header(message.header, now, self._robot.frame)
        self._markers.publish(message)
