# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of a comparison: bounds, tables and words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure
from paper.tables import number, Table


@dataclass(frozen=True)
class Check:
    """A difference between the two models, with its bound."""

    what: str  #: that is compared
    found: float  #: the largest difference
    bound: float  #: on it
    unit: str  #: of both
    why: str  #: it is not zero

    @property
    def kept(self) -> bool:
        """Return whether the difference is within its bound."""
        return self.found <= self.bound

    def row(self) -> tuple[str, str, str, str]:
        """Return the cells of a table of checks."""
        found = f'{number(self.found, 2)} {self.unit}'.strip()
        bound = f'{number(self.bound, 2)} {self.unit}'.strip()
        return self.what, found if self.kept else f'**{found}**', bound, self.why


@dataclass(frozen=True)
class Section:
    """One comparison."""

    heading: str  #: of its section
    words: str  #: what was done, and what is to be seen
    checks: tuple[Check, ...]  #: the differences, each with its bound
    tables: tuple[Table, ...] = ()  #: the numbers
    figure: Figure | None = None  #: a drawing; None for none
    picture: str = ''  #: its alternative text


#: Makes one comparison.
Compare = Callable[[], Section]
