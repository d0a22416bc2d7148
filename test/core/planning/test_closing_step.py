# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of closing on an object: the program is solved, and no step leads where it must not."""

from dataclasses import replace

import closings
from isotruss_ros.core import ConvexObject
from isotruss_ros.core.errors import ConfigurationError, SolverError
from isotruss_ros.core.manipulation.limits import MemberLengthLimit
from isotruss_ros.core.planning import closing_step
from isotruss_ros.core.planning.closing import evaluate_state
from isotruss_ros.core.planning.closing_step import solve_step, take_closing_step
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
import numpy as np
import pytest

SEEDS = range(12)
STANDOFF = 0.006


def tasks(seed, count=2):
    """Return an object in a robot, and random things that are to close on it."""
    config, body, tube = closings.scene(seed)
    rng = np.random.default_rng([8, seed])
    return config, [closings.closing(config, body, tube, rng) for _ in range(count)], rng


@pytest.mark.parametrize('seed', SEEDS)
def test_what_is_known_of_a_place_is_what_is_there(seed):
    config, (closing, _), _ = tasks(seed)
    place = evaluate_state(config, closing.body)
    assert place.config is config
    assert place.gaps == pytest.approx(
        np.concatenate(closings.gaps(config, closing.body)), abs=1e-4
    )
    assert place.rigidity == pytest.approx(closings.rigidity(config), rel=1e-3)
    assert place.clearance == pytest.approx(closings.clearance(config), abs=2e-5)


def floors(config, closing, targets):
    """Return the least distances (3m,) of the object that a step may leave."""
    tube = config.robot.description.tube_diameter
    present = np.concatenate(closings.gaps(config, closing.body))
    least = np.full(len(present), 0.05 * tube)
    least[list(closing.members)] = np.asarray(targets) - 0.015 * tube
    return np.minimum(least, present)


def trouble(config, there, closing, targets):
    """Return what forbids a step from one configuration to another, or None; and its value."""
    rigid = closings.rigidity(there)
    if rigid < min(closing.min_rigidity, closings.rigidity(config)):
        return 'rigidity', rigid
    clear = closings.clearance(there)
    if clear < min(0.0, closings.clearance(config)):
        return 'self_clearance', clear
    distances = np.concatenate(closings.gaps(there, closing.body))
    short = distances - floors(config, closing, targets)
    if short.min() < 0.0:
        return 'object_clearance', distances[short.argmin()]
    return None


def crowded(seed):
    """Return what closes on an object that nearly touches something, or does, and a generator."""
    config, body, tube = closings.scene(seed)
    rng = np.random.default_rng([9, seed])
    gaps = np.concatenate(closings.gaps(config, body))
    # What is not to touch is to keep 0.05 diameters of the tube away.
    left = config.robot.description.tube_diameter * rng.uniform(-0.02, 0.12)
    wider = ConvexObject.disc(body.pose[:2], 2.0 * (body.arm + gaps.min() - left))
    closing = closings.closing(config, wider, tube, rng)
    if rng.random() < 0.7:
        # The nearest part is one that is not to touch.
        nearest = int(gaps.argmin()) % len(config.robot.member_names)
        away = [i for i in np.flatnonzero(config.robot.topology.tube == tube) if i != nearest]
        closing = replace(closing, members=tuple(int(i) for i in away[:2]))
    least = closings.rigidity(config) * rng.uniform(0.98, 1.02)
    return config, replace(closing, min_rigidity=least), rng


@pytest.mark.parametrize('seed', range(40))
def test_a_step_keeps_its_bounds_to_first_order(seed):
    # All of them hold where it leads, but for what curves.
    config, closing, rng = crowded(seed)
    robot, lengths = config.robot, config.member_lengths
    tube, length = robot.description.tube_diameter, robot.home.member_lengths.mean()
    limit = MemberLengthLimit(lengths.min() - 2e-3, lengths.max() + 2e-3, 0.5)
    closing = replace(closing, limits=(limit,))
    targets = rng.uniform(-0.02, 0.01, len(closing.members))
    state = evaluate_state(config, closing.body)
    move = solve_step(state, closing, targets, 0.3)
    there = evaluate_state(config.moved_to(config.roller_positions + move), closing.body)
    slack, sides = 5e-3 * tube, list(closing.members)
    floor = np.minimum(state.gaps, 0.05 * tube + 0.5 * state.gaps)
    floor[sides] = np.minimum(state.gaps[sides], targets)
    assert (there.gaps > floor - slack).all()
    rigid = min(state.rigidity, 0.5 * (state.rigidity + closing.min_rigidity))
    assert there.rigidity > rigid - 2e-3
    near = np.minimum(state.distances, 0.5 * (state.distances + 0.01 * length))
    assert (there.distances > near - slack).all()
    reached = there.config.member_lengths
    assert lengths.min() - 1.2e-3 < reached.min()
    assert reached.max() < lengths.max() + 1.2e-3
    assert np.abs(move).max() < 0.3 * 0.035 * length + 1e-9


@pytest.mark.parametrize('seed', range(40))
def test_a_step_is_halved_until_it_leads_where_it_may(seed, monkeypatch):
    # Whatever the program says: here it knows nothing, and its steps are far too long.
    config, closing, rng = crowded(seed)
    place = evaluate_state(config, closing.body)
    targets = np.full(len(closing.members), rng.choice([STANDOFF, -0.03]))
    for size in (0.002, 0.02, 0.1, 0.4):
        move = (
            size
            * config.robot.home.member_lengths.mean()
            * rng.uniform(-1.0, 1.0, len(config.roller_positions))
        )
        monkeypatch.setattr(closing_step, 'solve_step', lambda *_, move=move: move)
        closing = replace(closing, tally=SearchTally())
        try:
            made, blocked = take_closing_step(place, closing, targets, 0.3), None
        except RequirementError as error:
            blocked = error.args
        for halving in range(5):
            goal = config.roller_positions + move / 2**halving
            try:
                there = config.moved_to(goal)
            except ConfigurationError:
                expected = ('rigidity', 0.0)
                continue
            expected = trouble(config, there, closing, targets)
            if expected is None:
                break
        if expected is None:
            assert (made[0].config.roller_positions == goal).all()
            assert closing.tally.evaluations == halving + 1
            assert made[1] == (0.6 if halving == 0 else pytest.approx(0.3 * 0.5**halving))
        else:
            assert closing.tally.evaluations == 5
            assert blocked[0] == expected[0]
            assert blocked[1] == pytest.approx(expected[1], abs=1e-3)


def test_a_step_without_a_solution_is_an_error(monkeypatch):
    config, (closing, _), _ = tasks(0)
    place, targets = (
        evaluate_state(config, closing.body),
        np.full(len(closing.members), STANDOFF),
    )
    monkeypatch.setattr(closing_step, 'solve_qp', lambda problem: None)
    with pytest.raises(SolverError, match='no step of the rollers keeps the bounds'):
        solve_step(place, closing, targets, 1.0)
