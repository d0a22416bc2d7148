# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Publishers of true states and of simulated time, which exist only in simulation."""

from __future__ import annotations

from geometry_msgs.msg import PoseStamped, WrenchStamped
from isotruss_ros.core import Robot
from isotruss_ros.nodes.conversions.grasp_messages import ContactForces
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.conversions.sensor_messages import to_joint_markers
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError
from isotruss_ros.nodes.framework.topics import EVENTS, RELIABLE
from isotruss_ros.nodes.simulator.plants import Plant
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import MultiDOFJointState

CLOCK_SPEED = FixedSpec(
    'clock_speed',
    0.0,
    'Speed of simulated time on /clock [s/s]; 0 if published by another node',
    (0.0, 1000.0),
)


class SimulatedTruth:
    """Publisher of `truth/object_pose`, `truth/joint_markers` and `truth/contact_forces`."""

    def __init__(self, node: ManagedNode, robot: Robot) -> None:
        self._robot, self._contacts = robot, ContactForces(robot.frame)
        self._pose = node.advertise(PoseStamped, 'truth/object_pose')
        self._joints = node.advertise(MultiDOFJointState, 'truth/joint_markers')
        self._forces = node.advertise(WrenchStamped, 'truth/contact_forces', EVENTS)

    def publish(self, now: float, plant: Plant) -> None:
        """Publish the true states on the topics that have subscribers."""
        header = make_header(now, self._robot.frame)
        if self._pose.get_subscription_count():
            self._pose.publish(PoseStamped(header=header, pose=to_pose_message(plant.object_pose)))
        if self._joints.get_subscription_count():
            names = self._robot.topology.joint_names
            markers = to_joint_markers(dict(zip(names, plant.joints, strict=True)))
            markers.header = header
            self._joints.publish(markers)
        if self._forces.get_subscription_count():
            for message in self._contacts.make_messages(now, plant.normal_forces, {}):
                self._forces.publish(message)


class ClockSource:
    """
    Publisher of `/clock`, which advances in equal steps while the node is active.

    If the computer is too slow, simulated time slows down; no step is skipped.

    :param rate: number of steps per simulated second [Hz].
    :param speed: ratio of simulated time to real time, positive [-].
    """

    def __init__(self, node: ManagedNode, rate: float, speed: float) -> None:
        if not node.get_parameter('use_sim_time').value:
            raise ParameterError(
                f'parameter clock_speed: {speed:g}: must be 0 if use_sim_time is false'
            )
        self._step = round(1e9 / rate)
        # Continues from the last active time.
        self._now = node.get_clock().now().nanoseconds
        self._publisher = node.create_publisher(ClockMessage, '/clock', RELIABLE)
        node.create_steady_timer(1.0 / (rate * speed), self._tick)

    def _tick(self) -> None:
        self._now += self._step
        self._publisher.publish(ClockMessage(clock=Time(nanoseconds=self._now).to_msg()))
