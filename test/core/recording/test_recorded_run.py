# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decisions of a servo, computed again from the records of its cycles."""

from dataclasses import replace
from functools import cache
import json
import pickle

from grips import gripped
from held_grips import HOME
from isotruss_ros.core import ConvexObject, Disc, Grip, Obstacle, place_between, Status, TwistServo
from isotruss_ros.core.estimation.state_estimate import EstimatedTravel
from isotruss_ros.core.holding.attach_grip import attach_grip
from isotruss_ros.core.inputs import RejectedInput, RollerState, StampedInput
from isotruss_ros.core.model.obstacle import HalfPlane
from isotruss_ros.core.recording.encoded_values import (
    decode,
    encode,
    find_changes,
    RecordedCycleError,
)
from isotruss_ros.core.recording.recorded_cycle import INPUTS, read_cycle
from isotruss_ros.core.recording.recorded_servo import RecordedServo
from isotruss_ros.core.recording.repeated_run import decide_again, read_robot
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

CONFIG, BODY = gripped(35.0, squeeze=0.1)
MEMBERS = ('north/P-Z', 'north/Z-R')
DISC = place_between(HOME, MEMBERS, Disc(0.2), indentation=0.01).body
GRIPS = {
    'wedge': (CONFIG, Grip.at_module(CONFIG.robot, 'north/Z', BODY, 0.5)),
    'home': (HOME, Grip(MEMBERS, attach_grip(HOME, DISC).body, 0.8)),
}
KINDS = ['twist', 'twist', 'rest', 'jump', 'repeat', 'bad', 'gone', 'offsets', 'stop']


class Faults:
    """Random twists and inputs, of which each kind lasts for some cycles."""

    def __init__(self, loop, rng):
        self.loop, self.rng, self.until = loop, rng, 0
        self.offsets = np.zeros(6)

    def cycle(self, number):
        loop, rng = self.loop, self.rng
        if number >= self.until:
            self.until = number + int(rng.integers(4, 12))
            self.kind = rng.choice(KINDS)
            self.twist = rng.normal(size=3) * (0.03, 0.03, 0.15)
            self.away = rng.normal(size=3) * (3e-3, 3e-3, 0.0)
            halt = (Status.HALT_EMERGENCY_STOP, 'stop') if self.kind == 'stop' else None
            loop.servo.receive(halt=halt)
            if self.kind == 'offsets':
                self.offsets = 2e-3 * rng.normal(size=6)
        inputs, away = {}, {'jump': self.away, 'gone': (5.0, 5.0, 0.0)}.get(self.kind, (0.0,) * 3)
        positions = loop.plant.roller_positions + self.offsets
        state = RollerState(positions, loop.plant.roller_velocities, self.offsets)
        inputs['rollers'] = StampedInput(state, loop.now)
        estimate = EstimatedTravel(self.offsets, 1e-6 * np.eye(6))
        inputs['estimate'] = StampedInput(estimate, loop.now)
        if self.kind == 'repeat' and number:
            inputs['pose'] = loop.servo.inputs.pose
        if self.kind == 'bad':
            inputs['pose'] = RejectedInput('no pose')
        twist = None if self.kind == 'rest' else self.twist
        return loop.cycle(twist, away=away, **inputs)


def numbers(decision):
    command = decision.command
    return (
        command.roller_velocities.tolist(),
        command.achieved_twist.tolist(),
        (command.scale, command.status, command.limiting, decision.message),
        (decision.squeeze, decision.desired_pose, decision.pose_gain, decision.pose_delay),
    )


CYCLES = 25


def recorded_loop(name='wedge', **settings):
    """Return a loop whose servo records its cycles."""
    loop = SqueezeLoop(*GRIPS[name], **settings)
    loop.servo = RecordedServo(loop.servo.robot, loop.servo.settings, loop.servo.inputs)
    return loop


@cache
def record_faults(seed=0, name='wedge'):
    """Return records, decisions and pickled memories of a run with random faults and calls."""
    loop = recorded_loop(name, noise=1e-4, servo={'bounds': ShapeBounds()})
    texts, memories = [], []
    servo, rng = loop.servo, np.random.default_rng(seed)
    faults, settings = Faults(loop, rng), servo.settings
    renewed, cleared = rng.integers(1, CYCLES, size=2)
    for number in range(CYCLES):
        if number == renewed:
            squeeze = replace(settings.squeeze, force=1.1 * loop.target)
            servo.apply(replace(settings, squeeze=squeeze))
        if number == cleared:
            servo.acknowledge()
            servo.reset_failures()
        memories.append(pickle.dumps(servo.memory))
        faults.cycle(number)
        texts.append(servo.describe())
    return texts, loop.decisions, memories


TEXTS, *_ = record_faults()
CYCLE = json.loads(TEXTS[0])


@pytest.mark.parametrize('name', some_now(sorted(GRIPS, reverse=True)))
@pytest.mark.parametrize('seed', some_now(list(range(8)), 1))
def test_records_give_the_same_decisions_bit_by_bit_from_any_cycle_on(seed, name):
    texts, decisions, memories = record_faults(seed, name)
    for first in (0, int(np.random.default_rng(seed).integers(1, CYCLES))):
        cycles = [read_cycle(text) for text in texts[first:]]
        memory = pickle.loads(memories[first]) if first else None
        again = decide_again(cycles, read_robot(cycles[0]), memory=memory)
        for cycle, decision in zip(again, decisions[first:], strict=True):
            assert numbers(cycle.decision) == numbers(decision)


def test_roller_velocities_that_the_client_commands_are_limited_again_as_recorded():
    servo, texts, limited = recorded_loop().servo, [], []
    for number in range(3):
        limited.append(servo.command(np.full(6, 0.05), 0.02 * number))
        texts.append(servo.describe())
    again = decide_again(map(read_cycle, texts), servo.robot)
    velocities = [cycle.decision.command.roller_velocities for cycle in again]
    np.testing.assert_array_equal(velocities, limited)


def test_a_command_changes_as_far_from_the_recorded_one_as_the_acceleration_admits():
    servo, cycles = recorded_loop().servo, []
    for number in range(2):
        servo.command(np.full(6, 0.05), 0.02 * number)
        cycles.append(read_cycle(servo.describe()))
    given = {'velocities': np.full(6, 0.01), 'achieved': np.zeros(3)}
    cycles[0] = cycles[0]._replace(decision=cycles[0].decision | given)
    *_, last = decide_again(cycles, servo.robot)
    change = 0.02 * servo.robot.description.max_acceleration
    assert last.decision.command.roller_velocities == pytest.approx(np.full(6, 0.01 + change))


def test_a_changed_setting_is_named_with_both_values():
    before, after = (read_cycle(TEXTS[number]).settings for number in (0, -1))
    (change,) = find_changes(before, after)
    assert change == f'squeeze.force: {before.squeeze.force} -> {after.squeeze.force}'


def test_obstacles_are_recorded_with_the_cycle():
    hand = Obstacle('hand', ConvexObject(Disc(0.1), (0.7, 0.2, 0.0)), (0.1, -0.1, 0.0), 0.5)
    wall = Obstacle('wall', ConvexObject(HalfPlane(), (0.0, -9.0, 0.5 * np.pi)))
    for value in (StampedInput((hand,), 0.0), wall):
        assert decode(json.loads(json.dumps(encode(value)))) == value
    assert 'obstacles' in INPUTS


def test_a_run_goes_on_with_a_new_memory_behind_missing_cycles():
    cycles = [read_cycle(text) for text in TEXTS]
    again = list(decide_again(cycles[:5] + cycles[8:], read_robot(cycles[0])))
    assert [cycle.recorded.number for cycle in again if cycle.is_anew] == [0, 8]


def test_a_cycle_that_is_recorded_twice_is_decided_once():
    cycles = [read_cycle(text) for text in TEXTS for _ in range(2)]
    again = list(decide_again(cycles, read_robot(cycles[0])))
    assert [cycle.recorded.number for cycle in again] == list(range(len(TEXTS)))
    assert [cycle.recorded.number for cycle in again if cycle.is_anew] == [0]


def test_a_record_names_the_fields_that_it_lacks():
    older = CYCLE | {'inputs': {'mapping': {}}}
    del older['versions'], older['calls']
    absent = read_cycle(json.dumps(older)).absent
    assert {'versions', 'calls', 'inputs.pose', 'inputs.halt'} <= set(absent)


def test_a_record_states_the_versions_of_the_numerical_packages():
    assert read_cycle(json.dumps(CYCLE)).versions['numpy'] == np.__version__


#: Changes of a record, and texts that are none.
BROKEN = [
    ({'now': 'noon'}, 'now: .*noon.*must be a finite number'),
    ({'now': float('nan')}, 'now: .*NaN.*must be a finite number'),
    ({'settings': {'kind': 'Popen', 'args': 'true'}}, "settings: 'Popen': no known class"),
    ({'settings': CYCLE['settings'] | {'period': -1.0}}, 'settings: period'),
    ({'inputs': {'mapping': {'pose': {'array': ['x']}}}}, 'inputs: could not convert'),
    ({'commanded': [1.0]}, 'commanded: '),
    ({'calls': [['system']]}, 'calls: '),
    ({'calls': [['reset_failures', 3]]}, 'calls: .*must be pairs of name and argument'),
    ({'settings': CYCLE['settings'] | {'limits': ['x']}}, 'settings: .*without .*limits'),
    ({'inputs': {'mapping': {'failed': [[]]}}}, 'inputs: .*the failed rollers by name'),
    ({'commanded': {'array': [10**400]}}, 'commanded: .*too large'),
    ({'decision': json.loads('[' * 400 + ']' * 400)}, 'decision: '),
]
BROKEN += [(text, 'record of a cycle: no JSON text') for text in ('', '[', '3', '[' * 100_000)]
BROKEN += [('{"number": 1}', 'now: must be in the record')]


@pytest.mark.parametrize(('broken', 'words'), BROKEN)
def test_a_broken_record_is_refused_with_the_field(broken, words):
    text = broken if isinstance(broken, str) else json.dumps(CYCLE | broken)
    with pytest.raises(RecordedCycleError, match=words):
        read_cycle(text)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'calls': [['system', ['true']]]}, "calls: 'system': no known call"),
        ({'detected': ['north/none']}, 'north/none'),
        ({'inputs': {'mapping': {'halt': 'stop'}}}, 'halt'),
    ],
)
def test_a_cycle_with_unknown_content_is_refused_with_its_number(change, words):
    cycle = read_cycle(json.dumps(CYCLE | change))
    with pytest.raises(RecordedCycleError, match=f'cycle 0: .*{words}'):
        next(decide_again([cycle], TwistServo(read_robot(cycle), cycle.settings).robot))
