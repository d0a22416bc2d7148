# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Programs with few rows to choose from: none, a zero one, one that nothing fulfils."""

from grips import disc_grip
from isotruss_ros.core import load_robot, solve_twist, Status
from isotruss_ros.core.errors import SolverError
from isotruss_ros.core.manipulation import twist_qp
from isotruss_ros.core.manipulation.limit_handling import LimitHandling, solve_by_few_rows
from isotruss_ros.core.manipulation.limits import (
    MemberLengthLimit,
    RollerSpeedLimit,
    Rows,
    StackedRows,
)
from isotruss_ros.core.manipulation.task import Reach, WorkingRollers
from isotruss_ros.core.manipulation.twist_qp import maximize_progress, project_target
import numpy as np
import pytest

SLIDE = LimitHandling(slide_along_limits=True)
NINE = load_robot('nine_member')


def test_rows_are_added_until_none_is_violated():
    count = 40
    solved = []

    def farthest(cost, equality, rows):
        solved.append(len(rows.upper))
        return maximize_progress(cost, equality, np.ones(1), 100.0, rows)

    # The even rollers do what the odd ones leave, which are at their bounds.
    bound = np.where(np.arange(count) % 2, 0.1, 0.5)
    rows = StackedRows([Rows(np.eye(count), -bound, bound)])
    every = WorkingRollers(count, np.arange(count), np.eye(count), np.eye(count), True)
    equality = np.ones((1, count))
    speeds, progress = solve_by_few_rows(farthest, every, equality, rows, np.zeros(count))
    assert speeds == pytest.approx(bound, abs=1e-6)
    assert progress == pytest.approx(20 * 0.1 + 20 * 0.5, abs=1e-5)
    assert solved == sorted(set(solved))
    assert solved[0] == 16 < solved[-1] <= count


def test_rollers_alone_do_not_bend_a_twist():
    """Nothing is left to slide along."""
    grasp = disc_grip(NINE.home, 'north/Z', 0.3)
    twist, limits = np.array([1.0, -2.0, 0.5]), [RollerSpeedLimit(0.1)]
    scaled = solve_twist(NINE.home, grasp, twist, limits=limits)
    slid = solve_twist(NINE.home, grasp, twist, limits=limits, handling=SLIDE)
    assert 0.0 < scaled.scale < 1.0
    assert slid.status is scaled.status is Status.SLOWED_ROLLER_SPEED
    assert slid.achieved_twist == pytest.approx(slid.scale * twist, abs=1e-9)
    assert slid.roller_velocities == pytest.approx(scaled.roller_velocities, abs=1e-6)


def test_sliding_needs_no_limit_of_roller_speed():
    """The direction is first kept within none, then within those of the lengths."""
    grasp = disc_grip(NINE.home, 'north/Z', 0.3)
    lengths = NINE.home.member_lengths
    kept = MemberLengthLimit(lengths.min(), lengths.max())
    twist = np.array([0.01, -0.02, 0.005])
    alone, fast = (
        solve_twist(NINE.home, grasp, twist, limits=limits, handling=SLIDE)
        for limits in ([kept], [RollerSpeedLimit(1e3), kept])
    )
    assert alone.status is fast.status is Status.SLIDING
    assert alone.scale == pytest.approx(fast.scale, abs=1e-9)
    assert alone.roller_velocities == pytest.approx(fast.roller_velocities, abs=1e-9)


@pytest.mark.parametrize('zero', [3, 4])
def test_a_row_of_the_grip_that_no_roller_changes_keeps_nothing(zero):
    active = np.vstack([np.eye(4, 5), np.eye(4, 5)[3:]])
    active[7 - zero], active[zero] = [0.0, 0.0, 0.0, 2.0, 1.0], 0.0
    reach = Reach.of(active, 0.5)
    weights = np.diag([1.0, 1.0, 0.5])
    assert reach.directions.T @ reach.directions == pytest.approx(np.eye(3), abs=1e-12)
    assert reach.directions.T @ reach.rows[:3] == pytest.approx(weights @ active[:3], abs=1e-12)
    assert len(reach.rows) == 4
    across = reach.rows[3] * np.sign(reach.rows[3, 3])
    assert across == pytest.approx(np.array([0.0, 0.0, 0.0, 2.0, 1.0]) / np.sqrt(5.0), abs=1e-12)
    # Row 3 is the opening rate: where no roller changes it nothing is to be opened.
    opening = 0.0 if zero == 3 else 1.0 / np.sqrt(5.0)
    assert np.abs(reach.opening) == pytest.approx([opening], abs=1e-12)


def test_rows_that_bounds_forbid_to_follow_stay_at_zero():
    bound = np.full(2, 0.5)
    for wanted, followed in ((0.4, 0.4), (1.0, 0.0)):
        found = project_target(
            np.eye(2), np.eye(2), np.array([0.3, wanted]), 1, Rows(np.eye(2), -bound, bound), 1e-9
        )
        assert found == pytest.approx([0.3, followed], abs=1e-6)


def test_a_projection_that_is_not_solved_is_an_error(monkeypatch):
    monkeypatch.setattr(twist_qp, 'solve_qp', lambda problem: None)
    bound = np.ones(1)
    with pytest.raises(SolverError, match='close to a singular one'):
        project_target(np.eye(1), np.eye(1), bound, 1, Rows(np.eye(1), -bound, bound), 1e-9)


def test_a_status_is_written_in_words():
    assert str(Status.SLOWED_ROLLER_SPEED) == 'slowed roller speed'
