# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How long forward kinematics and twist-to-rollers take on the nine-member robot, one core.

Medians and 99th percentiles over random reachable states, each next to a peer that is called in
the same loop. Nothing is prepared: a timed call starts from a configuration whose matrix has been
neither built nor factored, unless its row says so.

    python benchmarks/kinematics.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
import os

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from isotruss_ros import core
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.kinematics.constraints import Targets
from isotruss_ros.core.manipulation.grip import find_members
from isotruss_ros.core.manipulation.limits import default_limits
from isotruss_ros.core.manipulation.twist_qp import PENALTIES
from isotruss_ros.core.numerics.arrays import Array
from measuring import part, PEER, PEER_OPTIONS, print_machine, print_table, timed
import numpy as np
import qpsolvers
import scipy.optimize

STATES = part(2000)
#: Roller travel of random states [m]: 98 % of the corners have 15 to 134 degrees.
TRAVEL = 0.4
DIAMETER = 0.15
TARGET = 300e-6
#: The paper's cost sees only length rates; solvers want it positive definite in all coordinates.
REGULAR = 1e-9


@dataclass(frozen=True)
class State:
    """A random reachable state: configuration, grip and the largest twist within the limits."""

    config: core.Configuration
    grip: core.Grip
    twist: Array


def random_states(robot: core.Robot, count: int, seed: int) -> list[State]:
    """Draw states within the length limits in which the object fits into its grasp."""
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
    """Return the same configuration without its cached results."""
    return core.Configuration(config.robot, config.roller_positions, config.points)


@dataclass
class Row:
    """One line of the table: times [s] of ours and of the peer."""

    name: str
    peer: str
    target: float | None = TARGET
    ours: list[float] = field(default_factory=list)
    peers: list[float] = field(default_factory=list)
    differences: list[float] = field(default_factory=list)

    def add(
        self, ours: Callable[[], Array], peer: Callable[[], Array | None], unit: float
    ) -> None:
        """
        Time both on one state.

        :param ours: the call of the package.
        :param peer: that of the peer; None where it failed.
        :param unit: results that differ by more than this are of another branch.
        """
        time, result = timed(ours)
        self.ours.append(time)
        time, expected = timed(peer)
        self.peers.append(time)
        difference = np.inf if expected is None else float(np.abs(result - expected).max())
        self.differences.append(difference / unit)

    def cells(self) -> list[str]:
        """Return the row as text."""
        median, high = np.percentile(self.ours, [50, 99])
        peer = float(np.median(self.peers))
        verdict = '' if self.target is None else 'pass' if median < self.target else 'FAIL'
        same = np.array([difference for difference in self.differences if difference < 1.0])
        typical = f'{np.median(same):.0e}' if len(same) else '-'
        return [
            self.name,
            f'{1e6 * median:.0f}',
            f'{1e6 * high:.0f}',
            '' if self.target is None else f'< {1e6 * self.target:.0f}',
            verdict,
            self.peer,
            f'{1e6 * peer:.0f}',
            f'{peer / median:.1f}',
            f'{len(self.differences) - len(same)}',
            typical,
        ]


def nodes_at(near: core.Configuration, travel: Array) -> Array:
    """Forward kinematics by the package."""
    return near.moved_to(travel).nodes


def roller_velocities(config: core.Configuration, grip: core.Grip, twist: Array) -> Array:
    """Twist to rollers by the package."""
    return core.solve_twist(config, grip, twist).roller_velocities


def root_by_hybr(near: core.Configuration, travel: Array) -> Array | None:
    """Forward kinematics by MINPACK's hybr, with the same residual and Jacobian."""
    robot = near.robot
    lengths = robot.home_targets.lengths.copy()
    lengths[: robot.topology.n_modules] += robot.topology.incidence @ travel
    targets = Targets(lengths, robot.home_targets.ground)
    found = scipy.optimize.root(
        lambda x: robot.constraints.residual(x.view(np.complex128), targets),
        near.points.view(np.float64),
        jac=lambda x: robot.constraints.matrix(x.view(np.complex128)),
        method='hybr',
        tol=1e-12,
    )
    return found.x.reshape(-1, 2) if found.success else None


def task_rows(config: core.Configuration, grip: core.Grip) -> tuple[Array, float]:
    """Return (14) to (16) on node velocities (4, 2 n), and (17), what a roller adds to (16)."""
    nodes, points = find_members(config.robot, grip.members), config.points
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
    The quadratic program (11) with the rows of (20), in node velocities as in the paper.

    :ivar rollers_by_lengths: constant maps, made once: roller speeds and tubes from length rates.
    """

    def __init__(self, robot: core.Robot) -> None:
        topology = robot.topology
        self.robot = robot
        self.rollers_by_lengths = np.linalg.pinv(topology.incidence)
        self.tubes = (np.arange(len(topology.tube_names))[:, None] == topology.tube).astype(float)

    def _rows(self, state: State) -> tuple[Array, Array, Array]:
        """Return R_tube, the rows of (20) above M, and M with rolling expressed in nodes."""
        config = unprepared(state.config)
        m = self.robot.topology.n_modules
        matrix = config.matrix
        lengths = matrix[:m]
        task, rolling = task_rows(config, state.grip)
        module = find_members(self.robot, state.grip.members).members[0]
        roller = self.robot.topology.driven.searchsorted(module)
        task[2] += rolling * (self.rollers_by_lengths[roller] @ lengths)
        return lengths, np.vstack([self.tubes @ lengths, matrix[m:]]), task

    def solve(self, state: State, twist: Array) -> Array | None:
        """Solve (11) with (20), without limits, by a dense active-set solver."""
        lengths, fixed, task = self._rows(state)
        nodes = qpsolvers.solve_qp(
            lengths.T @ lengths + REGULAR * np.eye(lengths.shape[1]),
            np.zeros(lengths.shape[1]),
            A=np.vstack([fixed, task]),
            b=np.concatenate([np.zeros(len(fixed)), twist, [0.0]]),
            solver=PEER,
            **PEER_OPTIONS,
        )
        return None if nodes is None else self.rollers_by_lengths @ lengths @ nodes

    def solve_kkt(self, state: State, twist: Array) -> Array:
        """Solve (11) with (20) as one linear system, dense, by NumPy."""
        lengths, fixed, task = self._rows(state)
        equality = np.vstack([fixed, task])
        k, n = equality.shape
        system = np.zeros((n + k, n + k))
        system[:n, :n] = lengths.T @ lengths
        system[n:, :n] = equality
        system[:n, n:] = equality.T
        right = np.zeros(n + k)
        right[n + len(fixed) : n + len(fixed) + 3] = twist
        return self.rollers_by_lengths @ lengths @ np.linalg.solve(system, right)[:n]

    def solve_within_limits(self, state: State, twist: Array) -> Array | None:
        """Solve (11) with (20), the limits as rows, and the scale of the twist as a variable."""
        lengths, fixed, task = self._rows(state)
        limits = [limit.rows(state.config) for limit in default_limits(self.robot)]
        by_nodes = self.rollers_by_lengths @ lengths
        inequality = np.vstack([rows.matrix @ by_nodes for rows in limits])
        upper = np.concatenate([rows.upper for rows in limits])
        lower = np.concatenate([rows.lower for rows in limits])
        n = lengths.shape[1]
        unit = self.robot.description.max_speed
        hessian = np.zeros((n + 1, n + 1))
        hessian[:n, :n] = lengths.T @ lengths + REGULAR * np.eye(n)
        hessian[n, n] = 0.5 * PENALTIES[0]
        linear = np.zeros(n + 1)
        linear[n] = -PENALTIES[0]
        right = np.zeros(len(fixed) + 4)
        right[len(fixed) : len(fixed) + 3] = twist / unit
        bounds = np.full(n + 1, np.inf)
        bounds[n] = 1.0
        found = qpsolvers.solve_qp(
            hessian,
            linear,
            np.column_stack([np.vstack([inequality, -inequality]), np.zeros(2 * len(upper))]),
            np.concatenate([upper, -lower]) / unit,
            np.column_stack([np.vstack([fixed, task]), -right]),
            np.zeros(len(right)),
            np.append(np.full(n, -np.inf), 0.0),
            bounds,
            solver=PEER,
            **PEER_OPTIONS,
        )
        return None if found is None else unit * (by_nodes @ found[:n])


def forward_rows(robot: core.Robot, states: list[State], rng: np.random.Generator) -> list[Row]:
    """Measure forward kinematics; differences in units of 1 cm at the nodes."""
    speed = robot.description.max_speed
    rows: list[Row] = []
    for name, step, prepared, target in (
        ('one cycle at 200 Hz, full speed', speed / 200.0, False, TARGET),
        ('one cycle at 1 kHz, full speed', speed / 1000.0, False, TARGET),
        ('one cycle at 1 kHz, factored before', speed / 1000.0, True, TARGET),
        ('1 s at full speed in one step', speed, False, None),
        ('from home', None, False, None),
    ):
        row = Row(f'forward kinematics, {name}', 'scipy root(hybr)', target)
        for state in states:
            near = unprepared(robot.home if step is None else state.config)
            if prepared:
                _ = near.factor
            goal = state.config.roller_positions
            if step is not None:
                goal = goal + step * rng.choice([-1.0, 1.0], len(goal))
            try:
                near.moved_to(goal)
            except ConfigurationError:
                continue  # a long step can end outside of what the robot can reach
            near = unprepared(near)
            if prepared:
                _ = near.factor
            row.add(
                partial(nodes_at, near, goal),
                partial(root_by_hybr, near, goal),
                unit=0.01,
            )
        rows.append(row)
    return rows


def twist_rows(robot: core.Robot, states: list[State]) -> list[Row]:
    """Measure twist to rollers; differences in units of 1 % of the largest roller speed."""
    paper = PaperProgram(robot)
    rows: list[Row] = []
    for name, size, peer, solve in (
        ('half of what the limits allow', 0.5, f'(20) by {PEER}, no limits', paper.solve),
        ('half of what the limits allow', 0.5, '(20) as KKT, no limits', paper.solve_kkt),
        ('twice what the limits allow', 2.0, f'(20) by {PEER}', paper.solve_within_limits),
    ):
        row = Row(f'twist to rollers, {name}', peer)
        for state in states:
            config, twist = unprepared(state.config), size * state.twist
            row.add(
                partial(roller_velocities, config, state.grip, twist),
                partial(solve, state, twist),
                unit=0.01 * robot.description.max_speed,
            )
        rows.append(row)
    return rows


def main() -> None:
    """Print the table."""
    print_machine()
    robot = core.load_robot('nine_member')
    states = random_states(robot, STATES, seed=1)
    forward_rows(robot, states[:20], np.random.default_rng(2))  # warm up, not counted
    twist_rows(robot, states[:20])
    rows = [*forward_rows(robot, states, np.random.default_rng(2)), *twist_rows(robot, states)]
    print(f'{robot.name}: {STATES} random reachable states, times in us; matrix, factorization,')
    print('Jacobians and QP included; "ratio" is peer / ours; "apart": how often the peer')
    print('failed or ended elsewhere; "typical": the median difference otherwise, 1 = 1 cm or 1 %')
    print('of the largest roller speed. CPU time of the calling thread.\n')
    header = ['case', 'median', 'p99', 'target', '', 'peer', 'its median', 'ratio', 'apart']
    print_table([*header, 'typical'], [row.cells() for row in rows])


if __name__ == '__main__':
    main()
