# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Page of all items: docs/paper.md."""

from __future__ import annotations

from collections.abc import Sequence

from studies.paper.item import Item, Report
from studies.paper.tables import markdown

#: Folder of figures and tables, relative to the page.
FOLDER = 'paper'

INTRODUCTION = """\
<!-- Written by `make paper`; change studies/paper/ instead. -->
# The paper, figure by figure

`make paper` computes and draws this page in less than five minutes with the package's own
functions ([which computes which equation](equations.md)).

**No measurement of the paper is in this package**, only the captions of its figures and the
headings of Table I. The figures show our model; each *difference* compares it with the paper's
text. All forces depend on the [theoretical](tube_stiffness.md) stiffness of the tube.
"""


def page(reports: Sequence[tuple[Item, Report]]) -> str:
    """Return the whole page."""
    return '\n'.join([INTRODUCTION, *(section(item, report) for item, report in reports)])


def section(item: Item, report: Report) -> str:
    """Return the section of one item."""
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
        caption = f'{table.caption} ([CSV]({FOLDER}/{table.name}.csv))'
        parts += [f'{caption}:', markdown(table)] if table.shown else [f'{caption}.']
    return '\n\n'.join(parts) + '\n'
