# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sensors of a simulated robot: encoders, object pose, joint markers."""

from __future__ import annotations

from collections.abc import Callable

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Pose, Robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.simulation.sensor_channel import SensorChannel, SensorFaults
from isotruss_ros.nodes.conversions.marker_messages import to_joint_markers
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError, Parameters, Spec
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np
from sensor_msgs.msg import JointState, MultiDOFJointState

#: Distance of the marks by which a tracker measures the angle of an object [m].
MARK_DISTANCE = 0.1
ALL_JOINTS = 'all'
SENSOR_SPECS = (
    Spec('encoder_delay', 0.0, 'Delay of joint_states after their stamp [s]', (0.0, 10.0)),
    Spec('encoder_step', 0.0, 'Resolution of the encoders [m]', (0.0, 0.1)),
    Spec(
        'tracker_rate',
        0.0,
        'Rate of object_pose and joint_markers; 0: one message per cycle [Hz]',
        (0.0, 1000.0),
    ),
    Spec(
        'tracker_delay',
        0.0,
        'Delay of object_pose and joint_markers after their stamp [s]',
        (0.0, 10.0),
    ),
    Spec('tracker_dropouts', 0.0, 'Probability of the loss of a pose or marker [-]', (0.0, 1.0)),
    Spec(
        'tracker_noise',
        0.0,
        f'Standard deviation of their coordinates [m]; of the angle: over {MARK_DISTANCE} m [rad]',
        (0.0, 0.1),
    ),
    FixedSpec(
        'marker_joints', [''], f"Joints that have markers; ['{ALL_JOINTS}'], or [''] for none"
    ),
)


class SimulatedSensors:
    """
    Measures a simulated robot and its object.

    :param node: publishing node.
    :param robot: the robot.
    :param values: values of `SENSOR_SPECS`.
    :param seed: seed of noise and dropouts.
    :raises ParameterError: a marker at a joint that the robot does not have.
    """

    def __init__(self, node: ManagedNode, robot: Robot, values: Parameters, seed: int) -> None:
        self._robot, self._values = robot, values
        self._marked = _find_marked(robot, values)
        # Separate random streams: the noise of one sensor is independent of the faults of another.
        self._encoders, self._tracker, self._markers = (
            SensorChannel(SensorFaults(), (seed, stream)) for stream in (3, 4, 5)
        )
        self.apply()
        make = node.create_lifecycle_publisher
        self._joint_states = make(JointState, 'joint_states', RELIABLE)
        self._object_pose = make(PoseStamped, 'object_pose', RELIABLE)
        self._joint_markers = make(MultiDOFJointState, 'joint_markers', RELIABLE)

    def apply(self) -> None:
        """Apply the current values of the parameters."""
        values, none = self._values, np.zeros(len(self._robot.roller_names))
        step = np.append(none + values.encoder_step, none)
        self._encoders.faults = SensorFaults(delay=values.encoder_delay, step=step)
        tracker = values.tracker_rate, values.tracker_delay, values.tracker_dropouts
        noise = values.tracker_noise * np.array([1.0, 1.0, 1.0 / MARK_DISTANCE])
        self._tracker.faults = SensorFaults(*tracker, noise)
        self._markers.faults = SensorFaults(*tracker, values.tracker_noise)

    def publish(
        self, now: float, travel: Array, speeds: Array, pose: Pose, joints: Callable[[], Array]
    ) -> None:
        """
        Publish the measurements due by now.

        :param now: time of the simulated robot [s].
        :param travel: (r,) roller travel since home [m].
        :param speeds: (r,) roller speeds [m/s].
        :param pose: pose of the object.
        :param joints: function that returns the joint positions (j, 2) [m].
        """
        for found in self._encoders.measure(now, lambda: np.append(travel, speeds)):
            positions, velocities = np.split(found.values[0], 2)
            states = JointState(
                header=make_header(found.time),
                name=list(self._robot.roller_names),
                position=positions.tolist(),
                velocity=velocities.tolist(),
            )
            self._joint_states.publish(states)
        for found in self._tracker.measure(now, lambda: pose):
            header = make_header(found.time, self._robot.frame)
            measured = to_pose_message(Pose(*found.values[0].tolist()))
            self._object_pose.publish(PoseStamped(header=header, pose=measured))
        if not self._marked:
            return
        for found in self._markers.measure(now, lambda: self._marker_places(joints())):
            places = {self._marked[i]: found.values[i] for i in np.flatnonzero(found.seen)}
            markers = to_joint_markers(places)
            markers.header = make_header(found.time, self._robot.frame)
            self._joint_markers.publish(markers)

    def _marker_places(self, joints: Array) -> Array:
        """Return the positions of the marked joints (k, 2) [m]."""
        return joints[[self._robot.topology.joint_names.index(name) for name in self._marked]]


def _find_marked(robot: Robot, values: Parameters) -> tuple[str, ...]:
    """Return the marked joints."""
    known = robot.topology.joint_names
    named = tuple(name for name in values.marker_joints if name)
    if named == (ALL_JOINTS,):
        return tuple(known)
    unknown = [name for name in named if name not in known]
    if unknown:
        raise ParameterError(
            f'parameter marker_joints: {", ".join(unknown)}: must be of {", ".join(known)}, '
            f'or {ALL_JOINTS} alone'
        )
    return named
