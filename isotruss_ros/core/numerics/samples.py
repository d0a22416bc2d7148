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

from collections.abc import Callable, Sequence
import copy
from typing import Any, ClassVar, TypeVar

from isotruss_ros.core.numerics.arrays import Array, Indices
import numpy as np

T = TypeVar('T')
S = TypeVar('S', bound='SampledValues')


class SampledValues:
    """
    Attributes of n values as arrays, whose first axis has the values.

    :cvar sampled: names of the attributes.
    """

    sampled: ClassVar[tuple[str, ...]]

    def __init__(self, values: Sequence[Any]) -> None:
        for name in self.sampled:
            setattr(self, name, np.array([getattr(value, name) for value in values]))

    def chosen(self: S, indices: Indices) -> S:
        """Return a copy with the attributes of some of the values, by their indices (q,)."""
        taken = copy.copy(self)
        for name in self.sampled:
            setattr(taken, name, getattr(self, name)[indices])
        return taken


def sum_at(places: Indices, values: Array, size: int) -> Array:
    """Return the sums (..., size) of values (..., q) that have the same places (q,)."""
    if values.ndim == 1:
        return np.bincount(places, values, size)
    lead = values.shape[:-1]
    count = values.size // len(places)
    indices = places + size * np.arange(count)[:, None]
    return np.bincount(indices.ravel(), values.ravel(), size * count).reshape(*lead, size)


def pick(values: Array, indices: Indices) -> Array:
    """Return the entries (..., q) of values (..., p) at indices (q,), or (n, q) of n samples."""
    if indices.ndim == 1 or len(indices) == 1:
        return values[..., indices.ravel()]
    shape = (1,) * (values.ndim - indices.ndim) + indices.shape
    return np.take_along_axis(values, indices.reshape(shape), -1)


def apply(matrices: Array, vectors: Array) -> Array:
    """Return products (..., r) of matrices (..., r, c) with vectors (..., c)."""
    return (matrices @ vectors[..., None])[..., 0]  # type: ignore[no-any-return]


def column(values: Any) -> Any:
    """Return values of samples with one more axis, or one value as an array (1,)."""
    return np.asarray(values)[..., None]


def first_sample(values: Array | Indices) -> Any:
    """Return values (k,) of the first sample, or of the only one."""
    return values if values.ndim == 1 else values[0]


def plain(values: Any) -> Any:
    """Return the value of one sample as a Python number, which messages need; else the array."""
    return values.item() if values.ndim == 0 else values


def take(value: T, index: Any) -> T:
    """
    Return samples of a record, chosen by an index of the first axis of its arrays.

    An integer returns one sample without this axis. None adds this axis to one sample.
    """
    return _map_arrays(  # type: ignore[no-any-return]
        [value], lambda arrays: arrays[0][index], lambda items: items[0].take_samples(index)
    )


def join(values: Sequence[T]) -> T:
    """Return the samples of several records; cached properties that some lack are left out."""
    if len(values) == 1:
        return values[0]
    return _map_arrays(  # type: ignore[no-any-return]
        values, np.concatenate, lambda items: items[0].join_samples(items)
    )


def _map_arrays(
    values: Sequence[Any], of_arrays: Callable[..., Any], of_others: Callable[..., Any]
) -> Any:
    """Return a record of what a function returns of the arrays of several records."""
    first, kind = values[0], type(values[0])
    if kind is np.ndarray:
        return of_arrays(values)
    if hasattr(kind, 'take_samples'):
        return of_others(values)
    if kind is list or kind is tuple or hasattr(kind, '_fields'):
        fields = [_map_arrays(items, of_arrays, of_others) for items in zip(*values, strict=True)]
        return kind(*fields) if hasattr(kind, '_fields') else kind(fields)
    if not hasattr(kind, 'shared'):
        return first
    mapped: Any = object.__new__(kind)
    records, copied = list(map(vars, values)), vars(mapped)
    in_all = set(records[0]).intersection(*records[1:])
    # Cached properties are fields of the copy, too.
    for name, value in records[0].items():
        if name in kind.shared:
            copied[name] = value
        elif name in in_all:
            items = [record[name] for record in records]
            copied[name] = _map_arrays(items, of_arrays, of_others)
    return mapped
