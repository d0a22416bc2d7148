# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A box between two sides of the nine-member robot that meet at no module, for tests."""

from isotruss_ros.core import load_robot, place_between, read_object

ROBOT = load_robot('nine_member')
SIDES = ('south/P-Q', 'north/R-P')
#: Held by two corners; the line between them is almost that which halves the sides' angle.
ANGLE, DEPTH = -0.5, 0.01
BOX = (
    '{shape: polygon, vertices: [[-0.25, -0.2], [0.25, -0.2], [0.25, 0.2], [-0.25, 0.2]],'
    ' corner_radius: 0.02, mass: 0.8, friction: 0.9}'
)


def box_between(config=ROBOT.home, angle=ANGLE, depth=DEPTH):
    """Return a grip of the box between the two sides."""
    return place_between(config, SIDES, read_object(BOX).shape, angle, depth)
