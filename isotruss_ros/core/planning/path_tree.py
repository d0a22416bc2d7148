# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Tree of motions of a held object, a rapidly exploring random tree (LaValle and Kuffner).

The configuration at a pose depends on the path to it, because there are more rollers than
coordinates of the pose. So the tree grows from the start only. Contacts roll without slip on
undeformed members. The rollers move by the commands of the control loop, by which the object
slides along limits and obstacles; the poses of a path are those of this motion.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
import itertools
import math
from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError, GraspError, SolverError
from isotruss_ros.core.manipulation.grip import find_members
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.pose import Pose
from isotruss_ros.core.model.separation import separate
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.foresee_path import (
    guard_steps,
    guard_twist,
    OUT_OF_REACH,
    split_turns,
    TRACKING,
)
import numpy as np

#: Length [m], with rotations times the characteristic radius, and time [s] of a step.
STEP, STEP_TIME = 0.02, 0.7
#: Distance of the nodes along a motion, in steps, and smallest approach to its end by a step, as a
#: share of the step [-].
NODE_STEPS, MIN_APPROACH = 4, 0.1
#: Distance at which a motion ends, and of poses from the lines that replace them [m].
MOTION_END, LINE_TOLERANCE = 0.001, 0.002
#: Largest error of a pose that is reached, relative to the tolerances of a path [-]. A path ends
#: within 0.5; elastic members bend. With 0.2, one of four searches around limits of the robot
#: proposes no path in 3000 steps, and the others take two to four times the steps.
MAX_END_ERROR = 0.4
#: Smallest clearance of the object from obstacles, a tenth above that of the loop [m].
MIN_CLEARANCE = 0.022
#: Standard deviations of random poses from the straight line, in lengths of the line [-], and the
#: smallest such length [m].
SPREADS, MIN_LENGTH = (0.5, 1.5), 0.3
#: Fraction of random poses around the goal [-], and their standard deviation [m]. Motions to them
#: end in other configurations near the goal, some of which admit it. In searches around limits of
#: the robot, one of three goals had no path in 2500 steps with three seeds at a fraction of 0.5
#: and spreads of 0.3 and 1; it has one with these. With 0.5, half and twice the deviation change
#: the mean number of steps of four searches from 425 to 644 and 420.
GOAL_SHARE, GOAL_SPREAD = 0.25, 0.15


class Node(NamedTuple):
    """Grip in one configuration, and the path to it from the start."""

    rolling: RollingGrip
    poses: tuple[Array, ...]  #: (3,) poses at the ends of the motions to the node [m, rad]


@dataclass(eq=False)
class PathTree:
    """
    Tree of motions from the start.

    :ivar start: grip at the start.
    :ivar goal: (3,) desired pose, its angle at most half a turn from that of the start [m, rad].
    :ivar root: node at the start.
    :ivar steps: number of steps so far.
    :ivar blocking: numbers of the steps that each obstacle or limit has reduced.
    """

    start: RollingGrip
    goal: Array
    obstacles: Sequence[Obstacle]
    steps: int = 0
    blocking: Counter[str] = field(default_factory=Counter)
    root: Node = field(init=False)

    def __post_init__(self) -> None:
        """Set the root, the weights of twists, and the limits of the motions."""
        self.root = Node(self.start, (np.array(self.start.grip.body.pose),))
        self._nodes = [self.root]
        self._weights = np.array([1.0, 1.0, self.start.grip.body.arm])
        self._guard = guard_steps(self.start.config.robot, STEP_TIME, self.obstacles)

    def find_collision(self, *poses: Array, clearance: float = MIN_CLEARANCE) -> str:
        """Return the name of an obstacle to which the object at poses is too near, or no name."""
        bodies = [self.start.grip.body.moved_to(pose) for pose in poses]
        pairs = itertools.product(self.obstacles, bodies)
        near = (o.name for o, body in pairs if separate(o.body, body).distance < clearance)
        return next(near, '')

    def find_contact(self) -> str:
        """Return the names of a part and an obstacle that touch at the start, or no names."""
        for limit in self._guard.watch(self.start.config, self.start.grip).limits:
            touching = limit.indices[limit.margins + limit.barrier.law.bound < 0.0]
            if limit.status is Status.SLOWED_OBSTACLE and len(touching):
                return limit.barrier.names(touching)[0]
        return ''

    def propose(self, rng: np.random.Generator) -> Iterator[Node | None]:
        """Yield nodes at the goal, and None after motions that do not lead to it."""
        # The motion toward the goal slides along limits.
        end = self.move(self.root, self.goal)
        proposed = [self.path_to(end)]
        yield end if self.reaches(end, self.goal) else None
        for sample in self._sample(rng):
            near = self._nearest(sample)
            end = near if self.find_collision(sample) else self.move(near, sample)
            for node in self._connect(end) if end is not near else ():
                # Different nodes often have the same short path.
                path = self.path_to(node)
                if not any(is_near(path, other) for other in proposed):
                    proposed.append(path)
                    yield node
            yield None

    def path_to(self, end: Node) -> Array:
        """Return the path (n, 3) to a node at the goal, without poses near straight lines."""
        return split_turns(self._straighten(np.array([*end.poses[:-1], self.goal])))

    def discard(self, end: Node, pose: Pose) -> None:
        """Remove the nodes on the path to a node from the place nearest to a pose on."""
        errors = (np.array(end.poses) - np.array(pose)) * self._weights
        place = max(int(np.linalg.norm(errors, axis=1).argmin()), 1)
        lost = end.poses[place]
        # Nodes of one motion share the arrays of their poses.
        self._nodes = [
            n for n in self._nodes if len(n.poses) <= place or n.poses[place] is not lost
        ]

    def _sample(self, rng: np.random.Generator) -> Iterator[Array]:
        """Yield the pose of the object with its members at home, then random poses."""
        begin = self.root.poses[0]
        yield self._find_home()
        span = self.goal - begin
        length = max(self._distance(span), MIN_LENGTH) / (self._weights * (1.0, 1.0, 2.0))
        while True:
            deviation = rng.standard_normal(3)
            if rng.random() < GOAL_SHARE:
                yield self.goal + GOAL_SPREAD / self._weights * deviation
            else:
                yield begin + rng.random() * span + rng.choice(SPREADS) * length * deviation

    def _find_home(self) -> Array:
        """Return the pose after the rigid motion that moves the grip's members nearest to home."""
        config, grip = self.start.config, self.start.grip
        nodes = find_members(config.robot.topology, grip.members).lines.ravel()
        start, home = config.points[nodes], config.robot.home.points[nodes]
        angle = float(np.angle(np.vdot(start - start.mean(), home - home.mean())))
        center = home.mean() + np.exp(1j * angle) * (grip.body.center - start.mean())
        return np.array([center.real, center.imag, grip.body.pose.angle + angle])

    def _nearest(self, pose: Array) -> Node:
        """Return the node nearest to a pose."""
        ends = np.array([node.poses[-1] for node in self._nodes])
        return self._nodes[int(np.linalg.norm((ends - pose) * self._weights, axis=1).argmin())]

    def _distance(self, difference: Array) -> float:
        """Return the length of a difference of poses, with rotations times the radius [m]."""
        return float(np.linalg.norm(difference * self._weights))

    def _connect(self, node: Node) -> Iterator[Node]:
        """Yield the end of a short path to the goal through a node, then of one with all poses."""
        end = self.move(node, self.goal)
        if self.reaches(end, self.goal):
            yield self._shorten(end)
            yield end

    def _shorten(self, path: Node) -> Node:
        """Return the end of a path without poses that can be left out, the farthest ones first."""
        short, poses = self.root, [*path.poses[:-1], self.goal]
        while len(poses) > 1:
            # The motion from the start to the goal was proposed first.
            last = len(poses) - (2 if short is self.root else 1)
            for following in sorted({1, len(poses) // 2, max(last, 1)}, reverse=True):
                end = self.move(short, poses[following])
                if self.reaches(end, poses[following]):
                    break
            else:  # the shorter path ends at limits
                return path
            short, poses = end, poses[following:]
        return short

    def _straighten(self, poses: Array) -> Array:
        """Return a path without poses near its straight lines (Douglas and Peucker)."""
        points = poses * self._weights
        line = points[-1] - points[0]
        shares = ((points - points[0]) @ line / max(line @ line, LINE_TOLERANCE**2)).clip(0.0, 1.0)
        errors = np.linalg.norm(points - points[0] - np.outer(shares, line), axis=1)
        place = int(errors.argmax())
        if errors[place] < LINE_TOLERANCE:
            return poses[[0, -1]]
        parts = self._straighten(poses[: place + 1]), self._straighten(poses[place:])
        return np.concatenate([parts[0][:-1], parts[1]])

    def reaches(self, node: Node, pose: Array) -> bool:
        """Return whether a node is at a pose, within the tolerances of the end of a path."""
        x, y, angle = (pose - node.poses[-1]).tolist()
        error = math.hypot(x, y) / TRACKING.position_tolerance
        return max(error, abs(angle) / TRACKING.angle_tolerance) < MAX_END_ERROR

    def move(self, node: Node, target: Array) -> Node:
        """Return the end of a motion from a node toward a pose; add nodes on the way."""
        rolling, last = node.rolling, node
        remaining = target - node.poses[-1]
        distance = self._distance(remaining)
        for number in itertools.count(1):
            if distance < MOTION_END:
                break
            self.steps += 1
            moved = self._take_step(rolling, min(1.0, STEP / distance) * remaining / STEP_TIME)
            if moved is None:
                break
            pose = np.array(moved.grip.body.pose)
            remaining = target - pose
            before, distance = distance, self._distance(remaining)
            if before - distance < MIN_APPROACH * min(STEP, before):
                break
            rolling = moved
            if number % NODE_STEPS == 0:
                last = Node(rolling, (*last.poses, pose))
                self._nodes.append(last)
        if rolling is last.rolling:
            return last
        self._nodes.append(Node(rolling, (*last.poses, np.array(rolling.grip.body.pose))))
        return self._nodes[-1]

    def _take_step(self, rolling: RollingGrip, twist: Array) -> RollingGrip | None:
        """Return the grip after a step by the control loop; None if there is none."""
        config = rolling.config
        try:
            command = guard_twist(self._guard, config, rolling.grip, twist, STEP_TIME)
            self.blocking.update(command.limiting)
            travel = STEP_TIME * command.roller_velocities
            return rolling.moved_to(config.moved_to(config.roller_positions + travel))
        except (ConfigurationError, GraspError, SolverError):
            self.blocking.update([OUT_OF_REACH])
            return None


def is_near(path: Array, other: Array) -> bool:
    """Return whether two paths have the same number of poses, and each near its counterpart."""
    return len(path) == len(other) and float(np.abs(path - other).max()) < LINE_TOLERANCE
