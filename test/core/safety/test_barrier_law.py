# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Barriers: their law by its formulas, what of a motion is admissible, how commands are cut."""

from types import SimpleNamespace

from hypothesis import assume, given
from isotruss_ros.core import load_robot, Status
from isotruss_ros.core.errors import ConfigurationError, GraspError
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.safety import shape_guard
from isotruss_ros.core.safety.barrier_law import (
    ActiveValues,
    BarrierLaw,
    BarrierLimit,
    BarrierViolation,
)
from isotruss_ros.core.safety.shape_guard import Watch
import numpy as np
import pytest
import robots

SHARES = np.linspace(0.0, 1.0, 50)
LAW = BarrierLaw(bound=0.3, band=0.2)
#: Of the defaults: rate, and the margin at which motion comes to rest.
RATE, REST = 5.0, 0.01 * 0.2
HOME = load_robot('nine_member').home
PERIOD = 0.01


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


@pytest.mark.parametrize('share', [0.02, 0.1, 0.5, 0.9, 1.0])
def test_margins_fall_by_the_class_k_function(share):
    left = share * 0.2 - REST
    expected = RATE * left / (1.0 - left / 0.2)
    assert LAW.class_k_bound(np.array([share * 0.2])) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize('travel', [1e-4, 1e-3])
def test_a_small_positive_margin_loses_no_more_than_rounding(travel):
    margin = 0.05 * 0.1 * REST
    lost = margin - LAW.discrete_bound(np.array([margin]), 0.01, travel)[0]
    assert 0.0 < lost < 2e-9


def test_rows_admit_decreases_by_the_class_k_function_and_all_increases():
    barrier = SimpleNamespace(law=LAW, status=Status.SLOWED_BARRIER, names=lambda numbers: ['it'])
    values, matrix = LAW.bound + np.array([0.5 * LAW.band]), np.array([[0.3, -0.4]])
    limit = BarrierLimit(barrier, ActiveValues(np.arange(1), values, np.zeros((1, 0))), matrix)
    rows = limit.rows(HOME)
    assert (rows.matrix == matrix).all()
    assert rows.lower == pytest.approx(-LAW.class_k_bound(values - LAW.bound))
    assert rows.upper == [np.inf]


@pytest.mark.parametrize(
    ('share', 'duration'), [(0.5, 0.01), (0.5, 1.0), (0.9, 0.01), (0.02, 0.1)]
)
def test_a_sample_uses_at_most_twice_the_class_k_rate_and_leaves_a_tenth(share, duration):
    margin, last = share * LAW.band, 0.1 * LAW.safety_margin
    rate = LAW.rate * margin / (1.0 - share)
    expected = max(0.1 * margin, margin - 2.0 * duration * rate, last)
    bound = LAW.discrete_bound(np.array([margin]), duration, 0.0)
    assert bound == pytest.approx([expected], rel=1e-12)


@pytest.mark.parametrize('travel', [0.0, 1e-4, 1e-3])
def test_what_is_beyond_the_bound_may_lose_the_square_of_the_travel(travel):
    for margin in (0.09 * REST, 0.0, -0.1):
        left = LAW.discrete_bound(np.array([margin]), 0.01, travel)[0]
        assert margin - left == pytest.approx(1e-9 + 0.2 * (travel / 0.05) ** 2, rel=0.01)


@pytest.mark.parametrize(('travel', 'velocity'), [(1e-3, 0.0), (1e-3, 0.05), (1e-4, 0.2)])
@pytest.mark.parametrize('loss', [0.99, 1.01])
def test_beyond_the_bound_the_longer_travel_of_this_and_the_previous_sample_counts(
    travel, velocity, loss
):
    allowed = LAW.band * (max(travel, PERIOD * velocity) / 0.05) ** 2
    barrier = SimpleNamespace(
        law=LAW,
        status=Status.SLOWED_RIGIDITY,
        values=lambda *_: np.array([LAW.bound - 0.1 - loss * allowed]),
        names=lambda numbers: ['value'] * len(numbers),
    )
    active = ActiveValues(np.arange(1), np.array([LAW.bound - 0.1]), np.zeros((1, 0)))
    limit = BarrierLimit(barrier, active, np.zeros((1, 1)))
    found = limit.violation(None, None, np.array([travel]), np.array([-velocity]), PERIOD)
    assert (found is None) == (loss < 1.0)


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


@pytest.mark.parametrize(('room', 'share'), [(0.52, 0.8**3), (0.5, 0.0)])
def test_a_command_that_three_reductions_do_not_make_admissible_is_zero(room, share):
    travel = 0.1 * PERIOD
    found = kept(0.1, lambda moved: 1.0 if moved > room * travel else None)
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


#: Travel at which no configuration exists, or a value jumps below its bound [m].
END = 6e-3


def cut(barriers=(), grip=None):
    """Return a command of 10 mm, and what is kept of it where `END` must not be reached."""

    def move(positions):
        if not barriers and grip is None and positions[0] > END:
            raise ConfigurationError('no configuration')
        return SimpleNamespace(roller_positions=positions)

    config = SimpleNamespace(roller_positions=np.zeros(2), moved_to=move)
    command = RollerCommand(np.array([0.1, 0.0]), np.zeros(3), 1.0, Status.OK)
    return Watch(config, grip, barriers, ()).keep(command, np.zeros(2), 0.1)


def test_a_command_to_where_no_configuration_exists_is_reduced():
    found = cut()
    # By four fifths of a half.
    assert found.roller_velocities == pytest.approx([0.04, 0.0])
    assert (found.status, found.limiting) == (Status.SLOWED_RIGIDITY, ())


def test_a_command_that_loses_a_contact_is_reduced(monkeypatch):
    def roll(grip, _, end):
        if end.roller_positions[0] > END:
            raise GraspError('a contact is lost')
        return grip

    monkeypatch.setattr(shape_guard, 'roll_object', roll)
    found = cut(grip='a grip')
    assert found.roller_velocities == pytest.approx([0.04, 0.0])
    assert (found.status, found.limiting) == (Status.SLOWED_OBJECT, ('the contacts of the grip',))


def test_a_value_that_jumps_from_beyond_the_band_below_its_bound_reduces_the_command():
    barrier = SimpleNamespace(
        law=LAW,
        status=Status.SLOWED_BARRIER,
        values=lambda end, *_: LAW.bound + np.array([1.0, END - end.roller_positions[0]]),
        names=lambda numbers: [f'value {i}' for i in numbers],
    )
    found = cut((barrier,))
    assert found.roller_velocities == pytest.approx([0.04, 0.0])
    assert (found.status, found.limiting) == (Status.SLOWED_BARRIER, ('value 1',))


@pytest.mark.parametrize(('speed', 'looked'), [(0.009, False), (0.011, True)])
def test_values_beyond_the_band_are_evaluated_for_more_than_1_mm(speed, looked):
    calls = []
    barrier = SimpleNamespace(
        law=LAW,
        values=lambda *_: calls.append(1) or np.ones(1),
        names=lambda numbers: [],
    )
    config = SimpleNamespace(roller_positions=np.zeros(1), moved_to=lambda _: None)
    command = RollerCommand(np.array([-speed]), np.zeros(3), 1.0, Status.OK)
    found = Watch(config, None, (barrier,), ()).keep(command, np.zeros(1), 0.1)
    assert found is command
    assert bool(calls) is looked
