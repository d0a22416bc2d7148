# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Normal forces on discs, ellipses and boxes pressed into a corner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from comparison.grasps import STEPS
from comparison.grips import FINE, press_on, round_robot
from comparison.section import Check, Section
from comparison.wedge import closed_to, MODULE, pressed_into
from isotruss_ros.core import analyze_grasp, Disc, Ellipse, Polygon
from isotruss_ros.core.manipulation.grip import members_at
from isotruss_ros.core.model.shapes import Shape
import numpy as np
from paper.tables import number, Table

BOX = ((-0.12, -0.09), (0.12, -0.09), (0.12, 0.09), (-0.12, 0.09))
SHAPES: dict[str, Shape] = {
    'disc': Disc(0.3),
    'ellipse': Ellipse((0.16, 0.1)),
    'box': Polygon(BOX, 0.02),
}
#: Angle of the wedge [degrees], orientation of the object [rad], and indentations [m].
WEDGE, ANGLE, DEPTHS = 40.0, 0.5, (0.005, 0.01)


def compare(shapes: Mapping[str, Shape] = SHAPES, depths: Sequence[float] = DEPTHS) -> Section:
    """
    Compare the normal forces on fixed objects of several shapes, without friction.

    :param shapes: shapes by name.
    :param depths: indentations of the members, for straight tubes [m].
    """
    config = closed_to(round_robot().home, WEDGE, 0.3)
    members = members_at(config.robot, MODULE)
    rows, errors = [], []
    for name, shape in shapes.items():
        for depth in depths:
            held = pressed_into(config, MODULE, shape, ANGLE, depth)
            theirs = press_on(config, held, members, segments=FINE).contact_forces()
            ours = analyze_grasp(config, held).contact_forces
            cells = [name, number(1e3 * depth)]
            for member in sorted(ours):
                force = theirs[member].normal
                errors.append(abs(force / ours[member] - 1.0))
                cells += [number(force), number(ours[member])]
            rows.append(tuple(cells))
    return Section(
        'Forces on other shapes',
        f'A disc of 0.3 m, an ellipse with semi-axes of 0.16 and 0.1 m and a box of 0.24 x 0.18 m '
        f'with corners of 20 mm are turned by {np.degrees(ANGLE):.0f}°, pressed into the '
        f'same corner, which is closed to {WEDGE:g}°, and fixed. They have no friction.',
        (
            Check(
                'normal forces on disc, ellipse and box',
                100.0 * max(errors),
                2.0,
                '%',
                STEPS,
            ),
        ),
        (
            Table(
                'shapes',
                'Fixed object, without friction',
                (
                    'object',
                    'depth in each [mm]',
                    'N₁ MuJoCo [N]',
                    'N₁ ours [N]',
                    'N₂ MuJoCo',
                    'N₂ ours',
                ),
                rows,
                shown=False,
            ),
        ),
    )
