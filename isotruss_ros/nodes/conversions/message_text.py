# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text of message definitions with their nested types, in the format of recordings."""

from __future__ import annotations

import importlib
import re
from typing import Any

#: Separator of the definitions in a schema.
SEPARATOR = '=' * 80
#: Name of a type in message files, by its name in the interface definition language.
TYPE_NAMES = {'double': 'float64', 'float': 'float32', 'boolean': 'bool', 'octet': 'byte'}


def type_name(kind: Any) -> str:
    """Return the name of a message type, as `package/msg/Name`."""
    package, folder, *_ = kind.__module__.split('.')
    return f'{package}/{folder}/{kind.__name__}'


def schema_text(kind: Any) -> str:
    """Return the text that defines a message type and all types nested in it."""
    definitions: dict[str, str] = {}
    _collect(kind, definitions)
    first, *others = definitions.items()
    parts = [first[1], *(f'MSG: {name}\n{text}' for name, text in others)]
    return f'\n{SEPARATOR}\n'.join(parts)


def _collect(kind: Any, definitions: dict[str, str]) -> None:
    """Collect the definitions of a message type and of its fields' message types."""
    package, folder, name = type_name(kind).split('/')
    short = f'{package}/{name}'
    if short in definitions:
        return
    definitions[short] = ''
    lines = []
    for field, described in kind.get_fields_and_field_types().items():
        inner, suffix = _split(described)
        lines.append(f'{TYPE_NAMES.get(inner, inner)}{suffix} {field}')
        if '/' in inner:
            package, inner = inner.split('/')
            module = importlib.import_module(f'{package}.{folder}')
            _collect(getattr(module, inner), definitions)
    definitions[short] = '\n'.join(lines) + '\n'


def _split(described: str) -> tuple[str, str]:
    """Return the type of a field without array brackets, and these brackets or ''."""
    sequence = re.fullmatch(r'sequence<([^,>]+)(?:, (\d+))?>', described)
    if sequence:
        bound = f'<={sequence[2]}' if sequence[2] else ''
        return sequence[1], f'[{bound}]'
    array = re.fullmatch(r'([^\[]+)(\[\d+\])', described)
    return (array[1], array[2]) if array else (described, '')
