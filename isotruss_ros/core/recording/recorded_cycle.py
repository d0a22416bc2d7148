# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Record of a cycle of the twist servo as a JSON text: inputs, settings and decision."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
import json
import math
from typing import Any, NamedTuple

from isotruss_ros.core.errors import quote
from isotruss_ros.core.inputs import LatestInputs
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.recording.encoded_values import decode, encode, RecordedCycleError
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np

#: Inputs that the servo uses.
INPUTS = ('twist', 'rollers', 'estimate', 'pose', 'pressures', 'obstacles', 'failed', 'halt')


class RecordedCycle(NamedTuple):
    """Record of one cycle."""

    number: int  #: number of the cycle since the servo was created
    now: float  #: time of the cycle [s]
    settings: ServoSettings  #: settings at the cycle, without barriers and limits of the user
    inputs: Mapping[str, Any]  #: values of the fields of `LatestInputs` that the servo uses
    #: `velocities` [m/s], `achieved` twist, `status` and `message`; a record lacks unknown ones
    decision: Mapping[str, Any]
    versions: Mapping[str, str] = {}  #: versions of the packages
    robot: str = ''  #: content of the robot file
    left_out: tuple[str, ...] = ()  #: classes of barriers and limits that are not recorded
    #: name and argument of each call of the servo between the last cycle and this one
    calls: tuple[tuple[str, Any], ...] = ()
    commanded: Array | None = None  #: (r,) velocities of a `command`; None: `decide` [m/s]
    detected: tuple[str, ...] = ()  #: rollers whose failure was detected before the cycle
    absent: tuple[str, ...] = ()  #: names of the fields that the record lacks


def _are_texts(value: Any) -> bool:
    """Return whether a value is a tuple of texts."""
    return isinstance(value, tuple) and all(isinstance(part, str) for part in value)


def _is_call(value: Any) -> bool:
    """Return whether a value is the name of a call and its argument, None or names of rollers."""
    name, argument = value
    return isinstance(name, str) and (argument is None or _are_texts(argument))


#: What a field of a record must be, in words and as a condition.
FIELDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    'number': ('an integer', lambda value: isinstance(value, int)),
    'now': ('a finite number', lambda value: isinstance(value, float) and math.isfinite(value)),
    'settings': (
        'settings without barriers and limits',
        lambda value: isinstance(value, ServoSettings) and not (value.barriers or value.limits),
    ),
    'inputs': (
        'named inputs, the failed rollers by name',
        lambda value: isinstance(value, dict) and _are_texts(tuple(value.get('failed', ()))),
    ),
    'decision': ('named values', lambda value: isinstance(value, dict)),
    'versions': ('named versions', lambda value: isinstance(value, dict)),
    'robot': ('a text', lambda value: isinstance(value, str)),
    'left_out': ('texts', _are_texts),
    'calls': ('pairs of name and argument', lambda value: all(map(_is_call, value))),
    'commanded': ('an array or null', lambda value: isinstance(value, np.ndarray | None)),
    'detected': ('texts', _are_texts),
}


def describe_setup(settings: ServoSettings, robot: str, versions: Mapping[str, str]) -> str:
    """
    Return the part of a record that changes rarely, as the beginning of its text.

    :param robot: content of the robot file.
    """
    left_out = [type(part).__name__ for part in (*settings.barriers, *settings.limits)]
    plain = replace(settings, barriers=(), limits=())
    setup = {'versions': versions, 'robot': robot, 'left_out': left_out, 'settings': plain}
    return json.dumps({name: encode(value) for name, value in setup.items()})[:-1]


def describe_cycle(
    setup: str,
    inputs: LatestInputs,
    decision: Decision,
    reported: Decision | None = None,
    **others: Any,
) -> str:
    """
    Return the text of a record with the setup of `describe_setup` and other fields.

    :param reported: decision whose status and message the client reports; None: `decision`.
    """
    command, reported = decision.command, reported or decision
    named = others | {
        'inputs': {name: getattr(inputs, name) for name in INPUTS},
        'decision': {
            'velocities': command.roller_velocities,
            'achieved': command.achieved_twist,
            'status': reported.command.status,
            'message': reported.message,
        },
    }
    cycle = json.dumps({name: encode(value) for name, value in named.items()})
    return f'{setup}, {cycle[1:]}'


def read_cycle(text: str) -> RecordedCycle:
    """Return the record in a text; raise RecordedCycleError that names an invalid field."""
    name, read = 'no JSON text with named fields', dict[str, Any]()
    try:
        content = dict(json.loads(text))
        for name, (words, is_valid) in FIELDS.items():
            if name in content:
                read[name] = decode(content[name])
                if not is_valid(read[name]):
                    given = quote(json.dumps(content[name]))
                    raise RecordedCycleError(f'{given}: must be {words}')
            elif name not in RecordedCycle._field_defaults:
                raise RecordedCycleError('must be in the record')
    except Exception as error:  # values of strangers may lead to any
        number = f', number {read["number"]}' if 'now' in read else ''
        raise RecordedCycleError(f'record of a cycle{number}: {name}: {error}') from error
    absent = [name for name in FIELDS if name not in content]
    absent += [f'inputs.{name}' for name in INPUTS if name not in read['inputs']]
    return RecordedCycle(**read, absent=tuple(absent))
