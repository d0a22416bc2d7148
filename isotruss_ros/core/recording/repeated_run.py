# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decisions of a twist servo, computed again from the records of its cycles."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from isotruss_ros.core.errors import IsotrussError, RobotFileError
from isotruss_ros.core.inputs import LatestInputs, RejectedInput
from isotruss_ros.core.kinematics.robot import Robot
from isotruss_ros.core.model.robot_file import describe_robot
from isotruss_ros.core.model.safe_yaml import parse_yaml
from isotruss_ros.core.model.topology import check_names
from isotruss_ros.core.numerics.arrays import finite_array
from isotruss_ros.core.recording.encoded_values import encode, RecordedCycleError
from isotruss_ros.core.recording.recorded_cycle import INPUTS, RecordedCycle
from isotruss_ros.core.recording.recorded_servo import as_decision
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_memory import ServoMemory
from isotruss_ros.core.servo.servo_settings import ServoSettings
from isotruss_ros.core.servo.twist_servo import TwistServo


class RepeatedCycle(NamedTuple):
    """Cycle of a recording and what was decided again."""

    recorded: RecordedCycle  #: record of the cycle
    settings: ServoSettings  #: settings of the new decision
    decision: Decision  #: the new decision
    is_anew: bool  #: whether the memory before the cycle was not recorded, so that it is new
    failed: frozenset[str]  #: names of failed rollers


def read_robot(record: RecordedCycle) -> Robot | None:
    """Return the robot of a record; None if it lacks the robot file."""
    if not record.robot:
        return None
    source = Path('robot file of the recording')
    content = parse_yaml(source, record.robot, 'robot files', RobotFileError)
    return Robot(describe_robot(source, content))


def decide_again(
    cycles: Iterable[RecordedCycle],
    robot: Robot,
    change: Callable[[ServoSettings], ServoSettings] = lambda settings: settings,
    memory: ServoMemory | None = None,
) -> Iterator[RepeatedCycle]:
    """
    Yield each cycle of a recording, decided again.

    Behind cycles that are missing, the memory is that of a new servo. The rollers have followed
    the recorded commands, so the next cycle remembers these. A cycle that is recorded more than
    once in succession is decided once.

    :param change: function that returns the settings to decide with.
    :param memory: memory before the first cycle; None: that of a new servo.
    """
    servo: TwistServo
    recorded = following = previous = None
    for cycle in cycles:
        if (cycle.number, cycle.now) == previous:
            continue
        previous = cycle.number, cycle.now
        # Equal settings stay the same object, as in the recorded servo.
        if (described := encode(cycle.settings)) != recorded:
            recorded, settings = described, change(cycle.settings)
        is_anew, following = cycle.number != following, cycle.number + 1
        try:
            if is_anew:
                servo = TwistServo(robot, settings)
                _mark_failed(servo, cycle.detected)
                if memory is not None:
                    servo.memory, memory, is_anew = memory, None, False
            elif servo.settings is not settings and ('apply', None) not in cycle.calls:
                servo.apply(settings)
            for name, argument in cycle.calls:
                _repeat_call(servo, name, argument, settings)
            _receive(servo, cycle)
            if cycle.commanded is None:
                decision = servo.decide(cycle.now)
            else:
                decision = as_decision(servo.command(cycle.commanded, cycle.now))
            _remember(servo, cycle.decision)
        except IsotrussError as error:
            raise RecordedCycleError(f'cycle {cycle.number}: {error}') from error
        yield RepeatedCycle(cycle, settings, decision, is_anew, servo.failed)


def _mark_failed(servo: TwistServo, names: Collection[str]) -> None:
    """Regard rollers as failed by detection."""
    check_names('rollers', names, servo.robot.roller_names, servo.robot.name)
    detector = replace(servo.memory.detector, failed=frozenset(names))
    servo.memory = replace(servo.memory, detector=detector)


def _remember(servo: TwistServo, decision: Mapping[str, Any]) -> None:
    """Let a servo remember the recorded command, if it is recorded, in place of its own."""
    if not {'velocities', 'achieved'} <= decision.keys():
        return
    what = 'recorded velocities [m/s]'
    velocities = servo.robot.check_rollers(decision['velocities'], what)
    achieved = finite_array(decision['achieved'], 3, 'recorded twist', RecordedCycleError)
    history = replace(servo.memory.history, last=velocities)
    servo.memory = replace(servo.memory, history=history, velocity=achieved)


def _repeat_call(servo: TwistServo, name: str, argument: Any, settings: ServoSettings) -> None:
    """Repeat a call of the client between two cycles."""
    if name == 'apply':
        servo.apply(settings)
    elif name == 'acknowledge':
        servo.acknowledge()
    elif name == 'reset_failures':
        servo.reset_failures(argument)
    elif name == 'take_failures':
        _mark_failed(servo, argument or ())
    else:
        raise RecordedCycleError(f'calls: {name!r}: no known call')


def _receive(servo: TwistServo, cycle: RecordedCycle) -> None:
    """Give a servo the inputs of a record; raise RecordedCycleError if one is invalid."""
    missing = LatestInputs()
    given = {name: cycle.inputs.get(name, getattr(missing, name)) for name in INPUTS}
    servo.receive(**given)
    for name in INPUTS:
        rejected = getattr(servo.inputs, name)
        if isinstance(rejected, RejectedInput) and not isinstance(given[name], RejectedInput):
            raise RecordedCycleError(f'inputs: {name}: {rejected.reason}')
