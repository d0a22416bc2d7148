"""Read a robot file: YAML in, a checked description out, or an error that says what to mend."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from isotruss_ros.core.errors import RobotFileError
from isotruss_ros.core.model.description import Module, RobotDescription, Tube
from isotruss_ros.core.model.presets import find_robot_file
from isotruss_ros.core.model.robot_schema import check_form, refuse_if_any
from isotruss_ros.core.model.stiffness_law import find_contradictions, read_laws
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, ScalarEvent

#: A robot of 300 modules needs 30 kB; beyond this size the file is something else.
MAX_FILE_SIZE = 200_000
#: The keys go four levels deep; the reader takes time in the square of the depth.
MAX_DEPTH = 8
#: Longer texts are no names, and longer numbers Python does not print.
MAX_SCALAR_LENGTH = 1000
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
        check_form(path, content)
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
            if isinstance(event, ScalarEvent) and len(event.value) > MAX_SCALAR_LENGTH:
                raise RobotFileError(
                    f'{path}: line {event.start_mark.line + 1}: {event.value[:20]!r}... has '
                    f'{len(event.value)} characters; must be at most {MAX_SCALAR_LENGTH}'
                )
            # An alias can name its own parent, or unfold a small file into gigabytes.
            if getattr(event, 'anchor', None) is not None:
                sign = '*' if isinstance(event, AliasEvent) else '&'
                raise RobotFileError(
                    f'{path}: line {event.start_mark.line + 1}: {sign}{event.anchor}: anchors '
                    'and aliases are not used in robot files; write the value out'
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


def _describe(path: Path, content: dict[str, Any]) -> RobotDescription:
    joints = {name: (float(x), float(y)) for name, (x, y) in content['joints'].items()}
    tubes = tuple(
        Tube(name, tuple(tube['joints']), tube['passive'])
        for name, tube in content['tubes'].items()
    )
    supports = {joint: tuple(axes) for joint, axes in content['supports'].items()}
    limits = {key: float(value) for key, value in content['members'].items()}
    pressure = content['tube']['pressure']
    refuse_if_any(path, _cross_check(joints, tubes, supports, limits, pressure))
    if not isinstance(pressure, Mapping):
        pressure = dict.fromkeys(content['tubes'], pressure)
    pressures = {tube.name: float(pressure[tube.name]) for tube in tubes}
    module = Module(**{key: float(value) for key, value in content['module'].items()})
    stiffness = content['tube'].get('stiffness', {'model': 'inflatable_beam'})
    refuse_if_any(path, _check_stiffness(stiffness, pressures, limits, module))
    return RobotDescription(
        source=str(path),
        name=content['name'],
        frame=content.get('frame', DEFAULT_FRAME),
        joints=joints,
        tubes=tubes,
        module=module,
        tube_diameter=float(content['tube']['diameter']),
        pressures=pressures,
        local_stiffness=float(content['tube'].get('local_stiffness', 1.0)),
        stiffness=stiffness,
        supports=supports,
        max_speed=float(content['rollers']['max_speed']),
        **limits,
    )


def _check_stiffness(
    stiffness: Mapping[str, Any],
    pressures: Mapping[str, float],
    limits: Mapping[str, float],
    module: Module,
) -> Iterator[str]:
    """Yield for what lengths and pressures of this file its stiffness model is none."""
    if stiffness['model'] == 'power_law':
        lengths = limits['min_length'], limits['max_length']
        ring = module.guide_ring_distance
        yield from find_contradictions(read_laws(stiffness), pressures, lengths, ring)
    alike = len(set(pressures.values())) == 1
    if stiffness['model'] == 'section' and 'pressure' not in stiffness and not alike:
        yield (
            "tube.stiffness: key 'pressure' is missing; where tubes have different pressures "
            'it is the gauge pressure at which the three numbers hold [Pa]'
        )


def _cross_check(
    joints: Mapping[str, tuple[float, float]],
    tubes: tuple[Tube, ...],
    supports: Mapping[str, tuple[str, ...]],
    limits: Mapping[str, float],
    pressure: float | Mapping[str, float],
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
    if isinstance(pressure, Mapping):
        names = [tube.name for tube in tubes]
        for tube in pressure:
            if tube not in names:
                yield f'tube.pressure: unknown tube {tube!r}; known are {", ".join(names)}'
        for tube in names:
            if tube not in pressure:
                yield f'tube.pressure: tube {tube} is missing; give one number, or one for each'
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
