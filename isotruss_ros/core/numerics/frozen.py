# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Changes of frozen records in a control cycle, a third as long as `dataclasses.replace`."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, TypeVar

T = TypeVar('T')


def replace(record: T, **changes: Any) -> T:
    """
    Return a frozen dataclass with other values of some fields, like `dataclasses.replace`.

    No `__post_init__` checks the values again. Cached properties are left out.
    """
    kind: Any = type(record)
    before = vars(record)
    fields = {name: before[name] for name in _field_names(kind)}
    if not changes.keys() <= fields.keys():
        unknown = ', '.join(sorted(changes.keys() - fields.keys()))
        raise TypeError(f'{kind.__name__} has no field {unknown}')
    changed: T = object.__new__(kind)
    vars(changed).update(fields, **changes)
    return changed


@functools.cache
def _field_names(kind: Any) -> tuple[str, ...]:
    """Return the names of the fields of a dataclass."""
    return tuple(field.name for field in dataclasses.fields(kind))
