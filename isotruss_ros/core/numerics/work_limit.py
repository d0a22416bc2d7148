# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Bound on the work of a control cycle.

The unit of work is a step of Newton's method for an equilibrium, or a new sample of a dent; each
takes about a millisecond. Samples are stored, so a computation that has stopped at the bound
passes this point when it is repeated. Without a bound, work is not counted.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import contextvars
from dataclasses import dataclass

from isotruss_ros.core.errors import IsotrussError

#: Number of units of work if it is not bounded [-].
UNBOUNDED = 10**9


@dataclass
class Work:
    """
    Work that is done under a bound.

    :ivar limit: largest number of units [-].
    :ivar done: number of units [-].
    :ivar stored: number of those whose results are stored [-].
    """

    limit: int
    done: int = 0
    stored: int = 0


_current: contextvars.ContextVar[Work | None] = contextvars.ContextVar('work', default=None)


class WorkLimitError(IsotrussError):
    """
    The bound on work stops a computation.

    :ivar advances: whether results were stored, so that a repetition advances further.
    """

    def __init__(self, work: Work) -> None:
        super().__init__(f'{work.done} units of work in a cycle; must be at most {work.limit}')
        self.advances = work.stored > 0


@contextlib.contextmanager
def limited_work(limit: int) -> Iterator[Work]:
    """Limit the work that is done inside to a number of units, and to an enclosing bound."""
    enclosing = _current.get()
    if enclosing is not None:
        limit = min(limit, enclosing.limit - enclosing.done)
    work = Work(limit)
    token = _current.set(work)
    try:
        yield work
    finally:
        _current.reset(token)
        if enclosing is not None:
            enclosing.done += work.done
            enclosing.stored += work.stored


def work_left() -> int:
    """Return the number of units of work until the bound, or many without a bound."""
    work = _current.get()
    return UNBOUNDED if work is None else work.limit - work.done


def count_work(is_stored: bool = False) -> None:
    """
    Count a unit of work that begins, or whose result was stored.

    :param is_stored: whether its result was stored, so that a repetition does not need it.
    :raises WorkLimitError: the work would exceed its bound.
    """
    work = _current.get()
    if work is None:
        return
    work.stored += is_stored
    if work.done >= work.limit:
        raise WorkLimitError(work)
    work.done += 1
