# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The nearest point of a polyhedron: solutions known by hand, what is refused, least squares."""

from hypothesis import given, strategies
from isotruss_ros.core.numerics.qp import find_nearest, solve_least_squares
import numpy as np
import pytest
import robots
from scipy import optimize


@pytest.mark.parametrize('room', [0.0, 1.0])
def test_an_origin_that_is_inside_is_the_nearest_point(room):
    found = find_nearest(np.eye(2), np.array([room, 1.0]), 1.0, 0.0)
    assert found.point.tolist() == [0.0, 0.0]
    assert found.active.tolist() == []


def test_a_space_without_planes_holds_the_origin():
    assert find_nearest(np.zeros((3, 0)), np.zeros(0), 1.0, 0.0).point.tolist() == [0.0] * 3


@pytest.mark.parametrize('relaxation', [0.0, 1e-9])
def test_corner_of_two_planes_and_the_numbers_of_both(relaxation):
    columns = np.array([[1.0, 0.0, 1.0], [0.0, 2.0, 1.0]])
    found = find_nearest(columns, np.array([-1.0, -4.0, 3.0]), 1.0, relaxation)
    assert found.point == pytest.approx([-1.0, -2.0], abs=1e-15)
    assert found.active.tolist() == [0, 1]


@pytest.mark.parametrize('length', [1e-14, 1.0, 1e6])
def test_columns_as_short_as_rounding_constrain_nothing_but_keep_their_numbers(length):
    columns = length * np.array([[1e-13, 1.0], [1e-13, 0.0]])
    found = find_nearest(columns, length * np.array([-1.0, -2.0]), 1.0, 0.0)
    assert found.point == pytest.approx([-2.0, 0.0])
    assert found.active.tolist() == [1]


def test_an_origin_out_by_less_than_the_relaxation_is_inside():
    columns, room = np.eye(1), np.array([-1e-9])
    assert find_nearest(columns, room, 1.0, 1e-8).point.tolist() == [0.0]
    assert find_nearest(columns, room, 1.0, 0.0).point == pytest.approx([-1e-9], rel=1e-9)


def test_bounds_that_are_set_apart_beyond_the_origin_lead_to_no_point(capfd):
    assert find_nearest(np.eye(2), np.array([5.0, -1.5e-8]), 1.0, 1e-8) is None
    # LAPACK prints what it is given and refuses, an empty matrix.
    assert capfd.readouterr() == ('', '')


@pytest.mark.parametrize('length', [0.01, 1.0, 100.0])
def test_a_point_within_all_planes_that_is_not_the_nearest_is_refused(monkeypatch, length):
    def wrong(matrix, target, maxiter):
        # The plane y <= 5 keeps nothing from the origin.
        return np.array([0.5, 1e-3]), 0.0

    columns, room = np.array([[1.0, 0.0], [0.0, 1.0]]), length * np.array([-1.0, 5.0])
    assert find_nearest(columns, room, 1.0, 0.0).point == pytest.approx([-length, 0.0])
    monkeypatch.setattr(optimize, 'nnls', wrong)
    assert find_nearest(columns, room, 1.0, 0.0) is None


def test_a_point_between_bounds_that_contradict_each_other_is_refused(monkeypatch):
    def wrong(matrix, target, maxiter):
        return np.array([0.25, 0.25]), 0.0

    monkeypatch.setattr(optimize, 'nnls', wrong)
    assert find_nearest(np.ones((1, 2)), np.array([-1.0, -1.1]), 1.0, 0.0) is None


@robots.examples(100)
@given(robots.generators(), strategies.integers(1, 12), strategies.integers(1, 12))
def test_least_squares_are_the_shortest_of_any_rank(rng, m, n):
    matrix = rng.standard_normal((m, n))
    matrix[-1] = matrix[0]
    right = rng.standard_normal(m)
    expected = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
    assert solve_least_squares(matrix, right) == pytest.approx(expected, rel=1e-9, abs=1e-9)
