# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Roller trajectories, piecewise linear with parabolic blends, and a servo that tracks trajectories.

The servo starts at the measured roller positions and controls them by feedback. Trajectory time
stops while a roller lags behind, and the rollers rest while their measurement is missing or
rejected. After the timeout without a valid measurement the trajectory ends, and so it does at a
violated tolerance of the action goal.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError, IsotrussError
from isotruss_ros.core.inputs import LatestInputs, require_fresh, RollerState, StampedInput
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.numerics.arrays import Array, finite_array
from isotruss_ros.core.numerics.tolerances import SMALLEST_NORMAL
from isotruss_ros.core.paths.object_path import MAX_DURATION
from isotruss_ros.core.paths.path_tracking import TrackingSettings
import numpy as np
from numpy.typing import ArrayLike
import scipy

#: Decay rate of errors of the roller positions [1/s].
POSITION_GAIN = 5.0
#: Largest distance of a roller from the end of its trajectory [m], and larger value that is used
#: after a timeout, for imprecise drives or encoders of low resolution [m].
TOLERANCE, NEAR_TOLERANCE = 2e-5, 5e-4
#: Largest distance of the measured positions from the start of the trajectory [m].
START_TOLERANCE = 0.01
#: Largest distance of a roller from the trajectory at which trajectory time still advances [m].
MAX_LAG = 5e-3
#: Time within the end tolerance after which a trajectory ends [s].
REST_TIME = 0.1
#: Largest time without progress, the default of paths [s].
PROGRESS_TIMEOUT = TrackingSettings.progress_timeout
#: Largest number of waypoints between which the shapes of a trajectory are followed, of which each
#: takes 0.1 ms of the control cycle [-].
MAX_SHAPES = 200
#: Largest advance of trajectory time in a cycle [s]; larger advances would cut corners.
MAX_TIME_STEP = 0.2


class RollerTrajectory:
    """
    Waypoints (k, r) [m] of the rollers with times [s], with constant velocity between waypoints.

    At each waypoint the velocity changes with the largest acceleration (parabolic blend), for a
    time centred on the waypoint. The duration includes half of the blends at both ends.
    """

    def __init__(self, robot: Robot, positions: ArrayLike, times: ArrayLike) -> None:
        points = positions if np.iterable(positions) else [positions]
        rows = [robot.check_rollers(row, 'roller positions [m]') for row in points]
        if not rows:
            raise ConfigurationError('the trajectory has no points: must have one or more')
        stamps = finite_array(times, len(rows), 'times of the trajectory [s]', ConfigurationError)
        durations = np.diff(stamps)
        is_valid = np.append(stamps[0] >= 0.0, durations > 0.0) & (stamps <= MAX_DURATION)
        if not is_valid.all():
            point = int(is_valid.argmin())
            raise ConfigurationError(
                f'time {stamps[point]:.9g} s of point {point} of the trajectory: must be '
                f'later than that of the point before, from 0 to {MAX_DURATION:g} s'
            )

        # Velocities of the segments, and accelerations that the blends at both ends need.
        max_speed = robot.description.max_speed
        max_acceleration = robot.description.max_acceleration
        with np.errstate(over='ignore', invalid='ignore'):  # infinite values are refused
            velocities = np.diff(rows, axis=0) / durations[:, None]
            velocities = np.pad(velocities, ((1, 1), (0, 0)))  # at rest before and after
            # Largest velocity change of a roller at each waypoint [m/s].
            jumps = np.abs(np.diff(velocities, axis=0)).max(axis=1)
            # A segment contains half of the blends at both of its ends.
            accelerations = 0.5 * (jumps[1:] + jumps[:-1]) / durations
        top_speed = float(np.abs(velocities).max())
        if top_speed > max_speed * (1.0 + 1e-6):
            raise ConfigurationError(
                f'the trajectory has a roller speed of {top_speed:.9g} m/s; '
                f'must be at most {max_speed:g} m/s'
            )
        if accelerations.max(initial=0.0) > max_acceleration * (1.0 + 1e-6):
            point = int(accelerations.argmax())
            raise ConfigurationError(
                f'the trajectory has a roller acceleration of {accelerations[point]:.4g} m/s^2 '
                f'from point {point} to {point + 1}; must be at most {max_acceleration:g} m/s^2'
            )
        half_blends = 0.5 * jumps / max_acceleration  # half of each blend's duration [s]
        centres = stamps + max(half_blends[0] - stamps[0], 0.0)  # no blend begins before time 0
        self._velocity = _blend(velocities, centres, half_blends)
        self._start, self._travel = rows[0], self._velocity.antiderivative()
        self.duration = float(self._velocity.x[-1])

    def at(self, time: float) -> RollerState:
        """Return the desired roller state; rollers rest before the start and after the end."""
        clipped = min(max(time, self._velocity.x[0]), self.duration)
        return RollerState(self._start + self._travel(clipped), self._velocity(clipped))


def check_shapes(robot: Robot, waypoints: Array) -> None:
    """Raise `ConfigurationError` if waypoints (k, r) lead out of the configurations [m]."""
    config = robot.configuration(waypoints[0])
    points = np.linspace(0, len(waypoints) - 1, min(len(waypoints), MAX_SHAPES)).astype(int)
    for point in points[1:].tolist():
        config = config.moved_to(waypoints[point])


def _blend(velocities: Array, centres: Array, half_blends: Array) -> scipy.interpolate.PPoly:
    """Return a velocity that is constant between the centred blends, and linear within them."""
    # Knots are the begin and the end of each blend. Blends may overlap by the tolerance of the
    # acceleration.
    knots = np.stack([centres - half_blends, centres + half_blends], axis=1).ravel()
    knots = np.maximum.accumulate(knots)
    knot_velocities = np.repeat(velocities, 2, axis=0)[1:-1]  # before and after each blend
    intervals = np.maximum(np.diff(knots), SMALLEST_NORMAL)[:, None]
    slopes = np.diff(knot_velocities, axis=0) / intervals
    return scipy.interpolate.PPoly([slopes, knot_velocities[:-1]], knots)


class Tolerance(NamedTuple):
    """Largest deviations of measured from desired roller states; infinite if not bounded."""

    positions: Array  #: (r,) deviations of positions [m]
    velocities: Array  #: (r,) deviations of velocities [m/s]

    def find_violation(
        self, names: Sequence[str], wanted: RollerState, measured: RollerState
    ) -> str:
        """Return a sentence about the roller farthest beyond its tolerance; empty if none."""
        for quantity, unit, bounds, errors in (
            ('', 'm', self.positions, wanted.positions - measured.positions),
            (' in speed', 'm/s', self.velocities, wanted.velocities - measured.velocities),
        ):
            excess = np.abs(errors) - bounds
            worst = int(excess.argmax())
            if excess[worst] > 0.0:
                return (
                    f'roller {names[worst]} is {abs(errors[worst]):.4g} {unit} off{quantity}; the '
                    f'goal allows {bounds[worst]:g} {unit}'
                )
        return ''


class TrajectoryTolerances(NamedTuple):
    """Tolerances of an action goal, as defined in control_msgs/FollowJointTrajectory."""

    #: tolerance along the trajectory; None: no bound, and trajectory time stops while a roller
    #: lags behind
    path: Tolerance | None = None
    goal: Tolerance | None = None  #: tolerance at the end; None: the default of the servo
    #: largest delay of arrival [s], infinite if not bounded; None: the servo's default
    goal_time: float | None = None


class RollerStep(NamedTuple):
    """Roller velocities and state of the trajectory servo in one control cycle."""

    speeds: Array  #: (r,) commanded roller speeds [m/s]
    ended: bool = False  #: whether the trajectory has ended, successfully or not
    failure: str = ''  #: reason of a failure; empty if there is none
    at_goal: bool = False  #: whether the failure is a timeout at the goal


class RollerTrajectoryServo:
    """Feedback controller that tracks one trajectory of the rollers, with its state and inputs."""

    def __init__(self, robot: Robot, timeout: float, inputs: LatestInputs) -> None:
        self._robot, self.timeout, self.inputs = robot, timeout, inputs
        self._stop_step = RollerStep(np.zeros(len(robot.roller_names)))
        self.time = 0.0  #: trajectory time [s]
        self.trajectory: RollerTrajectory | None = None  #: trajectory that is tracked, if any
        self._tolerances = TrajectoryTolerances()
        unbounded = np.full(len(robot.roller_names), np.inf)
        self._default_goal = Tolerance(np.full_like(unbounded, TOLERANCE), unbounded)
        self._start = self._last_cycle = self._waited = 0.0  # waited: time without progress [s]
        self._measured = 0.0  # time of the last valid measurement [s]
        self._arrived = math.inf  # since when all rollers are within the end tolerance [s]
        self._offsets: Array | float = 0.0  # of the rollers, before the end of the trajectory [m]

    def begin(
        self,
        trajectory: RollerTrajectory,
        now: float,
        start: float | None = None,
        tolerances: TrajectoryTolerances | None = None,
    ) -> None:
        """Start a trajectory, which replaces the current one unless it is rejected."""
        state = self.check_start(trajectory, now)
        self.trajectory, self._offsets = trajectory, state.offsets
        self._tolerances = tolerances or TrajectoryTolerances()
        self._start = self._last_cycle = now if start is None else max(start, now)
        self.time, self._waited, self._arrived, self._measured = 0.0, 0.0, math.inf, now

    def check_start(self, trajectory: RollerTrajectory, now: float) -> RollerState:
        """Return the measured roller state; raise an error if the trajectory begins elsewhere."""
        state = require_fresh(now, self.timeout, joint_states=self.inputs.rollers)[0].value
        distances = np.abs(trajectory.at(0.0).positions - state.positions)
        worst = int(distances.argmax())
        if distances[worst] > START_TOLERANCE:
            raise ConfigurationError(
                f'the trajectory begins {distances[worst]:.4g} m from the measured position of '
                f'roller {self._robot.roller_names[worst]}; must begin within {START_TOLERANCE} m'
            )
        return state

    def decide(self, now: float) -> RollerStep:
        """Return the roller velocities of a cycle, zero without a valid measurement."""
        trajectory = self.trajectory
        if trajectory is None:
            return self._finish('the servo has no trajectory; start one first')
        try:
            (measured,) = require_fresh(now, self.timeout, joint_states=self.inputs.rollers)
        except IsotrussError as error:
            if not 0.0 <= now - self._measured <= self.timeout:
                return self._finish(str(error))
            self._last_cycle = max(self._last_cycle, now)  # trajectory time stops
            return self._stop_step
        self._measured = measured.time
        if now < self._start:
            return self._stop_step
        # Cycles may be late on a busy machine, or rare on a coarse clock.
        longest = min(MAX_TIME_STEP, self.timeout)
        elapsed, self._last_cycle = min(max(0.0, now - self._last_cycle), longest), now
        # At the end of the trajectory the roller offsets are kept, because each marker changes
        # their estimate by more than the tolerance.
        state = measured.value
        if self.time < trajectory.duration:
            self._offsets = state.offsets
        state = state._replace(positions=state.positions - state.offsets + self._offsets)

        if self._tolerances.path is not None:
            desired = trajectory.at(self.time - max(0.0, now - measured.time))
            names = self._robot.roller_names
            violation = self._tolerances.path.find_violation(names, desired, state)
            if violation:
                return self._finish(violation)
        return self._advance(measured._replace(value=state), now, elapsed)

    def _advance(self, measured: StampedInput, now: float, elapsed: float) -> RollerStep:
        """Return the step of a cycle; trajectory time advances unless a roller lags."""
        trajectory, state, names = self.trajectory, measured.value, self._robot.roller_names

        # Position errors at the begin and at the end of the cycle. The smaller one decides about a
        # lag: by the travel of one cycle, rollers at rest seem to lag, and moving rollers to lead.
        next_time = min(self.time + elapsed, trajectory.duration)
        is_at_end = next_time >= trajectory.duration
        error_now = trajectory.at(self.time).positions - state.positions
        error_next = trajectory.at(next_time).positions - state.positions
        has_lag = min(float(np.abs(error_next).max()), float(np.abs(error_now).max())) > MAX_LAG
        error = error_now if has_lag else error_next

        # Arrival: all rollers stay within the tolerances of the goal.
        is_default = self._tolerances.goal is None
        goal = self._default_goal if is_default else self._tolerances.goal
        goal_violation = goal.find_violation(names, trajectory.at(trajectory.duration), state)
        has_arrived = is_at_end and not goal_violation
        self._arrived = min(self._arrived, now) if has_arrived else math.inf
        if min(measured.time, now) - self._arrived > REST_TIME:
            return self._finish()

        # Progress of trajectory time, or time without progress.
        if not has_lag and self.time < trajectory.duration:
            self.time, self._waited = next_time, 0.0
        elif not has_arrived:
            self._waited += elapsed

        is_stuck = self._waited > PROGRESS_TIMEOUT
        if not has_arrived and self._is_overdue(now, is_stuck, is_at_end):
            worst = int(np.abs(error).argmax())
            lag = abs(error[worst])
            if is_default and is_at_end and lag <= NEAR_TOLERANCE:
                return self._finish()
            failure = '' if is_default else goal_violation
            failure = failure or f'roller {names[worst]} stays {lag:.4g} m behind the trajectory'
            return self._finish(failure, at_goal=is_at_end or not is_stuck)

        # Feed-forward of the trajectory's velocity, which is zero during a lag, and feedback.
        speeds = (error - error_now) / (elapsed or self.timeout) + POSITION_GAIN * error_now
        if is_at_end:
            # Rollers that have arrived stay at rest; they need no further feedback.
            speeds = np.where(np.abs(error) <= np.minimum(TOLERANCE, goal.positions), 0.0, speeds)
        limit = self._robot.description.max_speed
        return RollerStep(np.clip(speeds, -limit, limit))

    def _is_overdue(self, now: float, is_stuck: bool, is_at_end: bool) -> bool:
        """Return whether a timeout has passed; at the end, the goal's may replace the default."""
        if self._tolerances.goal_time is None:
            return is_stuck
        latest_arrival = self._start + self.trajectory.duration + self._tolerances.goal_time
        return now > latest_arrival or (is_stuck and not is_at_end)

    def _finish(self, failure: str = '', at_goal: bool = False) -> RollerStep:
        """End the trajectory, and return a step that stops the rollers."""
        self.trajectory = None
        return self._stop_step._replace(ended=True, failure=failure, at_goal=at_goal)
