# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Robots of any size that are rigid by construction: nested triangles (a Sierpinski gasket).

A triangular tube is replaced by three tubes of half its size, corner to corner. Together they are
again a rigid triangle (a three-hinged arch on a base), so the robot remains isostatic. Each
replacement adds 6 modules and 3 joints. Each joint belongs to one or two tubes, each corner has 60
degrees, and the distance of joints is `EDGE` or twice `EDGE`. With 9 modules the robot has the
shape and the size of the preset nine_member.
"""

from __future__ import annotations

from collections import deque
import math

from isotruss_ros.core.model.description import Module, RobotDescription, Tube

#: Numbers of modules, from one triangle to 303.
SIZES = (3, 9, 15, 27, 51, 99, 147, 201, 303)
#: Smallest distance of two joints of a tube [m].
EDGE = 1.432
#: Name of the tube and the joint at the top, whose module is driven.
TOP_JOINT = 'top'


def nested_triangles(n_modules: int) -> RobotDescription:
    """
    Return a robot of nested triangles, supported at its two lower corners.

    :param n_modules: number of modules: 3, 9, 15, ... (3 more than a multiple of 6).
    """
    steps, rest = divmod(n_modules - 3, 6)
    if rest or steps < 0:
        raise ValueError(f'{n_modules} modules: must be 3, 9, 15, ...')
    # Corners (i, j) of a triangular grid: i to the right, j up to the right; lower left and size.
    size = 2 ** math.ceil(math.log(2 * steps + 1, 3) - 1e-9)
    triangles = deque([(0, 0, size)])
    for _ in range(steps):  # the largest first, so that sizes differ by a factor of 2 at most
        i, j, edge = triangles.popleft()
        half = edge // 2
        triangles += [(i, j, half), (i + half, j, half), (i, j + half, half)]

    names = {(0, 0): 'left', (size, 0): 'right', (0, size): TOP_JOINT}
    joints: dict[str, tuple[float, float]] = {}
    tubes: list[Tube] = []
    for i, j, edge in sorted(triangles):
        corners = [(i, j), (i + edge, j), (i, j + edge)]
        around = tuple(names.get(corner, 'j{}_{}'.format(*corner)) for corner in corners)
        for name, (right, up) in zip(around, corners, strict=True):
            joints[name] = (EDGE * (right + 0.5 * up), EDGE * math.sqrt(0.75) * up)
        tubes.append(Tube(f't{i}_{j}', around, passive=around[0]))
    return RobotDescription(
        source=f'nested triangles with {n_modules} modules',
        name=f'nested_{n_modules}',
        frame='truss',
        joints=joints,
        tubes=tuple(tubes),
        module=Module(0.12, 0.2032, 0.08, axial_rigidity=5.0e6, flexural_rigidity=2.0e3),
        tube_diameter=0.102,
        pressures={tube.name: 34500.0 for tube in tubes},
        stiffness={'model': 'inflatable_beam'},
        supports={'left': ('x', 'y'), 'right': ('y',)},
        max_speed=0.10,
        max_acceleration=1.0,
        min_length=0.25,
        max_length=3.0,
    )


def top_module(description: RobotDescription) -> str:
    """Return the driven module at the top of the robot."""
    tube = next(tube for tube in description.tubes if TOP_JOINT in tube.joints)
    return f'{tube.name}/{TOP_JOINT}'
