# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the twist servo, and publication of the servo's decisions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import math

from diagnostic_msgs.msg import DiagnosticStatus
from isotruss_msgs.msg import HeldGrip, ManipulationStatus
from isotruss_ros.core import ConvexObject, Grip, Obstacle, Pose, Robot, Status
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.safety.roller_failure import FAILURE_TIME
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_settings import (
    MAX_OBJECT_ACCELERATION,
    ServoSettings,
    SqueezeSettings,
)
from isotruss_ros.core.servo.squeeze_control import SqueezeControl
from isotruss_ros.nodes.conversions.messages import (
    HELD_VALUES,
    make_header,
    to_pose_message,
    to_twist_message,
)
from isotruss_ros.nodes.conversions.state_messages import to_grip_message
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import Parameters, Spec
from isotruss_ros.nodes.framework.topics import FIRST_RECORDS, RECORDS
from std_msgs.msg import String

#: Statuses that cause no warning.
NORMAL_STATUSES = frozenset(
    {
        Status.OK,
        Status.IDLE,
        Status.FOLLOWING_TRAJECTORY,
        Status.ARRIVED,
        Status.ACCELERATING,
        Status.HALT_NO_TWIST,
    }
)
#: Smallest period of messages about the held object [s], equal to the period of grasp analyses.
GRIP_PERIOD = 0.04
UNKNOWN_POSE = Pose(math.nan, math.nan, math.nan)
BOUNDS = ShapeBounds()
SPECS = (
    common.FRICTION,
    common.PRESSURE_TIMEOUT,
    common.AMBIENT_PRESSURE,
    Spec(
        'squeeze_force',
        0.0,
        'Desired mean normal force of the grasping members [N]; 0: the angle between the grasping '
        'members is constant',
        (0.0, 1000.0),
    ),
    Spec(
        'object_mass',
        0.0,
        'Mass of the object [kg]; 0: the mass in the description of the object. If the mass is '
        'unknown, the gains are low',
        (0.0, 1000.0),
    ),
    Spec(
        'frequency',
        0.0,
        'Lowest natural frequency of the held object [rad/s]; 0: computed from the masses',
        (0.0, 1000.0),
    ),
    Spec(
        'expected_load',
        0.0,
        'Size of the expected external loads on the object [N], used with squeeze_force; 0: 2 N',
        (0.0, 1000.0),
    ),
    Spec(
        'zero_deviation',
        0.0,
        'Standard deviation of the roller offsets [m], used with squeeze_force unless '
        'state_estimator runs; 0: that of the robot file, or 10 mm without calibrate_home',
        (0.0, 1.0),
    ),
    common.OBJECT_DIAMETER,
    common.GRIP_MODULE,
    common.GRIP,
    common.RATE,
    common.COMMAND_TIMEOUT,
    Spec('min_rigidity', BOUNDS.min_rigidity, 'Smallest rigidity index (1 at home)', (0.0, 0.99)),
    Spec(
        'min_clearance',
        BOUNDS.min_clearance,
        'Smallest distance between parts of the robot that are not fixed to each other [m]',
        (0.0, 1.0),
    ),
    Spec(
        'min_object_clearance',
        BOUNDS.min_object_clearance,
        'Smallest distance between the object and parts outside the grip [m]',
        (0.0, 1.0),
    ),
    Spec(
        'min_obstacle_clearance',
        BOUNDS.min_obstacle_clearance,
        'Smallest distance of robot and object from obstacles [m]',
        (0.0, 1.0),
    ),
    common.OBSTACLE_TIMEOUT,
    Spec(
        'slide_along_limits',
        True,
        'Project twists on the limits of the configuration; if false, twists are scaled',
    ),
    Spec(
        'max_object_acceleration',
        MAX_OBJECT_ACCELERATION,
        'Largest acceleration of the object by commands [m/s^2]; rotations count by the '
        'velocity of the surface',
        (0.001, 100.0),
    ),
    Spec(
        'failed_rollers', [''], "Names t/j of failed rollers, whose command is zero; [''] for none"
    ),
    Spec(
        'failure_time',
        FAILURE_TIME,
        'Time after which a roller that is commanded at 2 mm/s or more and does not move has '
        'failed [s]; 0: no detection',
        (0.0, 60.0),
    ),
)


def make_settings(
    robot: Robot,
    values: Parameters,
    described: ConvexObject | None,
    joint: str | None,
    obstacles: tuple[Obstacle, ...] = (),
) -> ServoSettings:
    """
    Return the settings of the servo that the parameters specify.

    :param described: object of the parameter `object`; None for a disc with the parameter
        `object_diameter`.
    :param joint: joint that is moved by twists; None: twists move the object.
    :param obstacles: obstacles at rest.
    """
    body = common.make_body(values, described)
    if values.object_mass:
        body = replace(body, mass=values.object_mass)
    squeeze = None
    if values.squeeze_force != 0.0:
        squeeze = SqueezeSettings(
            values.squeeze_force,
            frequency=values.frequency or None,
            load=values.expected_load,
            zero_deviation=values.zero_deviation or None,
        )
    return ServoSettings(
        Grip(common.select_grip(robot, values), body),
        period=1.0 / values.rate,
        timeout=values.command_timeout,
        joint=joint,
        squeeze=squeeze,
        bounds=ShapeBounds(
            values.min_rigidity,
            values.min_clearance,
            values.min_object_clearance,
            min_obstacle_clearance=values.min_obstacle_clearance,
        ),
        slide_along_limits=values.slide_along_limits,
        failure_time=values.failure_time or math.inf,  # 0 means never
        pressure_timeout=values.pressure_timeout,
        obstacles=obstacles,
        obstacle_timeout=values.obstacle_timeout,
        max_object_acceleration=values.max_object_acceleration,
    )


class StatusReport:
    """Publisher of the servo's decisions, created whenever the node is configured."""

    def __init__(self, node: ManagedNode, robot: Robot) -> None:
        self._publisher = node.advertise(ManipulationStatus, 'manipulation/status')
        self._grips = node.advertise(HeldGrip, 'manipulation/grip')
        self._cycles = node.advertise(String, 'manipulation/cycle', RECORDS)
        self._recorded = 0  # number of published records
        self._robot, self._frame, self._node = robot, robot.frame, node
        self._told = 0.0
        self.status = Status.OK  #: status of the last cycle

    def publish_record(self, describe: Callable[[], str]) -> None:
        """
        Publish the record of a cycle to subscribers, and the first records in any case.

        A subscriber that is discovered after the first cycles receives these, too.

        :param describe: function that returns the text of the record.
        """
        if self._recorded < FIRST_RECORDS or self._cycles.get_subscription_count():
            self._cycles.publish(String(data=describe()))
            self._recorded += 1

    def publish(self, decision: Decision, control: SqueezeControl | None, now: float) -> None:
        """
        Publish a decision, and log it if the twist is not executed as commanded.

        The equilibrium of the held object is published at most once in `GRIP_PERIOD`.

        :param control: squeeze control with the equilibrium of the held object; None without it.
        """
        fault = None if control is None else control.fault
        belief = None if control is None or fault is not None else control.tracker.belief
        held = False if fault is Status.HALT_NOT_HELD else True if belief is not None else None
        if not 0.0 <= now - self._told < GRIP_PERIOD:
            self._told = now
            record = None
            if belief is not None:
                record = GripRecord.of(belief.held, belief.estimate, belief.is_assumed)
            self._grips.publish(to_grip_message(record, self._robot, now))
        command, cycle = decision.command, self._node.cycle
        slowness = '' if cycle is None else cycle.slowness
        conflicts = self._node.inputs.conflicts
        if conflicts in decision.message:  # as the reason of a halt
            conflicts = ''
        status = self.status = command.status
        squeeze, deviation = decision.squeeze or (math.nan, math.nan)
        message = ManipulationStatus(
            header=make_header(now, self._frame),
            code=int(status),
            message='; '.join(filter(None, (conflicts, slowness, decision.message))),
            commanded=to_twist_message(decision.twist),
            achieved=to_twist_message(command.achieved_twist),
            desired_pose=to_pose_message(decision.desired_pose or UNKNOWN_POSE),
            scale=command.scale,
            reachable_dof=command.reachable_dof,
            failed_rollers=decision.failed,
            cycle_time=0.0 if cycle is None else cycle.duration,
            frequency=decision.frequency,
            pose_gain=decision.pose_gain,
            squeeze=squeeze,
            squeeze_deviation=deviation,
            squeeze_assumed=belief is not None and belief.is_assumed,
            pose_delay=decision.pose_delay,
            held=HELD_VALUES[held],
        )
        self._publisher.publish(message)
        level = DiagnosticStatus.WARN if status < Status.HALT_NO_TWIST else DiagnosticStatus.ERROR
        if status in NORMAL_STATUSES:
            level = DiagnosticStatus.WARN if decision.failed else DiagnosticStatus.OK
        text = decision.message or status.name
        if conflicts:
            level, text = max(level, DiagnosticStatus.WARN), f'{conflicts}; {text}'
        if decision.failed:
            text = f'failed rollers: {", ".join(decision.failed)}; {text}'
        self._node.diagnostics.set_status(text, level)
        if level != DiagnosticStatus.OK:
            self._node.reasons.note(status.name, f'{status}: {text}')
