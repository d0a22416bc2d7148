# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Records of arrays over n samples, which have one more axis, the first one.

Named tuples have arrays over samples in all fields. A class with the attribute `shared`, a tuple
of names, has them in all fields but these; a class with `take_samples` is taken by
it. Formulas are valid for one sample without this axis, and for n samples with it.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    lead = values.shape[:-1]
    if values.size == len(places):
        return np.bincount(places, values.ravel(), size).reshape(*lead, size)
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


def take(value: T, index: Any) -> T:
    """
    Return samples of a record, chosen by an index of the first axis of its arrays.

    An integer returns one sample without this axis.
    """
    kind: Any = type(value)
    given: Any = value
    if kind is np.ndarray:
        return given[index]  # type: ignore[no-any-return]
    if hasattr(kind, 'take_samples'):
        return given.take_samples(index)  # type: ignore[no-any-return]
    if kind is list or kind is tuple or hasattr(kind, '_fields'):
        fields = [take(item, index) for item in given]
        return kind(*fields) if hasattr(kind, '_fields') else kind(fields)
    if not hasattr(kind, 'shared'):
        return value
    taken: Any = object.__new__(kind)
    # Cached properties are fields of the copy, too.
    for name, item in vars(given).items():
        vars(taken)[name] = item if name in kind.shared else take(item, index)
    return taken  # type: ignore[no-any-return]


def join(values: Sequence[T]) -> T:
    """Return the samples of several arrays, or of tuples of arrays."""
    first: Any = values[0]
    if isinstance(first, np.ndarray):
        return np.concatenate(values)  # type: ignore
    fields = [join(items) for items in zip(*values, strict=True)]  # type: ignore
    return type(first)(*fields) if hasattr(first, '_fields') else type(first)(fields)
