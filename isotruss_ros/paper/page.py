"""The page that shows all items: docs/paper.md."""

from __future__ import annotations

from collections.abc import Sequence

from isotruss_ros.paper.item import Item, Report
from isotruss_ros.paper.tables import markdown

#: Where figures and tables are, seen from the page.
FOLDER = 'paper'

INTRODUCTION = """\
<!-- Written by `make paper`; change isotruss_ros/paper instead. -->
# The paper, figure by figure

`make paper` computes and draws all of this anew in well under five minutes, with the functions
that the package offers its users. [derivation.md](derivation.md) says which function holds which
equation.

**No measurement of the paper is in this package, and none is drawn.** Of its figures only the
captions were at hand, and of its Table I the headings. So the figures below show the model, or
points that the model made and that say so; differences are those to what the paper's text states.
The stiffness of the tube is theory ([tube_stiffness.md](tube_stiffness.md)) until you measure a
tube: sizes of forces depend on it, orders and shapes of curves hardly do.
"""


def page(reports: Sequence[tuple[Item, Report]]) -> str:
    """Return the whole page."""
    return '\n'.join([INTRODUCTION, *(section(item, report) for item, report in reports)])


def section(item: Item, report: Report) -> str:
    """Return what the page says about one item."""
    parts = [f'## {report.heading}']
    if item.draw:
        parts.append(f'![{report.picture}]({FOLDER}/{item.name}.png)')
    parts += [
        f'**The paper:** {report.stated}',
        f'**Here:** {report.computed}',
        f'**Difference:** {report.difference}',
        f'**Assumption:** {report.assumption}',
    ]
    for table in report.tables:
        parts.append(f'{table.caption} ([CSV]({FOLDER}/{table.name}.csv)):')
        parts.append(markdown(table))
    return '\n\n'.join(parts) + '\n'
