# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shape guard: margins from sample to sample, from within and beyond the bounds."""

from dataclasses import replace
from functools import cache

from driven import Driven
from grips import held_at, rolled
from hypothesis import assume, example, given
from hypothesis import strategies as st
from isotruss_ros.core import Robot, ShapeGuard, solve_twist, Status
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.manipulation.status import RollerCommand
from isotruss_ros.core.safety.barrier_law import ActiveValues, ALL_VALUES, BarrierLaw
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from nightly import some_now
import numpy as np
import pytest
import robots
import walks

#: Longer cycles, in which robots approach bounds [s].
APPROACH_PERIOD = 0.05
BARRIERS = {Status.SLOWED_RIGIDITY, Status.SLOWED_SELF_COLLISION, Status.SLOWED_OBJECT}
PERIOD = 0.01


def pushed(seed, slide=False):
    """Return a robot, and a twist that takes it to a bound."""
    rng = np.random.default_rng(seed)
    held = walks.begin(rng, walks.GRIPS[seed % len(walks.GRIPS)])
    return Driven(held, PERIOD, slide_along_limits=slide), 0.2 * rng.standard_normal(3)


def approach(robot, twist, distance):
    """Command a twist in longer cycles until a margin is below a distance."""
    for _ in range(200):
        if walks.margins(robot.held).min() < distance:
            return
        robot.step(twist, APPROACH_PERIOD)
    raise AssertionError('the twist does not lead to a bound')


@pytest.mark.parametrize(
    ('seed', 'distance', 'cycles', 'named'),
    some_now(
        [
            (
                0,
                0.06,
                50,
                [(Status.SLOWED_SELF_COLLISION, ('module east/R and member east/Y-Q',))],
            ),
            (9, np.inf, 200, [(Status.SLOWED_OBJECT, ('module east/Q and the object',))]),
            (15, np.inf, 200, []),
        ]
    ),
)
def test_margins_fall_by_the_class_k_function_along_the_twist(seed, distance, cycles, named):
    (robot, twist), binding = pushed(seed), []
    laws = [BarrierLaw(0.0, band) for band in (0.2, 0.1, 0.1)]
    slowed = 0
    approach(robot, twist, distance)
    before = walks.margins(robot.held)
    for _ in range(700):
        command = robot.step(twist)
        if command.status not in (Status.UNREACHABLE, Status.ACCELERATING):
            assert command.achieved_twist == pytest.approx(command.scale * twist, abs=1e-7)
        after = walks.margins(robot.held)
        for law, h, there in zip(laws, before, after, strict=True):
            least = h - PERIOD * law.class_k_bound(np.array([h]))[0]
            if np.isfinite(least):
                # Second order in the step of the rollers of at most 1 mm.
                assert there >= least - 1e-4
        before = after
        if command.status in BARRIERS:
            binding.append((command.status, command.limiting))
        slowed += bool(command.limiting) and command.scale < 1.0
        if slowed > cycles:
            break
    assert slowed
    assert binding[:1] == named
    assert before.min() > 0.0


@pytest.mark.parametrize('acceleration', some_now([0.1, 1.0]))
def test_the_rigidity_index_stays_above_its_bound(acceleration):
    robot = Robot(replace(walks.ROBOT.description, max_acceleration=acceleration))
    held, bounds = held_at(robot.home, 'north/Z', 0.3), ShapeBounds(0.9)
    weak = Driven(held, PERIOD, bounds=bounds, slide_along_limits=False)
    commands = []
    for period in [APPROACH_PERIOD] * 50 + [PERIOD] * 60:
        commands.append(weak.step((0.0, 0.1, 0.0), period))
        assert weak.change <= acceleration * period * (1.0 + 1e-6)
        assert walks.margins(weak.held)[0] + walks.BOUNDS.min_rigidity > 0.9
    slowed = [command for command in commands if command.status is Status.SLOWED_RIGIDITY]
    assert slowed
    assert 'the rigidity index' in slowed[0].limiting


@robots.examples(12)
@example(seed=1, kind='arch')  # reaches the bound of rigidity
@example(seed=20, kind='arch')  # reaches the bound of clearance
@example(seed=3, kind='ring')  # reaches the bound of the object's clearance
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(robots.KINDS))
def test_any_robot_keeps_its_bounds_and_gets_no_further_beyond_them(seed, kind):
    robot, rng = robots.random_robot(seed, kind), np.random.default_rng(seed)
    module = str(rng.choice(robot.module_names))
    try:
        held = held_at(robot.home, module, 0.2)
    except GraspError:
        assume(False)
    walker = Driven(held, 0.1, slide_along_limits=bool(seed % 2))
    least = np.minimum(walks.margins(walker.held), 0.0) - 1e-6
    twist = 0.3 * rng.standard_normal(3)
    for _ in range(40):
        walker.step(twist)
        assert (walks.margins(walker.held) > least).all()


@pytest.mark.parametrize('period', some_now([0.05, 0.1, 0.02]))
@pytest.mark.parametrize(
    ('seed', 'size', 'guarded'),
    some_now([(12, 2.0, True), (13, 0.2, False), (12, 2.0, False), (13, 0.2, True)], 2),
)
def test_rollers_do_not_oscillate_in_slow_loops(seed, size, guarded, period):
    rng = np.random.default_rng(seed)
    held = walks.begin(rng, walks.GRIPS[seed % len(walks.GRIPS)])
    twist = rng.standard_normal(3)
    twist *= size / np.linalg.norm(twist)
    bounds = ShapeBounds() if guarded else None
    robot = Driven(held, period, bounds=bounds, slide_along_limits=False)
    turns, rolled = 0, 0.0
    for _ in range(round(6.0 / period)):
        before = robot.velocities
        robot.step(twist)
        turns += (robot.velocities * before < -(0.001**2)).any()
        rolled += period * np.abs(robot.velocities).sum()
    assert rolled > 0.1
    assert turns < 6


@cache
def commanded(seed):
    """Return a grip near bounds, with commands for random twists."""
    rng = np.random.default_rng(seed)
    held = walks.begin(rng, walks.GRIPS[seed % len(walks.GRIPS)])
    twists = rng.standard_normal((3, 3))
    return held, [solve_twist(held.config, held.grip, twist) for twist in twists]


@pytest.mark.parametrize('duration', [1e-3, 0.05, 0.5, 2.0])
def test_commands_of_any_duration_cross_no_bound(duration):
    guard, reduced = ShapeGuard(walks.ROBOT), 0
    for seed in range(12):
        held, commands = commanded(seed)
        for command in commands:
            # The sample begins in `held`; the guard knows the configuration in its middle.
            speeds = command.roller_velocities * (0.2 if duration < 1.0 else 0.0)
            middle = rolled(held, 0.5 * duration * speeds)
            watch = guard.watch(middle.config, middle.grip)
            kept = watch.keep(command, speeds, duration)
            share = kept.scale / command.scale
            assert 0.0 <= share <= 1.0
            assert kept.roller_velocities == pytest.approx(share * command.roller_velocities)
            assert kept.achieved_twist == pytest.approx(share * command.achieved_twist)
            assert walks.margins(rolled(held, duration * kept.roller_velocities)).min() > 0.0
            if share < 1.0:
                reduced += 1
                stays = command.status is Status.UNREACHABLE and share > 0.0
                assert kept.status in ({Status.UNREACHABLE} if stays else BARRIERS)
    assert bool(reduced) == (duration >= 0.5)


def test_a_command_of_a_short_sample_ends_before_a_bound_beside_it():
    """The rollers travel by 1 mm toward the bound, without rows that limit their speeds."""
    held, _ = commanded(9)
    bound = walks.LEAST[2] + walks.margins(held)[2] - 1e-3
    guard = ShapeGuard(walks.ROBOT, ShapeBounds(min_object_clearance=bound))
    watch = guard.watch(held.config, held.grip)
    limit = min(watch.limits, key=lambda limit: limit.margins.min())
    toward = -limit.matrix[limit.margins.argmin()]
    command = RollerCommand(0.1 * toward / np.abs(toward).max(), np.zeros(3), 1.0, Status.OK)
    kept = watch.keep(command, np.zeros(len(toward)), PERIOD)
    there = rolled(held, PERIOD * kept.roller_velocities)
    assert walks.LEAST[2] + walks.margins(there)[2] > bound
    assert kept.status is Status.SLOWED_OBJECT


class Kink:
    """Barrier whose value falls by 10 per metre from a roller's home position on."""

    status, needs_object, law = Status.SLOWED_BARRIER, False, BarrierLaw(0.0, 0.1)

    def active(self, config, grip):
        rows = np.zeros((1, 2 * len(config.points)))
        return ActiveValues(np.array([0]), self.values(config, grip, ALL_VALUES), rows)

    def values(self, config, grip, indices):
        return np.array([0.05 - 10.0 * max(0.0, config.roller_positions[0])])[indices]

    def names(self, indices):
        return ['kink']


@pytest.mark.parametrize('speed', [0.0, -0.02])
def test_a_command_is_reduced_repeatedly_until_it_keeps_a_bound(speed):
    """The sample begins at home; the guard is told the configuration in its middle."""
    start, barrier, duration = walks.ROBOT.home, Kink(), 0.1
    unit = (np.arange(len(start.roller_positions)) == 0).astype(float)
    middle = start.moved_to(0.5 * duration * speed * unit)
    watch = ShapeGuard(walks.ROBOT, barriers=(barrier,)).watch(middle, None)
    command = RollerCommand(0.1 * unit, np.zeros(3), 1.0, Status.OK)
    kept = watch.keep(command, speed * unit, duration)
    end = start.moved_to(duration * kept.roller_velocities)
    assert 0.0 < barrier.values(end, None, ALL_VALUES)[0] < 0.03
    assert (kept.status, kept.limiting) == (Status.SLOWED_BARRIER, ('kink',))
