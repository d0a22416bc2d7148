# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Node `path_follower`, which moves the object along a path by twists for `manipulation`."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
import math

from isotruss_msgs.action import FollowObjectPath
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import ConvexObject, IsotrussError, Obstacle, Robot
from isotruss_ros.core.errors import GraspError, PathError
from isotruss_ros.core.holding.grip_record import GripRecord
from isotruss_ros.core.inputs import find_fresh, InputError, RollerState
from isotruss_ros.core.paths.object_path import ObjectPath
from isotruss_ros.core.paths.path_servo import PathOutcome, PathServo, ServoFeedback
from isotruss_ros.core.paths.path_tracking import PathTracker, Tracking, TrackingSettings
from isotruss_ros.core.planning.foresee_path import foresee_grip, Foresight, OUT_OF_REACH
from isotruss_ros.nodes.conversions.path_messages import read_object_path
from isotruss_ros.nodes.framework import common_parameters as common
from isotruss_ros.nodes.framework.commands import create_twist_publisher
from isotruss_ros.nodes.framework.cycle import Cycle
from isotruss_ros.nodes.framework.gate import Topic
from isotruss_ros.nodes.framework.managed import ManagedNode
from isotruss_ros.nodes.framework.parameters import Spec
from isotruss_ros.nodes.framework.sensors import Inputs
from isotruss_ros.nodes.framework.single_goal import SingleGoal
import numpy as np

SPECS = (
    replace(common.RATE, bounds=(10.0, 1000.0)),
    common.COMMAND_TIMEOUT,
    common.USE_STAMPED_TWIST,
    Spec('ramp_time', 0.5, 'Time from rest to the speed of the path, and back [s]', (0.01, 10.0)),
    Spec(
        'progress_timeout',
        3.0,
        'Time without progress after which a goal is aborted [s]',
        (0.5, 600.0),
    ),
    Spec(
        'smooth_path',
        False,
        'Whether the path is a spline through the poses; if false, it has straight segments',
    ),
    *common.OBJECT_SPECS,
    common.OBSTACLES,
)
#: Fields of a result with errors of the last cycle (`LAST_ERRORS`) and of the whole path
#: (`TRACKED_ERRORS`).
LAST_ERRORS = ('position_error', 'angle_error')
TRACKED_ERRORS = ('max_position_error', 'max_angle_error', 'rms_position_error')
FEEDBACK = (*LAST_ERRORS, 'progress', 'time_left')
#: Feedback while the feasibility of a path is checked.
NO_FEEDBACK = FollowObjectPath.Feedback(
    position_error=np.nan, angle_error=np.nan, progress=0.0, time_left=np.nan
)
#: Smallest rotation that is mentioned where a motion ends [rad].
SMALLEST_SHOWN_ANGLE = math.radians(0.5)


class PathFollower(ManagedNode):
    """
    Node that follows one path at a time, and publishes twists only while it follows a path.

    The callbacks of the action begin and end a goal; the control cycle publishes the twists.
    """

    node_name = 'path_follower'
    specs = SPECS
    awaited = ('follow_object_path',)
    idle = 'no path to follow'
    _last: Tracking | None = None
    #: Path whose feasibility is being checked in a thread; the node receives inputs meanwhile.
    _waiting: tuple[Future[Foresight | None], ObjectPath, TrackingSettings] | None = None
    _foresight: Foresight | None = None  # of the path that is followed; None if unknown

    def create(self) -> None:
        """Create the thread of the feasibility check."""
        self._thread = ThreadPoolExecutor(max_workers=1)

    def configure(self) -> None:
        """Create publishers and subscriptions, and offer the action."""
        values = self.values
        self._obstacles = common.read_resting_obstacles(values)
        inputs = self.inputs = Inputs(self, self.robot)
        self._servo = PathServo(1.0 / values.rate, values.command_timeout, inputs)
        self._publish_twist = create_twist_publisher(
            self, values.use_stamped_twist, self.robot.frame
        )
        inputs.keep('pose', 'rollers', 'estimate', 'held_grip')
        statuses = Topic(ManipulationStatus, 'manipulation/status', _read_status, 'status')
        inputs.keep_topic('servo_feedback', statuses)
        # Exists while the node is inactive as well, so that a goal that ends then gets its result.
        self._goal = SingleGoal(
            self,
            FollowObjectPath,
            'follow_object_path',
            self._read,
            self._refuse,
            self._begin,
            cancelled=lambda: self._end(PathOutcome.CANCELLED, 'cancelled by the client'),
            preempted=lambda: self._end(PathOutcome.PREEMPTED, 'replaced by a newer goal'),
            supervised=True,
        )

    def activate(self) -> None:
        """Accept goals with object paths from now on."""
        self.cycle = Cycle(self, self._step, self.inputs.clear, self._abort_on_stopped_clock)

    def deactivate(self) -> None:
        """Bring the object to rest by a zero twist, and end the active goal."""
        self._end(PathOutcome.STOPPED, 'the node was deactivated')

    def details(self) -> dict[str, object]:
        """Return the state of the active goal for the diagnostics."""
        details: dict[str, object] = {'following': self._goal.active}
        if self._goal.active and self._last is not None:
            details |= {'phase': self._last.phase.name, 'progress': f'{self._last.progress:.3f}'}
            details |= {'position error [m]': f'{self._last.position_error:.6f}'}
        return details  # type: ignore[return-value]

    def _apply(self) -> None:
        """Use the new parameters; gains and tolerances are used from the next goal on."""
        self._servo.timeout = self.values.command_timeout
        self._servo.period = 1.0 / self.values.rate

    # -- The action --

    def _read(self, goal: FollowObjectPath.Goal) -> tuple[ObjectPath | None, TrackingSettings]:
        """Return path and settings of a goal; the path is None if the object is already there."""
        values = self.values
        settings = TrackingSettings(
            goal.position_tolerance,
            goal.angle_tolerance,
            ramp_time=values.ramp_time,
            progress_timeout=values.progress_timeout,
        )
        here, smooth = self._servo.measured(self.now()), values.smooth_path
        path = read_object_path(goal.path, goal.speed, goal.turn_rate, self.robot, smooth, here)
        return path, settings

    def _begin(self, asked: tuple[ObjectPath | None, TrackingSettings]) -> None:
        """Start the feasibility check of a path."""
        self._last, (path, settings) = None, asked
        if path is None:
            self._end(PathOutcome.REACHED, 'the object is already at the only pose of the path')
            return
        servo, now, values = self._servo, self.now(), self.values
        # The other thread gets values of this time; inputs and parameters are this thread's.
        foreseen = self._thread.submit(
            _check_path,
            self.robot,
            common.make_body(values, common.read_described(values)),
            find_fresh(now, servo.timeout, servo.inputs.rollers),
            find_fresh(now, servo.timeout, servo.inputs.held_grip),
            path,
            settings,
            self._obstacles,
        )
        self._waiting = foreseen, path, settings

    def _begin_foreseen(self) -> None:
        """Follow the path after its feasibility check, or abort the goal if it is infeasible."""
        foreseen, path, settings = self._waiting
        if not foreseen.done():
            return
        self._waiting = None
        try:
            self._foresight = foreseen.result()
            self._servo.begin(path, settings, self.now())
        except IsotrussError as error:
            self._end(_find_outcome(error), str(error))

    def _refuse(self, error: IsotrussError) -> FollowObjectPath.Result:
        return _to_result(_find_outcome(error), str(error))

    def _end(self, outcome: PathOutcome, message: str) -> None:
        """Publish a zero twist, and end the active goal, if any, with a result."""
        if not self._goal.active:
            return
        self._waiting = None
        self._publish_twist(np.zeros(3))
        result = _to_result(outcome, message, self._servo.tracker, self._last)
        self._goal.report_end(outcome, result)

    # -- The cycle --

    def _step(self, now: float) -> None:
        if not self._goal.active:
            return
        if (loss := self._goal.client.find_loss(self._servo.timeout)) is not None:
            self._end(PathOutcome.STOPPED, loss)
            return
        if self._waiting is not None:
            self._publish_twist(np.zeros(3))
            self._begin_foreseen()
            if self._waiting is not None:
                self._goal.publish_feedback(lambda: NO_FEEDBACK)
            return
        step = self._servo.decide(now)
        self._last = step.tracking or self._last
        if step.outcome is not None:
            self._end(step.outcome, step.message)
            return
        self._publish_twist(step.tracking.twist)
        feedback = {name: getattr(step.tracking, name) for name in FEEDBACK}
        if self._foresight is not None:  # the path may be slower than at its full rate
            foreseen = self._foresight.time_left(step.tracking.progress)
            feedback['time_left'] = max(feedback['time_left'], foreseen)
        self._goal.publish_feedback(lambda: FollowObjectPath.Feedback(**feedback))
        self.diagnostics.set_status(step.tracking.phase.name.lower())

    def _abort_on_stopped_clock(self, now: float) -> None:
        """Abort the goal, because inputs do not age while the clock is stopped."""
        self.inputs.clear()
        self._end(PathOutcome.STOPPED, f'simulated time stopped at {now:.3f} s')


def _find_outcome(error: IsotrussError) -> PathOutcome:
    """Return the outcome of a goal that was ended by an error."""
    return PathOutcome.STOPPED if isinstance(error, InputError) else PathOutcome.BAD_GOAL


def _to_result(
    outcome: PathOutcome,
    message: str,
    tracker: PathTracker | None = None,
    last: Tracking | None = None,
) -> FollowObjectPath.Result:
    """Return the result message of a goal; errors are NaN before the first cycle on the path."""
    errors = {
        name: math.nan if last is None else getattr(source, name)
        for source, names in ((last, LAST_ERRORS), (tracker, TRACKED_ERRORS))
        for name in names
    }
    return FollowObjectPath.Result(code=int(outcome), message=message, **errors)


def _read_status(message: ManipulationStatus) -> ServoFeedback:
    return ServoFeedback(message.code, message.scale, message.message, message.frequency)


def _check_path(
    robot: Robot,
    body: ConvexObject,
    rollers: RollerState | None,
    record: GripRecord | None,
    path: ObjectPath,
    settings: TrackingSettings,
    obstacles: Sequence[Obstacle],
) -> Foresight | None:
    """
    Return the predicted motion; raise PathError if the object would slip or not follow the path.

    The prediction assumes that the squeeze does not change. It starts from the equilibrium
    reported by the node `manipulation` if that node controls the squeeze. None is returned if
    roller positions are missing, or if the object is not held at the start of the path, because an
    object that is only pushed has no slip margin.
    """
    if rollers is None:
        return None
    config = robot.configuration(rollers.positions)
    try:
        here = body.moved_to(path.poses[0])
        motion = path.poses, record, path.speed, path.turn_rate, settings
        foresight = foresee_grip(config, here, body.friction_or(None), *motion, obstacles)
    except GraspError:
        return None
    if foresight is not None and foresight.why:
        raise PathError(_describe_end(foresight))
    return foresight


def _describe_end(foresight: Foresight) -> str:
    """Return the reason, length and pose at which a predicted motion ends."""
    places = np.array([held.pose for held in foresight.grips])
    length = np.hypot(*np.diff(places[:, :2], axis=0).T).sum()
    x, y, angle = foresight.pose
    turned = angle - places[0, 2]
    turn = f' and {math.degrees(turned):+.0f}°' if abs(turned) > SMALLEST_SHOWN_ANGLE else ''
    end = f'after {100.0 * length:.0f} cm{turn}, at ({x:.3f}, {y:.3f})'
    if foresight.why.startswith(OUT_OF_REACH):
        return f'{OUT_OF_REACH} {end}{foresight.why.removeprefix(OUT_OF_REACH)}'
    return f'the motion would end {end}: {foresight.why}'
