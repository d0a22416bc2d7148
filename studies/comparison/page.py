# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Page of all comparisons: docs/plant.md."""

from __future__ import annotations

from collections.abc import Sequence

from studies.comparison.section import Section
from studies.paper.tables import markdown, Table

#: Folder of tables and figures, relative to the page.
FOLDER = 'plant'

INTRODUCTION = """\
<!-- Written by `make plant`; change studies/comparison/ instead. -->
# Our model and MuJoCo's, number by number

`make plant` computes this page in about a quarter of an hour. It compares two models, without
measurements of a robot. Errors in the parts that both [share](mujoco.md#the-model) do not appear.

MuJoCo's tubes are chains of segments, ours beams with axial force and large motion of their ends.
MuJoCo integrates assumed masses, drag and losses; our model is in equilibrium. MuJoCo's tubes stay
round, so here our tubes have `local_stiffness: 1e4`. Contact lengths and the effects of masses are
not compared.
"""


def page(sections: Sequence[Section]) -> str:
    """
    Return the whole page.

    :param sections: sections in order.
    """
    checks = [check.row() for section in sections for check in section.checks]
    before = ['', *(why for *_, why in checks)]
    rows = [
        (*cells, 'as above' if why and why == other else why)
        for (*cells, why), other in zip(checks, before, strict=False)
    ]
    headings = ('compared', 'largest difference', 'bound', 'why it is not zero')
    summary = Table('bounds', 'All bounds', headings, rows)
    parts = [INTRODUCTION, '## Bounds\n', markdown(summary) + '\n']
    return '\n'.join([*parts, *(show(section) for section in sections)])


def show(section: Section) -> str:
    """
    Return one section of the page.

    :param section: the section.
    """
    parts = [f'## {section.heading}']
    if section.figure is not None:
        parts.append(f'![{section.picture}]({FOLDER}/{section.tables[0].name}.png)')
    parts.append(section.words)
    for table in section.tables:
        caption = f'{table.caption} ([CSV]({FOLDER}/{table.name}.csv))'
        parts += [f'{caption}:', markdown(table)] if table.shown else [f'{caption}.']
    return '\n\n'.join(parts) + '\n'
