# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All comparisons, in the order of the page."""

from __future__ import annotations

from functools import partial

from studies.comparison import (
    boxes,
    carried,
    drops,
    friction,
    friction_cases,
    grasps,
    joint_loads,
    planned,
    pulls,
    random_carries,
    unloaded,
)
from studies.comparison.section import Compare, Section

SECTIONS: dict[str, Compare] = {
    'unloaded': unloaded.compare,
    'joint_loads': joint_loads.compare,
    'grasps': grasps.compare,
    'pulls': pulls.compare,
    'friction': friction.compare,
    'carried': carried.compare,
    'boxes': boxes.compare,
    'random_discs': random_carries.compare_discs,
    'random_boxes': random_carries.compare_boxes,
    'planned': planned.compare,
    'drops': drops.compare,
}
#: Fewer cases where all take long, of each kind at least one.
SOME: dict[str, Compare] = {
    'friction': partial(friction.compare, friction_cases.CASES[::9]),
    'random_discs': partial(random_carries.compare_discs, 1),
    'random_boxes': partial(random_carries.compare_boxes, 1),
    'drops': partial(drops.compare, 10),
}


def make(name: str, some: bool = False) -> Section:
    """
    Compute one comparison in a separate process.

    :param name: name of the comparison.
    :param some: whether to compute only some of its cases, where all take long.
    """
    return (SECTIONS | SOME if some else SECTIONS)[name]()
