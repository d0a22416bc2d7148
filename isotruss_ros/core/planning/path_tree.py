# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Tree of straight motions of a held object, a rapidly exploring random tree (LaValle and Kuffner).

The configuration at a pose depends on the path to it, because there are more rollers than
coordinates of the pose. So the tree grows from the start only. Contacts roll without slip on
undeformed members, and rollers move by `solve_twist` within the limits of the control loop. The
bounds are stricter than those of the loop, because the steps are long.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
import itertools
from typing import NamedTuple

from isotruss_ros.core.errors import ConfigurationError, GraspError, SolverError
from isotruss_ros.core.manipulation.rolling_grip import RollingGrip
from isotruss_ros.core.manipulation.solve_twist import solve_twist
from isotruss_ros.core.manipulation.status import Status
from isotruss_ros.core.model.obstacle import Obstacle
from isotruss_ros.core.model.separation import separate
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.planning.foresee_path import LOOP_HANDLING, OUT_OF_REACH
from isotruss_ros.core.safety.shape_guard import ShapeBounds, ShapeGuard
import numpy as np

#: Length of a step, with rotations times the characteristic radius [m], and distance of the nodes
#: along a motion, in steps [-].
STEP, NODE_STEPS = 0.02, 4
#: Distance of a pose that is reached, in steps [-].
REACHED_SHARE = 0.05
#: Time of a step [s], and the largest share of a small margin that it may use [-].
STEP_TIME, DECAY = 1.0, 0.8
#: Bounds of the search; clearances exceed the default bounds of a motion by a tenth.
BOUNDS = ShapeBounds(0.21, 0.022, 0.022, rate=DECAY / STEP_TIME, min_obstacle_clearance=0.022)
#: Standard deviations of random poses from the straight line, in lengths of the line [-], and the
#: smallest such length [m].
SPREADS, MIN_LENGTH = (0.3, 1.0), 0.3
#: Largest deviation of a step from its direction, relative to its length [-], and smallest factor
#: by which limits may shorten a step [-].
MAX_DEVIATION, MIN_SCALE = 0.15, 0.3


class Node(NamedTuple):
    """Grip in one configuration, and the path to it from the start."""

    rolling: RollingGrip
    poses: tuple[Array, ...]  #: (3,) poses at the ends of the motions to the node [m, rad]


@dataclass(eq=False)
class PathTree:
    """
    Tree of straight motions from the start.

    :ivar start: grip at the start.
    :ivar goal: (3,) desired pose, its angle at most half a turn from that of the start [m, rad].
    :ivar root: node at the start.
    :ivar steps: number of steps so far.
    :ivar blocking: numbers of the motions that each obstacle or limit has ended.
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
        self._guard = ShapeGuard(self.start.config.robot, BOUNDS, obstacles=self.obstacles)

    def find_collision(
        self, *poses: Array, clearance: float = BOUNDS.min_obstacle_clearance
    ) -> str:
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

    def propose(self, rng: np.random.Generator) -> Iterator[Array | None]:
        """Yield paths (n, 3) to the goal, and None after motions that do not lead to it."""
        begin = self.root.poses[0]
        span = self.goal - begin
        length = max(self._distance(span), MIN_LENGTH) / (self._weights * (1.0, 1.0, 2.0))
        while True:
            spread = rng.choice(SPREADS) * length * rng.standard_normal(3)
            sample = begin + rng.random() * span + spread
            near = self._nearest(sample)
            end = near if self.find_collision(sample) else self.move(near, sample)
            yield None if end is near else self._connect(end)

    def _nearest(self, pose: Array) -> Node:
        """Return the node nearest to a pose."""
        ends = np.array([node.poses[-1] for node in self._nodes])
        return self._nodes[int(np.linalg.norm((ends - pose) * self._weights, axis=1).argmin())]

    def _distance(self, difference: Array) -> float:
        """Return the length of a difference of poses, with rotations times the radius [m]."""
        return float(np.linalg.norm(difference * self._weights))

    def _connect(self, node: Node) -> Array | None:
        """Return a short path (n, 3) to the goal through a node; None if there is none."""
        if self.find_collision(*np.linspace(node.poses[-1], self.goal, 10)[1:-1]):
            return None
        if not self.reaches(self.move(node, self.goal), self.goal):
            return None
        # Poses that can be left out, the farthest ones first.
        poses, short = [*node.poses, self.goal], self.root
        while len(poses) > 1:
            for following in sorted({1, len(poses) // 2, len(poses) - 1}, reverse=True):
                end = self.move(short, poses[following])
                if self.reaches(end, poses[following]):
                    break
            else:  # the shorter path ends at limits
                return np.array([*node.poses, self.goal])
            short, poses = end, poses[following:]
        return np.array([*short.poses[:-1], self.goal])

    def reaches(self, node: Node, pose: Array) -> bool:
        """Return whether a node is at a pose."""
        return self._distance(pose - node.poses[-1]) < REACHED_SHARE * STEP

    def move(self, node: Node, target: Array) -> Node:
        """Return the end of a straight motion from a node toward a pose; add nodes on the way."""
        rolling, last = node.rolling, node
        for number in range(1, 3 * int(self._distance(target - node.poses[-1]) / STEP) + 4):
            remaining = target - np.array(rolling.grip.body.pose)
            distance = self._distance(remaining)
            if distance < REACHED_SHARE * STEP:
                break
            self.steps += 1
            moved = self._take_step(rolling, min(1.0, STEP / distance) * remaining / STEP_TIME)
            if moved is None:
                break
            rolling = moved
            if number % NODE_STEPS == 0:
                last = Node(rolling, (*node.poses, np.array(rolling.grip.body.pose)))
                self._nodes.append(last)
        if rolling is last.rolling:
            return last
        self._nodes.append(Node(rolling, (*node.poses, np.array(rolling.grip.body.pose))))
        return self._nodes[-1]

    def _take_step(self, rolling: RollingGrip, twist: Array) -> RollingGrip | None:
        """Return the grip after a step; None if obstacles or limits end the motion."""
        config, grip = rolling.config, rolling.grip
        try:
            limits = self._guard.limits(config, grip)
            command = solve_twist(config, grip, twist, (), limits, LOOP_HANDLING)
            wanted, achieved = self._weights * twist, self._weights * command.achieved_twist
            scale = float(achieved @ wanted / (wanted @ wanted))
            deviation = float(np.linalg.norm(achieved - scale * wanted))
            if scale < MIN_SCALE or deviation > MAX_DEVIATION * scale * np.linalg.norm(wanted):
                self.blocking.update(command.limiting or [OUT_OF_REACH])
                return None
            travel = STEP_TIME * command.roller_velocities
            return rolling.moved_to(config.moved_to(config.roller_positions + travel))
        except (ConfigurationError, GraspError, SolverError):
            self.blocking.update([OUT_OF_REACH])
            return None
