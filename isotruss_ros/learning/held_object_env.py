# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gymnasium environment in which a robot moves a held object to a goal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import copy
import math
from typing import Any, NamedTuple

import gymnasium
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, GraspError, SolverError, suggest
from isotruss_ros.core.model.pose import check_range, Pose, pose_difference, pose_fault
from isotruss_ros.core.model.robot_schema import plausible_range
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, finite_array, MAX_LOAD
import numpy as np
from numpy.typing import NDArray

#: Penalty of the default reward for a lost object: ten times the largest distance of a goal [m].
LOSS_PENALTY = 0.2
#: Options of `HeldObjectEnv.reset`.
RESET_OPTIONS = ('goal', 'external_wrench')
RENDER_MODES = ('rgb_array', 'human')
#: Size of a picture [inch], at 100 points per inch.
PICTURE_SIZE = 6.4, 6.4


class Transition(NamedTuple):
    """One step of an episode, of which a reward is a function."""

    previous: Pose  #: pose of the object before the step [m, rad]
    pose: Pose  #: pose of the object after the step [m, rad]
    goal: Pose  #: pose to which the object should move [m, rad]
    twist: Array  #: (3,) commanded twist vx, vy [m/s], omega [rad/s]
    slip_margin: float  #: slip margin after the step, zero without contact [N]
    is_lost: bool  #: whether the episode ended because the object was lost


def progress_reward(transition: Transition) -> float:
    """
    Return the decrease of the distance to the goal in a step, minus `LOSS_PENALTY` if lost [m].

    :param transition: the step. Its orientation has no influence.
    """
    before = _distance(transition.previous, transition.goal)
    after = _distance(transition.pose, transition.goal)
    return before - after - LOSS_PENALTY * transition.is_lost


def _distance(pose: Pose, goal: Pose) -> float:
    """Return the distance of two positions [m]."""
    return math.hypot(goal.x - pose.x, goal.y - pose.y)


class HeldObjectEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """
    Simulated robot that moves a held object toward a goal, see `SimulatedRobot`, `ElasticObject`.

    An action is the twist (vx, vy, omega) of the object in the robot frame [m/s, m/s, rad/s],
    clipped to the action space. `solve_twist` with the limits of `ShapeGuard` turns it into roller
    speeds. An observation has 6 + r numbers for r rollers: the pose (x, y, angle) of the object
    [m, m, rad], the goal minus this pose [m, m, rad], and the travel of each roller since home,
    measured by its encoder [m].

    The episode is terminated if the object is lost, or the robot cannot move it. Then
    `info['reason']` has the reason in words; otherwise it is empty. `info` also has the distance
    to the goal [m], the slip margin and the squeeze [N], and the status of the command in words.

    :param robot: name of a preset, or path of a robot file.
    :param members: names of the two or three members that hold the object.
    :param shape: shape of the object; None: a disc with a diameter of 0.3 m.
    :param friction: coefficient of friction between tube and object [-].
    :param indentation: penetration of the straight members into the object at the start [m].
    :param goal_range: largest displacement (x, y, angle) of the goal from the start [m, m, rad].
    :param slip: largest mean slip of the rollers, drawn for each episode; see `RollerFaults` [-].
    :param force: largest constant external force along x and along y, drawn for each episode [N].
    :param max_twist: largest magnitudes of the action [m/s, m/s, rad/s].
    :param period: duration of a step [s].
    :param reward: function that returns the reward of a step.
    :param render_mode: `rgb_array`, `human` (a window of Matplotlib) or None, see `render`.
    :raises GraspError: an argument is invalid, or the members do not hold the object at the start.
    :raises RobotFileError: the robot file is invalid.
    """

    #: Whether an invalid action raises an error; otherwise it ends the episode with the reason.
    is_strict = True
    # Gymnasium reads it from the class.
    metadata: dict[str, Any] = {'render_modes': RENDER_MODES, 'render_fps': 20}  # noqa: RUF012

    @check_kinds
    def __init__(
        self,
        robot: str = 'nine_member',
        members: Sequence[str] = ('north/P-Z', 'north/Z-R'),
        shape: Shape | None = None,
        friction: float = 0.8,
        indentation: float = 0.01,
        goal_range: tuple[float, float, float] = (0.02, 0.02, 0.0),
        slip: float = 0.02,
        force: float = 0.0,
        max_twist: tuple[float, float, float] = (0.02, 0.02, 0.2),
        period: float = 0.05,
        reward: Callable[[Transition], float] = progress_reward,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise GraspError(f'render_mode {render_mode!r}: must be one of {RENDER_MODES} or None')
        self._home = core.load_robot(robot).home
        self._members, self._reward = tuple(members), reward
        self._friction, self._slip = friction, check_range(slip, 'slip', '', 0.0, 0.5)
        self._force = check_range(force, 'force', 'N', 0.0, MAX_LOAD)
        self._period = check_range(period, 'period', 's', 1e-3, 1.0)
        self.metadata = self.metadata | {'render_fps': round(1.0 / self._period)}
        self.render_mode = render_mode
        self._figure: Any = None  # of Matplotlib
        self._goal_range = _magnitudes(goal_range, 'goal_range (x, y [m], angle [rad])')
        shape = core.Disc(0.3) if shape is None else shape
        self._body = core.place_between(
            self._home, self._members, shape, indentation=indentation
        ).body
        settled = core.settle_grasp(self._home, self._body, friction, members=self._members)
        if not settled.held:
            raise GraspError(
                f'indentation {indentation:g} m, friction {friction:g}: must hold the object at '
                f'the start: {settled.reason}'
            )
        # All episodes begin with the same equilibrium.
        self._closed = core.ElasticObject(self._body, self._friction)
        self._closed.follow(self._home)
        self._guard = core.ShapeGuard(self._home.robot)
        self._robot: core.SimulatedRobot | None = None  # None: a reset is needed
        self._drawn: core.SimulatedRobot | None = None  # also that of an episode that has ended
        self._max_twist = _magnitudes(max_twist, 'max_twist (vx, vy [m/s], omega [rad/s])')
        twist = _single(self._max_twist)
        self.action_space = Box(-twist, twist)
        _, farthest = plausible_range('joints')
        travel = np.full(len(self._home.roller_positions), self._home.member_lengths.sum())
        pose = np.array([farthest, farthest, math.pi])
        bounds = _single([*pose, *(pose * (2.0, 2.0, 1.0)), *travel])
        self.observation_space = Box(-bounds, bounds)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """
        Begin an episode with a held object; return the observation and `info`.

        :param seed: seed of the random numbers; None: they continue.
        :param options: `goal`, a pose (x, y, angle) of the object [m, rad], and `external_wrench`,
            a wrench (fx, fy, m) from the first step on [N, N m]; both are drawn otherwise.
        :raises GraspError: an option is unknown or invalid.
        """
        super().reset(seed=seed)
        options = options or {}
        for name in options:
            if name not in RESET_OPTIONS:
                hint = suggest(name, RESET_OPTIONS)
                raise GraspError(f'option {name!r}: {hint}must be {" or ".join(RESET_OPTIONS)}')
        rng = self.np_random
        faults = core.RollerFaults(slip=rng.uniform(0.0, self._slip))
        self._object = copy.copy(self._closed)
        robot = core.SimulatedRobot(self._home, self._object, faults, int(rng.integers(2**31)))
        force, shift = rng.uniform(-self._force, self._force, 2), rng.uniform(-1.0, 1.0, 3)
        wrench = options.get('external_wrench', (*force, 0.0))
        goal = options.get('goal', robot.object_pose + self._goal_range * shift)
        self._object.external_wrench = wrench
        self._goal = Pose(*finite_array(goal, 3, 'goal (x, y [m], angle [rad])', GraspError))
        if 'goal' in options and (fault := pose_fault(*self._goal)):
            raise GraspError(f'goal {goal}: {fault}')
        self._robot = self._drawn = robot
        if self.render_mode == 'human':
            self.render()
        return self._observe(), self._info(core.Status.IDLE, '')

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """
        Move the object for one period.

        :param action: twist (vx, vy, omega) of the object [m/s, m/s, rad/s].
        :return: observation, reward, whether the episode is terminated, False, and `info`.
        :raises ResetNeeded: the episode is terminated, or none has begun.
        :raises GraspError: the action is not three finite numbers.
        """
        if self._robot is None:
            raise ResetNeeded('no episode: must be begun by reset')
        previous, twist = self._robot.object_pose, np.zeros(3)
        try:
            twist = finite_array(action, 3, 'action (vx, vy [m/s], omega [rad/s])', GraspError)
        except GraspError as error:
            if self.is_strict:
                raise
            status, reason = core.Status.HALT_KINEMATICS, str(error)
        else:
            twist = np.clip(twist, -self._max_twist, self._max_twist)
            status, reason = self._move(self._robot, twist)
        observation, info = self._observe(), self._info(status, reason)
        transition = Transition(
            previous,
            self._robot.object_pose,
            self._goal,
            twist,
            info['slip_margin'],
            self._object.grasp is None,
        )
        if self.render_mode == 'human':
            self.render()
        if reason:
            self._robot = None
        return observation, float(self._reward(transition)), bool(reason), False, info

    def _move(self, robot: core.SimulatedRobot, twist: Array) -> tuple[core.Status, str]:
        """Move the object by a twist; return the status and the reason why the episode ends."""
        grip = core.Grip(self._members, self._body.moved_to(robot.object_pose), self._friction)
        try:
            limits = self._guard.limits(robot.config, grip)
            command = core.solve_twist(robot.config, grip, twist, limits=limits)
            robot.command(command.roller_velocities)
            robot.advance(self._period)
        except (ConfigurationError, GraspError, SolverError) as error:
            return core.Status.HALT_KINEMATICS, str(error)
        if self._object.dropped is not None:
            return core.Status.HALT_NOT_HELD, self._object.dropped.value
        return command.status, ''

    def render(self) -> Any:
        """
        Draw the robot, the object with its forces, and the goal.

        :return: (h, w, 3) picture of type uint8 in the mode `rgb_array`; None in the mode `human`,
            which shows a window where `reset` and `step` draw.
        :raises ResetNeeded: no episode has begun.
        """
        if self.render_mode is None:
            return None
        if self._drawn is None:
            raise ResetNeeded('no episode: must be begun by reset')
        from isotruss_ros.plotting.grasp_drawing import plot_grasp
        from isotruss_ros.plotting.robot_drawing import frame, plot_robot
        from matplotlib import pyplot
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        if self._figure is None:
            is_window = self.render_mode == 'human'
            self._figure = (pyplot.figure if is_window else Figure)(figsize=PICTURE_SIZE)
        self._figure.clear()
        axes, grasp = self._figure.add_subplot(), self._object.grasp
        if grasp is None:
            plot_robot(self._drawn.config, axes)
            outline = self._body.moved_to(self._drawn.object_pose).outline(0.01)
            axes.fill(outline.real, outline.imag, color='0.6', zorder=5)
        else:
            plot_grasp(grasp, axes)
        axes.plot(self._goal.x, self._goal.y, 'x', color='black', ms=10, zorder=10)
        margin = 2.0 * self._home.robot.description.tube_diameter
        nodes = self._home.nodes
        frame(axes, nodes.min(axis=0) - margin, nodes.max(axis=0) + margin)
        if self.render_mode == 'human':
            pyplot.pause(1e-3)
            return None
        canvas = FigureCanvasAgg(self._figure)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def close(self) -> None:
        """Close the window, if any."""
        if self._figure is not None and self.render_mode == 'human':
            from matplotlib import pyplot

            pyplot.close(self._figure)
        self._figure = None

    def _observe(self) -> NDArray[np.float32]:
        """Return the observation."""
        pose = self._robot.object_pose
        away = pose_difference(self._goal, pose)
        angle = math.remainder(pose.angle, 2.0 * math.pi)
        return _single([pose.x, pose.y, angle, *away, *self._robot.roller_positions])

    def _info(self, status: core.Status, reason: str) -> dict[str, Any]:
        """Return the quantities besides the observation."""
        grasp = self._object.grasp
        return {
            'distance': _distance(self._robot.object_pose, self._goal),
            'slip_margin': self._object.slip_margin,
            'squeeze': 0.0 if grasp is None else grasp.squeeze,
            'status': str(status),
            'reason': reason,
        }


class HeldObjectVectorEnv(SyncVectorEnv):
    """
    Several `HeldObjectEnv` with equal arguments, reset in the step after the end of an episode.

    The equilibrium in which the episodes begin is computed once. An action that is not three
    finite numbers ends the episode of its own environment, with the reason in `info`.

    :param num_envs: number of environments.
    :param max_episode_steps: number of steps after which an episode is truncated.
    :param arguments: arguments of `HeldObjectEnv`.
    :raises GraspError: see `HeldObjectEnv`.
    :raises RobotFileError: the robot file is invalid.
    """

    def __init__(self, num_envs: int = 1, max_episode_steps: int = 200, **arguments: Any) -> None:
        first = HeldObjectEnv(**arguments)
        first.is_strict = False
        super().__init__(num_envs * [lambda: TimeLimit(copy.copy(first), max_episode_steps)])


def _single(values: Any) -> NDArray[np.float32]:
    """Return values in single precision."""
    return np.asarray(values, dtype=np.float32)


def _magnitudes(values: Any, what: str) -> Array:
    """Return three checked numbers that are not negative."""
    numbers = finite_array(values, 3, what, GraspError)
    if (numbers < 0.0).any():
        raise GraspError(f'{what} {values!r}: must not be negative')
    return numbers
