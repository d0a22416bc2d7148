# Copyright 2026 isotruss_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Change one assumption at a time on 12 held grasps, for the page "Limits of validity".

`python -m studies.limits` prints how many grasps each change loses. The grasps are drawn at
random: travel of the rollers, two members, shape, angle and indentation of the object. Draws that
are not held at the coefficient of friction `FRICTION` are discarded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
import itertools
import math
from typing import NamedTuple

from isotruss_ros.core import (
    ConvexObject,
    Disc,
    IsotrussError,
    load_robot,
    place_between,
    Polygon,
    Robot,
    settle_grasp,
)
from isotruss_ros.core.holding.settled_grasp import SettledGrasp
from isotruss_ros.core.numerics.arrays import Array
import numpy as np

#: Number of grasps [-], and coefficient of friction at which all are held [-].
COUNT, FRICTION = 12, 0.8
#: Ambient pressure [Pa] (ISO 2533), and temperature of the air in the tubes [K].
ATMOSPHERE, TEMPERATURE = 101_325.0, 293.0
ROBOT = load_robot('nine_member')
PRESSURE = next(iter(ROBOT.description.pressures.values()))


class Grasp(NamedTuple):
    """Grasp of a free object, with the assumptions that a study changes."""

    travel: Array  #: (r,) travel of the rollers from home [m]
    body: ConvexObject  #: the object at its pose
    members: tuple[str, ...]  #: names of the grasping members
    friction: float = FRICTION  #: coefficient of friction [-]
    stiffness: float = 1.0  #: factor on EA, EI and GA of the tubes [-]
    pressure: float = PRESSURE  #: gauge pressure of the tubes [Pa]
    #: ratio of the stiffness of the flattened section to its theory [-]; 1e4 for round sections
    local_stiffness: float = 1.0

    def settle(self) -> SettledGrasp:
        """Return the equilibrium of the object."""
        description = replace(
            ROBOT.description,
            stiffness_scale=self.stiffness,
            local_stiffness=self.local_stiffness,
        )
        config = Robot(description).configuration(self.travel)
        return settle_grasp(
            config, self.body, self.friction, pressure=self.pressure, members=self.members
        )

    def moved(self, x: float, y: float, angle: float) -> Grasp:
        """Return the grasp with the object moved by (x, y) [m] and turned by an angle [rad]."""
        center = self.body.center
        pose = center.real + x, center.imag + y, self.body.pose.angle + angle
        return self._replace(body=self.body.moved_to(pose))


def draw_grasps(random: np.random.Generator) -> Iterator[Grasp]:
    """Yield held grasps of discs, boxes and hexagons in turn."""
    kind = 0
    while True:
        size = random.uniform(0.2, 0.5)
        shape = Disc(size) if kind == 0 else Polygon(_corners((4, 6)[kind - 1], size), 0.02)
        travel = random.uniform(-0.1, 0.1, len(ROBOT.roller_names))
        names = tuple(random.choice(ROBOT.member_names, 2, replace=False).tolist())
        angle, depth = random.uniform(-np.pi, np.pi), random.uniform(0.003, 0.012)
        try:
            grip = place_between(ROBOT.configuration(travel), names, shape, angle, depth)
        except IsotrussError:  # the object does not fit between these members
            continue
        grasp = Grasp(travel, grip.body, names)
        if grasp.settle().held:
            yield grasp
            kind = (kind + 1) % 3


def _corners(count: int, size: float) -> tuple[tuple[float, float], ...]:
    """Return the corners of a regular polygon of a given diameter [m]."""
    angles = [2.0 * math.pi * k / count for k in range(count)]
    return tuple((0.5 * size * math.cos(a), 0.5 * size * math.sin(a)) for a in angles)


def heated_pressure(change: float) -> float:
    """Return the gauge pressure after a change of temperature at constant volume [K, Pa]."""
    return (PRESSURE + ATMOSPHERE) * (1.0 + change / TEMPERATURE) - ATMOSPHERE


def changes(grasp: Grasp) -> dict[str, list[Grasp]]:
    """Return the changed grasps by the name of the change; one for each sign and place of it."""
    one_roller = [sign * unit for unit in np.eye(len(grasp.travel)) for sign in (-1.0, 1.0)]
    turns, directions = (-math.radians(2.0), math.radians(2.0)), (1.0, 1j, -1.0, -1j)
    return {
        'friction 0.7': [grasp._replace(friction=0.7)],
        'friction 0.6': [grasp._replace(friction=0.6)],
        'stiffness -20 %': [grasp._replace(stiffness=0.8)],
        'object turned by 2 degrees': [grasp.moved(0.0, 0.0, turn) for turn in turns],
        'object 2 mm aside': [
            grasp.moved(0.002 * step.real, 0.002 * step.imag, 0.0) for step in directions
        ],
        'a roller 5 mm off': [
            grasp._replace(travel=grasp.travel + 0.005 * step) for step in one_roller
        ],
        'a roller 10 mm off': [
            grasp._replace(travel=grasp.travel + 0.01 * step) for step in one_roller
        ],
        'pressure -10 %': [grasp._replace(pressure=0.9 * PRESSURE)],
        'air 10 K colder': [grasp._replace(pressure=heated_pressure(-10.0))],
    }


def main() -> None:
    """Print a table of the changes, and the effect of 10 K on the gauge pressure."""
    grasps = list(itertools.islice(draw_grasps(np.random.default_rng(0)), COUNT))
    lost = dict.fromkeys(changes(grasps[0]), 0)
    for grasp in grasps:
        for name, changed in changes(grasp).items():
            lost[name] += not all(other.settle().held for other in changed)
    print(f'| change | lost, of {COUNT} |\n| --- | ---: |')
    for name, count in lost.items():
        print(f'| {name} | {count} |')
    ratios = [
        sum(grasp.settle().normal_forces.values())
        / sum(grasp._replace(local_stiffness=1e4).settle().normal_forces.values())
        for grasp in grasps
    ]
    lowered = 100.0 - 100.0 * np.array(ratios)
    print(f'flattening lowers the forces by {lowered.min():.0f} to {lowered.max():.0f} %')
    share = heated_pressure(10.0) / PRESSURE - 1.0
    print(f'10 K change the gauge pressure by {100.0 * share:.0f} %')


if __name__ == '__main__':
    main()
