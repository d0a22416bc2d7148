# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random messages: good ones, some fields of which are replaced by what should not be there."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np

NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-9, 1e6, 1e308, -1e308, 5e-324, math.nan, math.inf, -math.inf)
WHOLE = (0, 1, -1, 2**31 - 1, -(2**31))
NAMES = ('', 'nobody', 'x' * 1000, 'ö/☃', 'north/Z', 'north/R-P', 'truss')


def vary(message: Any, rng: np.random.Generator, most: int = 3) -> Any:
    """Return a copy of a message with one to some fields, however deep, replaced."""
    changed = copy.deepcopy(message)
    for _ in range(rng.integers(1, most + 1)):
        _replace(changed, rng)
    return changed


def _fields(message: Any) -> list[str]:
    """Return the fields of a message, or of a stand-in for one."""
    if hasattr(message, 'get_fields_and_field_types'):
        return list(message.get_fields_and_field_types())
    return list(vars(message))


def _replace(message: Any, rng: np.random.Generator) -> None:
    """Replace one field of a message, or of one in it."""
    name = str(rng.choice(_fields(message)))
    value = getattr(message, name)
    if _is_message(value):
        _replace(value, rng)
    elif isinstance(value, str):
        setattr(message, name, str(rng.choice(NAMES)))
    elif isinstance(value, bool):
        setattr(message, name, not value)
    elif isinstance(value, int):
        _set(message, name, int(rng.choice(WHOLE)))
    elif isinstance(value, float):
        _set(message, name, float(rng.choice(NUMBERS)))
    else:
        _replace_list(message, name, list(value), rng)


def _replace_list(message: Any, name: str, value: list[Any], rng: np.random.Generator) -> None:
    """Empty a list, double it, or change an element."""
    fixed = isinstance(getattr(message, name), np.ndarray)  # of a size that the type has
    how = 2 if fixed else rng.integers(4)
    if how == 0 or not value:
        _set(message, name, [])
    elif how == 1:
        _set(message, name, [*value, *value])
    else:
        place = rng.integers(len(value))
        if _is_message(value[place]):
            _replace(value[place], rng)
        elif isinstance(value[place], str):
            value[place] = str(rng.choice(NAMES))
        else:
            value[place] = float(rng.choice(NUMBERS))
        _set(message, name, value)


def _is_message(value: Any) -> bool:
    return hasattr(value, 'get_fields_and_field_types')


def _set(message: Any, name: str, value: Any) -> None:
    """Set a field, unless the type of the message itself refuses the value."""
    try:
        setattr(message, name, value)
    except (AssertionError, ValueError):
        return
