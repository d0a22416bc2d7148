# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path of a held object to a pose, around obstacles and limits of the robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from isotruss_ros.core.errors import format_numbers, GraspError
from isotruss_ros.core.holding.held_grip import HeldGrip
from isotruss_ros.core.holding.settle_grasp import settle_grasp
from isotruss_ros.core.kinematics.configuration import Configuration
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.manipulation.grip import Grip
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.pose import pose_difference, pose_fault
from isotruss_ros.core.numerics.argument_kinds import check_kinds
from isotruss_ros.core.numerics.arrays import Array, check_count, finite_array, MAX_MAGNITUDE
from isotruss_ros.core.numerics.blas_threads import single_threaded
from isotruss_ros.core.numerics.records import Record
from isotruss_ros.core.paths.path_tracking import TrackingSettings
from isotruss_ros.core.planning.foresee_path import foresee_path, SPEED, TRACKING, TURN_RATE
from isotruss_ros.core.planning.path_tree import Node, PathTree
import numpy as np
from numpy.typing import ArrayLike

#: Number of obstacles and limits that are named if no path is found [-].
NAMED = 3
#: Number of poses on the straight line at which the clearance of the object is evaluated [-], and
#: clearance at which the deviation from the line would exceed the tolerance of a path [m].
LINE_POSES, LINE_CLEARANCE = 50, 0.01
#: Steps of the search in the time of one step of `foresee_path` [-]; 1.7 to 3.2 with five goals.
FORESIGHT_STEPS = 3
#: Ratio of the tolerances in the search to those of the path [-]. With 1, one of 22 paths was lost
#: in the elastic plant: it was foreseen to end at 4.997 of 5 mm from the goal.
TOLERANCE_SHARE = 0.9
#: Largest number of steps of a search by default [-], of about 3 ms each.
MAX_SEARCH_STEPS = 4000


@dataclass(frozen=True, eq=False, repr=False)
class PathPlan(Record, Sequence[Array], headline=('why', 'poses', 'steps')):
    """
    Path of a held object to a pose, usable as a sequence of its poses.

    :ivar poses: (k, 3) poses x, y, angle of the path, from the start to the goal [m, rad]; empty
        if no path was found.
    :ivar why: reason if no path was found, with the obstacles and limits in the way; otherwise
        empty.
    :ivar steps: number of steps of the search.
    """

    poses: Array
    why: str
    steps: int

    def __getitem__(self, place: int | slice) -> Array:
        """Return the pose at an index, or the poses of a slice."""
        return self.poses[place]

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.poses)


@check_kinds
@single_threaded
def plan_path(
    robot: Robot | Configuration,
    grip: Grip,
    goal: ArrayLike,
    obstacles: Sequence[Obstacle] = (),
    seed: int = 0,
    max_steps: int = MAX_SEARCH_STEPS,
    on_progress: Callable[[float], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> PathPlan:
    """
    Return a path on which `foresee_path` moves a held object to a pose, or the reason of none.

    The path is straight if `foresee_path` accepts the straight line; in the search, its tolerances
    are nine tenths of those of a path. The result depends on `seed`, but not on the time that the
    search takes.

    :param robot: configuration of the robot that holds the object; or the robot, at home.
    :param grip: the grip, with the object at its pose at the start.
    :param goal: desired pose (x, y, angle), reached by the shorter rotation [m, rad].
    :param obstacles: obstacles at rest.
    :param seed: seed of the random number generator.
    :param max_steps: largest number of steps of the search, about 3 ms each.
    :param on_progress: callback with the share of `max_steps` that was used, 0 to 1.
    :param should_stop: function that is called after each motion; if it returns true, the search
        ends.
    :raises GraspError: the goal is not three finite numbers within range, or a number is invalid.
    """
    config = robot.home if isinstance(robot, Robot) else robot
    settled = settle_grasp(config, grip.body, grip.friction, members=grip.members)
    if not settled.held:
        return PathPlan(np.empty((0, 3)), f'the object is not held: {settled.reason}', 0)
    search = goal, obstacles, seed, max_steps, on_progress, should_stop
    return search_path(settled.equilibrium, grip.friction, *search)


def search_path(
    held: HeldGrip,
    friction: float,
    goal: ArrayLike,
    obstacles: Sequence[Obstacle] = (),
    seed: int = 0,
    max_steps: int = MAX_SEARCH_STEPS,
    on_progress: Callable[[float], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
    speed: float = SPEED,
    turn_rate: float = TURN_RATE,
    settings: TrackingSettings = TRACKING,
) -> PathPlan:
    """Return a path from an equilibrium to a pose, see `plan_path` and `foresee_path`."""
    what = 'the goal (x, y, angle) [m, rad]'
    target = finite_array(goal, 3, what, GraspError, MAX_MAGNITUDE)
    if fault := pose_fault(*target.tolist()):
        raise GraspError(f'{what}: {format_numbers(target)}: {fault}')
    max_steps = check_count(max_steps, 'max_steps', GraspError)
    rng = np.random.default_rng(check_count(seed, 'seed', GraspError))
    target = np.array(held.pose) + pose_difference(target, held.pose)
    tree = PathTree(RollingGrip.attach(held.config, held.touching(friction)), target, obstacles)
    strict = replace(
        settings,
        position_tolerance=TOLERANCE_SHARE * settings.position_tolerance,
        angle_tolerance=TOLERANCE_SHARE * settings.angle_tolerance,
    )
    stopped = False
    for node in _propose(tree, rng):
        if node is not None:
            poses = tree.path_to(node)
            foresight = foresee_path(held, friction, poses, speed, turn_rate, strict, obstacles)
            if not foresight.why:
                return PathPlan(poses, '', tree.steps)
            tree.discard(node, foresight.pose)
            tree.steps += FORESIGHT_STEPS * len(foresight.grips)
            limits = foresight.why.partition('limits of ')[2]
            tree.blocking.update(limits.split(', ') if limits else [foresight.why])
        if on_progress is not None:
            on_progress(min(tree.steps / max_steps, 1.0))
        stopped = should_stop is not None and should_stop()
        if stopped or tree.steps >= max_steps:
            break
    names = [name for name, _ in tree.blocking.most_common(NAMED)]
    end = f'no way found in {tree.steps} steps{" (stopped)" if stopped else ""}'
    return PathPlan(np.empty((0, 3)), f'{end}; in the way: {", ".join(names)}', tree.steps)


def _propose(tree: PathTree, rng: np.random.Generator) -> Iterator[Node | None]:
    """Yield the end of the straight line to the goal, then those of the tree; None without one."""
    if names := tree.find_contact():
        tree.blocking.update([f'at the start, {names}'])
        return
    if name := tree.find_collision(tree.goal, clearance=LINE_CLEARANCE):
        tree.blocking.update([f'the object at the goal and obstacle {name}'])
        return
    begin = np.array(tree.start.grip.body.pose)
    line = np.linspace(begin, tree.goal, LINE_POSES)
    if name := tree.find_collision(*line, clearance=LINE_CLEARANCE):
        tree.blocking.update([f'the object and obstacle {name}'])
    else:
        yield Node(tree.start, (begin, tree.goal))
    yield from tree.propose(rng)
