"""Read a robot file: YAML in, a checked description out, or an error that says what to mend."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import difflib
import functools
import json
from pathlib import Path
from typing import Any

from isotruss_ros.core.description import Module, RobotDescription, Tube
from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.presets import config_directory, find_robot_file
import jsonschema
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

#: A robot of 300 modules needs 30 kB; beyond this size the file is something else.
MAX_FILE_SIZE = 1_000_000
#: The keys go four levels deep; the reader takes time in the square of the depth.
MAX_DEPTH = 20
#: Beyond this magnitude a number is a slip of the keyboard and overflows in products.
MAX_MAGNITUDE = 1e12
DEFAULT_FRAME = 'truss'


def read_robot_file(name_or_path: str | Path) -> RobotDescription:
    """
    Read and check the form of a robot file.

    :param name_or_path: the name of a preset, or the path of a robot file.
    :raises RobotFileError: the file is missing, not YAML 1.2, or not a robot; each complaint names
        the file, the key, the value and what would be right.
    """
    path = find_robot_file(name_or_path)
    try:
        with path.open('rb') as file:
            data = file.read(MAX_FILE_SIZE + 1)
    except OSError as error:
        raise RobotFileError(f'{path}: cannot be read: {error.strerror}') from error
    if len(data) > MAX_FILE_SIZE:
        raise RobotFileError(f'{path}: too long; a robot file has at most {MAX_FILE_SIZE} bytes')
    try:
        content = _parse(path, data.decode('utf-8'))
        _check_form(path, content)
        return _describe(path, content)
    except UnicodeDecodeError as error:
        raise RobotFileError(f'{path}: byte {error.start}: not UTF-8 text') from error


def _parse(path: Path, text: str) -> Any:
    try:
        depth = 0
        for event in YAML(typ='safe', pure=True).parse(text):
            depth += isinstance(event, CollectionStartEvent)
            depth -= isinstance(event, CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise RobotFileError(
                    f'{path}: line {event.start_mark.line + 1}: nested too deeply '
                    'to be a robot file'
                )
            # An alias can name its own parent, or unfold a small file into gigabytes.
            if isinstance(event, AliasEvent):
                raise RobotFileError(
                    f'{path}: line {event.start_mark.line + 1}: alias *{event.anchor}: '
                    'aliases are not used in robot files; write the value out'
                )
        return YAML(typ='safe', pure=True).load(text)
    except YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        where = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        problem = getattr(error, 'problem', None) or str(error).splitlines()[0]
        raise RobotFileError(f'{path}: {where}not YAML 1.2: {problem}') from error
    except RobotFileError:
        raise
    # The reader's own constructors: dates, very long integers, tags on what does not fit them.
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise RobotFileError(f'{path}: not YAML 1.2: {error}') from error


def _is_number(_checker: jsonschema.TypeChecker, value: Any) -> bool:
    """Accept finite numbers only: NaN and infinity pass for numbers in YAML and in JSON Schema."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return value == value and -MAX_MAGNITUDE <= value <= MAX_MAGNITUDE


@functools.lru_cache(maxsize=1)
def _validator() -> Any:
    schema = json.loads((config_directory() / 'robot.schema.json').read_text(encoding='utf-8'))
    base = jsonschema.Draft7Validator
    checker = base.TYPE_CHECKER.redefine('number', _is_number)
    return jsonschema.validators.extend(base, type_checker=checker)(schema)


def _check_form(path: Path, content: Any) -> None:
    """Collect every complaint, so that a file is mended in one go."""
    complaints = [
        f'{path}: {keys}: {key!r} is not text; put quotes around it: {str(key)!r}'
        for keys, key in _keys_that_are_not_text(content)
    ]
    if not complaints:
        errors = sorted(
            _validator().iter_errors(content), key=lambda error: list(map(str, error.path))
        )
        complaints = [f'{path}: {line}' for error in errors for line in _explain(error)]
    if complaints:
        raise RobotFileError('\n'.join(complaints))


def _keys_that_are_not_text(value: Any, where: str = 'top level') -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            if not isinstance(key, str):
                yield where, key
            yield from _keys_that_are_not_text(inner, str(key))
    elif isinstance(value, list):
        for inner in value:
            yield from _keys_that_are_not_text(inner, where)


def _explain(error: jsonschema.ValidationError) -> Iterator[str]:
    """Turn a schema error into lines 'key: value: what is wrong; what would be right'."""
    where = '.'.join(map(str, error.absolute_path)) or 'top level'
    right = error.schema.get('description') if isinstance(error.schema, dict) else None
    if error.validator == 'additionalProperties':
        allowed = error.schema['properties']
        for key in error.instance:
            if key not in allowed:
                close = difflib.get_close_matches(key, allowed, n=1)
                hint = f'did you mean {close[0]}? ' if close else ''
                yield f'{where}: unknown key {key!r}; {hint}known are {", ".join(allowed)}'
    elif error.validator == 'required':
        for key in error.validator_value:
            if key not in error.instance:
                wanted = error.schema.get('properties', {}).get(key, {})
                meaning = wanted.get('description') if isinstance(wanted, dict) else None
                yield f'{where}: key {key!r} is missing' + (
                    f'; it is {meaning}' if meaning else ''
                )
    else:
        value = repr(error.instance)
        value = value if len(value) <= 60 else value[:57] + '...'
        yield f'{where}: {value}: must be {right}'


def _describe(path: Path, content: dict[str, Any]) -> RobotDescription:
    joints = {name: (float(x), float(y)) for name, (x, y) in content['joints'].items()}
    tubes = tuple(
        Tube(name, tuple(tube['joints']), tube['passive'])
        for name, tube in content['tubes'].items()
    )
    supports = {joint: tuple(axes) for joint, axes in content['supports'].items()}
    limits = {key: float(value) for key, value in content['members'].items()}
    complaints = list(_cross_check(joints, tubes, supports, limits))
    if complaints:
        raise RobotFileError('\n'.join(f'{path}: {line}' for line in complaints))
    return RobotDescription(
        source=str(path),
        name=content['name'],
        frame=content.get('frame', DEFAULT_FRAME),
        joints=joints,
        tubes=tubes,
        module=Module(**{key: float(value) for key, value in content['module'].items()}),
        tube_diameter=float(content['tube']['diameter']),
        pressure=float(content['tube']['pressure']),
        stiffness=content['tube'].get('stiffness', {'model': 'inflatable_beam'}),
        supports=supports,
        max_speed=float(content['rollers']['max_speed']),
        **limits,
    )


def _cross_check(
    joints: Mapping[str, tuple[float, float]],
    tubes: tuple[Tube, ...],
    supports: Mapping[str, tuple[str, ...]],
    limits: Mapping[str, float],
) -> Iterator[str]:
    """Yield what the schema cannot see: names that must refer to each other."""
    known = ', '.join(joints)
    used = {joint for tube in tubes for joint in tube.joints}
    for tube in tubes:
        for joint in tube.joints:
            if joint not in joints:
                yield f'tubes.{tube.name}.joints: unknown joint {joint!r}; known are {known}'
        if tube.passive not in tube.joints:
            yield (
                f'tubes.{tube.name}.passive: {tube.passive!r} is not a joint of this tube; '
                f'must be one of {", ".join(tube.joints)}'
            )
    for joint in joints:
        if joint not in used:
            yield f'joints.{joint}: on no tube; let a tube visit it or take it out'
    for joint in supports:
        if joint not in joints:
            yield f'supports.{joint}: unknown joint {joint!r}; known are {known}'
    places: dict[tuple[float, float], str] = {}
    for joint, place in joints.items():
        other = places.setdefault(place, joint)
        if other != joint:
            yield f'joints.{joint}: {list(place)}: joint {other} is there too; must be apart'
    if limits['min_length'] >= limits['max_length']:
        yield (
            f'members.min_length: {limits["min_length"]}: '
            f'must be less than max_length, {limits["max_length"]}'
        )
