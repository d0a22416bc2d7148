# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Check of the form of a robot file by its JSON schema."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import functools
import itertools
import json
from pathlib import Path
from typing import Any, TYPE_CHECKING

from isotruss_ros.core.errors import RobotFileError, suggest
from isotruss_ros.core.model.presets import config_directory
from isotruss_ros.core.model.units import likely_unit
from isotruss_ros.core.numerics.arrays import MAX_MAGNITUDE

if TYPE_CHECKING:
    import jsonschema

#: For membrane moduli, the only numbers in N/m of a robot file: the modulus of the material.
WALL_FORMS = {'N/m': {'in Pa, of a wall of 0.1 mm': (1e-4, 0.0)}}
#: Largest number of reported faults [-].
MAX_COMPLAINTS = 50


def find_faults(content: Any, block: str | None = None) -> Iterator[str]:
    """Yield the faults of a robot file's content, or of one of its blocks, by the schema."""
    errors = itertools.islice(_validator(block).iter_errors(content), MAX_COMPLAINTS + 1)
    for error in sorted(errors, key=lambda error: list(map(str, error.path))):
        yield from _explain(error)


def refuse_if_any(path: Path, complaints: Iterable[str]) -> None:
    """Raise RobotFileError if a robot file has faults."""
    lines = [f'{path}: {line}' for line in itertools.islice(complaints, MAX_COMPLAINTS + 1)]
    if len(lines) > MAX_COMPLAINTS:
        lines[MAX_COMPLAINTS:] = [f'{path}: and more like these']
    if lines:
        raise RobotFileError('\n'.join(lines))


def _is_number(_checker: jsonschema.TypeChecker, value: Any) -> bool:
    """Return whether a value is a finite number; YAML and JSON Schema allow NaN and infinity."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return value == value and -MAX_MAGNITUDE <= value <= MAX_MAGNITUDE


def _unique_texts(_validator: Any, wanted: bool, value: Any, _schema: Any) -> Iterator[Any]:
    """Yield an error for repeated texts; jsonschema's own check takes quadratic time."""
    texts = [item for item in value if isinstance(item, str)] if isinstance(value, list) else []
    if wanted and len(set(texts)) < len(texts):
        import jsonschema

        yield jsonschema.ValidationError('not unique')


@functools.cache
def ranged_numbers() -> dict[str, dict[str, Any]]:
    """Return the schema of each number with a plausible range, by its key in a robot file."""
    blocks = _schema()['properties']
    entries = {'joints': blocks['joints']['additionalProperties']['items']}
    for block, content in blocks.items():
        for key, entry in content.get('properties', {}).items():
            entries[f'{block}.{key}'] = entry
    for model in _schema()['definitions']['stiffness']['allOf']:
        for key, entry in model['then']['properties'].items():
            entries[f'tube.stiffness.{key}'] = entry
    # The range of a number with a special value outside of it is in the schema's `then`.
    return {
        key: {**entry, **entry.get('then', {})}
        for key, entry in entries.items()
        if isinstance(entry, dict) and 'reason' in entry
    }


def plausible_range(key: str) -> tuple[float, float]:
    """Return the smallest and the largest plausible value of a key, such as `tube.pressure`."""
    entry = ranged_numbers()[key]
    return float(entry['minimum']), float(entry['maximum'])


@functools.cache
def _schema() -> dict[str, Any]:
    text = (config_directory() / 'robot.schema.json').read_text(encoding='utf-8')
    schema: dict[str, Any] = json.loads(text)
    return schema


@functools.cache
def _validator(block: str | None) -> Any:
    # Imported on use: a seventh of the import time of the core.
    import jsonschema

    base = jsonschema.Draft7Validator
    checker = base.TYPE_CHECKER.redefine('number', _is_number)
    checks = {'uniqueItems': _unique_texts}
    schema = _schema() if block is None else _schema()['properties'][block]
    return jsonschema.validators.extend(base, checks, type_checker=checker)(schema)


def find_keys_without_quotes(value: Any, where: str = 'top level') -> Iterator[str]:
    """Yield a fault for each key that is not text."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if not isinstance(key, str):
                yield f'{where}: {key!r} is not text; put quotes around it: {str(key)!r}'
            yield from find_keys_without_quotes(inner, str(key))
    elif isinstance(value, list):
        for inner in value:
            yield from find_keys_without_quotes(inner, where)


def _explain(error: jsonschema.ValidationError) -> Iterator[str]:
    """Translate a schema error into lines of the form 'key: value: fault; valid range'."""
    where = '.'.join(map(str, error.absolute_path)) or 'top level'
    valid = error.schema.get('description') if isinstance(error.schema, dict) else None
    if error.validator == 'additionalProperties':
        allowed = error.schema['properties']
        for key in error.instance:
            if key not in allowed:
                hint = f'{suggest(key, allowed)}known are {", ".join(allowed)}'
                yield f'{where}: unknown key {key!r}; {hint}'
    elif error.validator == 'required':
        for key in error.validator_value:
            if key not in error.instance:
                schema = error.schema.get('properties', {}).get(key)
                has_meaning = isinstance(schema, dict) and 'description' in schema
                meaning = f'; it is {schema["description"]}' if has_meaning else ''
                yield f'{where}: key {key!r} is missing{meaning}'
    else:
        text = repr(error.instance)
        shown = text if len(text) <= 60 else text[:57] + '...'
        yield f'{where}: {shown}: must be {valid}{_plausible(error)}'


def _plausible(error: jsonschema.ValidationError) -> str:
    """Return the violated range of a number, and a unit in which the number would be valid."""
    if error.validator not in ('minimum', 'maximum'):
        return ''
    low = error.schema.get('minimum', error.schema.get('exclusiveMinimum'))
    high = error.schema.get('maximum')
    if high is None:
        return f', at least {low:g}'
    unit = error.schema.get('unit', '')
    hint = likely_unit(error.instance, unit, low, high, WALL_FORMS.get(unit))
    return f', from {low:g} to {high:g}{hint}'
