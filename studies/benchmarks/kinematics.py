# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Computing times of forward kinematics and of roller velocities for a twist, on one core.

The table has medians and 99th percentiles over random reachable states of the nine-member robot.
Each function has a peer that is called in the same loop. A timed call starts from a configuration
without caches, unless its row says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
import itertools

from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.manipulation.grip import find_members
from isotruss_ros.core.numerics.arrays import Array
import numpy as np
import scipy.optimize
from studies.benchmarks.measuring import part, Table, timed

STATES = part(2000)
#: Largest roller travel of random states [m]; 98 % of their corners have 15 to 134 degrees.
TRAVEL = 0.4
DIAMETER = 0.15
#: Differences of configurations that must not share a cache [m].
OFFSETS = itertools.count(1e-15, 1e-15)


@dataclass(frozen=True)
class State:
    """Random reachable state: configuration, grip, and the largest twist within the limits."""

    config: core.Configuration
    grip: core.Grip
    twist: Array


def random_states(robot: core.Robot, count: int, seed: int) -> list[State]:
    """Draw states within the length limits in which the object fits its grasp."""
    rng = np.random.default_rng(seed)
    limits = robot.description
    surface = np.array([1.0, 1.0, 0.5 * DIAMETER])
    states: list[State] = []
    while len(states) < count:
        module = str(rng.choice(robot.roller_names))
        travel = rng.uniform(-TRAVEL, TRAVEL, len(robot.roller_names))
        direction = rng.standard_normal(3)
        twist = direction / np.linalg.norm(direction) / surface
        try:
            config = robot.configuration(travel)
            center = core.tangent_center(config, module, DIAMETER)
            body = core.ConvexObject.disc(center, DIAMETER)
            grip = core.Grip.at_module(robot, module, body)
            command = core.solve_twist(config, grip, twist)
        except (ConfigurationError, GraspError):
            continue
        lengths = config.member_lengths
        inside = lengths.min() > limits.min_length and lengths.max() < limits.max_length
        if inside and command.status != core.Status.UNREACHABLE and command.scale < 1.0:
            states.append(State(config, grip, command.scale * twist))
    return states


def unprepared(config: core.Configuration) -> core.Configuration:
    """Return an almost equal configuration without caches."""
    travel = config.roller_positions + next(OFFSETS)
    return core.Configuration(config.robot, travel, config.points)


@dataclass
class Row:
    """Row of the table: times of the package and of the peer [s]."""

    name: str
    peer: str
    ours: list[float] = field(default_factory=list)
    peers: list[float] = field(default_factory=list)
    apart: int = 0

    def add(
        self, ours: Callable[[], Array], peer: Callable[[], Array | None], unit: float
    ) -> None:
        """
        Time the package and its peer in one state.

        :param ours: call of the package.
        :param peer: call of the peer; returns None if it failed.
        :param unit: largest difference of results on the same branch of solutions.
        """
        time, result = timed(ours)
        self.ours.append(time)
        time, expected = timed(peer)
        self.peers.append(time)
        self.apart += expected is None or bool(np.abs(result - expected).max() > unit)

    def cells(self) -> list[str]:
        """Return the row as text."""
        median, high = 1e6 * np.percentile(self.ours, [50, 99])
        peer = 1e6 * float(np.median(self.peers))
        times = [f'{time:.0f}' for time in (median, high)]
        peers = f'{peer:.0f}', f'{peer / median:.1f}', f'{self.apart}'
        return [self.name, *times, self.peer, *peers]


def nodes_at(near: core.Configuration, travel: Array) -> Array:
    """Return the nodes by the package's forward kinematics."""
    return near.moved_to(travel).nodes


def roller_velocities(config: core.Configuration, grip: core.Grip, twist: Array) -> Array:
    """Return the roller velocities for a twist by the package."""
    return core.solve_twist(config, grip, twist).roller_velocities


def root_by_hybr(near: core.Configuration, travel: Array) -> Array | None:
    """Return the nodes by MINPACK's hybr (same residual and Jacobian); None if it failed."""
    robot = near.robot
    lengths = robot.home_lengths.copy()
    lengths[: robot.topology.n_modules] += robot.topology.incidence @ travel
    found = scipy.optimize.root(
        lambda x: robot.constraints.residual(x.view(np.complex128), lengths),
        near.points.view(np.float64),
        jac=lambda x: robot.constraints.matrix(x.view(np.complex128)),
        method='hybr',
        tol=1e-12,
    )
    return found.x.reshape(-1, 2) if found.success else None


def task_rows(config: core.Configuration, grip: core.Grip) -> tuple[Array, float]:
    """Return the rows (14) to (16) of node velocities (4, 2 n), and (17) of the rollers."""
    nodes, points = find_members(config.robot.topology, grip.members), config.points
    (b, c_prev), (b_next, c) = nodes.lines.T
    rows = np.zeros((4, len(points)), dtype=np.complex128)
    ahead, back = points[b_next] - points[b], points[c_prev] - points[c]
    # (16), and the same of the member behind: Re(conj(row) v) is the turning rate.
    rows[2, [b_next, b]] = np.array([1j, -1j]) / ahead.conjugate()
    rows[3, [c_prev, c]] = np.array([1j, -1j]) / back.conjugate()
    # (14), (15): the angle between both; the object is at rest in the frame of B.
    rows[3] -= rows[2]
    arm = grip.center - points[b]
    rows[:2] = np.outer([-arm.imag, arm.real], rows[2])
    rows[[0, 1], b] += np.array([1.0, 1j])
    side = np.sign((ahead.conjugate() * arm).imag)
    return rows.view(np.float64), side * 2.0 / grip.body.shape.diameter


class PaperProgram:
    """
    Quadratic program (11) with the rows of (20) in node velocities, as in the paper.

    :ivar rollers_by_lengths: constant maps from length rates to roller speeds and tubes.
    """

    def __init__(self, robot: core.Robot) -> None:
        topology = robot.topology
        self.robot = robot
        self.rollers_by_lengths = np.linalg.pinv(topology.incidence)
        self.tubes = (np.arange(1 + topology.tube.max())[:, None] == topology.tube).astype(float)

    def solve_kkt(self, state: State, twist: Array) -> Array:
        """Return the solution of (11) with (20) as one dense linear system, by NumPy."""
        config, topology = unprepared(state.config), self.robot.topology
        matrix = self.robot.constraints.matrix(config.points)
        dense = matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
        lengths, fixed = np.split(dense, [topology.n_modules])
        task, rolling = task_rows(config, state.grip)
        module = find_members(self.robot.topology, state.grip.members).members[0]
        roller = topology.driven.searchsorted(module)
        task[2] += rolling * (self.rollers_by_lengths[roller] @ lengths)
        equality = np.vstack([self.tubes @ lengths, fixed, task])
        k, n = equality.shape
        system = np.zeros((n + k, n + k))
        system[:n, :n] = lengths.T @ lengths
        system[n:, :n] = equality
        system[:n, n:] = equality.T
        right = np.zeros(n + k)
        right[-4:-1] = twist
        return self.rollers_by_lengths @ lengths @ np.linalg.solve(system, right)[:n]


def forward_rows(robot: core.Robot, states: list[State], rng: np.random.Generator) -> list[Row]:
    """Measure forward kinematics; differences in units of 1 cm at the nodes."""
    step = robot.description.max_speed / 200.0
    rows = [
        Row('forward kinematics, one 200 Hz cycle on', 'scipy root(hybr)'),
        Row('forward kinematics, from home', 'scipy root(hybr)'),
    ]
    for state in states:
        goal = state.config.roller_positions
        ahead = goal + step * rng.choice([-1.0, 1.0], len(goal))
        for row, start, there in zip(rows, (state.config, robot.home), (ahead, goal), strict=True):
            near = unprepared(start)
            row.add(partial(nodes_at, near, there), partial(root_by_hybr, near, there), unit=0.01)
    return rows


def twist_rows(robot: core.Robot, states: list[State]) -> list[Row]:
    """Measure twist to rollers; differences in units of 1 % of the largest roller speed."""
    paper, unit = PaperProgram(robot), 0.01 * robot.description.max_speed
    rows = [
        Row('twist, no limit binds', '(20) as a KKT system'),
        Row('twist, limits bind', 'the same, no limits'),
    ]
    for state in states:
        for row, size in zip(rows, (0.5, 2.0), strict=True):
            config, twist = unprepared(state.config), size * state.twist
            ours = partial(roller_velocities, config, state.grip, twist)
            row.add(ours, partial(paper.solve_kkt, state, twist), unit)
    return rows


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    robot = core.load_robot('nine_member')
    states = random_states(robot, STATES, seed=1)
    forward_rows(robot, states[:20], np.random.default_rng(2))  # warm up, not counted
    twist_rows(robot, states[:20])
    rows = [*forward_rows(robot, states, np.random.default_rng(2)), *twist_rows(robot, states)]
    title = (
        f'{STATES} random reachable states; apart: how often the peer failed or ended elsewhere.'
    )
    header = ('case', 'median [us]', 'p99 [us]', 'peer', 'its median [us]', 'peer / ours', 'apart')
    yield Table(title, header, [row.cells() for row in rows])
