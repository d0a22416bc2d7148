# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading of robot files: YAML is parsed, checked, and converted to a description."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.model.description import Module, RobotDescription, Tube
from isotruss_ros.core.model.inflated_section import find_stiffness_faults
from isotruss_ros.core.model.presets import find_robot_file
from isotruss_ros.core.model.robot_schema import (
    find_faults,
    find_keys_without_quotes,
    refuse_if_any,
)
from isotruss_ros.core.model.safe_yaml import parse_yaml, read_text

DEFAULT_FRAME = 'truss'
#: Optional keys of the block `tube`, and fields of the description.
TUBE_KEYS = ('stiffness_scale', 'local_stiffness', 'mass_per_length')


def read_robot_file(name_or_path: str | Path) -> RobotDescription:
    """Read a robot file and check the form of its content."""
    path = find_robot_file(name_or_path)
    text = read_text(path, 'a robot file', RobotFileError)
    content = parse_yaml(path, text, 'robot files', RobotFileError)
    return describe_robot(path, content)


def describe_robot(path: Path, content: Any) -> RobotDescription:
    """Return the checked description of a robot file's content."""
    refuse_if_any(path, find_keys_without_quotes(content))
    refuse_if_any(path, find_faults(content))
    refuse_if_any(path, _cross_check(content))
    tubes, pressure = content['tubes'], content['tube']['pressure']
    pressures = pressure if isinstance(pressure, Mapping) else dict.fromkeys(tubes, pressure)
    max_speed = float(content['rollers']['max_speed'])
    description = RobotDescription(
        source=str(path),
        name=content['name'],
        frame=content.get('frame', DEFAULT_FRAME),
        joints={name: (float(x), float(y)) for name, (x, y) in content['joints'].items()},
        tubes=tuple(
            Tube(name, tuple(tube['joints']), tube['passive']) for name, tube in tubes.items()
        ),
        module=Module(**{key: float(value) for key, value in content['module'].items()}),
        tube_diameter=float(content['tube']['diameter']),
        pressures={name: float(pressures[name]) for name in tubes},
        stiffness=content['tube'].get('stiffness', {'model': 'inflatable_beam'}),
        supports={joint: tuple(axes) for joint, axes in content['supports'].items()},
        max_speed=max_speed,
        # By default the rollers reach the largest speed in 0.1 s.
        max_acceleration=float(content['rollers'].get('max_acceleration', 10.0 * max_speed)),
        calibration=content.get('calibration', {}),
        uncertainty=content.get('uncertainty', {}),
        **{key: float(value) for key, value in content['members'].items()},
        **{key: float(content['tube'][key]) for key in TUBE_KEYS if key in content['tube']},
    )
    refuse_if_any(path, find_stiffness_faults(description))
    return description


def _unknown(where: str, kind: str, names: Iterable[str], valid: Iterable[str]) -> Iterator[str]:
    """Yield a fault for each name that is not valid."""
    for name in names:
        if name not in valid:
            yield f'{where}: unknown {kind} {name!r}; known are {", ".join(valid)}'


def _cross_check(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield faults that the schema cannot express, such as names of joints that do not exist."""
    joints, tubes, limits = content['joints'], content['tubes'], content['members']
    joints_on_tubes = {joint for tube in tubes.values() for joint in tube['joints']}
    for name, tube in tubes.items():
        yield from _unknown(f'tubes.{name}.joints', 'joint', tube['joints'], joints)
        if tube['passive'] not in tube['joints']:
            yield (
                f'tubes.{name}.passive: {tube["passive"]!r} is not a joint of this tube; '
                f'must be one of {", ".join(tube["joints"])}'
            )
    for joint in joints:
        if joint not in joints_on_tubes:
            yield f'joints.{joint}: no tube has this joint; add it to a tube, or remove it'
    for joint in content['supports']:
        yield from _unknown(f'supports.{joint}', 'joint', [joint], joints)
    pressure = content['tube']['pressure']
    if isinstance(pressure, Mapping):
        yield from _unknown('tube.pressure', 'tube', pressure, tubes)
        for name in tubes:
            if name not in pressure:
                yield f'tube.pressure: tube {name} is missing; give one number, or one per tube'
    rollers = [
        f'{name}/{joint}'
        for name, tube in tubes.items()
        for joint in tube['joints']
        if joint != tube['passive']
    ]
    for key in ('zero_deviations', 'checked_rollers'):
        names = content.get('calibration', {}).get(key, ())
        yield from _unknown(f'calibration.{key}', 'roller', names, rollers)
    occupants: dict[tuple[float, float], str] = {}
    for joint, (x, y) in joints.items():
        occupant = occupants.setdefault((x, y), joint)  # the first joint at this position
        if occupant != joint:
            yield f'joints.{joint}: [{x}, {y}]: joint {occupant} is at this position; must differ'
    if limits['min_length'] >= limits['max_length']:
        yield (
            f'members.min_length: {limits["min_length"]}: '
            f'must be less than max_length, {limits["max_length"]}'
        )
