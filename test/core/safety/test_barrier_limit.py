# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What of a motion is admissible, by a parabola through margins, and which limits are checked."""

from types import SimpleNamespace

from hypothesis import assume, given, strategies
from isotruss_ros.core import Status
from isotruss_ros.core.safety.barrier_law import (
    _admissible_share,
    ActiveValues,
    BarrierLaw,
    BarrierLimit,
)
from isotruss_ros.core.safety.shape_guard import SAFETY_STEP, Watch
import numpy as np
import pytest
import robots

SHARES = np.linspace(0.0, 1.0, 50)


@robots.examples(100)
@given(
    strategies.floats(1e-3, 1.0),
    strategies.floats(-2.0, 2.0),
    strategies.floats(0.1, 2.0),
    strategies.sampled_from([-1.0, 1.0]),
)
def test_the_admissible_share_uses_up_the_room_of_a_parabola(room, slope, size, sign):
    change = slope + sign * size
    (share,) = _admissible_share(*np.array([[room], [slope], [change]]))
    # slope s + (change - slope) s^2 falls to -room first at the share, or after the motion.
    roots = np.roots([change - slope, slope, room])
    assume(abs(slope**2 - 4.0 * (change - slope) * room) > 1e-3)
    ahead = [root.real for root in roots if root.imag == 0.0 < root.real]
    if len(ahead) or sign < 0.0:
        assert share == pytest.approx(min([1.0, *ahead]), rel=1e-6)


@robots.examples(100)
@given(robots.generators())
def test_a_motion_ends_where_the_parabola_through_the_margins_meets_the_bound(rng):
    """However small margins and motions are; rows were found in the middle of the sample."""
    size = 10.0 ** rng.uniform(-6.0, 0.0)
    law, duration = BarrierLaw(0.5, size), rng.uniform(0.01, 0.1)
    velocities, travel = rng.standard_normal(2) * size
    slopes, margins = rng.standard_normal(3), size * rng.uniform(0.1, 2.0, 3)
    before = margins - 0.5 * duration * velocities * slopes
    after = before + size * rng.standard_normal(3)
    barrier = SimpleNamespace(
        law=law,
        status=Status.SLOWED_RIGIDITY,
        values=lambda *_: 0.5 + after,
        names=lambda numbers: [f'value {i}' for i in numbers],
    )
    active = ActiveValues(np.arange(3), 0.5 + margins, np.zeros((3, 0)))
    limit = BarrierLimit(barrier, active, slopes[:, None])
    assume(before.min() > 0.0)
    found = limit.violation(None, None, np.array([travel]), np.array([velocities]), duration)
    longest = max(abs(travel), duration * abs(velocities))
    bound = law.discrete_bound(before, duration, longest)
    assert (found is None) == (after >= bound).all()
    if found is None:
        return
    assert found.names == tuple(f'value {i}' for i in np.flatnonzero(after < bound))

    def left(share):
        first = slopes * travel * share
        return (before + first + (after - before - slopes * travel) * share**2 - bound) / size

    assert 0.0 <= found.share <= 1.0
    # One of them is used up there, and none before.
    assert np.abs(left(found.share)).min() == pytest.approx(0.0, abs=1e-9)
    assert min(left(share * found.share)[after < bound].min() for share in SHARES) > -1e-9


@pytest.mark.parametrize(
    ('size', 'margin', 'checked'),
    [
        (0.9 * SAFETY_STEP, 0.049, True),
        (0.9 * SAFETY_STEP, 0.051, False),
        (1.1 * SAFETY_STEP, 0.051, True),
        (1.1 * SAFETY_STEP, 0.2, True),
    ],
)
def test_short_steps_are_checked_where_little_is_left(size, margin, checked):
    law = SimpleNamespace(safety_margin=0.1)
    limit = SimpleNamespace(margins=np.array([0.3, margin]), barrier=SimpleNamespace(law=law))
    watch = Watch(None, None, (), (limit,))
    assert watch._within_reach(size) == ((limit,) if checked else ())
