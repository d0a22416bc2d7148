# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of a recorded run with the same run decided again, for `isotruss replay --decide`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
import itertools
import json
from pathlib import Path
import time
from typing import Any

from isotruss_ros.core import Robot, Status
from isotruss_ros.core.errors import ConfigurationError, suggest
from isotruss_ros.core.recording.encoded_values import find_changes
from isotruss_ros.core.recording.recorded_cycle import RecordedCycle
from isotruss_ros.core.recording.recorded_servo import find_versions
from isotruss_ros.core.recording.repeated_run import decide_again, read_robot, RepeatedCycle
from isotruss_ros.core.safety.shape_guard import ShapeBounds
from isotruss_ros.core.servo.servo_settings import ServoSettings, SqueezeSettings
from isotruss_ros.viewer.recorded_cycles import find_cycles
from isotruss_ros.viewer.recording import BrokenRecordingError, RecordingError
import numpy as np

#: Parts of the settings that may be off.
OPTIONAL_PARTS: dict[str, type[Any]] = {'squeeze': SqueezeSettings, 'bounds': ShapeBounds}
#: Largest difference of velocities that is rounding [m/s, rad/s].
ROUNDING = 1e-9


def name_settings(settings: Any) -> Iterator[str]:
    """
    Yield the names of the settings that are numbers, flags or texts, as `squeeze.force`.

    Settings of a part that is off have their names as well.
    """
    for field in fields(settings):
        if not field.init:  # computed from others
            continue
        value = getattr(settings, field.name, None)
        part = OPTIONAL_PARTS.get(field.name) if value is None else value
        if is_dataclass(part):
            yield from (f'{field.name}.{name}' for name in name_settings(part))
        elif value is None or isinstance(value, bool | float | int | str):
            yield field.name


def change_setting(settings: Any, name: str, value: Any) -> Any:
    """Return settings with another value of one, as `squeeze.force`, unless its part is off."""
    first, _, rest = name.partition('.')
    if rest and getattr(settings, first) is None:
        return settings
    part = change_setting(getattr(settings, first), rest, value) if rest else value
    return replace(settings, **{first: part})


def parse_changes(texts: Sequence[str]) -> Callable[[ServoSettings], ServoSettings]:
    """Return the function that makes the changes given as texts `NAME=VALUE`."""
    pairs = []
    for text in texts:
        name, _, value = text.partition('=')
        try:
            pairs.append((name, json.loads(value)))
        except ValueError as error:
            words = 'must be NAME=VALUE: a number, a text in "", true, false or null'
            raise ConfigurationError(f'--set {text}: {words}') from error

    def change(settings: ServoSettings) -> ServoSettings:
        for name, value in pairs:
            if name not in (known := list(name_settings(settings))):
                hint, names = suggest(name, known), ', '.join(known)
                raise ConfigurationError(
                    f'--set {name}: no such setting; {hint}must be of {names}'
                )
            try:
                settings = change_setting(settings, name, value)
            except TypeError as error:
                raise ConfigurationError(f'--set {name}: {error}') from error
        return settings

    return change


def find_difference(cycle: RepeatedCycle) -> float:
    """Return the largest difference of velocities from those recorded [m/s, rad/s]."""
    recorded, command = cycle.recorded.decision, cycle.decision.command
    before, again = recorded.get('velocities'), command.roller_velocities
    if before is None:  # an older recording
        before, again = recorded.get('achieved'), command.achieved_twist
    if not isinstance(before, np.ndarray) or before.shape != again.shape:
        raise RecordingError(f'cycle {cycle.recorded.number}: decision: no velocities')
    return float(np.abs(again - before).max(initial=0.0))


def find_events(before: RepeatedCycle | None, cycle: RepeatedCycle) -> Iterator[str]:
    """Yield a text for each change since the cycle before: memory, settings, rollers."""
    if cycle.is_anew and (before is not None or cycle.recorded.number):
        yield 'the cycles before are not recorded: begins with a new memory'
    if before is not None and cycle.settings is not before.settings:
        yield from find_changes(before.settings, cycle.settings)
    if failed := cycle.failed - (before.failed if before is not None else frozenset()):
        yield f'failed rollers: {", ".join(sorted(failed))}'


def find_status(cycle: RepeatedCycle) -> tuple[Status, str]:
    """Return status and message of a cycle, the recorded ones after a failed trajectory."""
    recorded, status = cycle.recorded.decision, cycle.decision.command.status
    # The servo does not follow trajectories: it has the velocities of its client, or no twist.
    is_open = status in (Status.FOLLOWING_TRAJECTORY, Status.HALT_NO_TWIST)
    if is_open and recorded.get('status') == Status.HALT_TRAJECTORY:
        return Status.HALT_TRAJECTORY, str(recorded.get('message', ''))
    return status, cycle.decision.message


def has_news(printed: Status | None, hindrance: Status | None) -> bool:
    """
    Return whether a hindrance is another one than that printed last, or a halt has ended.

    At a limit, cycles that are slowed and cycles that are not alternate.
    """
    if hindrance is None:
        return printed is not None and printed >= Status.HALT_NO_TWIST
    return hindrance is not printed


def print_setup(first: RecordedCycle, change: Callable[[ServoSettings], ServoSettings]) -> None:
    """Print what a recording lacks, and what differs from the recorded run before it begins."""
    if first.absent:
        print(f'absent in this recording: {", ".join(first.absent)}')
    if first.left_out:
        print(f'not recorded: {", ".join(first.left_out)}')
    versions = find_versions()
    for name, version in first.versions.items():
        if version != versions.get(name):
            print(f'another version: {name} {version} -> {versions.get(name)}')
    for words in find_changes(first.settings, change(first.settings)):
        print(f'another setting: {words}')


def print_run(path: Path, robot: Robot, diameter: float, changes: Sequence[str]) -> bool:
    """
    Print halts and slowings of a run that is decided again, and differences from the recorded one.

    :param robot: robot of recordings without robot file.
    :param diameter: diameter of the disc of recordings without settings [m].
    :return: whether no command differs by more than rounding.
    """
    cycles = find_cycles(path, robot, diameter)
    try:
        first = next(cycles)
    except StopIteration:
        raise RecordingError(f'{path}: no cycle of manipulation is recorded') from None
    change = parse_changes(changes)
    print_setup(first, change)
    began, last = time.perf_counter(), None
    printed, counts = None, Counter[Status]()
    differences: list[float] = []
    run = itertools.chain([first], cycles)
    try:
        for cycle in decide_again(run, read_robot(first) or robot, change):
            where = f'cycle {cycle.recorded.number}, {cycle.recorded.now - first.now:.3f} s'
            for event in find_events(last, cycle):
                print(f'{where}: {event}')
            status, message = find_status(cycle)
            # A halt or a slowing; None while the command is executed.
            hindrance = None if status < Status.SLOWED_ROLLER_SPEED else status
            if last is None or has_news(printed, hindrance):
                words = '' if hindrance is None else f': {message}'
                print(f'{where}: {status.name}{words}')
                printed = hindrance
            counts[status] += 1
            difference, last = find_difference(cycle), cycle
            if difference > ROUNDING >= max(differences, default=0.0):
                statuses = f'{cycle.recorded.decision.get("status")!s} -> {status!s}'
                print(f'{where}: first other command: by {difference:.3g}, {statuses}')
            differences.append(difference)
    except BrokenRecordingError as error:
        print(f'replay: {error}')
    spent = time.perf_counter() - began
    duration = 0.0 if last is None else last.recorded.now - first.now
    count = sum(difference > ROUNDING for difference in differences)
    largest = max(differences, default=0.0)
    print(f'{len(differences)} cycles of {duration:.1f} s decided in {spent:.1f} s')
    for status, number in sorted(counts.items()):
        print(f'  {status.name}: {number} cycles')
    print(f'{count} commands differ; largest difference {largest:.3g} m/s or rad/s')
    return not count
