# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Record of a cycle of the twist servo as a JSON text: inputs, settings and decision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import json
import math
from typing import Any, NamedTuple

from isotruss_ros.core.errors import IsotrussError, quote
from isotruss_ros.core.inputs import LatestInputs
from isotruss_ros.core.numerics.arrays import Array
from isotruss_ros.core.recording.encoded_values import decode, encode, RecordedCycleError
from isotruss_ros.core.servo.decision import Decision
from isotruss_ros.core.servo.servo_settings import ServoSettings
import numpy as np

#: Inputs that the servo uses.
INPUTS = ('twist', 'rollers', 'estimate', 'pose', 'pressures', 'obstacles', 'failed', 'halt')
#: Types of the fields of a record.
FIELDS: dict[str, Any] = {
    'number': int,
    'now': float,
    'settings': ServoSettings,
    'inputs': dict,
    'decision': dict,
    'versions': dict,
    'robot': str,
    'left_out': tuple,
    'calls': tuple,
    'commanded': np.ndarray | None,
    'detected': tuple,
}


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


def describe_setup(settings: ServoSettings, robot: str, versions: Mapping[str, str]) -> str:
    """
    Return the part of a record that changes rarely, as the beginning of its text.

    :param robot: content of the robot file.
    """
    left_out = [type(part).__name__ for part in (*settings.barriers, *settings.limits)]
    plain = replace(settings, barriers=(), limits=())
    setup = {'versions': versions, 'robot': robot, 'left_out': left_out, 'settings': plain}
    return json.dumps({name: encode(value) for name, value in setup.items()})[:-1]


def describe_cycle(setup: str, inputs: LatestInputs, decision: Decision, **others: Any) -> str:
    """Return the text of a record with the setup of `describe_setup` and other fields."""
    command = decision.command
    named = others | {
        'inputs': {name: getattr(inputs, name) for name in INPUTS},
        'decision': {
            'velocities': command.roller_velocities,
            'achieved': command.achieved_twist,
            'status': command.status,
            'message': decision.message,
        },
    }
    cycle = json.dumps({name: encode(value) for name, value in named.items()})
    return f'{setup}, {cycle[1:]}'


def read_cycle(text: str) -> RecordedCycle:
    """Return the record in a text; raise RecordedCycleError that names an invalid field."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordedCycleError(f'record of a cycle: no JSON text: {error}') from error
    if not isinstance(content, dict):
        raise RecordedCycleError(f'record of a cycle: {quote(text)}: must be named fields')
    read: dict[str, Any] = {}
    defaults = RecordedCycle._field_defaults
    for name, kind in FIELDS.items():
        try:
            read[name] = decode(content[name]) if name in content else defaults[name]
        except KeyError:
            raise RecordedCycleError(f'record of a cycle without the field {name}') from None
        except IsotrussError as error:
            raise RecordedCycleError(f'record of a cycle: {name}: {error}') from error
        if not isinstance(read[name], kind):
            given, wanted = quote(json.dumps(content[name])), getattr(kind, '__name__', kind)
            raise RecordedCycleError(f'record of a cycle: {name}: {given}: must be {wanted}')
    if not math.isfinite(read['now']):
        raise RecordedCycleError(f'record of a cycle: now: {read["now"]}: must be finite')
    if not all(isinstance(name, str) for name in (*read['detected'], *read['left_out'])):
        raise RecordedCycleError('record of a cycle: detected, left_out: must be texts')
    if not all(isinstance(call, tuple) and len(call) == 2 for call in read['calls']):
        raise RecordedCycleError('record of a cycle: calls: must be pairs of name and argument')
    absent = [name for name in FIELDS if name not in content]
    absent += [f'inputs.{name}' for name in INPUTS if name not in read['inputs']]
    return RecordedCycle(**read, absent=tuple(absent))
