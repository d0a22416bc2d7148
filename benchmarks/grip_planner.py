# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How often any two members, or three, hold a random convex object, against those of one module.

Objects are discs, ellipses and convex polygons with rounded corners, 0.1 to 0.6 m wide in the
mean, at random angles. They lie free in a random loop of the nine-member robot at home: one of its
tubes, or the hole between the three, 2 cm from everything at least. A grip holds by friction 0.5,
and no tube bears more than 0.8 of its wrinkling moment; the best has the largest slip margin.

Members of one module are pairs that meet, by the same search, which is allowed nothing else.

    python benchmarks/grip_planner.py [OBJECTS]
"""

from __future__ import annotations

from collections.abc import Sequence
import os
import sys
from typing import NamedTuple

os.environ.update(OPENBLAS_NUM_THREADS='1', OMP_NUM_THREADS='1')  # before NumPy comes in

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    Ellipse,
    GraspRequirements,
    load_robot,
    plan_grasps,
    Polygon,
    Pose,
)
from isotruss_ros.core.errors import GraspError
from isotruss_ros.core.model.shapes import Shape
from isotruss_ros.core.planning.seeds import enclosing_members
from isotruss_ros.core.safety.margins import object_distances
from measuring import part, print_machine, print_table, timed
import numpy as np

ROBOT = load_robot('nine_member')
NEEDS = GraspRequirements(count=1)
SEED, OBJECTS = 0, part(100)
WIDTHS, FREE = (0.1, 0.6), 0.02
KINDS = ('disc', 'ellipse', 'polygon')


class Result(NamedTuple):
    """What came of one object."""

    kind: str  #: of its shape
    width: float  #: in the mean [m]
    margin: float  #: the largest slip margin; zero where none was found [N]
    members: tuple[str, ...]  #: that hold it
    seconds: float  #: of the search


def random_shape(rng: np.random.Generator, kind: str, width: float) -> Shape:
    """Return a shape whose mean width is given [m]."""
    if kind == 'disc':
        return Disc(width)
    if kind == 'ellipse':
        aspect = float(rng.uniform(0.4, 1.0))
        scale = width * np.pi / Ellipse((1.0, aspect)).perimeter
        return Ellipse((scale, aspect * scale))
    while True:
        count = int(rng.integers(3, 8))
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
        aspect = float(rng.uniform(0.4, 1.0))
        corners = np.cos(angles) + 1j * aspect * np.sin(angles)
        gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
        if gaps.max() > 0.8 * np.pi or gaps.min() < 0.3:
            continue
        sides = np.abs(np.roll(corners, -1) - corners)
        corners *= width * np.pi / sides.sum()
        radius = 0.05 * width
        try:
            return Polygon([(z.real, z.imag) for z in corners], corner_radius=radius)
        except GraspError:
            continue


def random_object(rng: np.random.Generator) -> tuple[str, float, ConvexObject]:
    """Return an object that lies free in a loop of the robot."""
    joints = dict(zip(ROBOT.node_names, ROBOT.home.points, strict=True))
    loops = ['PQX', 'QRY', 'RPZ', 'PQR']
    while True:
        kind, width = str(rng.choice(KINDS)), float(rng.uniform(*WIDTHS))
        shape = random_shape(rng, kind, width)
        for _ in range(20):
            corners = np.array([joints[name] for name in loops[int(rng.integers(4))]])
            place = rng.dirichlet(np.full(3, 3.0)) @ corners
            pose = Pose(place.real, place.imag, float(rng.uniform(0.0, 2.0 * np.pi)))
            body = ConvexObject(shape, pose)
            least = object_distances(ROBOT.home, body).min()
            if least > FREE and enclosing_members(ROBOT.home, body.middle):
                return kind, width, body


def search(kind: str, width: float, body: ConvexObject, modules: Sequence[str]) -> Result:
    """Return the best grip, of the members of given modules or of any without them."""
    wanted = modules or [None]
    margin, members, seconds = 0.0, (), 0.0
    for module in wanted:
        needs = GraspRequirements(count=1, module=module)
        spent, plan = timed(lambda n=needs: plan_grasps(ROBOT.home, body, n, max_rounds=1))
        seconds += spent
        if plan and plan[0].slip_margin > margin:
            margin, members = plan[0].slip_margin, plan[0].grip.members
    return Result(kind, width, margin, members, seconds)


def around(body: ConvexObject) -> list[str]:
    """Return the modules at which two members meet that are seen from the object."""
    seen = set(enclosing_members(ROBOT.home, body.middle))
    previous = ROBOT.topology.previous
    return [name for i, name in enumerate(ROBOT.module_names) if {i, int(previous[i])} <= seen]


def row(name: str, of_module: Sequence[Result], of_any: Sequence[Result]) -> list[str]:
    """Return a row of the table: found, margin and time of both, and their ratios."""
    both = [
        (one.margin, other.margin)
        for one, other in zip(of_module, of_any, strict=True)
        if one.margin > 0.0 and other.margin > 0.0
    ]
    one, other = (
        sum(result.margin > 0.0 for result in results) for results in (of_module, of_any)
    )
    margins = np.median(both, axis=0) if both else np.array([np.nan, np.nan])
    times = [float(np.mean([r.seconds for r in results])) for results in (of_module, of_any)]
    return [
        name,
        str(len(of_any)),
        str(one),
        str(other),
        f'{other / one:.2f}' if one else '-',
        f'{margins[0]:.2f}',
        f'{margins[1]:.2f}',
        f'{margins[1] / margins[0]:.2f}' if both else '-',
        f'{times[0]:.1f}',
        f'{times[1]:.1f}',
    ]


def main(count: int) -> None:
    """Search grips of random objects, and print the table."""
    print_machine()
    rng = np.random.default_rng(SEED)
    of_module: list[Result] = []
    of_any: list[Result] = []
    for number in range(count):
        kind, width, body = random_object(rng)
        modules = around(body)
        empty = Result(kind, width, 0.0, (), 0.0)
        of_module.append(search(kind, width, body, modules) if modules else empty)
        of_any.append(search(kind, width, body, ()))
        print(
            f'{number + 1:3d} {kind:8s} {width:.2f} m: {of_module[-1].margin:6.2f} N, '
            f'{of_any[-1].margin:6.2f} N by {", ".join(of_any[-1].members) or "none"}',
            file=sys.stderr,
            flush=True,
        )
    rows = [row('all', of_module, of_any)]
    groups = {kind: [i for i, r in enumerate(of_any) if r.kind == kind] for kind in KINDS}
    groups['up to 0.35 m'] = [i for i, r in enumerate(of_any) if r.width <= 0.35]
    groups['wider'] = [i for i, r in enumerate(of_any) if r.width > 0.35]
    for name, chosen in groups.items():
        if chosen:
            rows.append(row(name, [of_module[i] for i in chosen], [of_any[i] for i in chosen]))
    header = [
        'objects',
        'number',
        'found at a module',
        'found by any',
        'ratio',
        'margin [N]',
        'by any [N]',
        'ratio',
        'time [s]',
        'by any [s]',
    ]
    print_table(header, rows)
    three = sum(len(result.members) > 2 for result in of_any)
    apart = sum(
        0 < len(r.members) < 3 and len({m.split('/')[0] for m in r.members}) > 1 for r in of_any
    )
    print(f'held best by three members: {three}; by two of different tubes: {apart}')


if __name__ == '__main__':
    main(int(sys.argv[1]) if len(sys.argv) > 1 else OBJECTS)
