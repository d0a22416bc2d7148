# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `manipulation`, which commands roller velocities for twists or trajectories."""

from __future__ import annotations

from functools import partial
import math

from geometry_msgs.msg import Twist, TwistStamped
from isotruss_ros.core import Status
from isotruss_ros.core.inputs import RejectedInput, StampedInput
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.recording.recorded_servo import RecordedServo
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.nodes.conversions.markers import to_obstacle_markers
from isotruss_ros.nodes.conversions.messages import check_frame, read_twist
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.commands import RollerCommands
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.gate import Topic
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import ParameterError, Spec, Value
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.topics import NEWEST_MESSAGES, take_waiting
from isotruss_ros.nodes.manipulation.emergency_stop import EmergencyStop
from isotruss_ros.nodes.manipulation.failed_rollers import describe_reachable_twists, FailedRollers
from isotruss_ros.nodes.manipulation.servo_settings import make_settings, StatusReport
from isotruss_ros.nodes.manipulation.servo_settings import SPECS as SERVO_SPECS
from isotruss_ros.nodes.manipulation.trajectory_following import TrajectoryFollowing
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool
from visualization_msgs.msg import MarkerArray

MODES = ('object', 'joint')
#: Period at which the node checks the message types of publishers of cmd_vel while no twist
#: arrives [s].
TYPE_CHECK_PERIOD = 1.0
#: Period of the markers of obstacles [s]; their lifetime is 1 s.
MARKER_PERIOD = 0.1
SPECS = (
    Spec(
        'mode',
        'object',
        "Part that cmd_vel moves: the held 'object', or a 'joint' of the robot without an object",
    ),
    Spec('joint', '', "Name of the joint that cmd_vel moves in the mode 'joint'"),
    common.USE_STAMPED_TWIST,
    common.REQUIRE_EMERGENCY_STOP,
    common.OBJECT,
    common.OBSTACLES,
    *SERVO_SPECS,
)


def _planar_parts(message: Twist | TwistStamped) -> dict[str, tuple[float, float, float]]:
    """Return the components of a twist, which is an input of one part."""
    twist = getattr(message, 'twist', message)
    return {'': (twist.linear.x, twist.linear.y, twist.angular.z)}


class Manipulation(ManagedNode):
    """Node that commands roller velocities in every cycle, computed from the latest inputs."""

    node_name = 'manipulation'
    specs = SPECS
    awaited = ('joint_states', 'object_pose', 'cmd_vel')
    _report: StatusReport | None = None
    _servo: RecordedServo | None = None
    _trajectory: TrajectoryFollowing | None = None

    def create(self) -> None:
        """Create the subscriptions that can stop the rollers, which exist in every state."""
        self._stop = EmergencyStop(self, self._apply_stop, self._wait_for_zero)
        self._failed_rollers = FailedRollers(self, self._apply_failures)
        self.create_service(SetBool, 'set_joint_mode', self._set_joint_mode)
        self.offer('resume_grip', self._resume_grip)
        self.offer('clear_obstacles', self._clear_obstacles)

    def configure(self) -> None:
        """Create publishers and subscriptions."""
        values = self.values
        self._described = common.read_described(values)
        self._obstacles = common.read_resting_obstacles(values)
        self._report = StatusReport(self, self.robot)
        inputs = self.inputs = Inputs(self, self.robot)
        self._servo = RecordedServo(self.robot, self._make_settings(), inputs)
        self._trajectory = TrajectoryFollowing(self, self._servo)
        self._commands = RollerCommands(self, len(self.robot.roller_names))
        stamped = values.use_stamped_twist
        kind, read = (TwistStamped, self._read_stamped_twist) if stamped else (Twist, read_twist)
        twists = Topic(
            kind, 'cmd_vel', read, 'twist', stops=True, parts=_planar_parts, shared=True
        )
        self._twists = inputs.keep_topic('twist', twists)
        inputs.keep('rollers', 'estimate', 'pose', 'pressures', 'obstacles')
        self.create_timer(TYPE_CHECK_PERIOD, self._check_twist_type)
        self._markers = self.advertise(MarkerArray, 'obstacle_markers')
        self._markers_time = -math.inf

    def prepare(self, settings: ServoSettings) -> ServoSettings:
        """
        Return the servo's settings; subclasses override this method to add limits and barriers.

        The method is called after each change of a parameter.
        """
        return settings

    def _make_settings(self) -> ServoSettings:
        """Return the settings of the servo that the parameters specify."""
        joint = self.values.joint if self.values.mode == 'joint' else None
        described, obstacles = self._described, self._obstacles
        return self.prepare(make_settings(self.robot, self.values, described, joint, obstacles))

    def activate(self) -> None:
        """Start the control cycle."""
        self._discard_twist()
        self._trajectory.subscribe()
        self._commands.subscribe()
        self.cycle = Cycle(self, self._step, self._clear_inputs, self._halt_on_stopped_clock)

    def deactivate(self) -> None:
        """Command zero velocities to all rollers, and wait for the acknowledgement."""
        self._trajectory.abort('the node was deactivated')
        self._commands.stop()
        if not self._wait_for_zero():
            self.get_logger().warning('not every subscriber has acknowledged the zero command')

    def cleanup(self) -> None:
        """Discard the robot and its servo; the record of failed rollers remains."""
        self._servo = self._trajectory = None

    def details(self) -> dict[str, object]:
        """Return the current motion, the grip and the failed rollers for the diagnostics."""
        servo, settings = self._servo, self._servo.settings
        details: dict[str, object] = {
            'moves': 'the object' if settings.joint is None else f'joint {settings.joint}',
            'grip': ', '.join(settings.grip.members),
        }
        if (follower := self._trajectory.follower).trajectory is not None:
            details['moves'] = 'the rollers along a trajectory'
            details['time on the trajectory [s]'] = f'{follower.time:.3f}'
        if servo.failed:
            details['failed rollers'] = ', '.join(sorted(servo.failed))
            details['reachable twists'] = describe_reachable_twists(servo)
        status = self._report.status
        details |= {'status': status.name, 'status code': int(status)}
        return details

    def describe(self) -> dict[str, object]:
        """Return the values for the diagnostics, including the reason of a stop, in any state."""
        return {'emergency stop': self._stop.reason or 'no'} | super().describe()

    def _wait_for_zero(self) -> bool:
        """Wait briefly until subscribers acknowledge zero velocity; return whether they did."""
        return not self.active or self._commands.wait_for_subscribers()

    def _find_halt(self) -> tuple[Status, str] | None:
        """Return status and reason of a halt that does not depend on inputs, or None."""
        reason = self._stop.reason
        if reason is not None:
            return Status.HALT_EMERGENCY_STOP, reason
        others = self._commands.find_others()
        if others is not None:
            # The rollers do not follow this node in that case.
            self._servo.reset_failures(())
            return Status.HALT_OTHER_COMMANDS, others
        fault = self._failed_rollers.find_fault(self.robot)
        return None if fault is None else (Status.HALT_INVALID_FAILED_ROLLERS, fault)

    def _apply_stop(self) -> None:
        """Halt at once if a stop is set; after its release only a new twist moves the object."""
        if self._servo is None:
            return
        self._servo.inputs.halt = self._find_halt()
        self._discard_twist()
        if self._servo.inputs.halt is not None:
            self._trajectory.abort('emergency stop')
            if self.active:
                self._commands.stop()

    def _resume_grip(self) -> str:
        """Clear the fault of the grip; the control starts anew from the measured pose."""
        squeeze = None if self._servo is None else self._servo.squeeze
        if squeeze is None or squeeze.fault is None:
            halt = None if self._servo is None else self._find_halt()
            return 'the grip has no fault' + (f'; {halt[1]}' if halt else '')
        fault = squeeze.fault
        self._servo.acknowledge()
        return f'resumed after {fault}'

    def _clear_obstacles(self) -> str:
        """Discard all moving obstacles, also those that are not published any more."""
        return 'no moving obstacles' if self._servo is None else self.inputs.clear_obstacles()

    def _discard_twist(self) -> None:
        """Discard the last twist and queued twists, so that only a new twist moves the object."""
        take_waiting([], self._twists, NEWEST_MESSAGES.depth)
        self._servo.receive(twist=None)

    def _clear_inputs(self) -> None:
        """Discard all inputs, because their ages are unknown after a jump of the clock."""
        self.inputs.clear()
        self._trajectory.abort('the clock jumped back or stopped')

    def _halt_on_stopped_clock(self, now: float) -> None:
        """Halt, because inputs do not age while the clock is stopped."""
        self._clear_inputs()
        self._step(now, (Status.HALT_CLOCK, f'simulated time stopped at {now:.3f} s'))

    def _apply_failures(self) -> None:
        """Command zero velocity to the failed rollers that the topic or the parameter names."""
        if self._servo is not None:
            by_parameter = set(self.values.failed_rollers) - {''}
            named = self._failed_rollers.named & set(self.robot.roller_names)
            self._servo.receive(failed=named | by_parameter)

    def _check(self, new: dict[str, Value]) -> None:
        """Check the parameters of grip, rollers and mode."""
        common.check_grip(self.robot, new)
        failed = set(new.get('failed_rollers', ())) - {''}  # type: ignore[arg-type]
        check_names(
            'parameter failed_rollers: rollers', failed, self.robot.roller_names, self.robot.name
        )
        mode, joint = (new.get(name, getattr(self.values, name)) for name in ('mode', 'joint'))
        if mode not in MODES:
            raise ParameterError(f'parameter mode: {mode!r}: must be one of {MODES}')
        if joint or mode == 'joint':
            joints = self.robot.topology.joint_names
            check_names('joint', [joint], joints, self.robot.name)

    def _apply(self) -> None:
        """Use new parameter values from the next cycle on."""
        settings, before = self._make_settings(), self._servo.settings.joint
        self._servo.apply(settings)
        self._failed_rollers.follow(self._servo)
        if settings.joint != before:
            self._trajectory.abort('the parameter mode was changed')
            if self.active:
                self._commands.stop()
        self._apply_failures()

    def _set_joint_mode(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        """Set the parameter `mode` on request of a service."""
        mode = 'joint' if request.data else 'object'
        (result,) = self.set_parameters([Parameter('mode', value=mode)])
        response.success = result.successful
        moved = f'joint {self.values.joint}' if request.data else 'object'
        response.message = result.reason or f'cmd_vel moves the {moved}'
        return response

    def _read_stamped_twist(self, message: TwistStamped) -> tuple[float, float, float]:
        check_frame('twist', message.header, self.robot.frame)
        return read_twist(message.twist)

    def _check_twist_type(self) -> None:
        """Halt if a publisher sends twists of the type that this node does not receive."""
        servo, twist = self._servo, self._servo.inputs.twist
        timeout = servo.settings.timeout
        if isinstance(twist, StampedInput) and self.now() - twist.time < timeout:
            return
        stamped = self.values.use_stamped_twist
        wrong, right = ('Twist', 'TwistStamped') if stamped else ('TwistStamped', 'Twist')
        publishers = self.get_publishers_info_by_topic('cmd_vel')
        rejected = RejectedInput(
            f'cmd_vel has a publisher of {wrong}, which is not received: publish {right}, or '
            f'set use_stamped_twist to {str(not stamped).lower()}'
        )
        if any(publisher.topic_type == f'geometry_msgs/msg/{wrong}' for publisher in publishers):
            servo.receive(twist=rejected)
        elif twist == rejected:
            servo.receive(twist=None)

    def _draw_obstacles(self, now: float) -> None:
        """Publish markers of all obstacles if they are due and there is a subscriber."""
        if 0.0 <= now - self._markers_time < MARKER_PERIOD:
            return
        self._markers_time = now
        if not self._markers.get_subscription_count():
            return
        received = self.inputs.obstacles
        moving = received.value if isinstance(received, StampedInput) else ()
        obstacles = (*self._obstacles, *(obstacle.at(now) for obstacle in moving))
        height = self.robot.description.tube_diameter
        self._markers.publish(to_obstacle_markers(obstacles, height, self.robot.frame, now))

    def _step(self, now: float, clock: tuple[Status, str] | None = None) -> None:
        halt = self._find_halt() or clock
        self._servo.inputs.halt = halt
        if halt is not None:
            self._trajectory.abort(halt[1])
        decision = self._trajectory.decide(now)
        self._commands.publish(decision.command.roller_velocities)
        self._report.publish(decision, self._servo.squeeze, now)
        self._report.publish_record(partial(self._servo.describe, reported=decision))
        self._draw_obstacles(now)
