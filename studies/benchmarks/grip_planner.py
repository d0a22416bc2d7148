# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Grasps of random convex objects by any two or three members, compared with grasps at one module.

Objects are discs, ellipses and convex polygons with rounded corners, at random angles, with a mean
width of 0.1 to 0.6 m. Each is free in a random loop of the nine-member robot at home (one of its
tubes, or the hole between the three tubes), at least 2 cm from all parts. A grip must hold the
object with a coefficient of friction of 0.5 and a utilisation of at most 0.8. The best grip has
the largest slip margin.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
import numpy as np
from studies.benchmarks.measuring import part, Table

ROBOT = load_robot('nine_member')
SEED, OBJECTS = 0, part(100)
WIDTHS, FREE = (0.1, 0.6), 0.02
KINDS = ('disc', 'ellipse', 'polygon')


def random_shape(rng: np.random.Generator, kind: str, width: float) -> Shape:
    """Return a random shape with a given mean width [m]."""
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


def random_object(rng: np.random.Generator) -> tuple[float, ConvexObject]:
    """Return a free object in a loop of the robot."""
    joints = dict(zip(ROBOT.node_names, ROBOT.home.points, strict=True))
    loops = ['PQX', 'QRY', 'RPZ', 'PQR']
    while True:
        width = float(rng.uniform(*WIDTHS))
        shape = random_shape(rng, str(rng.choice(KINDS)), width)
        for _ in range(20):
            corners = np.array([joints[name] for name in loops[int(rng.integers(4))]])
            place = rng.dirichlet(np.full(3, 3.0)) @ corners
            pose = Pose(place.real, place.imag, float(rng.uniform(0.0, 2.0 * np.pi)))
            body = ConvexObject(shape, pose)
            least = object_distances(ROBOT.home, body).min()
            if least > FREE and enclosing_members(ROBOT.home, body.middle):
                return width, body


def search(body: ConvexObject, modules: Sequence[str | None]) -> float:
    """Return the largest slip margin of grips at given modules; None: of any members [N]."""
    margin = 0.0
    for module in modules:
        plan = plan_grasps(
            ROBOT.home, body, GraspRequirements(count=1, module=module), max_rounds=1
        )
        margin = max(margin, plan[0].slip_margin if plan else 0.0)
    return margin


def around(body: ConvexObject) -> list[str]:
    """Return the modules whose two members are in line of sight of the object."""
    seen = set(enclosing_members(ROBOT.home, body.middle))
    previous = ROBOT.topology.previous
    return [name for i, name in enumerate(ROBOT.module_names) if {i, int(previous[i])} <= seen]


def tables() -> Iterator[Table]:
    """Yield the tables of the case."""
    rng, found = np.random.default_rng(SEED), []
    for _ in range(OBJECTS):
        width, body = random_object(rng)
        found.append((width, search(body, around(body)), search(body, [None])))
    rows = []
    for name, least in (('all', 0.0), ('wider than 0.35 m', 0.35)):
        _, *margins = np.array([one for one in found if one[0] > least]).reshape(-1, 3).T
        one, other = ((margin > 0.0).sum() for margin in margins)
        held = margins[1][margins[1] > 0.0]
        typical = f'{np.median(held):.2f}' if len(held) else '-'
        rows.append((name, f'{len(margins[0])}', f'{one}', f'{other}', typical))
    header = ('objects', 'number', 'found at a module', 'by any members', 'slip margin [N]')
    yield Table('', header, rows)
