# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of a comparison, which are checks with bounds, tables and text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure
from studies.paper.tables import number, Table


@dataclass(frozen=True)
class Check:
    """Difference between the two models, with its bound."""

    what: str  #: compared quantity
    found: float  #: largest difference
    bound: float  #: bound of the difference
    unit: str  #: unit of difference and bound
    why: str  #: reason of the difference

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

    heading: str  #: heading of the section
    words: str  #: description and result
    checks: tuple[Check, ...]  #: differences with their bounds
    tables: tuple[Table, ...] = ()  #: tables of the numbers
    figure: Figure | None = None  #: drawing; None without one
    picture: str = ''  #: alternative text of the drawing


#: Function that makes one comparison.
Compare = Callable[[], Section]
