# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of an item of the paper: numbers, a figure and a report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure
from studies.paper.tables import Table

#: Callback with the completed share of the work, from 0 to 1.
Advance = Callable[[float], None]


@dataclass(frozen=True)
class Report:
    """
    Text of an item on the page.

    :ivar heading: heading of the section.
    :ivar picture: alternative text of the figure; empty without a figure.
    :ivar stated: statement of the paper.
    :ivar computed: result of this package.
    :ivar difference: difference between the two.
    :ivar assumption: assumption on which the difference depends.
    :ivar tables: tables of the numbers.
    """

    heading: str
    picture: str
    stated: str
    computed: str
    difference: str
    assumption: str
    tables: tuple[Table, ...]


@dataclass(frozen=True)
class Item:
    """
    One table or figure of the paper.

    :ivar name: name of the item's files.
    :ivar compute: function that returns the numbers.
    :ivar report: function that returns the text and the tables.
    :ivar draw: function that draws the figure; None without a figure.
    """

    name: str
    compute: Callable[[Advance], Any]
    report: Callable[[Any], Report]
    draw: Callable[[Any], Figure] | None = None
