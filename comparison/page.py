# Copyright 2026 isotruss_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page that shows all comparisons: docs/plant.md."""

from __future__ import annotations

from collections.abc import Sequence

from comparison.section import Section
from paper.tables import markdown, Table

#: Where tables and figures are, seen from the page.
FOLDER = 'plant'

INTRODUCTION = """\
<!-- Written by `make plant`; change comparison/ instead. -->
# Our model and MuJoCo's, number by number

`make plant` computes this page in less than ten minutes. [MuJoCo](mujoco.md) is a dynamics engine
that nobody here wrote: it finds motion, contact, friction, rolling and slip in its own way.

**What both share, and what this page can therefore not find:** the robot file with home, lengths
and modules; bisection (3) as a rule of the modules; the section stiffness EA, EI, GA of the tubes
and how the pinched ends soften them. An error in these is in both. Nor is anything here a
measurement of a robot.

**What is different:** MuJoCo's tubes are chains of rigid pieces with springs between them, and
bend by large angles; ours are linear beams. MuJoCo integrates masses, drag and losses, which are
invented, over time; ours is in equilibrium. Its tubes stay round where they are touched: so all
of ours here are those of a robot file with `local_stiffness: 1e4`, which hardly flatten. Not
comparable are lengths of contact, and what masses and damping decide.
"""


def page(sections: Sequence[Section]) -> str:
    """
    Return the whole page.

    :param sections: in order.
    """
    checks = [check.row() for section in sections for check in section.checks]
    headings = ('compared', 'largest difference', 'bound', 'why it is not zero')
    summary = Table('bounds', 'All bounds', headings, checks)
    parts = [INTRODUCTION, '## Bounds\n', markdown(summary) + '\n']
    return '\n'.join([*parts, *(show(section) for section in sections)])


def show(section: Section) -> str:
    """
    Return one section of the page.

    :param section: to be shown.
    """
    parts = [f'## {section.heading}']
    if section.figure is not None:
        parts.append(f'![{section.picture}]({FOLDER}/{section.tables[0].name}.png)')
    parts.append(section.words)
    for table in section.tables:
        parts.append(f'{table.caption} ([CSV]({FOLDER}/{table.name}.csv)):')
        parts.append(markdown(table))
    return '\n\n'.join(parts) + '\n'
