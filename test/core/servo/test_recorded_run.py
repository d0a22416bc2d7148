# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decisions of a servo, computed again from the records of its cycles."""

from dataclasses import replace
import json
import pickle

from faulty_runs import Faults, GRIPS, numbers
from isotruss_ros.core import TwistServo
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.recorded_cycle import read_cycle
from isotruss_ros.core.servo.recorded_servo import RecordedServo
from isotruss_ros.core.servo.recorded_values import find_changes, RecordedCycleError
from isotruss_ros.core.servo.repeated_run import decide_again, read_robot
from nightly import some_now
import numpy as np
import pytest
from squeeze_loop import SqueezeLoop

CYCLES = 50


def recorded_loop(name='wedge', **settings):
    """Return a loop whose servo records its cycles."""
    loop = SqueezeLoop(*GRIPS[name], **settings)
    loop.servo = RecordedServo(loop.servo.robot, loop.servo.settings, loop.servo.inputs)
    return loop


def record_faults(seed=1, name='wedge'):
    """Return records, decisions and pickled memories of a run with random faults and calls."""
    loop, texts, memories = (
        recorded_loop(name, noise=1e-4, servo={'bounds': ShapeBounds()}),
        [],
        [],
    )
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


TEXTS, DECISIONS, _ = record_faults()
CYCLE = json.loads(TEXTS[0])


@pytest.mark.parametrize('name', sorted(GRIPS))
@pytest.mark.parametrize('seed', some_now(list(range(8)), 1))
def test_records_of_a_run_with_faults_give_the_same_decisions_bit_by_bit(seed, name):
    texts, decisions, _ = record_faults(seed, name)
    cycles = [read_cycle(text) for text in texts]
    again = decide_again(cycles, read_robot(cycles[0]))
    for cycle, decision in zip(again, decisions, strict=True):
        assert numbers(cycle.decision) == numbers(decision)


@pytest.mark.parametrize('name', sorted(GRIPS))
@pytest.mark.parametrize('seed', some_now(list(range(8)), 1))
def test_a_memory_and_the_records_that_follow_give_the_same_decisions_bit_by_bit(seed, name):
    texts, decisions, memories = record_faults(seed, name)
    first = int(np.random.default_rng(seed).integers(1, CYCLES))
    cycles = [read_cycle(text) for text in texts[first:]]
    again = decide_again(cycles, read_robot(cycles[0]), memory=pickle.loads(memories[first]))
    for cycle, decision in zip(again, decisions[first:], strict=True):
        assert numbers(cycle.decision) == numbers(decision)


def test_roller_velocities_that_the_client_commands_are_limited_again_as_recorded():
    servo, texts, limited = recorded_loop().servo, [], []
    for number in range(3):
        limited.append(servo.command(np.full(6, 0.05), 0.02 * number))
        texts.append(servo.describe())
    again = decide_again(map(read_cycle, texts), servo.robot)
    assert [cycle.velocities.tolist() for cycle in again] == [v.tolist() for v in limited]


def test_a_changed_setting_is_named_with_both_values():
    before, after = (read_cycle(TEXTS[number]).settings for number in (0, -1))
    (change,) = find_changes(before, after)
    assert change == f'squeeze.force: {before.squeeze.force} -> {after.squeeze.force}'


def test_a_run_goes_on_with_a_new_memory_behind_missing_cycles():
    cycles = [read_cycle(text) for text in TEXTS]
    again = list(decide_again(cycles[:5] + cycles[8:], read_robot(cycles[0])))
    assert [cycle.recorded.number for cycle in again if cycle.is_anew] == [0, 8]


def test_a_record_names_the_fields_that_it_lacks():
    older = CYCLE | {'inputs': {'mapping': {}}}
    del older['versions'], older['calls']
    absent = read_cycle(json.dumps(older)).absent
    assert {'versions', 'calls', 'inputs.pose', 'inputs.halt'} <= set(absent)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'now': 'noon'}, 'now: .*must be float'),
        ({'now': float('nan')}, 'now: nan: must be finite'),
        ({'settings': {'kind': 'Popen', 'args': 'true'}}, "settings: 'Popen': no known class"),
        ({'settings': CYCLE['settings'] | {'period': -1.0}}, 'settings: period'),
        ({'inputs': {'mapping': {'pose': {'array': ['x']}}}}, 'inputs: could not convert'),
        ({'commanded': [1.0]}, 'commanded: '),
        ({'calls': [['system']]}, 'calls: must be pairs'),
    ],
)
def test_a_record_with_a_broken_field_is_refused_by_its_name(change, words):
    with pytest.raises(RecordedCycleError, match=words):
        read_cycle(json.dumps(CYCLE | change))


@pytest.mark.parametrize('text', ['', '[', '3', '[' * 100_000, '{"number": 1}'])
def test_a_text_that_is_no_record_is_refused(text):
    with pytest.raises(RecordedCycleError, match='record of a cycle'):
        read_cycle(text)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'calls': [['system', 'true']]}, "calls: 'system': no known call"),
        ({'detected': ['north/none']}, 'north/none'),
        ({'inputs': {'mapping': {'halt': 'stop'}}}, 'halt'),
    ],
)
def test_a_cycle_with_unknown_content_is_refused_with_its_number(change, words):
    cycle = read_cycle(json.dumps(CYCLE | change))
    with pytest.raises(RecordedCycleError, match=f'cycle 0: .*{words}'):
        next(decide_again([cycle], TwistServo(read_robot(cycle), cycle.settings).robot))
