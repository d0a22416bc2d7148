# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results and frozen records."""

from __future__ import annotations

from collections.abc import Mapping
import dataclasses
import enum
import functools
from functools import cached_property
import html
import itertools
import math
from typing import Any, ClassVar, TypeVar

import numpy as np

# Base class of results, with a short `repr`, a table for notebooks, and equality by value.

#: Longest text shown in full, also of an array [characters].
MAX_SHOWN_CHARACTERS = 90


class Record:
    """
    Base class of results, with uniform display, conversion and comparison of their data.

    The class attribute `data` names the data of a result. If it is empty, the data are all
    properties, and the fields without `repr=False`. The `repr` shows the data in `headline`.
    """

    headline: ClassVar[tuple[str, ...]] = ()
    data: ClassVar[tuple[str, ...]] = ()
    __hash__: Any = None

    def __init_subclass__(
        cls, headline: tuple[str, ...] = (), data: tuple[str, ...] = (), **options: Any
    ) -> None:
        """Store the names of the fields for `repr` (`headline`) and for `to_dict` (`data`)."""
        super().__init_subclass__(**options)
        cls.headline, cls.data = headline or cls.headline, data or cls.data

    def to_dict(self) -> dict[str, Any]:
        """
        Return the data as a dictionary of numbers, texts, lists and dictionaries.

        Numbers that are not finite become None, since JSON has none.
        """
        return {name: as_plain(getattr(self, name)) for name in _names(type(self))}

    def __repr__(self) -> str:
        """Return the name of the class, and one line for each name in the headline."""
        lines = [
            f'{name}: {_show(getattr(self, name))}'
            for name in self.headline or _names(type(self))[:5]
        ]
        return '\n  '.join([type(self).__name__, *lines])

    def _repr_html_(self) -> str:
        """Return the headline as two tables: single values, and dictionaries in columns."""
        values = {name: getattr(self, name) for name in self.headline or _names(type(self))[:5]}
        columns = {name: value for name, value in values.items() if isinstance(value, Mapping)}
        value_rows = [
            f'<tr><th>{html.escape(name)}</th><td>{html.escape(_show(value))}</td></tr>'
            for name, value in values.items()
            if name not in columns
        ]
        title = f'<caption>{type(self).__name__}</caption>'
        tables = f'<table>{title}{"".join(value_rows)}</table>'
        keys = dict.fromkeys(itertools.chain(*columns.values()))  # of all columns, in order
        if keys:
            headings = ''.join(f'<th>{html.escape(name)}</th>' for name in columns)
            tables += f'<table><tr><th></th>{headings}</tr>'
            for key in keys:
                cells = (
                    _show(column[key]) if key in column else '' for column in columns.values()
                )
                row = ''.join(f'<td>{html.escape(cell)}</td>' for cell in cells)
                tables += f'<tr><th>{html.escape(str(key))}</th>{row}</tr>'
            tables += '</table>'
        return tables

    def __eq__(self, other: object) -> bool:
        """Return whether the other object has the same class and equal data."""
        if type(other) is not type(self):
            return NotImplemented
        names = _names(type(self))
        return all(is_equal(getattr(self, name), getattr(other, name)) for name in names)


def as_plain(value: Any) -> Any:
    """Convert a value to finite numbers, None, texts, lists and dictionaries with text keys."""
    if isinstance(value, enum.Enum):
        return value.value if isinstance(value.value, str) else value.name
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if hasattr(value, 'to_dict'):
        return value.to_dict()
    if isinstance(value, (np.ndarray, np.generic)):
        return as_plain(value.tolist())
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, slice):
        return [value.start, value.stop]
    if isinstance(value, Mapping):
        return {str(key): as_plain(item) for key, item in value.items()}
    if hasattr(value, '_asdict'):
        return as_plain(value._asdict())
    if isinstance(value, (tuple, list, set, frozenset)):
        return [as_plain(item) for item in value]
    if dataclasses.is_dataclass(value):
        fields = [field.name for field in dataclasses.fields(value) if field.repr]
        return {name: as_plain(getattr(value, name)) for name in fields}
    raise TypeError(f'{type(value).__name__}: must consist of numbers and texts')


def is_equal(value: Any, other: Any) -> bool:
    """Return whether two values, also arrays, are equal; NaN counts as equal to NaN."""
    if isinstance(value, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(value, other, equal_nan=True)
    if isinstance(value, Mapping) and isinstance(other, Mapping):
        return value.keys() == other.keys() and all(
            is_equal(item, other[key]) for key, item in value.items()
        )
    if isinstance(value, (tuple, list)) and isinstance(other, (tuple, list)):
        return len(value) == len(other) and all(map(is_equal, value, other))
    return bool(value == other) or (value != value and other != other)


def _names(kind: type[Record]) -> tuple[str, ...]:
    """Return the names of the data of a class, headline first."""
    if kind.data:
        return kind.data
    fields: Any = dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ()
    names = [*kind.headline, *(field.name for field in fields if field.repr)]
    for base in reversed(kind.__mro__):
        for name, member in vars(base).items():
            if isinstance(member, property | cached_property):
                names.append(name)
    public_names = (name for name in names if not name.startswith('_'))
    return tuple(dict.fromkeys(public_names))  # without repetitions


def _show(value: Any) -> str:
    """Return a value on one line, with numbers to four digits."""
    if hasattr(value, 'to_dict'):
        return type(value).__name__
    if isinstance(value, enum.Enum):
        return str(as_plain(value))
    if isinstance(value, np.ndarray):
        # An array that is too long for a text is shown as its shape.
        text = _show(value.tolist()) if value.size <= MAX_SHOWN_CHARACTERS else '…'
        return f'array of shape {value.shape}' if text.endswith('…') else text
    if isinstance(value, (float, np.floating)):
        return f'{value:.4g}'
    if isinstance(value, Mapping):
        text = ', '.join(f'{key}: {_show(item)}' for key, item in value.items())
    elif isinstance(value, (tuple, list)):
        text = f'({", ".join(map(_show, value))})'
    else:
        text = str(value)
    line = text.replace('\n', ' ')
    return line if len(line) <= MAX_SHOWN_CHARACTERS else f'{line[:MAX_SHOWN_CHARACTERS]}…'


# Changes of frozen records in a control cycle, much faster than `dataclasses.replace`.

T = TypeVar('T')


def replace(record: T, **changes: Any) -> T:
    """
    Return a frozen dataclass with other values of some fields, like `dataclasses.replace`.

    No `__post_init__` checks the values again. Cached properties are left out.
    """
    kind: Any = type(record)
    before, names = vars(record), _field_names(kind)
    changed: T = object.__new__(kind)
    fields = vars(changed)
    if len(before) == len(names):
        fields.update(before)
    else:  # without cached properties
        for name in names:
            fields[name] = before[name]
    fields.update(changes)
    if len(fields) > len(names):
        unknown = ', '.join(sorted(changes.keys() - set(names)))
        raise TypeError(f'{kind.__name__} has no field {unknown}')
    return changed


@functools.cache
def _field_names(kind: Any) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass."""
    return tuple(field.name for field in dataclasses.fields(kind))
