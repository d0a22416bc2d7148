# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Steps of closing on an object: the program is solved, and no step leads where it must not."""

from dataclasses import replace

import closings
from isotruss_ros.core import ConvexObject
from isotruss_ros.core.errors import ConfigurationError, SolverError
from isotruss_ros.core.kinematics.rigidity import rigidity_index
from isotruss_ros.core.planning import closing_step
from isotruss_ros.core.planning.closing import evaluate_state
from isotruss_ros.core.planning.closing_step import press, solve_step, take_closing_step
from isotruss_ros.core.planning.violations import RequirementError, SearchTally
from isotruss_ros.core.safety.distances import collision_model
import numpy as np
import pytest
from scipy.optimize import nnls

SEEDS = range(12)
STANDOFF = 0.006


def tasks(seed, count=2):
    """Return an object in a robot, and random things that are to close on it."""
    config, body, tube = closings.scene(seed)
    rng = np.random.default_rng([8, seed])
    return config, [closings.closing(config, body, tube, rng) for _ in range(count)], rng


def watched(config, body):
    """Return all that a step is to bring about or to leave."""
    gaps = evaluate_state(config, body).gaps
    values = rigidity_index(config.robot).modes(config).values[:2]
    near = collision_model(config.robot).distances(config)
    return np.concatenate([gaps, values, near, config.member_lengths])


def slopes(config, body):
    """Return the derivatives of what is watched by roller travel, by differences."""
    moves = 1e-6 * np.eye(len(config.roller_positions))
    here = config.roller_positions
    return np.column_stack(
        [
            watched(config.moved_to(here + move), body)
            - watched(config.moved_to(here - move), body)
            for move in moves
        ]
    ) / (2e-6)


def turning(config, closing):
    """Return how fast the members turn with the rollers, by differences."""
    here = config.roller_positions
    ahead, back = (
        [closing.normals(config.moved_to(here + move)) for move in sign * 1e-6 * np.eye(len(here))]
        for sign in (1.0, -1.0)
    )
    return np.angle(np.array(ahead) / np.array(back)).T / 2e-6


class Program:
    """
    The program of a step, from the numbers that the documents give and from differences.

    :ivar gradient: of its cost, by the rollers' motion.
    :ivar rows: lower <= rows u.
    :ivar lower: of these rows.
    :ivar rigid: which rows speak of rigidity.
    """

    def __init__(self, config, closing, targets, share):
        robot, m = config.robot, config.robot.topology.n_modules
        tube, r = robot.description.tube_diameter, len(config.roller_positions)
        length = robot.home.member_lengths.mean()
        values, by = watched(config, closing.body), slopes(config, closing.body)
        ends = [m, 3 * m, 3 * m + 2, len(values) - m]
        members, others, modes, near, lengths = np.split(values, ends)
        *_, by_modes, by_near, _ = np.split(by, ends)
        sides = list(closing.members)

        wanted = np.maximum(targets - members[sides], -0.027 * share * length)
        rows, lower = [by[: 3 * m]], 0.5 * (0.1 * tube - np.append(members, others))
        lower[sides] = targets - members[sides]
        bounds = [np.minimum(0.0, lower)]
        task, aim = by[sides], wanted
        if closing.facing is not None:
            turned = np.angle(closing.facing / closing.normals(config))
            task = np.vstack([task, 0.3 * turning(config, closing)])
            aim = np.append(aim, 0.3 * np.clip(turned, -0.1, 0.1))
        count = sum(map(len, rows))
        rows.append(by_modes)
        bounds.append(np.minimum(0.0, -0.5 * (modes - closing.min_rigidity)))
        close = np.flatnonzero(near < 0.15 * length)
        rows.append(by_near[close])
        bounds.append(np.minimum(0.0, -0.5 * (near[close] - 0.01 * length)))
        shortest, speed = closing.limits[0], closing.limits[1].max_speed
        rows += [by[-m:], -by[-m:]]
        bounds += [0.5 * (shortest.min_length - lengths), -0.5 * (shortest.max_length - lengths)]
        most = min(speed, 0.035 * share * length)
        rows += [np.eye(r), -np.eye(r)]
        bounds += [np.full(2 * r, -most)]
        nominal_posture = np.zeros(r)
        if closing.nominal_posture is not None:
            most = 0.035 * share * length
            nominal_posture = np.clip(
                closing.nominal_posture - config.roller_positions, -most, most
            )

        self.gradient = lambda u: task.T @ (task @ u - aim) + 1e-4 * (u - nominal_posture)
        self.rows, self.lower = np.vstack(rows), np.concatenate(bounds)
        self.rigid = np.isin(np.arange(len(self.rows)), [count, count + 1])


@pytest.mark.parametrize('seed', range(24))
def test_no_admissible_motion_is_better(seed):
    # The cost is convex, so this is so where its slope is balanced by bounds that are reached.
    config, todo, rng = tasks(seed)
    present = closings.rigidity(config)
    for closing in todo:
        away = rng.standard_normal(len(config.roller_positions))
        nominal_posture = config.roller_positions + 0.1 * away if rng.random() < 0.5 else None
        given = {
            'nominal_posture': nominal_posture,
            'min_rigidity': present * rng.uniform(0.97, 1.01),
        }
        if rng.random() < 0.5:
            turns = rng.uniform(-0.2, 0.2, len(closing.members))
            given['facing'] = closing.normals(config) * np.exp(1j * turns)
        closing = replace(closing, **given)
        share = rng.uniform(0.1, 1.0)
        targets = rng.uniform(-0.02, 0.01, len(closing.members))
        program = Program(config, closing, targets, share)
        move = solve_step(evaluate_state(config, closing.body), closing, targets, share)
        slack = program.rows @ move - program.lower
        assert (slack > np.where(program.rigid, -3e-5, -1e-6)).all()
        gradient = program.gradient(move)
        # The rigidity of the weakest modes, and so its slope, is known to a few iterations.
        reached = slack < np.where(program.rigid, 3e-5, 1e-6)
        left = np.linalg.norm(gradient)
        if reached.any():
            left = nnls(program.rows[reached].T, gradient)[1]
        assert left < (1e-5 if (reached & program.rigid).any() else 1e-9)


def test_a_step_without_a_solution_is_an_error(monkeypatch):
    config, (closing, _), _ = tasks(0)
    place, targets = (
        evaluate_state(config, closing.body),
        np.full(len(closing.members), STANDOFF),
    )
    monkeypatch.setattr(closing_step, 'solve_qp', lambda problem: None)
    with pytest.raises(SolverError, match='no step of the rollers keeps the bounds'):
        solve_step(place, closing, targets, 1.0)


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


def test_where_there_is_no_shape_there_is_no_rigidity(monkeypatch):
    config, (closing, _), _ = tasks(0)
    place, far = evaluate_state(config, closing.body), np.full(len(config.roller_positions), 1e3)
    far[::2] *= -1.0
    monkeypatch.setattr(closing_step, 'solve_step', lambda *_: far)
    with pytest.raises(RequirementError) as blocked:
        take_closing_step(place, closing, np.full(len(closing.members), STANDOFF), 1.0)
    assert blocked.value.args[:2] == ('rigidity', 0.0)


@pytest.mark.parametrize('seed', range(40))
def test_who_stands_still_is_not_blocked_wherever_that_is(seed, monkeypatch):
    config, closing, _ = crowded(seed)
    still = np.zeros(len(config.roller_positions))
    monkeypatch.setattr(closing_step, 'solve_step', lambda *_: still)
    place, targets = evaluate_state(config, closing.body), np.full(len(closing.members), STANDOFF)
    assert take_closing_step(place, closing, targets, 1.0)[1] == 1.0


def test_members_that_do_not_reach_say_how_far_they_are(monkeypatch):
    config, (closing, _), _ = tasks(0)
    monkeypatch.setattr(closing_step, 'MAX_PRESS_STEPS', 1)
    gaps = closings.gaps(config, closing.body)[0][list(closing.members)]
    for depth in (0.0, 0.02):
        with pytest.raises(RequirementError) as missed:
            press(config, closing, np.full(len(closing.members), depth))
        assert missed.value.args == ('reach', pytest.approx(np.abs(gaps + depth).max()), 0.0)
