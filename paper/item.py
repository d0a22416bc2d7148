# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of an item of the paper: numbers, a figure and a report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure
from paper.tables import Table

#: Called with the share of the work that is done, from 0 to 1.
Advance = Callable[[float], None]


@dataclass(frozen=True)
class Report:
    """
    The text of an item on the page.

    :ivar heading: of its section.
    :ivar picture: alternative text of the figure; empty where there is no figure.
    :ivar stated: what the paper states.
    :ivar computed: what is shown here.
    :ivar difference: between the two.
    :ivar assumption: that the difference rests on.
    :ivar tables: the numbers.
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

    :ivar name: of its files.
    :ivar compute: returns its numbers.
    :ivar report: returns the text and the tables.
    :ivar draw: draws the figure, if there is one.
    """

    name: str
    compute: Callable[[Advance], Any]
    report: Callable[[Any], Report]
    draw: Callable[[Any], Figure] | None = None
