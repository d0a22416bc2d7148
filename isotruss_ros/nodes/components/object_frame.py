"""The frame that wrenches on the object are about, as a transform on `/tf`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from geometry_msgs.msg import TransformStamped
from isotruss_ros.nodes.conversions.messages import name_object_frame, stamp_header
from rclpy.qos import QoSProfile

if TYPE_CHECKING:
    from isotruss_ros.nodes.framework.managed import ManagedNode
    from rclpy.time import Time

try:
    from tf2_msgs.msg import TFMessage
except ModuleNotFoundError:  # every ROS installation has it, but there are no wheels of it
    TFMessage = None

#: As the broadcasters of tf2 have it.
TRANSFORMS = QoSProfile(depth=100)


class ObjectFrame:
    """
    Broadcasts where the object's centre is; its axes are parallel to those of the robot's frame.

    Without `tf2_msgs` nothing is broadcast, which the log states.

    :param node: publishes.
    :param frame: the robot's frame.
    """

    def __init__(self, node: ManagedNode, frame: str) -> None:
        self._frame = frame
        self._transforms = None
        if TFMessage is None:
            node.get_logger().info(
                f'tf2_msgs is not installed: {name_object_frame(frame)} is not on /tf'
            )
            return
        self._transforms = node.create_lifecycle_publisher(TFMessage, '/tf', TRANSFORMS)

    def broadcast(self, center: tuple[float, float], time: Time) -> None:
        """
        Publish the transform from the robot's frame.

        :param center: of the object, robot frame [m].
        :param time: when it was measured.
        """
        if self._transforms is None:
            return
        transform = TransformStamped(child_frame_id=name_object_frame(self._frame))
        stamp_header(transform.header, time, self._frame)
        transform.transform.translation.x, transform.transform.translation.y = center
        transform.transform.rotation.w = 1.0
        self._transforms.publish(TFMessage(transforms=[transform]))
