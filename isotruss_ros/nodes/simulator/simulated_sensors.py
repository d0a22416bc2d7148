# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulated encoders, object tracker and joint markers, with faults."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import math

from geometry_msgs.msg import PoseStamped
from isotruss_ros.core import Pose, Robot
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.nodes.conversions.messages import make_header, to_pose_message
from isotruss_ros.nodes.conversions.sensor_messages import to_joint_markers
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import FixedSpec, ParameterError, Parameters, Spec
from isotruss_ros.nodes.simulator.plants import Plant
import numpy as np
from numpy.typing import ArrayLike
from sensor_msgs.msg import JointState, MultiDOFJointState

#: Distance between the two marks from which a tracker computes the object's angle [m].
MARK_DISTANCE = 0.1
#: Largest difference between times that count as equal, such as sums of periods [s].
TIME_TOLERANCE = 1e-6
ALL_JOINTS = 'all'
#: Smallest resolution that is simulated [m]; numbers of steps may overflow below 1e-300 m.
MIN_ENCODER_STEP = 1e-9
SENSOR_SPECS = (
    Spec('encoder_delay', 0.0, 'Delay of joint_states relative to their stamps [s]', (0.0, 10.0)),
    Spec('encoder_step', 0.0, 'Resolution of the encoders [m]; below 1e-9: exact', (0.0, 0.1)),
    Spec(
        'tracker_rate',
        0.0,
        'Rate of object_pose and joint_markers [Hz]; 0: one message per cycle',
        (0.0, 1000.0),
    ),
    Spec(
        'tracker_delay',
        0.0,
        'Delay of object_pose and joint_markers relative to their stamps [s]',
        (0.0, 10.0),
    ),
    Spec('tracker_dropouts', 0.0, 'Probability that a pose or a marker is lost [-]', (0.0, 1.0)),
    Spec(
        'tracker_noise',
        0.0,
        'Standard deviation of the coordinates of poses and markers [m]; that of the angle of a '
        f'pose is this value divided by {MARK_DISTANCE} m [rad]',
        (0.0, 0.1),
    ),
    FixedSpec(
        'marker_joints',
        [''],
        f"Names of the joints with markers; ['{ALL_JOINTS}'], or [''] for none",
    ),
)


class SensorChannel:
    """Measurements of one sensor, which can be sampled at a rate, noisy, delayed or lost."""

    def __init__(self, seed: tuple[int, ...]) -> None:
        self._random = np.random.default_rng(seed)
        self._period: int | None = None
        self._pending: deque[tuple[float, Array]] = deque()

    def measure(
        self,
        time: float,
        read: Callable[[], ArrayLike],
        rate: float = 0.0,
        delay: float = 0.0,
        dropouts: float = 0.0,
        noise: ArrayLike = 0.0,
    ) -> list[tuple[float, Array]]:
        """
        Make a measurement if its time has come; return the measurements that have arrived.

        If the time was set back, measurements that have not arrived yet are discarded.

        :param time: current time [s].
        :param read: function that returns the true values (k, n); it is called only when a
            measurement is made.
        :param rate: rate of the measurements [Hz], at most one measurement per call; 0: one
            measurement in each call.
        :param delay: time from a measurement to its arrival [s].
        :param noise: standard deviation, one number for all values or one for each value
            of a row [unit of the values].
        :return: time [s] and values (k, n) of each measurement, the oldest first. Lost rows are
            NaN; measurements whose rows are all lost are left out.
        """
        pending = self._pending
        if pending and pending[-1][0] > time:
            pending.clear()
        period = math.floor((time + TIME_TOLERANCE) * rate)
        if rate == 0.0 or period != self._period:
            self._period = period
            values = np.atleast_2d(np.asarray(read(), dtype=float))
            # Drawn always, so that the noise of a seed does not depend on the dropouts.
            deviation = self._random.normal(size=values.shape)
            chance = self._random.random(len(values))
            measured = values + np.asarray(noise) * deviation
            measured[chance < dropouts] = np.nan
            if (chance >= dropouts).any():
                pending.append((time, measured))
        arrived = []
        while pending and pending[0][0] + delay <= time + TIME_TOLERANCE:
            arrived.append(pending.popleft())
        return arrived


class SimulatedSensors:
    """Sensors of a simulated robot and its object."""

    def __init__(self, node: ManagedNode, robot: Robot, values: Parameters) -> None:
        self._robot, self._values = robot, values
        self._marked = _find_marked(robot, values)
        # Separate random streams: the noise of one sensor is independent of the faults of another.
        self._encoders, self._tracker, self._markers = (
            SensorChannel((values.seed, stream)) for stream in (3, 4, 5)
        )
        self._joint_states = node.advertise(JointState, 'joint_states')
        self._object_pose = node.advertise(PoseStamped, 'object_pose')
        self._joint_markers = node.advertise(MultiDOFJointState, 'joint_markers')

    def publish(self, now: float, plant: Plant) -> None:
        """Make new measurements, and publish the measurements that have arrived."""
        values, travel, step = self._values, plant.roller_positions, self._values.encoder_step
        counted = step * np.round(travel / step) if step >= MIN_ENCODER_STEP else travel
        encoders = self._encoders.measure(
            now, lambda: np.append(counted, plant.roller_velocities), delay=values.encoder_delay
        )
        for time, measured in encoders:
            positions, velocities = np.split(measured[0], 2)
            states = JointState(
                header=make_header(time),
                name=list(self._robot.roller_names),
                position=positions.tolist(),
                velocity=velocities.tolist(),
            )
            self._joint_states.publish(states)
        tracker = values.tracker_rate, values.tracker_delay, values.tracker_dropouts
        noise = values.tracker_noise * np.array([1.0, 1.0, 1.0 / MARK_DISTANCE])
        for time, measured in self._tracker.measure(
            now, lambda: plant.object_pose, *tracker, noise
        ):
            header = make_header(time, self._robot.frame)
            message = to_pose_message(Pose(*measured[0].tolist()))
            self._object_pose.publish(PoseStamped(header=header, pose=message))
        if not self._marked:
            return
        places = [self._robot.topology.joint_names.index(name) for name in self._marked]
        noise = values.tracker_noise
        for time, measured in self._markers.measure(
            now, lambda: plant.joints[places], *tracker, noise
        ):
            seen = np.flatnonzero(np.isfinite(measured[:, 0]))
            markers = to_joint_markers({self._marked[i]: measured[i] for i in seen})
            markers.header = make_header(time, self._robot.frame)
            self._joint_markers.publish(markers)


def _find_marked(robot: Robot, values: Parameters) -> tuple[str, ...]:
    """Return the names of the joints with markers."""
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
