"""Node `path_follower`: carries the grasped object along a path, by twists for `manipulation`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import sys

from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from isotruss_msgs.action import FollowObjectPath
from isotruss_msgs.msg import ManipulationStatus
from isotruss_ros.core import (
    IsotrussError,
    load_robot,
    Refusal,
    Sample,
    Tracking,
    TrackingSettings,
)
from isotruss_ros.core.path_servo import Obedience, Outcome, PathServo
from isotruss_ros.core.samples import InputError
from isotruss_ros.nodes import parameters as params
from isotruss_ros.nodes.cycle import Cycle
from isotruss_ros.nodes.diagnostics import Level
from isotruss_ros.nodes.inputs import age, latest
from isotruss_ros.nodes.managed import ManagedNode
from isotruss_ros.nodes.messages import MessageError, seconds, stamp, twist_message
from isotruss_ros.nodes.newest import subscribe_newest
from isotruss_ros.nodes.path_messages import (
    feedback_message,
    measured_pose,
    object_path,
    result_message,
)
from isotruss_ros.nodes.qos import RELIABLE
from isotruss_ros.nodes.runner import run
from isotruss_ros.nodes.single_goal import Ending, SingleGoal
import numpy as np
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from rclpy.time import Time

RATE = replace(params.RATE, default=100.0, bounds=(10.0, 1000.0))
POSITION_GAIN = params.Spec(
    'position_gain', 2.0, 'Rate at which errors of position decay [1/s]', bounds=(0.0, 20.0)
)
ANGLE_GAIN = params.Spec(
    'angle_gain', 2.0, 'Rate at which errors of orientation decay [1/s]', bounds=(0.0, 20.0)
)
RAMP_TIME = params.Spec(
    'ramp_time', 0.5, 'From rest to the speed of the path, and back [s]', bounds=(0.01, 10.0)
)
PATIENCE = params.Spec(
    'patience', 3.0, 'A path is given up after this long without progress [s]', bounds=(0.5, 600.0)
)
SMOOTH_PATH = params.Spec(
    'smooth_path', False, 'Round the corners of paths; straight from pose to pose if not'
)
SPECS = (
    params.ROBOT,
    RATE,
    params.COMMAND_TIMEOUT,
    params.USE_STAMPED_TWIST,
    POSITION_GAIN,
    ANGLE_GAIN,
    RAMP_TIME,
    PATIENCE,
    SMOOTH_PATH,
)
#: Feedback comes this often [Hz].
FEEDBACK_RATE = 10.0


#: How the action ends with each outcome; with all others it is aborted.
ENDINGS = {Outcome.REACHED: Ending.SUCCEEDED, Outcome.CANCELLED: Ending.CANCELED}


class PathFollower(ManagedNode):
    """
    Follows one path at a time; says nothing on `cmd_vel` while there is none.

    The action's callbacks only begin and end; all motion comes from the cycle.

    :raises IsotrussError: a parameter is unusable; says which and what would be right.
    """

    def __init__(self, parameter_overrides: Sequence[Parameter] = ()) -> None:
        super().__init__('path_follower', SPECS, parameter_overrides)
        self._servo: PathServo | None = None
        self._cycle: Cycle | None = None
        self._goal: SingleGoal | None = None
        self._cycles = 0
        self._last: Tracking | None = None
        self.start()

    def configure(self) -> None:
        """Listen, and offer the action."""
        values = self.values
        self._frame = load_robot(values[params.ROBOT]).frame
        self._servo = PathServo(1.0 / values[RATE], values[params.COMMAND_TIMEOUT])
        values.on_change(lambda _new: None, self._apply)
        self._stamped = values[params.USE_STAMPED_TWIST]
        self._twists = self.create_lifecycle_publisher(
            TwistStamped if self._stamped else Twist, 'cmd_vel', RELIABLE
        )
        subscribe_newest(self, PoseStamped, 'object_pose', self._take_pose)
        subscribe_newest(self, ManipulationStatus, 'manipulation/status', self._take_status)
        # There while the node is inactive too, so that a goal that ends then gets its result.
        self._goal = SingleGoal(
            self,
            FollowObjectPath,
            'follow_object_path',
            ready=lambda: self.active,
            begin=self._begin,
            preempted=lambda: self._end(Outcome.PREEMPTED, 'a newer goal took over'),
            cancelled=lambda: self._end(Outcome.CANCELLED, 'cancelled by the client'),
        )

    def activate(self) -> None:
        """Take goals from now on."""
        self.diagnostics.say(Level.OK, 'no path to follow')
        self._cycle = Cycle(
            self,
            self.values[RATE],
            self._step,
            jumped_back=self._forget,
            stands=self._clock_stands,
            patience=self._servo.timeout,
        )

    def deactivate(self) -> None:
        """Leave the object at rest."""
        self._cycle = None
        self._end(Outcome.STOPPED, 'the node was deactivated')

    def cleanup(self) -> None:
        """Let go of what was heard."""
        self._servo = self._goal = None

    def details(self) -> dict[str, object]:
        """Return what it does and what it goes by."""
        if self._servo is None:
            return {}
        now = 1e-9 * self.get_clock().now().nanoseconds
        found: dict[str, object] = {
            'following': self._goal.pursued,
            'age of object pose [s]': age(self._servo.pose, now),
            'age of status [s]': age(self._servo.obedience, now),
        }
        if self._goal.pursued and self._last is not None:
            found |= {'phase': self._last.phase.name, 'progress': f'{self._last.progress:.3f}'}
            found |= {'position error [m]': f'{self._last.position_error:.6f}'}
        return found

    # -- What comes in --

    def _take_pose(self, message: PoseStamped) -> None:
        try:
            came = Sample(measured_pose(message, self._frame), seconds(message.header))
            self._servo.pose = latest(self._servo.pose, came, self._servo.timeout)
        except MessageError as error:
            self._servo.pose = Refusal(str(error))

    def _take_status(self, message: ManipulationStatus) -> None:
        answer = Obedience(message.code, message.scale, message.message)
        came = Sample(answer, seconds(message.header))
        self._servo.obedience = latest(self._servo.obedience, came, self._servo.timeout)

    def _apply(self) -> None:
        """Take over changed parameters; gains and the like with the next goal."""
        self._servo.timeout = self.values[params.COMMAND_TIMEOUT]
        self._servo.period = 1.0 / self.values[RATE]
        if self._cycle is not None:
            self._cycle.change(self.values[RATE], self._servo.timeout)

    # -- The action --

    def _begin(self, asked: FollowObjectPath.Goal) -> None:
        """Begin to follow a path, or say why not."""
        self._cycles, self._last = 0, None
        values = self.values
        try:
            path = object_path(
                asked.path, asked.speed, asked.turn_rate, self._frame, values[SMOOTH_PATH]
            )
            settings = TrackingSettings(
                asked.position_tolerance,
                asked.angle_tolerance,
                values[POSITION_GAIN],
                values[ANGLE_GAIN],
                values[RAMP_TIME],
                values[PATIENCE],
            )
            self._servo.begin(path, settings, 1e-9 * self.get_clock().now().nanoseconds)
        except InputError as error:
            self._end(Outcome.STOPPED, str(error))
        except IsotrussError as error:
            self._end(Outcome.BAD_GOAL, str(error))

    def _end(self, outcome: Outcome, message: str) -> None:
        """Leave the object at rest, and say how the goal ended, if there is one."""
        if not self._goal.pursued:
            return
        self._send(np.zeros(3))
        result = result_message(outcome, message, self._servo.tracker, self._last)
        self._goal.end(ENDINGS.get(outcome, Ending.ABORTED), result)
        words = f'{outcome.name.lower().replace("_", " ")}: {message}'
        good = outcome in (Outcome.REACHED, Outcome.CANCELLED, Outcome.PREEMPTED)
        self.diagnostics.say(Level.OK if good else Level.WARN, f'no path to follow; last {words}')
        if good:
            self.get_logger().info(words)
        else:
            self.get_logger().warning(words)

    # -- The cycle --

    def _step(self, now: Time) -> None:
        if not self._goal.pursued:
            return
        step = self._servo.decide(1e-9 * now.nanoseconds)
        self._last = step.tracking or self._last
        if step.outcome is not None:
            self._end(step.outcome, step.message)
            return
        self._send(step.twist)
        if self._cycles % max(1, round(self.values[RATE] / FEEDBACK_RATE)) == 0:
            self._goal.tell(feedback_message(step.tracking))
            self.diagnostics.say(Level.OK, step.tracking.phase.name.lower())
        self._cycles += 1

    def _forget(self) -> None:
        """Rely on nothing that came before the clock ran back: its age cannot be known."""
        self._servo.pose = self._servo.obedience = None

    def _clock_stands(self, now: Time) -> None:
        """Give up: with the clock, ages stand still too, and old poses would seem new."""
        self._forget()
        self._end(Outcome.STOPPED, f'simulated time stands at {now}')

    def _send(self, twist: NDArray[np.float64]) -> None:
        message = twist_message(twist)
        if self._stamped:
            message = TwistStamped(twist=message)
            stamp(message.header, self.get_clock().now(), self._frame)
        self._twists.publish(message)


def main(args: Sequence[str] | None = None) -> int:
    """Run the path follower until it is interrupted."""
    return run(PathFollower, args)


if __name__ == '__main__':
    sys.exit(main())
