# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The program of a step, row by row: where members face, how they turn, what keeps apart."""

from dataclasses import replace

import closings
from isotruss_ros.core import ConvexObject, Disc, load_robot
from isotruss_ros.core.planning import closing_step
from isotruss_ros.core.planning.closing import (
    Closing,
    evaluate_state,
)
from isotruss_ros.core.planning.closing_step import bound_rows, solve_step, turning_rows
import numpy as np
import pytest

HOME = load_robot('nine_member').home
BODY = ConvexObject(Disc(0.2), (0.716, 0.43, 0.0))
MEMBERS = tuple(HOME.robot.member_names.index(name) for name in ('north/P-Z', 'north/Z-R'))
#: Closes two members, within no limits.
PAIR = Closing(BODY, MEMBERS, (), 0.0)


def test_normals_go_out_of_the_object_across_the_members():
    begin, end, _ = closings.parts(HOME)
    every = replace(PAIR, members=tuple(range(len(begin))))
    # However near the object is to one of them.
    beside = 0.5 * (begin[0] + end[0]) + np.array([0.05j, -0.05j]) * (end[0] - begin[0])
    for center in (BODY.center, *beside):
        body = ConvexObject(Disc(0.2), (center.real, center.imag, 0.0))
        normals = replace(every, body=body).normals(HOME)
        assert np.abs(normals) == pytest.approx(1.0)
        assert (normals.conj() * (end - begin)).real == pytest.approx(0.0, abs=1e-12)
        assert (normals.conj() * (begin - center)).real.min() > 0.0


@pytest.mark.parametrize('turns', [(0.02, -0.03), (-0.01, 0.03)])
def test_members_turn_toward_where_they_are_to_face(turns):
    state = evaluate_state(HOME, PAIR.body)
    normals = PAIR.normals(HOME)
    facing = replace(PAIR, facing=normals * np.exp(1j * np.array(turns)))
    members = list(PAIR.members)
    move = solve_step(state, facing, state.gaps[members], 1.0)
    assert turning_rows(HOME, members) @ move == pytest.approx(turns, rel=0.05)
    moved = PAIR.normals(HOME.moved_to(HOME.roller_positions + move))
    assert np.angle(moved / normals) == pytest.approx(turns, rel=0.1)


def test_parts_that_are_not_to_touch_come_nearer_by_half_of_what_is_left():
    state = evaluate_state(HOME, PAIR.body)
    members = list(PAIR.members)
    _, least = bound_rows(state, PAIR, np.full(2, 0.006))
    gaps = np.concatenate(closings.gaps(HOME, BODY))
    expected = 0.5 * (0.1 * HOME.robot.description.tube_diameter - gaps)
    expected[members] = 0.006 - gaps[members]
    assert least[: len(gaps)] == pytest.approx(np.minimum(0.0, expected), abs=1e-9)


@pytest.mark.parametrize('seed', [3, 8, 18])
@pytest.mark.parametrize(('near', 'apart'), [(0.2, 0.01), (0.6, 0.05)])
def test_parts_of_the_robot_that_are_near_keep_apart(seed, near, apart, monkeypatch):
    config, body, tube = closings.scene(seed)
    length = config.member_lengths.mean()
    closing = closings.closing(config, body, tube, np.random.default_rng(0))
    monkeypatch.setattr(closing_step, 'NEAR', near)
    monkeypatch.setattr(closing_step, 'SELF_CLEARANCE', apart)
    state = evaluate_state(config, body)
    rows, least = bound_rows(state, closing, np.zeros(len(closing.members)))
    left = state.distances[state.distances < near * length] - apart * length
    assert 0 < len(left) < len(state.distances)
    rigid = state.modes.values[:2] - closing.min_rigidity
    shape = slice(len(state.gaps), len(state.gaps) + 2 + len(left))
    assert least[shape] == pytest.approx(np.minimum(0.0, -0.5 * np.append(rigid, left)))
    assert len(rows) == len(least)
