# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All comparisons, in the order of the page."""

from __future__ import annotations

from studies.comparison import (
    boxes,
    carried,
    drops,
    faces,
    friction,
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
    'faces': faces.compare,
    'carried': carried.compare,
    'boxes': boxes.compare,
    'random_discs': random_carries.compare_discs,
    'random_boxes': random_carries.compare_boxes,
    'planned': planned.compare,
    'drops': drops.compare,
}


def make(name: str) -> Section:
    """
    Compute one comparison in a separate process.

    :param name: name of the comparison.
    """
    return SECTIONS[name]()
