# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Few rows of the limits, added as they are violated: the same solution as with all of them."""

from hypothesis import given, strategies
from isotruss_ros.core import solve_twist
from isotruss_ros.core.manipulation import limit_handling
from isotruss_ros.core.manipulation.limit_handling import LimitHandling
from isotruss_ros.core.manipulation.limits import MemberLengthLimit, RollerSpeedLimit
import numpy as np
import pytest
import robots


def solved(monkeypatch, all_rows_up_to, *arguments, **options):
    """Solve a twist, with all rows for robots of at most so many rollers."""
    monkeypatch.setattr(limit_handling, 'ALL_ROWS_UP_TO', all_rows_up_to)
    return solve_twist(*arguments, **options)


@pytest.mark.parametrize('slide', [False, True])
@pytest.mark.parametrize('first', [1, 16])
@robots.examples(15)
@given(robots.robots(('arch', 'ring')), robots.generators(), strategies.integers(0, 10**6))
def test_few_rows_give_the_solution_of_all(slide, first, robot, rng, number):
    config, grasp, _ = robots.random_grasp(robot, rng, number)
    lengths = config.member_lengths
    # Some members are at their bounds.
    limits = [
        RollerSpeedLimit(0.1),
        MemberLengthLimit(*np.sort(rng.uniform(lengths.min(), lengths.max(), 2))),
    ]
    failed = [name for name in robot.roller_names if rng.random() < 0.1]
    twist = 10.0 ** rng.uniform(-2.0, 1.0) * rng.standard_normal(3)
    arguments = (config, grasp, twist, failed, limits, LimitHandling(slide, 0.005))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(limit_handling, 'FIRST', first)
        patch.setattr(limit_handling, 'ADDED', first)
        every = solved(patch, 10**6, *arguments)
        few = solved(patch, 0, *arguments)
    assert few.scale == pytest.approx(every.scale, abs=1e-9)
    assert few.status is every.status
    size = max(1.0, np.abs(every.roller_velocities).max())
    assert few.roller_velocities == pytest.approx(every.roller_velocities, abs=1e-7 * size)
