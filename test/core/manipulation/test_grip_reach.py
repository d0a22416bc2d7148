# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A polygon rolls off a face that lies on a member: where statics has a balance for it."""

from apart_grips import balance_exists, FAILED, inclination, inclined_grip, NINE
from hypothesis import assume, given, strategies
from isotruss_ros.core import (
    reachable_twists,
    RollingGrip,
    solve_twist,
    Status,
)
from isotruss_ros.core.manipulation.grip_contacts import find_contacts
from isotruss_ros.core.manipulation.grip_rows import contact_rows
from isotruss_ros.core.manipulation.rolling_off import rolled_corners
import numpy as np
import pytest
import random_grips
import robots


def lifting(grip, command):
    """Return the speeds (k,) at which contacts move off their members [m/s]."""
    contacts, hand, rigid = contact_rows(NINE.home, grip)
    off = rigid @ command.achieved_twist - hand @ command.roller_velocities
    return (off.view(complex) * -contacts.normals.conj()).real


@pytest.mark.parametrize(('friction', 'rolls'), [(0.0, False), (0.5, False), (1.0, True)])
def test_a_face_lifts_at_one_end_where_forces_at_the_other_balance(friction, rolls):
    grip = inclined_grip(0.0, friction)
    assert len(reachable_twists(NINE.home, grip, FAILED)) == 2
    command = solve_twist(NINE.home, grip, [0.0, 0.0, 0.02], FAILED)
    off = lifting(grip, command)
    if rolls:
        assert command.status is Status.OK
        assert command.achieved_twist == pytest.approx([0.0, 0.0, 0.02], abs=1e-9)
        assert sorted(np.abs(off) > 1e-3) == [False, False, True]
        assert off.max() > 1e-3
    else:
        assert command.status is Status.UNREACHABLE
        assert off == pytest.approx(0.0, abs=1e-9)
    assert command.reachable_dof == (3 if rolls else 2)
    # The other way around it would have to roll over the other end, for which there is none.
    command = solve_twist(NINE.home, grip, [0.0, 0.0, -0.02], FAILED)
    assert command.status is Status.UNREACHABLE
    assert lifting(grip, command) == pytest.approx(0.0, abs=1e-9)


def test_an_object_rolls_where_that_comes_a_little_closer_to_the_twist():
    """All that can be reached is far from the twist, and 9 % less so where it rolls."""
    grip, failed, twist = inclined_grip(0.0, 1.0), ('south/P', 'north/R', 'north/Z'), [0, 0, -0.02]
    weights = np.array([1.0, 1.0, grip.body.arm])

    def missed(directions):
        """Return the share of the twist that is no combination of some twists (k, 3)."""
        found = np.linalg.lstsq((weights * directions).T, weights * twist, rcond=None)[0]
        return np.linalg.norm(weights * (twist - found @ directions)) / (0.02 * grip.body.arm)

    stays = missed(reachable_twists(NINE.home, grip, failed))
    command = solve_twist(NINE.home, grip, twist, failed)
    rolls = missed(command.achieved_twist[None])
    assert rolls == pytest.approx(0.911 * stays, rel=1e-3)
    assert command.reachable_dof == 2
    assert sorted(lifting(grip, command) > 1e-3) == [False, False, True]


def test_the_slowest_turn_there_is_moves_nothing():
    """Rolling would reach it, but its surface speed is less than any number but zero."""
    grip = inclined_grip(0.0, 1.0)
    assert solve_twist(NINE.home, grip, [0.0, 0.0, 1e-300], FAILED).status is Status.OK
    assert not solve_twist(NINE.home, grip, [0.0, 0.0, 5e-324], FAILED).roller_velocities.any()


@pytest.mark.parametrize(('friction', 'rolls'), [(0.0, False), (1.0, True)])
def test_a_polygon_rolls_across_a_face_or_stops_on_it(friction, rolls):
    rolling = RollingGrip.attach(NINE.home, inclined_grip(-0.01, friction))
    before = inclination(rolling)
    for _ in range(100):
        command = solve_twist(rolling.config, rolling.grip, [0.0, 0.0, 0.05], FAILED)
        travel = rolling.config.roller_positions + 0.02 * command.roller_velocities
        rolling = rolling.moved_to(rolling.config.moved_to(travel))
    assert before == pytest.approx(0.01, abs=1e-9)
    # In the window in which a face counts as lying on a member either end may be the last.
    assert rolling.misfit < 3e-4
    if rolls:
        assert command.status < Status.UNREACHABLE
        assert inclination(rolling) < -0.02
    else:
        assert command.status is Status.UNREACHABLE
        assert 0.0 < inclination(rolling) < 2e-3


@robots.examples(40)
@given(strategies.data(), robots.generators(), strategies.sampled_from(['module', 'tubes']))
def test_corners_are_rolled_over_where_a_linear_program_finds_a_balance(data, rng, kind):
    robot = data.draw(random_grips.robots_with(kind))
    config, grip = random_grips.random_convex_grip(robot, rng, kind, 2, flat=True)
    assume(grip is not None)
    contacts, friction = find_contacts(config, grip), float(rng.uniform(0.05, 1.5))
    assume(contacts.owners.tolist() == [0, 0, 1])
    found = list(rolled_corners(contacts, friction))
    for kept in ((0, 2), (1, 2)):
        # Not at the edge of a cone, where rounding decides.
        sure = {balance_exists(contacts, kept, friction * change) for change in (0.999, 1.001)}
        if len(sure) == 1:
            assert (kept in found) == sure.pop()
    assert (0, 1, 2) not in found


def test_a_box_on_three_members_stays_on_its_faces():
    rng = np.random.default_rng(3)
    grip = None
    while grip is None:
        config, grip = random_grips.random_convex_grip(NINE, rng, 'tubes', 3, flat=True)
    contacts = find_contacts(config, grip)
    assert len(contacts.owners) > 3
    assert list(rolled_corners(contacts, 1.0)) == []
