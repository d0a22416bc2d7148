# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays of callers, factors of matrices, quadratic programs, and changes of frozen records."""

import dataclasses
from functools import cached_property

from hypothesis import given
from hypothesis import strategies as st
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.numerics import qp
from isotruss_ros.core.numerics.arrays import finite_array
from isotruss_ros.core.numerics.factorization import factorize
from isotruss_ros.core.numerics.records import replace
import numpy as np
import pytest
import robots
from scipy import optimize
from scipy.optimize import lsq_linear
from scipy.sparse import csc_matrix

KINDS = pytest.mark.parametrize('kind', [np.array, csc_matrix])


@KINDS
@robots.examples(60)
@given(robots.generators(), st.integers(1, 40), st.integers(1, 3))
def test_factors_solve_like_numpy_for_any_size(kind, rng, n, columns):
    left, right = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    gains = rng.uniform(0.1, 10.0, n)
    matrix = left * gains @ right
    factor = factorize(kind(matrix))
    given_sides = rng.standard_normal((n, columns))
    for sides in (given_sides, given_sides[:, 0].copy()):
        wanted = np.linalg.solve(matrix, sides)
        assert factor.solve(sides) == pytest.approx(wanted, rel=1e-9, abs=1e-10)
        wanted = np.linalg.solve(matrix.T, sides)
        assert factor.solve(sides, transposed=True) == pytest.approx(wanted, rel=1e-9, abs=1e-10)


@pytest.mark.parametrize('values', [(1, 2.0), np.uint8([1, 2]), np.arange(1.0, 3.0)])
def test_real_numbers_become_a_new_array_of_floats(values):
    array = finite_array(values, 2, 'center', GraspError)
    assert array.dtype == np.float64
    assert array.tolist() == [1.0, 2.0]
    array[0] = 5.0
    assert values[0] == 1


NO_PAIRS = [
    *([1.0], [[1.0, 2.0]], [1.0, np.inf], np.float32([1.0, np.inf]), None, [1.0, 2j], ['1', '2']),
    [[1.0], [1.0, 2.0]],
]


@pytest.mark.parametrize('values', NO_PAIRS)
def test_anything_else_is_refused(values):
    with pytest.raises(GraspError, match='must be 2 finite numbers'):
        finite_array(values, 2, 'center', GraspError)


@dataclasses.dataclass(frozen=True)
class Side:
    """Length of a square [m]."""

    length: float
    name: str = 'square'

    @cached_property
    def area(self):
        """Return the area [m^2]."""
        return self.length**2


def test_a_changed_record_has_its_own_cached_properties():
    side = Side(2.0, name='tile')
    assert side.area == 4.0
    changed = replace(side, length=3.0)
    assert changed == dataclasses.replace(side, length=3.0)
    assert (changed.area, side.area) == (9.0, 4.0)


def random_program(rng, n, degenerate=False):
    """Return a program with an admissible point at which many limits may meet."""
    root = rng.standard_normal((n, n)) + np.eye(n)
    k, count = int(rng.integers(0, n)), int(rng.integers(0, 30))
    rows = rng.standard_normal((count, n))
    bounds = rng.uniform(0.0, 1.0, count)
    lower, upper = -rng.uniform(0.0, 2.0, n), rng.uniform(0.0, 2.0, n)
    if degenerate:
        bounds[rng.random(count) < 0.7] = 0.0
        upper[rng.random(n) < 0.3] = 0.0
        rows[: count // 2] = rows[::-1][: count // 2]
    equality, shift = rng.standard_normal((k, n)) if k else None, rng.standard_normal(n)
    hessian = root.T @ root + 1e-3 * np.eye(n)
    limits = np.concatenate([rows, np.eye(n), -np.eye(n)])
    return qp.QuadraticProgram(
        hessian,
        10.0 * rng.standard_normal(n) - hessian @ shift,
        limits,
        np.concatenate([bounds, upper, -lower]) + limits @ shift,
        equality,
        equality @ shift if k else None,
    )


def corner_program(rng, n, flat, far, extra):
    """Return a program whose solution is x = 0, where planes meet that are next to dependent."""
    normals = rng.standard_normal((n + extra, n))
    normals[:, -1] *= flat
    # What pushes against the planes, so that the minimum without them is far beyond all of them.
    push = rng.uniform(0.1, 1.0, len(normals)) @ normals
    return qp.QuadraticProgram(
        np.eye(n), -far * push / np.linalg.norm(push), normals, np.zeros(len(normals))
    )


def check_optimality(program, x):
    """Check feasibility, and that multipliers of the right sign balance the gradient."""
    room = program.bounds - program.rows @ x
    assert room.min() >= -1e-8
    columns, low = [program.rows[room < 1e-7].T], [np.zeros((room < 1e-7).sum())]
    if program.equality is not None:
        assert program.equality @ x == pytest.approx(program.target, abs=1e-8)
        columns.append(program.equality.T)
        low.append(np.full(len(program.equality), -np.inf))
    slope = program.hessian @ x + program.gradient
    matrix, low = np.concatenate(columns, axis=1), np.concatenate(low)
    left = slope
    if matrix.shape[1]:
        multipliers = lsq_linear(matrix, -slope, (low, np.inf), method='bvls', tol=1e-14)
        left = slope + matrix @ multipliers.x
    assert np.abs(left).max() <= 1e-6 * (1.0 + np.abs(program.gradient).max())


@pytest.mark.parametrize('size', [1e-6, 1e6])
@pytest.mark.parametrize('length', [1e-4, 1e4])
def test_solution_is_of_any_size_and_rows_of_any_length(size, length):
    rng = np.random.default_rng(7)
    for _ in range(10):
        row, bound = rng.standard_normal(5), -rng.uniform(0.5, 2.0) * size
        rows = length * np.stack([row, rng.standard_normal(5)])
        bounds = length * np.array([bound, np.inf])
        program = qp.QuadraticProgram(np.eye(5), np.zeros(5), rows, bounds)
        # The nearest point of the half-plane.
        assert qp.solve_qp(program) == pytest.approx(row * bound / (row @ row), rel=1e-9)


@pytest.mark.parametrize(
    ('rows', 'bounds', 'hessian'),
    [
        ([[1.0, 0.0], [-1.0, 0.0]], [-1.0, -1.0], [1.0, 1.0]),
        ([[0.0, 0.0]], [-1e10], [1.0, 1.0]),
        (np.zeros((0, 2)), [], [1.0, -1.0]),
    ],
    ids=['contradiction', 'rows of zeros', 'non-convex cost'],
)
def test_a_program_without_a_minimum_has_no_solution(rows, bounds, hessian):
    program = qp.QuadraticProgram(np.diag(hessian), np.ones(2), np.array(rows), np.array(bounds))
    assert qp.solve_qp(program) is None


@pytest.mark.parametrize('length', [1e-6, 1e6])
@pytest.mark.parametrize('bound', [1.0, 4.0, 5.0])
def test_a_row_fixed_by_the_equalities_is_fulfilled_or_contradictory(bound, length):
    rows, bounds = np.array([[1.0, 1.0], [1.0, -1.0]]), np.array([bound, 0.5])
    # The other one is fulfilled, x = y = 2.
    limits = length * rows, length * bounds
    program = qp.QuadraticProgram(np.eye(2), np.zeros(2), *limits, rows[:1], np.array([4.0]))
    solution = qp.solve_qp(program)
    if bound < 4.0:
        assert solution is None
    else:
        assert solution == pytest.approx([2.0, 2.0])


@robots.examples(200)
@given(robots.generators(), st.integers(2, 9), st.booleans())
def test_solutions_are_optimal(rng, n, degenerate):
    program = random_program(rng, n, degenerate)
    check_optimality(program, qp.solve_qp(program))


@pytest.mark.parametrize('n', [3, 6])
@pytest.mark.parametrize(('flat', 'far'), [(1.0, 30.0), (1e-4, 30.0), (1e-8, 30.0), (1e-2, 1e6)])
def test_nearly_dependent_planes_far_from_the_minimum_have_a_vertex(n, flat, far):
    rng = np.random.default_rng(23)
    for _ in range(30):
        program = corner_program(rng, n, flat, far, int(rng.integers(0, 15)))
        solution = qp.solve_qp(program)
        assert (program.rows @ solution).max() <= 1e-8
        assert np.abs(solution[:-1]).max() <= 1e-12 * far + 1e-10
        assert flat * abs(solution[-1]) <= 1e-12 * far + 1e-10


def test_exceeding_the_iteration_cap_gives_no_solution(monkeypatch):
    def endless(matrix, target, maxiter):
        raise RuntimeError('too many iterations')

    monkeypatch.setattr(optimize, 'nnls', endless)
    assert qp.solve_qp(random_program(np.random.default_rng(3), 6)) is None


@robots.examples(100)
@given(robots.generators(), st.integers(1, 12), st.integers(1, 12))
def test_least_squares_have_minimum_norm_at_any_rank(rng, m, n):
    matrix = rng.standard_normal((m, n))
    matrix[-1] = matrix[0]
    right = rng.standard_normal(m)
    expected = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
    assert qp.solve_least_squares(matrix, right) == pytest.approx(expected, rel=1e-9, abs=1e-9)
