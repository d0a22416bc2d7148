# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Records of arrays over n samples, which have one more axis, the first one.

Named tuples have arrays over samples in all fields. A class with the attribute `shared`, a tuple
of names, has them in all fields but these; a class with `take_samples` and `join_samples` is taken
and joined by these methods. Formulas are valid for one sample without this axis, and for n samples
with it.
"""

from __future__ import annotations

from collections.abc import Sequence
import copy
from typing import Any, TypeVar

from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

T = TypeVar('T')


def sum_at(places: Indices, values: Array, size: int) -> Array:
    """Return the sums (..., size) of values (..., q) that have the same places (q,)."""
    lead = values.shape[:-1]
    if values.size == len(places):  # one sample
        return np.bincount(places, values.ravel(), size).reshape(*lead, size)
    count = values.size // len(places)
    indices = places + size * np.arange(count)[:, None]
    return np.bincount(indices.ravel(), values.ravel(), size * count).reshape(*lead, size)


def pick(values: Array, indices: Indices) -> Array:
    """Return the entries (..., q) of values (..., p) at indices (..., q) of each sample."""
    if values.ndim == 1:
        return values[indices]
    if len(values) == 1:
        return values[0][indices[0]][None]
    return np.take_along_axis(values, indices, -1)


def plain(values: Any) -> Any:
    """Return the value of one sample as a Python number, which messages need; else the array."""
    return values.item() if values.ndim == 0 else values


def take(value: T, index: Any) -> T:
    """
    Return samples of a record, chosen by an index of the first axis of its arrays.

    An integer returns one sample without this axis. None adds this axis to one sample.
    """
    if isinstance(value, np.ndarray):
        return value[index]
    kind: Any = type(value)
    if hasattr(kind, '_fields'):
        return kind(*(take(item, index) for item in value))  # type: ignore
    if kind is list or kind is tuple:
        return kind(take(item, index) for item in value)  # type: ignore
    if hasattr(kind, 'take_samples'):
        return value.take_samples(index)  # type: ignore
    shared = getattr(kind, 'shared', None)
    if shared is None:
        return value
    chosen = copy.copy(value)
    # Cached properties are fields of the copy, too.
    for name, item in vars(value).items():
        if name not in shared:
            chosen.__dict__[name] = take(item, index)
    return chosen


def join(values: Sequence[T]) -> T:
    """Return the samples of several records; cached properties that some lack are left out."""
    first = values[0]
    if len(values) == 1:
        return first
    if isinstance(first, np.ndarray):
        return np.concatenate(values)  # type: ignore
    kind: Any = type(first)
    if hasattr(kind, '_fields'):
        return kind(*map(join, zip(*values, strict=True)))  # type: ignore
    if kind is list or kind is tuple:
        return kind(map(join, zip(*values, strict=True)))  # type: ignore
    if hasattr(kind, 'join_samples'):
        return first.join_samples(values)  # type: ignore
    shared = getattr(kind, 'shared', None)
    if shared is None:
        return first
    joined = copy.copy(first)
    for name, item in vars(first).items():
        if all(name in vars(value) for value in values):
            items = [vars(value)[name] for value in values]
            joined.__dict__[name] = item if name in shared else join(items)
        else:
            del joined.__dict__[name]
    return joined
