# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page that shows all items: docs/paper.md."""

from __future__ import annotations

from collections.abc import Sequence

from paper.item import Item, Report
from paper.tables import markdown

#: Where figures and tables are, seen from the page.
FOLDER = 'paper'

INTRODUCTION = """\
<!-- Written by `make paper`; change paper/ instead. -->
# The paper, figure by figure

`make paper` computes and draws this page in less than five minutes with the package's own
functions ([which computes which equation](equations.md)).

**No measurement of the paper is in this package.** Of its figures only captions were at hand, of
Table I the headings. Figures show the model, or points made by it, and differences are those to
the paper's text. The stiffness of the tube is [theory](tube_stiffness.md), and all
forces depend on it.
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
