"""What an item of the paper consists of: numbers, a figure, and what is to be said about them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from isotruss_ros.paper.tables import Table
from matplotlib.figure import Figure

#: Told the share of the work that is done, from 0 to 1.
Advance = Callable[[float], None]


@dataclass(frozen=True)
class Report:
    """
    What the page says about an item.

    :ivar heading: of its section.
    :ivar picture: what the figure shows, for who cannot see it; empty where there is no figure.
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
    :ivar report: says what they mean.
    :ivar draw: makes the figure, if there is one.
    """

    name: str
    compute: Callable[[Advance], Any]
    report: Callable[[Any], Report]
    draw: Callable[[Any], Figure] | None = None
