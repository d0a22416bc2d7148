# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How far commands are scaled down where limits object, and which bounds are the default."""

from types import SimpleNamespace

from isotruss_ros.core import load_robot, Status
from isotruss_ros.core.manipulation.solve_twist import RollerCommand
from isotruss_ros.core.safety.barrier_law import BarrierViolation
from isotruss_ros.core.safety.distances import nearest_on_segment
from isotruss_ros.core.safety.shape_guard import ShapeBounds, Watch
import numpy as np
import pytest

HOME = load_robot('nine_member').home
PERIOD = 0.01


def keep(speed, share_of, status=Status.OK):
    """Return a command of a speed, and what is kept; a share of each travel is admissible."""

    def violation(end, grasp, travel, velocities, duration):
        assert duration == PERIOD
        assert end.roller_positions == pytest.approx(travel - 0.5 * PERIOD * velocities)
        share = share_of(travel[0])
        return None if share is None else BarrierViolation(share, Status.SLOWED_OBJECT, ('it',))

    law = SimpleNamespace(safety_margin=0.1)
    limit = SimpleNamespace(
        margins=np.zeros(1), barrier=SimpleNamespace(law=law), violation=violation
    )
    velocities = np.zeros(len(HOME.roller_positions))
    velocities[0] = speed
    before = np.linspace(-0.01, 0.02, len(velocities))
    command = RollerCommand(velocities, np.array([0.1, 0.2, 0.3]), 0.9, status)
    return command, Watch(HOME, None, (), (limit,)).keep(command, before, PERIOD)


def kept(speed, share_of):
    """Return which share of a command of a speed is kept."""
    command, found = keep(speed, share_of)
    share = found.roller_velocities[0] / speed
    assert found.achieved_twist == pytest.approx(share * command.achieved_twist)
    assert found.scale == pytest.approx(share * command.scale)
    assert (found is command) == (share == 1.0)
    if share < 1.0:
        assert (found.status, found.limiting) == (Status.SLOWED_OBJECT, ('it',))
    return share


@pytest.mark.parametrize(
    ('speed', 'share'), [(0.02, 1.0), (0.049, 1.0), (0.051, 0.8 / 1.02), (0.1, 0.4)]
)
def test_a_fifth_less_than_what_is_admissible_is_kept(speed, share):
    """As long as the travel in a cycle of 10 ms is 0.5 mm or less, it is admissible."""
    room = 5e-4
    found = kept(speed, lambda travel: room / travel if travel > room else None)
    assert found == pytest.approx(share)


@pytest.mark.parametrize(('most', 'share'), [(0.9, 0.8), (0.55, 0.512), (0.45, 0.0)])
def test_the_robot_stands_still_after_four_attempts(most, share):
    found = kept(0.05, lambda travel: 1.0 if travel > 5e-4 * most else None)
    assert found == pytest.approx(share)


@pytest.mark.parametrize('status', [Status.UNREACHABLE, Status.SLIDING, Status.OK])
@pytest.mark.parametrize('share', [0.0, 0.01, 0.5])
def test_that_a_twist_was_bent_counts_for_more_than_that_it_is_slowed(status, share):
    """As long as anything is left of it."""
    room = 1e-3 * share
    _, found = keep(0.1, lambda travel: room / travel if travel > room else None, status)
    assert np.abs(found.roller_velocities).max() == pytest.approx(0.08 * share)
    bent = status is not Status.OK and share > 0.0
    assert found.status is (status if bent else Status.SLOWED_OBJECT)


def test_a_robot_that_stands_still_is_not_slowed():
    command, found = keep(0.0, lambda travel: 0.5)
    assert found is command


def test_shapes_keep_these_bounds():
    assert vars(ShapeBounds()) == {
        'min_rigidity': 0.2,
        'min_clearance': 0.02,
        'min_object_clearance': 0.02,
        'rigidity_band': 0.2,
        'clearance_band': 0.1,
        'rate': 5.0,
    }
    # Any that are not negative are taken, the smallest ones too.
    least = ShapeBounds(0.0, 0.0, 0.0, 1e-6, 1e-6, 1e-6)
    assert (least.min_rigidity, least.clearance_band) == (0.0, 1e-6)


def test_points_on_segments_and_segments_of_next_to_no_length_have_a_direction():
    start = np.array([1.0 + 1.0j, 1.0 + 1.0j])
    end = start + np.array([0.3 + 0.4j, 1e-7j])
    found = nearest_on_segment(0.5 * (start + end), start, end)
    assert found.normal[0] == pytest.approx(1j * (0.6 + 0.8j), abs=1e-6)
    assert np.abs(found.normal) == pytest.approx(1.0)
    assert found.share == pytest.approx(0.5)
    found = nearest_on_segment(np.array([1.5 + 1.0j, 1.0 + 2.0j]), start, end)
    assert found.share == pytest.approx([0.6, 1.0])
    assert found.distance == pytest.approx([0.4, 1.0])
