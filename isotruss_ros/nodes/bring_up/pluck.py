# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Node `pluck`, which measures the oscillation of a held object.

The node moves the object by a short twist and stops it. Then the node fits frequency and damping
ratio to the poses that follow, and ends.
"""

from __future__ import annotations

from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.calibration.measurements import MeasurementError
from isotruss_ros.calibration.oscillation import fit_oscillation, Oscillation
from isotruss_ros.core import ConvexObject, Disc, load_robot, Status
from isotruss_ros.core.inputs import StampedInput
from isotruss_ros.nodes.bring_up.joint_markers import MAX_TOPIC_AGE
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.commands import create_twist_publisher
from isotruss_ros.nodes.framework.parameters import ROBOT, Spec
from isotruss_ros.nodes.framework.runner import StoppableNode
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.topics import RELIABLE
import numpy as np

#: Duration of the push [s], which is short compared with the period of the oscillation.
PUSH_TIME = 0.15
SPECS = (
    ROBOT,
    common.OBJECT_DIAMETER,
    common.OBJECT,
    common.RATE,
    common.USE_STAMPED_TWIST,
    Spec('vx', 0.04, 'Velocity of the push along x [m/s]', (-1.0, 1.0)),
    Spec('vy', 0.0, 'Velocity of the push along y [m/s]', (-1.0, 1.0)),
    Spec(
        'omega',
        0.0,
        "Angular velocity of the push, about the origin of the object's frame [rad/s]",
        (-10.0, 10.0),
    ),
    Spec('listen_time', 3.0, 'Duration of the measurement after the push [s]', (0.5, 60.0)),
    Spec(
        'wait_time',
        10.0,
        'Longest wait for poses and for the status of `manipulation` [s]',
        (0.1, 600.0),
    ),
)


class Pluck(StoppableNode):
    """
    Node that pushes the object once and fits an oscillation to its poses.

    :ivar oscillation: fitted oscillation; None before the fit.
    """

    node_name = 'pluck'
    specs = SPECS

    def start(self) -> None:
        """Create the subscriptions, and wait for pose and status."""
        values = self.values
        self.oscillation: Oscillation | None = None
        robot = load_robot(values.robot)
        body = common.read_described(values) or ConvexObject(Disc(values.object_diameter))
        self._arm = body.arm
        stamped = values.use_stamped_twist
        self._twists = create_twist_publisher(self, stamped, robot.frame)
        self._times: list[float] = []
        self._poses: list[tuple[float, ...]] = []
        self._status: ManipulationStatus | None = None
        self._inputs = Inputs(self, robot, oldest=MAX_TOPIC_AGE)
        self._inputs.keep('pose', take=self._take_pose)
        self.create_subscription(
            ManipulationStatus, 'manipulation/status', self._take_status, RELIABLE
        )
        self._began = self.now()
        self._pushed: float | None = None
        self.create_steady_timer(1.0 / values.rate, self._cycle)

    def stop(self) -> None:
        """Publish a zero twist before the node ends."""
        self._publish_twist(0.0)

    def _take_pose(self, sample: StampedInput) -> None:
        self._times.append(sample.time)
        self._poses.append(tuple(sample.value))

    def _take_status(self, message: ManipulationStatus) -> None:
        self._status = message
        if self._pushed is not None and message.code >= Status.HALT_NO_TWIST:
            raise MeasurementError(
                f'manipulation must not halt during the measurement; it halted: {message.message}'
            )

    def _cycle(self) -> None:
        """Wait for inputs, push the object, record poses, and report the result."""
        now, values = self.now(), self.values
        self._inputs.settle()
        if self._pushed is None:
            self._wait(now)
        elif now < self._pushed + PUSH_TIME:
            self._publish_twist(1.0)
        elif now < self._pushed + PUSH_TIME + values.listen_time:
            self._publish_twist(0.0)
        else:
            self._report()

    def _wait(self, now: float) -> None:
        """Start the push once the object is held and poses are received."""
        self._publish_twist(0.0)
        status, waited = self._status, now - self._began > self.values.wait_time
        if status is not None and status.pose_gain > 0.0:
            raise MeasurementError(
                'squeeze_force of manipulation: must be 0 during the measurement, because squeeze '
                'control changes the oscillation; restore its value afterwards'
            )
        if status is not None and self._poses and status.code < Status.HALT_NO_TWIST:
            self._pushed = now
        elif waited:
            topic = 'manipulation/status' if self._poses else 'object_pose'
            why = f'{topic}: no message in {self.values.wait_time:g} s; a node must publish it'
            if self._poses and status is not None:
                why = f'manipulation: {status.message}'
            raise MeasurementError(why)

    def _report(self) -> None:
        """Fit an oscillation to the poses, print the result, and end the node."""
        times = np.array(self._times)
        after = times > self._pushed + PUSH_TIME
        self.oscillation = fit_oscillation(times[after], np.array(self._poses)[after], self._arm)
        frequency, damping, amplitude = self.oscillation
        self.get_logger().info(
            f'frequency {frequency:.3g} rad/s, damping ratio {damping:.2g}, amplitude '
            f'{1e3 * amplitude:.2g} mm; set the parameter `frequency` of manipulation, and '
            '`tube: damping_ratio` of the robot file'
        )
        self.done = True

    def _publish_twist(self, share: float) -> None:
        values = self.values
        self._twists([share * speed for speed in (values.vx, values.vy, values.omega)])
