# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What is true of a simulated robot, for who judges estimates; published where that is heard."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Pose, Robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.nodes.conversions.marker_messages import to_joint_markers
from isotruss_ros.nodes.conversions.messages import stamp_header, to_pose_message
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.qos import RELIABLE
from rclpy.time import Time
from sensor_msgs.msg import JointState, MultiDOFJointState


class SimulatedTruth:
    """
    Publish `truth/object_pose`, `truth/joint_markers` and `truth/contact_forces`.

    :param node: publishes.
    :param robot: that is simulated.
    """

    def __init__(self, node: ManagedNode, robot: Robot) -> None:
        self._robot = robot
        make = node.create_lifecycle_publisher
        self._pose = make(PoseStamped, 'truth/object_pose', RELIABLE)
        self._joints = make(MultiDOFJointState, 'truth/joint_markers', RELIABLE)
        self._forces = make(JointState, 'truth/contact_forces', RELIABLE)

    def publish(
        self,
        now: Time,
        pose: Pose,
        joints: Callable[[], Array],
        forces: Callable[[], Mapping[str, float]],
    ) -> None:
        """
        Publish what has a subscriber.

        :param now: time of the simulated robot.
        :param pose: of the object.
        :param joints: returns where the joints are (j, 2) [m].
        :param forces: returns the normal forces of the members on the object, by member [N].
        """
        frame = self._robot.frame
        if self._pose.get_subscription_count():
            placed = PoseStamped(pose=to_pose_message(pose))
            stamp_header(placed.header, now, frame)
            self._pose.publish(placed)
        if self._joints.get_subscription_count():
            names = self._robot.topology.joint_names
            markers = to_joint_markers(dict(zip(names, joints(), strict=True)))
            stamp_header(markers.header, now, frame)
            self._joints.publish(markers)
        if self._forces.get_subscription_count():
            found = forces()
            pressing = JointState(name=list(found), effort=list(found.values()))
            stamp_header(pressing.header, now, frame)
            self._forces.publish(pressing)
